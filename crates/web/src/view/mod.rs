//! Interactive view of a scene in a browser.
//!
//! The page sends key and pointer input; the camera is moved here, where collisions can be checked, and images are
//! returned over a WebSocket. Each page has its own camera. Images are never queued: the next one is rendered only once
//! the page has displayed an earlier one, so that a slow page sees the newest.

mod camera;
mod draw;
mod library;
mod message;
mod quality;
mod renderer;
mod server;
mod session;
mod sight;

use spf_core::craft::CraftKind;
use spf_core::geometry::Pose;
use spf_scene::SceneLook;

pub use library::Library;
pub use server::{Stopper, ViewError, Viewer};

/// Reads a page's message, for fuzzing; whether it is one.
#[doc(hidden)]
#[must_use]
pub fn read_page_message(text: &str) -> bool {
    message::FromPage::read(text).is_ok()
}

/// The initial view of a page.
#[derive(Clone, Debug)]
pub struct InitialView {
    /// Name of the scene in the library.
    pub scene: String,
    /// Its light and weather.
    pub conditions: SceneLook,
    /// Craft whose camera is used; `None` for the scene's own.
    pub craft: Option<CraftKind>,
    /// Initial pose; `None` for the scene's preview pose.
    pub pose: Option<Pose>,
}

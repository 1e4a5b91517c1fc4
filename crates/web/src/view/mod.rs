//! Flying around in a scene from a browser's page.
//!
//! The page tells which keys are held and where the pointer is; the camera is moved here, where the scene can be touched, and
//! images go back over a WebSocket. Each page has a camera of its own. Images never queue up: the next is drawn only when
//! the page has shown an earlier one, so that a slow page sees the newest.

mod camera;
mod draw;
mod eye;
mod guard;
mod library;
mod message;
mod quality;
mod server;
mod session;
mod sight;

use spf_core::craft::CraftKind;
use spf_core::geometry::Pose;
use spf_scene::SceneLook;

pub use library::Library;
pub use server::{Stopper, ViewError, Viewer};

/// What a new page sees.
#[derive(Clone, Debug)]
pub struct Beginning {
    /// Name of the scene in the library.
    pub scene: String,
    /// Its light and weather.
    pub conditions: SceneLook,
    /// Whose camera; none: that of the scene's own craft.
    pub craft: Option<CraftKind>,
    /// From where; none: the scene's preview.
    pub pose: Option<Pose>,
}

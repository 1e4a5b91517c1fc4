//! A program as a drone, flown through its window: profiles, the picture of the window, keys and mouse.
//!
//! [`Profile`](profile::Profile) describes a game or simulator: its window, its camera, its keys and what they do.
//! [`Display`] is the X11 display with its windows and monitors, [`Eye`] takes pictures, and [`Hands`] press keys; [`Pane`] is a window of our own. On Windows
//! and macOS the feature `screen-native` gives the same without the last one; without it, [`Display::open`] says that there is none.
//!
//! Keys go to whatever window has the focus. So [`Hands`] look before each press whether it is still the right one, and release
//! what they hold as soon as it is not, and when they are dropped.

pub mod area;
pub mod duty;
pub mod gamepad;
pub mod mask;
mod name;
pub mod picture;
pub mod pixels;
pub mod profile;

#[cfg(not(any(target_os = "linux", all(feature = "screen-native", any(windows, target_os = "macos")))))]
mod absent;
#[cfg(any(target_os = "linux", all(feature = "screen-native", any(windows, target_os = "macos"))))]
mod choosing;
#[cfg(any(test, all(feature = "screen-native", any(windows, target_os = "macos"))))]
mod native;
#[cfg(not(target_os = "linux"))]
mod padless;
#[cfg(not(target_os = "linux"))]
mod paneless;
#[cfg(all(target_os = "linux", feature = "screen-native"))]
mod portal;
#[cfg(all(target_os = "linux", not(feature = "screen-native")))]
#[path = "portalless.rs"]
mod portal;
#[cfg(target_os = "linux")]
mod uinput;
#[cfg(target_os = "linux")]
mod x11;

#[cfg(not(any(target_os = "linux", all(feature = "screen-native", any(windows, target_os = "macos")))))]
pub use absent::{Display, Eye, Hands};
pub use name::WindowName;
#[cfg(all(feature = "screen-native", any(windows, target_os = "macos")))]
pub use native::{Display, Eye, Hands};
#[cfg(not(target_os = "linux"))]
pub use padless::Gamepad;
#[cfg(not(target_os = "linux"))]
pub use paneless::{Keyboard, Pane};
pub use picture::Shown;
#[cfg(target_os = "linux")]
pub use uinput::Gamepad;
#[cfg(target_os = "linux")]
pub use x11::{Display, Eye, Hands, Keyboard, Pane};

use area::Area;

/// Why a window cannot be seen.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Hidden {
    /// No window has the name.
    #[error("no window has {0}")]
    Gone(WindowName),
    /// It is minimised, or on another desktop.
    #[error("the window is minimised, or on another desktop")]
    Minimised,
    /// Another window lies over it.
    #[error("the window is covered by {0}")]
    Covered(String),
    /// It reaches beyond the screen.
    #[error("the window reaches beyond the screen")]
    OffScreen,
    /// It is too small to be a picture.
    #[error("the window is only {width}×{height}")]
    Tiny {
        /// Width of the region, pixels.
        width: u32,
        /// Height of the region, pixels.
        height: u32,
    },
}

/// Why the screen, or a key, cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ScreenError {
    /// This system has no X11, or only X11 can do it.
    #[error(
        "only X11 on Linux can do this; a build with the feature `screen-native` sees and flies windows on Windows and macOS"
    )]
    Unsupported,
    /// The display cannot be reached.
    #[error("cannot connect to the X11 display{}: {why}", if display.is_empty() { String::new() } else { format!(" `{display}`") })]
    NoDisplay {
        /// What `DISPLAY` says.
        display: String,
        /// The library's reason.
        why: String,
    },
    /// The display lacks something.
    #[error("the X11 display has no {0}")]
    Lacks(&'static str),
    /// The connection was lost, or the server refused a request.
    #[error("the X11 display failed: {0}")]
    Failed(String),
    /// Several windows have the name.
    #[error("{count} windows have {name}: {list}")]
    Ambiguous {
        /// The name looked for.
        name: WindowName,
        /// How many windows have it.
        count: usize,
        /// Their titles.
        list: String,
    },
    /// No window has the name.
    #[error("no window has {0}")]
    NoWindow(WindowName),
    /// No monitor has the name.
    #[error("no monitor `{name}`: {known}")]
    NoMonitor {
        /// The name.
        name: String,
        /// The names of the monitors.
        known: String,
    },
    /// The keyboard's layout has no such key.
    #[error("the keyboard has no key `{0}`")]
    NoKey(String),
    /// Two names of a profile are one key of this keyboard.
    #[error("`{0}` and `{1}` are the same key of this keyboard")]
    SameKey(String, String),
    /// The display is Xwayland's, in a Wayland session, whose monitors it does not see.
    #[error("the display is Xwayland's: in a Wayland session only windows of X11 can be captured, not monitors")]
    Wayland,
    /// The desktop's portal shows nothing.
    #[error("the desktop's portal for pictures of the screen: {0}")]
    Portal(String),
    /// No gamepad can be made.
    #[error("no gamepad: {0}")]
    NoGamepad(String),
    /// The window does not have the focus: nothing was pressed.
    #[error("the window does not have the focus")]
    NoFocus,
}

/// A window of a program.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Window {
    /// Its number on the display.
    pub id: u32,
    /// Its title.
    pub title: String,
    /// Its class: on X11 the two texts of `WM_CLASS`, elsewhere the name of the program.
    pub classes: Vec<String>,
    /// Where its contents are, without its frame.
    pub area: Area,
    /// Whether it is shown on this desktop: not minimised.
    pub shown: bool,
    /// Whether it has the focus.
    pub focused: bool,
}

/// A monitor.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Monitor {
    /// Its name, such as `DP-1`.
    pub name: String,
    /// Its part of the screen.
    pub area: Area,
    /// Whether it is the primary one.
    pub primary: bool,
}

/// What to capture.
#[derive(Clone, Debug, PartialEq)]
pub enum Target {
    /// Part of the window with this name; fractions of its contents.
    Window {
        /// The name.
        name: WindowName,
        /// The part.
        region: area::Region,
    },
    /// Part of what the user chooses in the dialog of a Wayland desktop's portal; fractions of it.
    Portal {
        /// The part.
        region: area::Region,
    },
    /// A whole monitor, whatever it shows.
    Monitor {
        /// Its name.
        name: String,
    },
}

/// The examples of the README, run as tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

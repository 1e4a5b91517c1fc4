//! Windows and macOS, by the libraries xcap (what is on the screen) and enigo (keys and mouse).
//!
//! It was compiled for both, and never run. Where these systems tell less than X11, it is refused: a window that reaches over two
//! monitors, and keys while the window in front is not the named one.

#[cfg(all(feature = "screen-native", any(windows, target_os = "macos")))]
mod eye;
#[cfg(all(feature = "screen-native", any(windows, target_os = "macos")))]
mod hands;
pub(crate) mod places;
pub(crate) mod stack;
#[cfg(all(feature = "screen-native", any(windows, target_os = "macos")))]
mod windows;

#[cfg(all(feature = "screen-native", any(windows, target_os = "macos")))]
pub use self::{eye::Eye, hands::Hands, windows::Display};

//! Which window is meant, and how much of it must be visible.

use std::time::Duration;

use crate::{ScreenError, Window, WindowName};

/// Interval at which a window that is gone is looked for.
pub(crate) const AGAIN: Duration = Duration::from_millis(300);
/// Fraction of the region that others may cover, or that may lie beside the screen: a tooltip, a rounding.
pub(crate) const ALLOWED: f64 = 0.005;
/// Least width and height of a region, pixels.
pub(crate) const LEAST: u32 = 64;

/// The window with a name; one whose title is just that comes before others, and one that is shown before one that is not.
///
/// # Errors
/// [`ScreenError::Ambiguous`] if several have it.
pub(crate) fn chosen(mut windows: Vec<Window>, name: &WindowName) -> Result<Option<u32>, ScreenError> {
    windows.retain(|window| name.is_of(window));
    for better in [
        |window: &Window, name: &WindowName| name.title.as_ref() == Some(&window.title),
        |window: &Window, _: &WindowName| window.shown,
    ] {
        if windows.iter().any(|window| better(window, name)) {
            windows.retain(|window| better(window, name));
        }
    }
    match &windows[..] {
        [] => Ok(None),
        [one] => Ok(Some(one.id)),
        several => {
            let list = several.iter().map(|window| format!("`{}`", window.title)).collect::<Vec<_>>().join(", ");
            Err(ScreenError::Ambiguous { name: name.clone(), count: several.len(), list })
        }
    }
}

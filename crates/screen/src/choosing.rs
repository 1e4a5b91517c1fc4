//! Which window is meant by a title, and how much of it must be visible.

use std::time::Duration;

use crate::{ScreenError, Window};

/// Interval at which a window that is gone is looked for.
pub(crate) const AGAIN: Duration = Duration::from_millis(300);
/// Fraction of the region that others may cover, or that may lie beside the screen: a tooltip, a rounding.
pub(crate) const ALLOWED: f64 = 0.005;
/// Least width and height of a region, pixels.
pub(crate) const LEAST: u32 = 64;

/// The window whose title contains `title`; one whose title is just that comes before others, and one that is shown before one that is
/// not.
///
/// # Errors
/// [`ScreenError::Ambiguous`] if several have it.
pub(crate) fn chosen(mut windows: Vec<Window>, title: &str) -> Result<Option<u32>, ScreenError> {
    windows.retain(|window| window.title.contains(title));
    for better in [|window: &Window, title: &str| window.title == title, |window: &Window, _: &str| window.shown] {
        if windows.iter().any(|window| better(window, title)) {
            windows.retain(|window| better(window, title));
        }
    }
    match &windows[..] {
        [] => Ok(None),
        [one] => Ok(Some(one.id)),
        several => {
            let list = several.iter().map(|window| format!("`{}`", window.title)).collect::<Vec<_>>().join(", ");
            Err(ScreenError::Ambiguous { title: title.to_owned(), count: several.len(), list })
        }
    }
}

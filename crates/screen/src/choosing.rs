//! Which window is meant by a title.

use crate::{ScreenError, Window};

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

//! The name of a window: what of its title and class is known.

use crate::Window;

/// A window's name: a text in its title, its class, or both. With neither it is that of no window.
///
/// A title may tell what a program is doing, and change; a class stays. On X11 it is one of the two texts of the property `WM_CLASS`
/// (ICCCM section 4.1.2.5), elsewhere the name of the program.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct WindowName {
    /// Text that the title contains.
    pub title: Option<String>,
    /// The class, whatever the case of its letters.
    pub class: Option<String>,
}

impl WindowName {
    /// Whether nothing is known, as of a window that a portal shows.
    #[must_use]
    pub fn is_none(&self) -> bool {
        self.title.is_none() && self.class.is_none()
    }

    /// Whether a window has the name.
    #[must_use]
    pub fn is_of(&self, window: &Window) -> bool {
        if self.is_none() {
            return false;
        }
        let has_title = self.title.as_ref().is_none_or(|title| window.title.contains(title));
        let has_class = |class: &String| window.classes.iter().any(|known| known.eq_ignore_ascii_case(class));
        has_title && self.class.as_ref().is_none_or(has_class)
    }
}

impl From<&str> for WindowName {
    /// By its title.
    fn from(title: &str) -> Self {
        Self { title: Some(title.to_owned()), class: None }
    }
}

impl std::fmt::Display for WindowName {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match (&self.title, &self.class) {
            (Some(title), None) => write!(f, "`{title}` in the title"),
            (None, Some(class)) => write!(f, "the class `{class}`"),
            (Some(title), Some(class)) => write!(f, "`{title}` in the title and the class `{class}`"),
            (None, None) => f.write_str("no name"),
        }
    }
}

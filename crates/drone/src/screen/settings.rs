//! Settings of the driver of games.

/// Settings of the driver of games.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ScreenSettings {
    /// Name of the X11 display, such as `:0`; `None` for the one that the variable `DISPLAY` names.
    pub display: Option<String>,
}

//! What can be set about drivers.

use crate::tello::settings::TelloSettings;

/// What is set about each driver that has settings.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Options {
    /// About a Tello.
    pub tello: TelloSettings,
}

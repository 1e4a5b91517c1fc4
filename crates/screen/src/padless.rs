//! A gamepad, which a program can make on Linux alone.

use std::convert::Infallible;

use crate::ScreenError;

/// A gamepad.
#[derive(Debug)]
pub struct Gamepad(Infallible);

impl Gamepad {
    /// Makes the device.
    ///
    /// # Errors
    /// [`ScreenError::NoGamepad`].
    pub fn open() -> Result<Self, ScreenError> {
        Self::check().and(Err(ScreenError::Unsupported))
    }

    /// Whether a device could be made.
    ///
    /// # Errors
    /// [`ScreenError::NoGamepad`].
    pub fn check() -> Result<(), ScreenError> {
        Err(ScreenError::NoGamepad("a program can make one on Linux alone; fly by keys".to_owned()))
    }

    /// There is none.
    pub(crate) fn is_none(&self) {
        match self.0 {}
    }
}

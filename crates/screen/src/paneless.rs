//! A window of our own, with its keyboard, which there is on Linux alone: here it cannot be opened.

use std::collections::BTreeSet;
use std::convert::Infallible;

use spf_media::Rgb;

use crate::profile::Key;
use crate::{Display, ScreenError};

/// A window with a picture.
#[derive(Debug)]
pub struct Pane(Infallible);

impl Pane {
    /// Opens a window.
    ///
    /// # Errors
    /// [`ScreenError::Unsupported`].
    pub fn open(_display: &Display, _title: &str, _size: (u16, u16)) -> Result<Self, ScreenError> {
        Err(ScreenError::Unsupported)
    }

    /// Its size.
    #[must_use]
    pub fn size(&self) -> (u32, u32) {
        match self.0 {}
    }

    /// Shows a picture.
    ///
    /// # Errors
    /// None, since there is no window.
    pub fn show(&mut self, _image: &Rgb) -> Result<(), ScreenError> {
        match self.0 {}
    }

    /// Whether it was closed.
    ///
    /// # Errors
    /// None, since there is no window.
    pub fn is_closed(&mut self) -> Result<bool, ScreenError> {
        match self.0 {}
    }

    /// Looks at the keyboard.
    ///
    /// # Errors
    /// None, since there is no window.
    pub fn keyboard(&self) -> Result<Keyboard, ScreenError> {
        match self.0 {}
    }
}

/// Looks at the keyboard.
#[derive(Debug)]
pub struct Keyboard(Infallible);

impl Keyboard {
    /// The keys that are down.
    ///
    /// # Errors
    /// None, since there is no window.
    pub fn down(&mut self) -> Result<BTreeSet<Key>, ScreenError> {
        match self.0 {}
    }
}

//! What stands in for X11 on systems without it: it cannot be opened.

use std::convert::Infallible;

use crate::gamepad::Positions;
use crate::picture::Shown;
use crate::profile::Key;
use crate::{Gamepad, Hidden, Monitor, ScreenError, Target, Window, WindowName};

/// A connection to the X11 display.
#[derive(Clone, Debug)]
pub struct Display(Infallible);

impl Display {
    /// Connects to the display.
    ///
    /// # Errors
    /// [`ScreenError::Unsupported`].
    pub fn open(_name: Option<&str>) -> Result<Self, ScreenError> {
        Err(ScreenError::Unsupported)
    }

    /// The windows.
    ///
    /// # Errors
    /// None, since there is no display.
    pub fn windows(&self) -> Result<Vec<Window>, ScreenError> {
        match self.0 {}
    }

    /// The monitors.
    ///
    /// # Errors
    /// None, since there is no display.
    pub fn monitors(&self) -> Result<Vec<Monitor>, ScreenError> {
        match self.0 {}
    }

    /// The window with a name.
    ///
    /// # Errors
    /// None, since there is no display.
    pub fn find(&self, _name: &WindowName) -> Result<Option<u32>, ScreenError> {
        match self.0 {}
    }

    /// What hides a part of a window.
    ///
    /// # Errors
    /// None, since there is no display.
    pub fn hidden(&self, _window: u32, _region: &crate::area::Region) -> Result<Option<Hidden>, ScreenError> {
        match self.0 {}
    }
}

/// Takes pictures of a target.
#[derive(Debug)]
pub struct Eye(Infallible);

impl Eye {
    /// For a target on a display.
    #[must_use]
    pub fn new(display: Display, _target: Target) -> Self {
        match display.0 {}
    }

    /// A picture, or why there is none.
    ///
    /// # Errors
    /// None, since there is no display.
    pub fn look(&mut self) -> Result<Result<Shown, Hidden>, ScreenError> {
        match self.0 {}
    }
}

/// Presses keys for one window.
#[derive(Debug)]
pub struct Hands(Infallible);

impl Hands {
    /// For the window with a name.
    ///
    /// # Errors
    /// None, since there is no display.
    pub fn open(display: &Display, _name: &WindowName) -> Result<Self, ScreenError> {
        match display.0 {}
    }

    /// Whether the keyboard has all these keys.
    ///
    /// # Errors
    /// None, since there is no display.
    pub fn check<'a>(&mut self, _keys: impl IntoIterator<Item = &'a Key>) -> Result<(), ScreenError> {
        match self.0 {}
    }

    /// Asks for the focus.
    ///
    /// # Errors
    /// None, since there is no display.
    pub fn activate(&mut self) -> Result<bool, ScreenError> {
        match self.0 {}
    }

    /// Whether the window is no more.
    ///
    /// # Errors
    /// None, since there is no display.
    pub fn is_gone(&self) -> Result<bool, ScreenError> {
        match self.0 {}
    }

    /// Whether the window has the focus.
    ///
    /// # Errors
    /// None, since there is no display.
    pub fn has_focus(&mut self) -> Result<bool, ScreenError> {
        match self.0 {}
    }

    /// Presses or releases a key.
    ///
    /// # Errors
    /// None, since there is no display.
    pub fn set(&mut self, _key: Key, _down: bool) -> Result<(), ScreenError> {
        match self.0 {}
    }

    /// Presses a key that is still wanted.
    ///
    /// # Errors
    /// None, since there is no display.
    pub fn press_if(&mut self, _key: Key, _wanted: impl FnOnce() -> bool) -> Result<(), ScreenError> {
        match self.0 {}
    }

    /// Moves the mouse.
    ///
    /// # Errors
    /// None, since there is no display.
    pub fn turn(&mut self, _pixels: i16) -> Result<(), ScreenError> {
        match self.0 {}
    }

    /// Takes a gamepad.
    pub fn take(&mut self, gamepad: Gamepad) {
        gamepad.is_none();
    }

    /// Moves the sticks of the gamepad.
    ///
    /// # Errors
    /// None, since there is no display.
    pub fn push_if(&mut self, _sticks: Positions, _wanted: impl FnOnce() -> bool) -> Result<(), ScreenError> {
        match self.0 {}
    }

    /// Releases all keys.
    pub fn release_all(&mut self) {
        match self.0 {}
    }

    /// Whether any key is held.
    #[must_use]
    pub fn holds(&self) -> bool {
        match self.0 {}
    }

    /// The keys that are held.
    #[must_use]
    pub fn held(&self) -> Vec<Key> {
        match self.0 {}
    }
}

impl Drop for Hands {
    fn drop(&mut self) {
        match self.0 {}
    }
}

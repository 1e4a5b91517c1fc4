//! Keys and mouse for one window.
//!
//! What is pressed goes to the window in front. So before each press that is looked at, and nothing is pressed if it is another one. All
//! keys are released when the value is dropped, which a panic does as well. Neither system lets a program take the focus by these
//! libraries: the operator clicks on the window.

use std::time::{Duration, Instant};

use enigo::{Coordinate, Direction, Enigo, InputError, Keyboard as _, Mouse as _, Settings};

use super::places;
use super::windows::Display;
use crate::gamepad::Positions;
use crate::profile::Key;
use crate::{Gamepad, ScreenError, WindowName};

/// How long a click on the window is awaited.
const FOCUS_TIME: Duration = Duration::from_secs(5);

/// Presses keys for one window, and releases them.
pub struct Hands {
    display: Display,
    name: WindowName,
    window: u32,
    enigo: Enigo,
    held: Vec<Key>,
}

impl std::fmt::Debug for Hands {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Hands").field("window", &self.window).field("held", &self.held).finish_non_exhaustive()
    }
}

impl From<InputError> for ScreenError {
    fn from(error: InputError) -> Self {
        Self::Failed(error.to_string())
    }
}

impl Hands {
    /// For the window with a name.
    ///
    /// # Errors
    /// [`ScreenError`]: no such window, or several, or no permission to press keys (on macOS: Accessibility, for the terminal).
    pub fn open(display: &Display, name: &WindowName) -> Result<Self, ScreenError> {
        let window = display.find(name)?.ok_or_else(|| ScreenError::Failed(missing(name)))?;
        let settings = Settings {
            // Games that turn by the mouse see the motion as it is sent.
            windows_subject_to_mouse_speed_and_acceleration_level: true,
            ..Settings::default()
        };
        let enigo = Enigo::new(&settings).map_err(|error| ScreenError::Failed(format!("keys cannot be pressed: {error}")))?;
        Ok(Self { display: display.clone(), name: name.clone(), window, enigo, held: Vec::new() })
    }

    /// Whether there is a place on the keyboard for each of these keys.
    ///
    /// # Errors
    /// [`ScreenError::NoKey`] for the first that has none.
    pub fn check<'a>(&mut self, keys: impl IntoIterator<Item = &'a Key>) -> Result<(), ScreenError> {
        keys.into_iter().try_for_each(|key| code(*key).map(drop))
    }

    /// Waits until the operator clicks on the window; whether it has the focus.
    ///
    /// # Errors
    /// [`ScreenError::Failed`].
    pub fn activate(&mut self) -> Result<bool, ScreenError> {
        let begun = Instant::now();
        let mut told = false;
        while begun.elapsed() < FOCUS_TIME {
            if let Some(window) = self.display.find(&self.name)? {
                self.window = window;
            }
            if self.has_focus()? {
                return Ok(true);
            }
            if !std::mem::replace(&mut told, true) {
                tracing::warn!(
                    "click on the window with {}: within {} s it must have the focus",
                    self.name,
                    FOCUS_TIME.as_secs()
                );
            }
            std::thread::sleep(Duration::from_millis(50));
        }
        Ok(false)
    }

    /// Whether the window is no more, as after the end of its program.
    ///
    /// # Errors
    /// [`ScreenError::Failed`].
    pub fn is_gone(&self) -> Result<bool, ScreenError> {
        Ok(self.display.listed()?.iter().all(|listed| listed.window.id != self.window))
    }

    /// Whether the window has the focus.
    ///
    /// # Errors
    /// [`ScreenError::Failed`].
    pub fn has_focus(&mut self) -> Result<bool, ScreenError> {
        let listed = self.display.listed()?;
        Ok(listed.iter().find(|listed| listed.window.focused).is_some_and(|listed| listed.window.id == self.window))
    }

    /// Presses a key, if the window has the focus, or releases it.
    ///
    /// # Errors
    /// [`ScreenError::NoFocus`] and [`ScreenError::NoKey`]: nothing was pressed.
    pub fn set(&mut self, key: Key, down: bool) -> Result<(), ScreenError> {
        if down {
            return self.press_if(key, || true);
        }
        match self.held.iter().position(|held| *held == key) {
            Some(place) => {
                self.send(key, Direction::Release)?;
                self.held.remove(place);
                Ok(())
            }
            None => Ok(()),
        }
    }

    /// Presses a key, if the window has the focus, and if `wanted` says so right before.
    ///
    /// # Errors
    /// [`ScreenError::NoFocus`] and [`ScreenError::NoKey`]: nothing was pressed.
    pub fn press_if(&mut self, key: Key, wanted: impl FnOnce() -> bool) -> Result<(), ScreenError> {
        if self.held.contains(&key) {
            return Ok(());
        }
        code(key)?;
        if !self.has_focus()? {
            return Err(ScreenError::NoFocus);
        }
        if !wanted() {
            return Ok(());
        }
        // Noted first: a key that may be down is released.
        self.held.push(key);
        self.send(key, Direction::Press)
    }

    /// Moves the mouse to the right by pixels, if the window has the focus.
    ///
    /// # Errors
    /// [`ScreenError::NoFocus`]: it was not moved.
    pub fn turn(&mut self, pixels: i16) -> Result<(), ScreenError> {
        if pixels == 0 {
            return Ok(());
        }
        if !self.has_focus()? {
            return Err(ScreenError::NoFocus);
        }
        Ok(self.enigo.move_mouse(pixels.into(), 0, Coordinate::Rel)?)
    }

    /// There is no gamepad on these systems, and so none is taken.
    pub fn take(&mut self, gamepad: Gamepad) {
        gamepad.is_none()
    }

    /// Moves the sticks of a gamepad, which there is none of.
    ///
    /// # Errors
    /// [`ScreenError::NoGamepad`], except for the centre.
    pub fn push_if(&mut self, sticks: Positions, _wanted: impl FnOnce() -> bool) -> Result<(), ScreenError> {
        if sticks.are_centred() { Ok(()) } else { Gamepad::check() }
    }

    /// Releases all keys.
    pub fn release_all(&mut self) {
        for key in std::mem::take(&mut self.held) {
            if let Err(error) = self.send(key, Direction::Release) {
                tracing::error!("the key {key:?} was not released: {error}");
            }
        }
    }

    /// The keys that are held.
    #[must_use]
    pub fn held(&self) -> Vec<Key> {
        self.held.clone()
    }

    /// Whether any key is held.
    #[must_use]
    pub fn holds(&self) -> bool {
        !self.held.is_empty()
    }

    fn send(&mut self, key: Key, direction: Direction) -> Result<(), ScreenError> {
        match code(key)? {
            Code::Raw(code) => self.enigo.raw(code, direction)?,
            #[cfg(windows)]
            Code::Key(key) => self.enigo.key(key, direction)?,
        }
        Ok(())
    }
}

impl Drop for Hands {
    fn drop(&mut self) {
        self.release_all();
    }
}

/// What is pressed for a key.
enum Code {
    Raw(u16),
    #[cfg(windows)]
    Key(enigo::Key),
}

#[cfg(target_os = "macos")]
fn code(key: Key) -> Result<Code, ScreenError> {
    places::macos(key).map(Code::Raw).ok_or_else(|| ScreenError::NoKey(key.to_string()))
}

#[cfg(windows)]
fn code(key: Key) -> Result<Code, ScreenError> {
    use enigo::Key as Its;
    use places::{Named, WindowsKey};
    const DIGITS: [Its; 10] = [
        Its::Numpad0,
        Its::Numpad1,
        Its::Numpad2,
        Its::Numpad3,
        Its::Numpad4,
        Its::Numpad5,
        Its::Numpad6,
        Its::Numpad7,
        Its::Numpad8,
        Its::Numpad9,
    ];
    let named = match places::windows(key) {
        Some(WindowsKey::Scan(code)) => return Ok(Code::Raw(code)),
        Some(WindowsKey::Named(named)) => named,
        None => return Err(ScreenError::NoKey(key.to_string())),
    };
    Ok(Code::Key(match named {
        Named::Left => Its::LeftArrow,
        Named::Up => Its::UpArrow,
        Named::Right => Its::RightArrow,
        Named::Down => Its::DownArrow,
        Named::Home => Its::Home,
        Named::End => Its::End,
        Named::PageUp => Its::PageUp,
        Named::PageDown => Its::PageDown,
        Named::Insert => Its::Insert,
        Named::Delete => Its::Delete,
        Named::ControlRight => Its::RControl,
        Named::Divide => Its::Divide,
        Named::Digit(digit) => DIGITS[usize::from(digit) % DIGITS.len()],
    }))
}

/// Why no window was found.
fn missing(name: &WindowName) -> String {
    let permission = if cfg!(target_os = "macos") {
        "; titles are seen with the permission for screen recording, which the terminal needs"
    } else {
        ""
    };
    format!("no window has {name}{permission}")
}

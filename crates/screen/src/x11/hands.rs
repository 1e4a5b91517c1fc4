//! Keys, mouse and gamepad for one window: the first two by the extension XTest.
//!
//! What XTest does goes to the window with the focus. So before each press the focus is looked at, and nothing is pressed if another
//! window has it. A key that this program holds would stay down for ever if it ended, for the server does not know who pressed it: so
//! all are released when the value is dropped, which a panic does as well. What a gamepad does goes to whoever listens; its sticks are
//! pushed under the same conditions.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use std::time::{Duration, Instant};

use x11rb::connection::{Connection as _, RequestConnection as _};
use x11rb::protocol::Event;
use x11rb::protocol::xproto::{
    ClientMessageEvent, ConfigureWindowAux, ConnectionExt as _, EventMask, InputFocus, KEY_PRESS_EVENT, KEY_RELEASE_EVENT,
    Keycode, MOTION_NOTIFY_EVENT, StackMode, Window as WindowId,
};
use x11rb::protocol::xtest::{ConnectionExt as _, X11_EXTENSION_NAME};
use x11rb::rust_connection::RustConnection;

use super::windows::ids;
use super::{Display, Server, unless_gone};
use crate::gamepad::Positions;
use crate::profile::Key;
use crate::{Gamepad, ScreenError, WindowName};

/// How long the focus is awaited after it was asked for, before the user is asked for it, and in all.
const FOCUS_TIMES: (Duration, Duration) = (Duration::from_millis(1500), Duration::from_millis(6500));
/// The source of a request for the focus: the user, by a pager or the like (EWMH).
const BY_USER: u32 = 2;
/// Keysyms of the digits of the keypad.
const KEYPAD: RangeInclusive<u32> = 0xffb0..=0xffb9;
/// How deep the window with the focus may lie in the program's window.
const DEPTH: usize = 8;

/// Presses keys for one window, and releases them.
pub struct Hands {
    display: Display,
    name: WindowName,
    /// `None` without a window, which gets sticks alone.
    window: Option<WindowId>,
    /// For each keycode from the lowest on, its keysym ([`layout`]).
    symbols: Vec<u32>,
    held: Vec<(Key, Keycode)>,
    gamepad: Option<Gamepad>,
}

impl std::fmt::Debug for Hands {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Hands").field("window", &self.window).field("held", &self.held).finish_non_exhaustive()
    }
}

impl Hands {
    /// For the window with a name, on a connection of its own to the same display. Without a name no key is pressed, and whether a stick
    /// may be pushed is not asked of the display: a window of Wayland is not known there.
    ///
    /// # Errors
    /// [`ScreenError`]: no display, no XTest, no such window, or several.
    pub fn open(display: &Display, name: &WindowName) -> Result<Self, ScreenError> {
        let display = Display::open(display.0.name.as_deref())?;
        if display.0.connection.extension_information(X11_EXTENSION_NAME)?.is_none() {
            return Err(ScreenError::Lacks("extension XTEST, which presses keys"));
        }
        let window =
            if name.is_none() { None } else { Some(display.find(name)?.ok_or_else(|| ScreenError::NoWindow(name.clone()))?) };
        let symbols = layout(&display.0.connection)?;
        Ok(Self { display, name: name.clone(), window, symbols, held: Vec::new(), gamepad: None })
    }

    /// Whether the keyboard's layout has all these keys, each another one.
    ///
    /// # Errors
    /// [`ScreenError::NoKey`] for the first that it has not, and [`ScreenError::SameKey`] for two names of one key.
    pub fn check<'a>(&mut self, keys: impl IntoIterator<Item = &'a Key>) -> Result<(), ScreenError> {
        self.handle_events()?;
        let mut known = BTreeMap::new();
        for key in keys {
            let first = *known.entry(self.code(*key)?).or_insert(*key);
            if first != *key {
                return Err(ScreenError::SameKey(first.to_string(), key.to_string()));
            }
        }
        Ok(())
    }

    /// Asks the window manager for the focus, and waits for it; whether it came. A window manager may give the focus to the user's
    /// clicks alone, so that the user is then asked.
    ///
    /// # Errors
    /// [`ScreenError::Failed`].
    pub fn activate(&mut self) -> Result<bool, ScreenError> {
        let Some(window) = self.refind()? else { return Ok(true) };
        let Server { connection, root, atoms, .. } = &*self.display.0;
        if ids(&self.display.0, atoms._NET_CLIENT_LIST)?.is_empty() {
            // Nobody manages the windows.
            let raise = ConfigureWindowAux::new().stack_mode(StackMode::ABOVE);
            connection.configure_window(window, &raise)?.ignore_error();
            connection.set_input_focus(InputFocus::PARENT, window, x11rb::CURRENT_TIME)?.ignore_error();
        } else {
            let data = [BY_USER, x11rb::CURRENT_TIME, 0, 0, 0];
            let message = ClientMessageEvent::new(32, window, atoms._NET_ACTIVE_WINDOW, data);
            let mask = EventMask::SUBSTRUCTURE_REDIRECT | EventMask::SUBSTRUCTURE_NOTIFY;
            connection.send_event(false, *root, mask, message)?.ignore_error();
        }
        connection.flush()?;
        let (begun, mut is_told) = (Instant::now(), false);
        while begun.elapsed() < FOCUS_TIMES.1 {
            if self.has_focus()? {
                return Ok(true);
            }
            if begun.elapsed() >= FOCUS_TIMES.0 && !std::mem::replace(&mut is_told, true) {
                let left = (FOCUS_TIMES.1 - FOCUS_TIMES.0).as_secs();
                tracing::warn!("click on the window with {}: within {left} s it must have the focus", self.name);
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        Ok(false)
    }

    /// A program that was started again has another window.
    fn refind(&mut self) -> Result<Option<WindowId>, ScreenError> {
        if let Some(window) = self.window
            && unless_gone(self.display.0.connection.get_window_attributes(window)?.reply())?.is_none()
            && let Some(found) = self.display.find(&self.name)?
        {
            self.window = Some(found);
        }
        Ok(self.window)
    }

    /// Whether the window is no more, as after the end of its program; without a window never.
    ///
    /// # Errors
    /// [`ScreenError::Failed`].
    pub fn is_gone(&self) -> Result<bool, ScreenError> {
        let Some(window) = self.window else { return Ok(false) };
        Ok(unless_gone(self.display.0.connection.get_window_attributes(window)?.reply())?.is_none())
    }

    /// Whether the window has the focus, both by the window manager and by the server; without a window, always.
    ///
    /// # Errors
    /// [`ScreenError::Failed`].
    pub fn has_focus(&mut self) -> Result<bool, ScreenError> {
        let Some(window) = self.window else { return Ok(true) };
        let Server { connection, root, atoms, .. } = &*self.display.0;
        let focus = connection.get_input_focus()?;
        let active = ids(&self.display.0, atoms._NET_ACTIVE_WINDOW)?;
        let mut at = focus.reply()?.focus;
        if active.first().is_some_and(|active| *active != window) {
            return Ok(false);
        }
        // The focus may be in a window within that of the program.
        for _ in 0..DEPTH {
            if at == window {
                return Ok(true);
            }
            // 0 and 1 stand for no window and for the one under the pointer.
            if at <= 1 || at == *root {
                return Ok(false);
            }
            match unless_gone(connection.query_tree(at)?.reply())? {
                Some(tree) => at = tree.parent,
                None => return Ok(false),
            }
        }
        Ok(false)
    }

    /// Presses a key, if the window has the focus, or releases it.
    ///
    /// # Errors
    /// [`ScreenError::NoFocus`] and [`ScreenError::NoKey`]: nothing was pressed.
    pub fn set(&mut self, key: Key, down: bool) -> Result<(), ScreenError> {
        if down {
            return self.press_if(key, || true);
        }
        match self.held.iter().position(|(held, _)| *held == key) {
            Some(place) => {
                let (_, code) = self.held.remove(place);
                self.fake(KEY_RELEASE_EVENT, code)
            }
            None => Ok(()),
        }
    }

    /// Presses a key, if the window has the focus, and if `wanted` says so right before: the focus is asked of the server, which may
    /// take a while.
    ///
    /// # Errors
    /// [`ScreenError::NoFocus`] and [`ScreenError::NoKey`]: nothing was pressed.
    pub fn press_if(&mut self, key: Key, wanted: impl FnOnce() -> bool) -> Result<(), ScreenError> {
        if self.held.iter().any(|(held, _)| *held == key) {
            return Ok(());
        }
        self.handle_events()?;
        let code = self.code(key)?;
        self.with_focus(|hands| {
            if !wanted() {
                return Ok(());
            }
            // Noted first: a key that may be down is released.
            hands.held.push((key, code));
            hands.fake(KEY_PRESS_EVENT, code)
        })
    }

    /// Does something if the window has the focus, which no other program can take before it is done: what they ask of the server
    /// waits meanwhile, for as many replies of the server as [`has_focus`](Self::has_focus) needs.
    fn with_focus(&mut self, act: impl FnOnce(&mut Self) -> Result<(), ScreenError>) -> Result<(), ScreenError> {
        if self.window.is_none() {
            return Err(ScreenError::NoFocus);
        }
        self.display.0.connection.grab_server()?;
        let done = match self.has_focus() {
            Ok(true) => act(self),
            Ok(false) => Err(ScreenError::NoFocus),
            Err(error) => Err(error),
        };
        let connection = &self.display.0.connection;
        connection.ungrab_server()?;
        connection.flush()?;
        done
    }

    /// Moves the mouse to the right by pixels, if the window has the focus.
    ///
    /// # Errors
    /// [`ScreenError::NoFocus`]: it was not moved.
    pub fn turn(&mut self, pixels: i16) -> Result<(), ScreenError> {
        if pixels == 0 {
            return Ok(());
        }
        self.with_focus(|hands| {
            let Server { connection, root, .. } = &*hands.display.0;
            // Relative to where it is.
            connection.xtest_fake_input(MOTION_NOTIFY_EVENT, 1, x11rb::CURRENT_TIME, *root, pixels, 0, 0)?;
            Ok(())
        })
    }

    /// Takes a gamepad, for [`push_if`](Self::push_if).
    pub fn take(&mut self, gamepad: Gamepad) {
        self.gamepad = Some(gamepad);
    }

    /// Moves the sticks of the gamepad: to the centre at any time, elsewhere if the window has the focus, and if `wanted` says so right
    /// before.
    ///
    /// # Errors
    /// [`ScreenError::NoFocus`] and [`ScreenError::NoGamepad`]: nothing was moved.
    pub fn push_if(&mut self, sticks: Positions, wanted: impl FnOnce() -> bool) -> Result<(), ScreenError> {
        let now = self.gamepad.as_ref().map(Gamepad::positions).unwrap_or_default();
        if sticks == now {
            return Ok(());
        }
        if !sticks.are_centred() {
            if !self.has_focus()? {
                return Err(ScreenError::NoFocus);
            }
            if !wanted() {
                return Ok(());
            }
        }
        let missing = || ScreenError::NoGamepad("it was not made".to_owned());
        self.gamepad.as_mut().ok_or_else(missing)?.set(sticks)
    }

    /// Releases all keys and centres all sticks, and waits until the server has released the keys.
    pub fn release_all(&mut self) {
        if let Some(gamepad) = &mut self.gamepad {
            gamepad.centre();
        }
        let connection = &self.display.0.connection;
        for (key, code) in self.held.drain(..) {
            if let Err(error) = connection.xtest_fake_input(KEY_RELEASE_EVENT, code, x11rb::CURRENT_TIME, x11rb::NONE, 0, 0, 0) {
                tracing::error!("the key {key:?} was not released: {error}");
            }
        }
        // Any reply shows that what came before was done.
        if let Ok(cookie) = connection.get_input_focus() {
            drop(cookie.reply());
        }
    }

    /// The keys that are held.
    #[must_use]
    pub fn held(&self) -> Vec<Key> {
        self.held.iter().map(|(key, _)| *key).collect()
    }

    /// Whether any key is held, or a stick pushed.
    #[must_use]
    pub fn holds(&self) -> bool {
        !self.held.is_empty() || self.gamepad.as_ref().is_some_and(|gamepad| !gamepad.positions().are_centred())
    }

    fn fake(&self, kind: u8, code: Keycode) -> Result<(), ScreenError> {
        let connection = &self.display.0.connection;
        connection.xtest_fake_input(kind, code, x11rb::CURRENT_TIME, x11rb::NONE, 0, 0, 0)?;
        connection.flush()?;
        Ok(())
    }

    /// Takes note of a change of the keyboard's layout. Keys that are held are then released by their old codes.
    ///
    /// The server also tells a change when another keyboard with the same layout is used, as when XTest presses its first key: that is
    /// none.
    fn handle_events(&mut self) -> Result<(), ScreenError> {
        let mut changed = false;
        while let Some(event) = self.display.0.connection.poll_for_event()? {
            changed |= matches!(event, Event::MappingNotify(_));
        }
        if changed {
            let symbols = layout(&self.display.0.connection)?;
            if symbols != self.symbols {
                self.release_all();
                self.symbols = symbols;
            }
        }
        Ok(())
    }

    fn code(&self, key: Key) -> Result<Keycode, ScreenError> {
        let least = self.display.0.connection.setup().min_keycode;
        let code = match key {
            Key::Code(code) => Some(code),
            Key::Symbol(symbol) => {
                let place = self.symbols.iter().position(|known| *known == symbol);
                place.and_then(|place| u8::try_from(place).ok()).and_then(|place| least.checked_add(place))
            }
        };
        code.ok_or_else(|| ScreenError::NoKey(key.to_string()))
    }
}

/// The keyboard's layout: for each keycode from the lowest on, the keysym of its first level, or `KP_0` to `KP_9`, which are at the
/// second one: the first level of the digits of the keypad is that without Num Lock.
pub(super) fn layout(connection: &RustConnection) -> Result<Vec<u32>, ScreenError> {
    let (least, most) = (connection.setup().min_keycode, connection.setup().max_keycode);
    let mapping = connection.get_keyboard_mapping(least, most - least + 1)?.reply()?;
    let each = usize::from(mapping.keysyms_per_keycode.max(1));
    Ok(mapping.keysyms.chunks(each).map(symbol).collect())
}

/// What a key with these levels is named by.
fn symbol(levels: &[u32]) -> u32 {
    let digit = levels.iter().find(|symbol| KEYPAD.contains(symbol));
    digit.or(levels.first()).copied().unwrap_or(0)
}

impl Drop for Hands {
    fn drop(&mut self) {
        self.release_all();
    }
}

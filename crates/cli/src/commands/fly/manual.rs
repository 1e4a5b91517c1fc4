//! Manual flight from the terminal: only keys typed in it, and only during a flight on the wall clock.

use std::sync::mpsc::Sender;

use spf_core::craft::Craft;
use spf_core::pilot::OperatorEvent;

use super::reading::Reader;

/// A terminal that passes single keys; its modes are restored when this is dropped.
pub(super) struct Manual(Option<platform::Raw>);

impl Manual {
    /// Nothing is listened to.
    pub(super) fn none() -> Self {
        Self(None)
    }

    /// Whether there is a terminal to listen to.
    pub(super) fn is_possible() -> bool {
        platform::is_possible()
    }

    /// Whether manual flight is possible.
    pub(super) fn is_on(&self) -> bool {
        self.0.is_some()
    }

    /// Listens to the terminal, if there is one, and sends what the keys mean. A `reader` checks typed instructions.
    pub(super) fn start(craft: Craft, reader: Option<Reader>, events: Sender<OperatorEvent>) -> Self {
        Self(platform::listen(craft, reader, events))
    }
}

/// Restores the terminal, at an end that runs no destructors.
pub(crate) fn restore() {
    platform::restore();
}

#[cfg(unix)]
mod platform {
    use std::io::{IsTerminal, Read, Write, stderr, stdin};
    use std::sync::Mutex;
    use std::sync::mpsc::Sender;
    use std::time::Instant;

    use rustix::termios::{LocalModes, OptionalActions, Termios, tcgetattr, tcsetattr};
    use spf_core::craft::Craft;
    use spf_core::pilot::OperatorEvent;
    use spf_core::time::Time;
    use spf_flight::keys::{Keys, keys_of};

    use crate::background;
    use crate::commands::fly::reading::Reader;

    /// The original modes of the terminal.
    static BEFORE: Mutex<Option<Termios>> = Mutex::new(None);

    pub(super) struct Raw;

    impl Drop for Raw {
        fn drop(&mut self) {
            restore();
        }
    }

    pub(super) fn restore() {
        let modes = BEFORE.lock().ok().and_then(|mut before| before.take());
        if let Some(modes) = modes
            && let Err(error) = tcsetattr(stdin(), OptionalActions::Now, &modes)
        {
            tracing::warn!(%error, "cannot restore the terminal; run `stty sane`");
        }
    }

    pub(super) fn is_possible() -> bool {
        stdin().is_terminal() && stderr().is_terminal()
    }

    pub(super) fn listen(craft: Craft, reader: Option<Reader>, events: Sender<OperatorEvent>) -> Option<Raw> {
        if !is_possible() {
            return None;
        }
        let before = tcgetattr(stdin()).ok()?;
        let mut modes = before.clone();
        // Ctrl-C stays a signal, and output lines stay lines.
        modes.local_modes.remove(LocalModes::ICANON | LocalModes::ECHO);
        *BEFORE.lock().ok()? = Some(before);
        let raw = Raw;
        tcsetattr(stdin(), OptionalActions::Now, &modes).ok()?;
        // It ends with the process: a read from a terminal cannot be cancelled.
        std::thread::Builder::new().name("keys".to_owned()).spawn(move || read(craft, reader.as_ref(), &events)).ok()?;
        Some(raw)
    }

    fn read(craft: Craft, reader: Option<&Reader>, events: &Sender<OperatorEvent>) {
        let (mut keys, mut buffer, mut input, start) = (Keys::new(craft), [0; 256], stdin(), Instant::now());
        while let Ok(length) = input.read(&mut buffer) {
            if length == 0 {
                return;
            }
            let typing = keys.typed().is_some();
            let pressed = keys.read(Time::ZERO + start.elapsed(), &keys_of(&buffer[..length]));
            let (admitted, lines) = match reader {
                Some(reader) => reader.admit(pressed),
                None => (pressed.events, pressed.hint.map(str::to_owned).into_iter().collect()),
            };
            for event in admitted {
                if events.send(event).is_err() {
                    return;
                }
            }
            show(typing, keys.typed());
            lines.iter().for_each(|line| background::say(line));
        }
    }

    /// The line that is being typed.
    fn show(before: bool, typed: Option<&str>) {
        let mut out = stderr().lock();
        // A closed standard error must not end a flight.
        drop(match typed {
            Some(text) => write!(out, "\r\x1b[2Kinstruction> {text}"),
            None if before => writeln!(out),
            None => Ok(()),
        });
        drop(out.flush());
    }
}

#[cfg(not(unix))]
mod platform {
    use std::sync::mpsc::Sender;

    use spf_core::craft::Craft;
    use spf_core::pilot::OperatorEvent;

    use crate::commands::fly::reading::Reader;

    pub(super) struct Raw;

    pub(super) fn restore() {}

    pub(super) fn is_possible() -> bool {
        false
    }

    pub(super) fn listen(_craft: Craft, _reader: Option<Reader>, _events: Sender<OperatorEvent>) -> Option<Raw> {
        None
    }
}

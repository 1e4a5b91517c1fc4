//! Manual flight from the terminal: only keys typed in it, and only during a flight on the wall clock.

use std::sync::mpsc::Sender;

use spf_core::craft::Craft;
use spf_pilot::OperatorEvent;

use spf_api::reading::Reader;

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
    pub(super) fn start(craft: Craft, reader: Reader, events: Sender<OperatorEvent>) -> Self {
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
    use std::sync::mpsc::Sender;
    use std::sync::{Mutex, MutexGuard, PoisonError};
    use std::time::Instant;

    use rustix::termios::{LocalModes, OptionalActions, Termios, tcgetattr, tcsetattr};
    use spf_core::craft::Craft;
    use spf_core::time::Time;
    use spf_flight::keys::{Keys, keys_of};
    use spf_pilot::OperatorEvent;

    use crate::background;
    use spf_api::reading::Reader;

    /// The original modes of the terminal.
    static BEFORE: Mutex<Option<Termios>> = Mutex::new(None);

    /// Who listens to the keys of the process.
    static KEYBOARD: Keyboard = Keyboard::new();

    pub(super) struct Raw;

    impl Drop for Raw {
        fn drop(&mut self) {
            KEYBOARD.inner().listener = None;
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

    pub(super) fn listen(craft: Craft, reader: Reader, events: Sender<OperatorEvent>) -> Option<Raw> {
        if !is_possible() {
            return None;
        }
        let before = tcgetattr(stdin()).ok()?;
        let mut modes = before.clone();
        // Ctrl-C stays a signal, and output lines stay lines.
        modes.local_modes.remove(LocalModes::ICANON | LocalModes::ECHO);
        *BEFORE.lock().ok()? = Some(before);
        let raw = Raw;
        // What was typed before the flight is not for it.
        tcsetattr(stdin(), OptionalActions::Flush, &modes).ok()?;
        if KEYBOARD.listen(Listener::new(craft, reader, events)) {
            // It goes on from flight to flight: a read from a terminal cannot be cancelled, and a second reader would take
            // the first one's keys.
            std::thread::Builder::new().name("keys".to_owned()).spawn(|| KEYBOARD.read(stdin())).ok()?;
        }
        Some(raw)
    }

    /// The keys of a process: one thread reads them, for the flight that is under way.
    struct Keyboard(Mutex<Inner>);

    struct Inner {
        /// Whether the thread runs that reads.
        is_read: bool,
        listener: Option<Listener>,
    }

    impl Keyboard {
        const fn new() -> Self {
            Self(Mutex::new(Inner { is_read: false, listener: None }))
        }

        fn inner(&self) -> MutexGuard<'_, Inner> {
            // Consistent between calls.
            self.0.lock().unwrap_or_else(PoisonError::into_inner)
        }

        /// From now on keys are for this flight. True if they are not read yet: then [`Keyboard::read`] must run.
        fn listen(&self, listener: Listener) -> bool {
            let mut inner = self.inner();
            inner.listener = Some(listener);
            !std::mem::replace(&mut inner.is_read, true)
        }

        /// Reads keys until the input ends. Between flights they mean nothing.
        fn read(&self, mut input: impl Read) {
            let mut buffer = [0; 256];
            loop {
                let length = input.read(&mut buffer).unwrap_or(0);
                let mut inner = self.inner();
                if length == 0 {
                    // The next flight tries again.
                    inner.is_read = false;
                    return;
                }
                if let Some(listener) = &mut inner.listener {
                    listener.pressed(&buffer[..length]);
                }
            }
        }
    }

    /// What keys mean to one flight.
    struct Listener {
        keys: Keys,
        reader: Reader,
        events: Sender<OperatorEvent>,
        start: Instant,
    }

    impl Listener {
        fn new(craft: Craft, reader: Reader, events: Sender<OperatorEvent>) -> Self {
            Self { keys: Keys::new(craft), reader, events, start: Instant::now() }
        }

        fn pressed(&mut self, bytes: &[u8]) {
            let typing = self.keys.typed().is_some();
            let pressed = self.keys.read(Time::ZERO + self.start.elapsed(), &keys_of(bytes));
            let (admitted, lines) = self.reader.admit(pressed);
            for event in admitted {
                // The flight may be over.
                if self.events.send(event).is_err() {
                    return;
                }
            }
            show(typing, self.keys.typed());
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

    #[cfg(test)]
    mod tests {
        use std::io::Write as _;
        use std::os::unix::net::UnixStream;
        use std::sync::mpsc::channel;
        use std::time::Duration;

        use super::*;

        #[test]
        fn the_first_key_of_each_flight_is_its_own() {
            static KEYS: Keyboard = Keyboard::new();
            let (mut terminal, input) = UnixStream::pair().unwrap();
            let mut reader = None;
            for flight in 0..3 {
                let (send, events) = channel();
                if KEYS.listen(Listener::new(Craft::tello(), Reader::of_model(), send)) {
                    let input = input.try_clone().unwrap();
                    assert!(reader.replace(std::thread::spawn(|| KEYS.read(input))).is_none(), "a second reader takes keys");
                }
                terminal.write_all(b" ").unwrap();
                assert_eq!(events.recv_timeout(Duration::from_secs(10)), Ok(OperatorEvent::Hold), "flight {flight}");
                KEYS.inner().listener = None;
            }
            // The end of the input ends the reader, and the next flight starts another.
            drop(terminal);
            reader.unwrap().join().unwrap();
            let (send, _events) = channel();
            assert!(KEYS.listen(Listener::new(Craft::tello(), Reader::of_model(), send)));
        }
    }
}

#[cfg(not(unix))]
mod platform {
    use std::sync::mpsc::Sender;

    use spf_core::craft::Craft;
    use spf_pilot::OperatorEvent;

    use spf_api::reading::Reader;

    pub(super) struct Raw;

    pub(super) fn restore() {}

    pub(super) fn is_possible() -> bool {
        false
    }

    pub(super) fn listen(_craft: Craft, _reader: Reader, _events: Sender<OperatorEvent>) -> Option<Raw> {
        None
    }
}

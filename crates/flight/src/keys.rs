//! Manual flight from a keyboard: the meaning of keys. Keys fly only while no text is being typed, and only those sent
//! to this program's terminal; the keyboard is not read globally.
//!
//! Text that is pasted, or typed without opening the prompt first, is not flown: characters that arrive together and
//! differ, and letters within a second of one that is not a key, are ignored. No text can cut the motors, which takes
//! Ctrl-X twice, each alone: what arrives together was pasted, or waited while this program was stopped.

use spf_core::command::Setpoint;
use spf_core::craft::Craft;
use spf_core::time::{Duration, Time};
use spf_pilot::OperatorEvent;

/// A key.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Key {
    /// Up arrow.
    Up,
    /// Down arrow.
    Down,
    /// Left arrow.
    Left,
    /// Right arrow.
    Right,
    /// Return.
    Enter,
    /// Escape.
    Escape,
    /// Backspace.
    Backspace,
    /// Ctrl-X.
    CtrlX,
    /// A letter, digit or symbol.
    Character(char),
}

/// Decodes the bytes sent by a terminal. Each escape sequence must be complete; unknown ones are skipped.
#[must_use]
pub fn keys_of(bytes: &[u8]) -> Vec<Key> {
    let mut keys = Vec::new();
    let mut rest = bytes;
    while let Some((&first, after)) = rest.split_first() {
        rest = after;
        match first {
            b'\r' | b'\n' => keys.push(Key::Enter),
            0x7f | 0x08 => keys.push(Key::Backspace),
            0x18 => keys.push(Key::CtrlX),
            0x1b => match after {
                [b'[' | b'O', letter, ..] if letter.is_ascii_alphabetic() => {
                    rest = &after[2..];
                    let arrows = [(b'A', Key::Up), (b'B', Key::Down), (b'C', Key::Right), (b'D', Key::Left)];
                    keys.extend(arrows.iter().find(|(code, _)| code == letter).map(|(_, key)| *key));
                }
                [b'[' | b'O', parameters @ ..] => {
                    // A longer sequence: it ends with its first letter or `~`.
                    let end = parameters.iter().position(|byte| byte.is_ascii_alphabetic() || *byte == b'~');
                    rest = end.map_or(&[], |end| &parameters[end + 1..]);
                }
                _ => keys.push(Key::Escape),
            },
            0x00..=0x1f => {}
            _ => {
                let length = match first {
                    0xc0..=0xdf => 2,
                    0xe0..=0xef => 3,
                    0xf0..=0xf7 => 4,
                    _ => 1,
                };
                let whole = &bytes[bytes.len() - after.len() - 1..];
                let letter = whole.get(..length).and_then(|bytes| core::str::from_utf8(bytes).ok());
                if let Some(letter) = letter.and_then(|text| text.chars().next()) {
                    keys.push(Key::Character(letter));
                    rest = &whole[length..];
                }
            }
        }
    }
    keys
}

/// Maximum length of a typed instruction, characters.
const LONGEST: usize = 2000;

/// Help text for the keys.
pub const HELP: &str = "Keys: arrow keys fly, W/S climb and descend, A/D yaw, Space holds (also during a landing), T resumes, \
L lands, Enter opens a prompt for a new instruction, Ctrl-X twice within 1 s cuts the motors.";

/// How long letters are ignored after a letter that is not a key.
const TEXT_TIME: Duration = Duration::from_secs(1);
/// The second Ctrl-X counts within this time.
const TWICE_WITHIN: Duration = Duration::from_secs(1);

/// What keys mean.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pressed {
    /// Operator inputs, in order.
    pub events: Vec<OperatorEvent>,
    /// A message for the operator.
    pub hint: Option<&'static str>,
}

/// Keyboard state.
#[derive(Clone, Debug)]
pub struct Keys {
    craft: Craft,
    typed: Option<String>,
    /// Until when letters are text that was not meant to fly.
    text_until: Time,
    /// The first of two Ctrl-X.
    first_cut: Option<Time>,
}

impl Keys {
    /// Keys for a craft, flying at half its preset speeds.
    #[must_use]
    pub fn new(craft: Craft) -> Self {
        Self { craft, typed: None, text_until: Time::ZERO, first_cut: None }
    }

    /// The instruction being typed; `None` if none is.
    #[must_use]
    pub fn typed(&self) -> Option<&str> {
        self.typed.as_deref()
    }

    /// The operator inputs that result from keys that arrived together at `now`, on any steady clock.
    pub fn read(&mut self, now: Time, keys: &[Key]) -> Pressed {
        let mut pressed = Pressed::default();
        let letters = || keys.iter().filter(|key| is_letter(key));
        // A held key repeats one letter; different ones at once were pasted.
        let pasted = self.typed.is_none() && letters().any(|letter| Some(letter) != letters().next());
        if pasted || (self.typed.is_none() && letters().any(|letter| !is_command(letter))) {
            self.text_until = now + TEXT_TIME;
            pressed.hint = Some("text is ignored; Enter opens a prompt for a new instruction");
        }
        for key in keys {
            if *key == Key::CtrlX && keys.len() > 1 {
                self.first_cut = None;
                pressed.hint = Some("Ctrl-X together with other keys, as in pasted text, does not count");
                continue;
            }
            if *key == Key::CtrlX {
                if self.first_cut.take().is_some_and(|first| now.since(first) <= TWICE_WITHIN) {
                    pressed.events.push(OperatorEvent::CutMotors);
                } else {
                    self.first_cut = Some(now);
                    pressed.hint = Some("Ctrl-X again within 1 s cuts the motors: the drone falls");
                }
                continue;
            }
            self.first_cut = None;
            // In pasted text, spaces and line ends are text too.
            let part = is_letter(key) || (pasted && matches!(key, Key::Enter | Key::Character(_)));
            let text = self.typed.is_none() && now < self.text_until && part;
            if !text {
                pressed.events.extend(self.press(*key));
            }
        }
        pressed
    }

    /// The operator inputs that result from a key. While an instruction is typed every key is text, and the craft
    /// holds.
    fn press(&mut self, key: Key) -> Vec<OperatorEvent> {
        if let Some(text) = &mut self.typed {
            match key {
                Key::Character(letter) if !letter.is_control() && text.chars().count() < LONGEST => text.push(letter),
                Key::Backspace => drop(text.pop()),
                Key::Escape => self.typed = None,
                Key::Enter => {
                    let text = self.typed.take().unwrap_or_default().trim().to_owned();
                    if !text.is_empty() {
                        return vec![OperatorEvent::Instruction(text), OperatorEvent::Resume];
                    }
                }
                _ => {}
            }
            return Vec::new();
        }
        let (speed, climb, turn) = (0.5 * self.craft.cruise_speed, 0.5 * self.craft.climb_speed, 0.5 * self.craft.yaw_rate);
        let hold = Setpoint::HOLD;
        let flown = match key {
            Key::Up => Setpoint { forward: speed, ..hold },
            Key::Down => Setpoint { forward: -speed, ..hold },
            Key::Left => Setpoint { right: -speed, ..hold },
            Key::Right => Setpoint { right: speed, ..hold },
            Key::Character('w' | 'W') => Setpoint { up: climb, ..hold },
            Key::Character('s' | 'S') => Setpoint { up: -climb, ..hold },
            Key::Character('a' | 'A') => Setpoint { yaw_rate: -turn, ..hold },
            Key::Character('d' | 'D') => Setpoint { yaw_rate: turn, ..hold },
            Key::Character(' ') => return vec![OperatorEvent::Hold],
            Key::Character('t' | 'T') => return vec![OperatorEvent::Resume],
            Key::Character('l' | 'L') => return vec![OperatorEvent::Land],
            Key::Enter => {
                self.typed = Some(String::new());
                return vec![OperatorEvent::Hold];
            }
            Key::Escape | Key::Backspace | Key::CtrlX | Key::Character(_) => return Vec::new(),
        };
        vec![OperatorEvent::Setpoint(flown)]
    }
}

/// Whether a key is text outside of the prompt; a space holds, whatever came before it.
fn is_letter(key: &Key) -> bool {
    matches!(key, Key::Character(letter) if *letter != ' ')
}

/// Whether a character is a key of manual flight.
fn is_command(key: &Key) -> bool {
    matches!(key, Key::Character(letter) if "wsadtl".contains(letter.to_ascii_lowercase()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn typed(keys: &mut Keys, text: &str) -> Vec<OperatorEvent> {
        text.chars().flat_map(|letter| keys.press(Key::Character(letter))).collect()
    }

    /// Known failure 7 of similar programs: keys for manual flight are read globally, so that typing an instruction
    /// flies the drone.
    #[test]
    fn failing_7_typing_an_instruction_flies_nothing() {
        let mut keys = Keys::new(Craft::tello());
        assert_eq!(keys.press(Key::Enter), [OperatorEvent::Hold]);
        assert_eq!(typed(&mut keys, "the yellow towel on the left wall, twelve steps"), []);
        assert_eq!([Key::Up, Key::Left, Key::Right, Key::Down].map(|key| keys.press(key)), [const { Vec::new() }; 4]);
        let events = keys.press(Key::Enter);
        let instruction = OperatorEvent::Instruction("the yellow towel on the left wall, twelve steps".to_owned());
        assert_eq!(events, [instruction, OperatorEvent::Resume]);
    }

    #[test]
    fn keys_fly_at_half_speed() {
        let mut keys = Keys::new(Craft::tello());
        assert_eq!(keys.press(Key::Up), [OperatorEvent::Setpoint(Setpoint { forward: 0.5, ..Setpoint::HOLD })]);
        assert_eq!(keys.press(Key::Character('s')), [OperatorEvent::Setpoint(Setpoint { up: -0.4, ..Setpoint::HOLD })]);
        assert_eq!(keys.press(Key::Character('L')), [OperatorEvent::Land]);
    }

    #[test]
    fn cutting_the_motors_takes_ctrl_x_twice_within_a_second_also_while_typing() {
        let press = |keys: &mut Keys, ms| keys.read(Time::from_millis(ms), &[Key::CtrlX]).events;
        for typing in [false, true] {
            let mut keys = Keys::new(Craft::tello());
            if typing {
                keys.press(Key::Enter);
            }
            assert_eq!((press(&mut keys, 0), press(&mut keys, 1100)), (vec![], vec![]), "too slow");
            assert_eq!(press(&mut keys, 2000), [OperatorEvent::CutMotors]);
            assert_eq!(press(&mut keys, 2100), [], "a third one is a first one");
            keys.read(Time::from_millis(2200), &[Key::Up]);
            assert_eq!(press(&mut keys, 2300), [], "another key in between");
        }
    }

    #[test]
    fn pasted_text_and_text_without_the_prompt_fly_nothing() {
        let mut keys = Keys::new(Craft::tello());
        let pasted: Vec<Key> = "land at the wall\ndwell\n".chars().map(|c| keys_of(c.to_string().as_bytes())[0]).collect();
        let read = keys.read(Time::ZERO, &pasted);
        assert!(read.events.is_empty() && read.hint.is_some(), "{read:?}");
        assert_eq!(keys.typed(), None);
        // Typed at ten characters per second: after the first letter that is not a key, only spaces have an effect.
        let mut at = Time::from_millis(10_000);
        let mut events = Vec::new();
        for letter in "fly to the red crane and descend slowly".chars() {
            events.extend(keys.read(at, &[Key::Character(letter)]).events);
            at += Duration::from_millis(100);
        }
        assert!(events.iter().all(|event| *event == OperatorEvent::Hold), "{events:?}");
        let later = keys.read(at + Duration::from_secs(1), &[Key::Character('w'), Key::Character('w')]).events;
        assert_eq!(later.len(), 2, "a held key repeats");
    }

    #[test]
    fn escape_and_an_empty_line_leave_the_instruction() {
        let mut keys = Keys::new(Craft::tello());
        for last in [Key::Escape, Key::Enter] {
            keys.press(Key::Enter);
            typed(&mut keys, "  ");
            assert_eq!(keys.press(last), []);
            assert_eq!(keys.typed(), None);
        }
    }

    #[test]
    fn a_terminal_s_bytes_are_keys() {
        let found = keys_of("w\x1b[A\x1bOD\x1b[1;5C\x1b[3~ü\r\x7f".as_bytes());
        let expected = [Key::Character('w'), Key::Up, Key::Left, Key::Character('ü'), Key::Enter, Key::Backspace];
        assert_eq!(found, expected);
        assert_eq!(keys_of(b"\x1b"), [Key::Escape]);
    }

    proptest! {
        #[test]
        fn no_bytes_panic(bytes in proptest::collection::vec(any::<u8>(), 0..40)) {
            prop_assert!(keys_of(&bytes).len() <= bytes.len());
        }

        /// No text cuts the motors, at any typing speed.
        #[test]
        fn no_text_cuts_the_motors(texts in proptest::collection::vec(("(\\x18|\\PC){2,20}", 0_u64..2000), 0..20)) {
            let mut keys = Keys::new(Craft::tello());
            let mut now = Time::ZERO;
            for (text, pause) in texts {
                now += Duration::from_millis(pause);
                let events = keys.read(now, &keys_of(text.as_bytes())).events;
                prop_assert!(!events.contains(&OperatorEvent::CutMotors));
            }
        }

        /// While text is typed, only ending it has an effect.
        #[test]
        fn no_text_flies(text in "\\PC{0,80}") {
            let mut keys = Keys::new(Craft::tello());
            keys.press(Key::Enter);
            prop_assert!(typed(&mut keys, &text).is_empty());
            prop_assert_eq!(keys.typed(), Some(text.as_str()));
        }
    }
}

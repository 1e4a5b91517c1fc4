//! Manual flight from a keyboard: the meaning of keys. Keys fly only while no text is being typed, and only those sent
//! to this program's terminal; the keyboard is not read globally.

use spf_core::command::Setpoint;
use spf_core::craft::Craft;
use spf_core::pilot::OperatorEvent;

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
pub const HELP: &str = "Keys: arrows fly, W/S climb and descend, A/D yaw, Space holds, T resumes, L lands, E stops the \
motors, Enter opens a prompt for a new instruction.";

/// Keyboard state.
#[derive(Clone, Debug)]
pub struct Keys {
    craft: Craft,
    typed: Option<String>,
}

impl Keys {
    /// Keys for a craft, flying at half its preset speeds.
    #[must_use]
    pub fn new(craft: Craft) -> Self {
        Self { craft, typed: None }
    }

    /// The instruction being typed; `None` if none is.
    #[must_use]
    pub fn typed(&self) -> Option<&str> {
        self.typed.as_deref()
    }

    /// The operator inputs that result from a key. While an instruction is typed every key is text, and the craft
    /// holds.
    pub fn press(&mut self, key: Key) -> Vec<OperatorEvent> {
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
            Key::Character('e' | 'E') => return vec![OperatorEvent::Stop],
            Key::Enter => {
                self.typed = Some(String::new());
                return vec![OperatorEvent::Hold];
            }
            Key::Escape | Key::Backspace | Key::Character(_) => return Vec::new(),
        };
        vec![OperatorEvent::Setpoint(flown)]
    }
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
    fn keys_fly_at_half_speed_and_e_cuts_the_motors() {
        let mut keys = Keys::new(Craft::tello());
        assert_eq!(keys.press(Key::Up), [OperatorEvent::Setpoint(Setpoint { forward: 0.5, ..Setpoint::HOLD })]);
        assert_eq!(keys.press(Key::Character('s')), [OperatorEvent::Setpoint(Setpoint { up: -0.4, ..Setpoint::HOLD })]);
        assert_eq!(keys.press(Key::Character('L')), [OperatorEvent::Land]);
        assert_eq!(keys.press(Key::Character('e')), [OperatorEvent::Stop]);
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

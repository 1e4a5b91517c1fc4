//! Names of keys: those of X11 keysyms, or `#NN`, the key with this code whatever is printed on it.

use std::fmt;

use serde::{Deserialize, Serialize};

/// Keys with names of more than one character, and their keysyms (X11's `keysymdef.h`).
const NAMED: &[(&str, u32)] = &[
    ("space", 0x20),
    ("apostrophe", 0x27),
    ("comma", 0x2c),
    ("minus", 0x2d),
    ("period", 0x2e),
    ("slash", 0x2f),
    ("semicolon", 0x3b),
    ("equal", 0x3d),
    ("bracketleft", 0x5b),
    ("backslash", 0x5c),
    ("bracketright", 0x5d),
    ("grave", 0x60),
    ("BackSpace", 0xff08),
    ("Tab", 0xff09),
    ("Return", 0xff0d),
    ("Escape", 0xff1b),
    ("Home", 0xff50),
    ("Left", 0xff51),
    ("Up", 0xff52),
    ("Right", 0xff53),
    ("Down", 0xff54),
    ("Page_Up", 0xff55),
    ("Page_Down", 0xff56),
    ("End", 0xff57),
    ("Insert", 0xff63),
    ("KP_Enter", 0xff8d),
    ("KP_Multiply", 0xffaa),
    ("KP_Add", 0xffab),
    ("KP_Subtract", 0xffad),
    ("KP_Divide", 0xffaf),
    ("Shift_L", 0xffe1),
    ("Shift_R", 0xffe2),
    ("Control_L", 0xffe3),
    ("Control_R", 0xffe4),
    ("Alt_L", 0xffe9),
    ("Delete", 0xffff),
];

/// A key.
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum Key {
    /// The key that gives this keysym without Shift, by the keyboard's layout.
    Symbol(u32),
    /// The key with this code (8 to 255), whatever the layout says.
    Code(u8),
}

/// The name is not that of a key.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "expected a key such as `w`, `space`, `Shift_L`, `Up`, `F5`, `KP_8`, or `#25` for the key with that code, found `{0}`; \
     `xev` shows names and codes"
)]
pub struct KeyError(String);

impl Key {
    /// The key of this name.
    ///
    /// # Errors
    /// [`KeyError`] if there is none.
    pub fn named(name: &str) -> Result<Self, KeyError> {
        let unknown = || KeyError(name.chars().take(40).collect());
        if let Some(code) = name.strip_prefix('#') {
            let is_plain = code.starts_with(|first| matches!(first, '1'..='9'));
            let code = code.parse().ok().filter(|code| *code >= 8 && is_plain);
            return code.map(Self::Code).ok_or_else(unknown);
        }
        let mut letters = name.chars();
        if let (Some(letter), None) = (letters.next(), letters.next()) {
            // The keysym of a Latin letter or a digit is its code.
            let known = letter.is_ascii_lowercase() || letter.is_ascii_digit();
            return known.then_some(Self::Symbol(letter.into())).ok_or_else(unknown);
        }
        let numbered = |prefix: &str, first: u32, most: u32| {
            let number: u32 =
                name.strip_prefix(prefix).filter(|digits| !digits.starts_with(['0', '+']) || *digits == "0")?.parse().ok()?;
            (number <= most).then(|| first.wrapping_add(number))
        };
        let found = NAMED.iter().find(|(known, _)| *known == name).map(|(_, symbol)| *symbol);
        let found = found.or_else(|| numbered("KP_", 0xffb0, 9));
        // F1 is 0xffbe.
        let found = found.or_else(|| numbered("F", 0xffbd, 12).filter(|symbol| *symbol > 0xffbd));
        found.map(Self::Symbol).ok_or_else(unknown)
    }
}

impl fmt::Display for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Code(code) => write!(f, "#{code}"),
            Self::Symbol(symbol) => match NAMED.iter().find(|(_, known)| *known == symbol) {
                Some((name, _)) => f.write_str(name),
                None if (0xffb0..=0xffb9).contains(&symbol) => write!(f, "KP_{}", symbol - 0xffb0),
                None if (0xffbe..=0xffc9).contains(&symbol) => write!(f, "F{}", symbol - 0xffbd),
                None => write!(f, "{}", char::from_u32(symbol).unwrap_or('?')),
            },
        }
    }
}

impl fmt::Debug for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "`{self}`")
    }
}

impl TryFrom<String> for Key {
    type Error = KeyError;

    fn try_from(name: String) -> Result<Self, KeyError> {
        Self::named(&name)
    }
}

impl From<Key> for String {
    fn from(key: Key) -> Self {
        key.to_string()
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn names_of_keys_and_back() {
        for (name, key) in [
            ("w", Key::Symbol(0x77)),
            ("7", Key::Symbol(0x37)),
            ("space", Key::Symbol(0x20)),
            ("Shift_L", Key::Symbol(0xffe1)),
            ("F1", Key::Symbol(0xffbe)),
            ("F12", Key::Symbol(0xffc9)),
            ("KP_0", Key::Symbol(0xffb0)),
            ("KP_8", Key::Symbol(0xffb8)),
            ("#25", Key::Code(25)),
        ] {
            assert_eq!((Key::named(name), key.to_string()), (Ok(key), name.to_owned()));
        }
        for name in ["", "W", "ö", "F0", "F13", "F01", "KP_10", "Super_L", "#7", "#256", "#0025", "#025", "#+25", "#", "enter"] {
            assert!(Key::named(name).is_err(), "{name}");
        }
    }

    proptest! {
        #[test]
        fn any_text_is_a_key_of_that_name_or_none(name in ".{0,12}") {
            if let Ok(key) = Key::named(&name) {
                prop_assert_eq!(key.to_string(), name);
            }
        }
    }
}

//! The keys of a profile as codes of Windows and macOS.
//!
//! A key is pressed by its place on the keyboard: that of the US layout, whatever is printed on it. So a change of the layout while it
//! is held changes nothing, and macOS asks for the layout on its main thread alone, which is not ours.

use crate::profile::Key;

/// A key of Windows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg(any(test, windows))]
pub(crate) enum WindowsKey {
    /// By its scan code (set 1).
    Scan(u16),
    /// By what it does: its scan code has a prefix, or depends on Num Lock.
    Named(Named),
}

/// Keys without a scan code of their own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg(any(test, windows))]
pub(crate) enum Named {
    Left,
    Up,
    Right,
    Down,
    Home,
    End,
    PageUp,
    PageDown,
    Insert,
    Delete,
    ControlRight,
    Divide,
    /// Of the keypad.
    Digit(u8),
}

/// Names of keys and their codes: the kernel's (`linux/input-event-codes.h`), which are the scan codes of set 1 up to 0x58, and macOS's
/// virtual key codes (`HIToolbox/Events.h`).
const PLACES: &[(&str, u16, u16)] = &[
    ("Escape", 1, 0x35),
    ("1", 2, 0x12),
    ("2", 3, 0x13),
    ("3", 4, 0x14),
    ("4", 5, 0x15),
    ("5", 6, 0x17),
    ("6", 7, 0x16),
    ("7", 8, 0x1a),
    ("8", 9, 0x1c),
    ("9", 10, 0x19),
    ("0", 11, 0x1d),
    ("minus", 12, 0x1b),
    ("equal", 13, 0x18),
    ("BackSpace", 14, 0x33),
    ("Tab", 15, 0x30),
    ("q", 16, 0x0c),
    ("w", 17, 0x0d),
    ("e", 18, 0x0e),
    ("r", 19, 0x0f),
    ("t", 20, 0x11),
    ("y", 21, 0x10),
    ("u", 22, 0x20),
    ("i", 23, 0x22),
    ("o", 24, 0x1f),
    ("p", 25, 0x23),
    ("bracketleft", 26, 0x21),
    ("bracketright", 27, 0x1e),
    ("Return", 28, 0x24),
    ("Control_L", 29, 0x3b),
    ("a", 30, 0x00),
    ("s", 31, 0x01),
    ("d", 32, 0x02),
    ("f", 33, 0x03),
    ("g", 34, 0x05),
    ("h", 35, 0x04),
    ("j", 36, 0x26),
    ("k", 37, 0x28),
    ("l", 38, 0x25),
    ("semicolon", 39, 0x29),
    ("apostrophe", 40, 0x27),
    ("grave", 41, 0x32),
    ("Shift_L", 42, 0x38),
    ("backslash", 43, 0x2a),
    ("z", 44, 0x06),
    ("x", 45, 0x07),
    ("c", 46, 0x08),
    ("v", 47, 0x09),
    ("b", 48, 0x0b),
    ("n", 49, 0x2d),
    ("m", 50, 0x2e),
    ("comma", 51, 0x2b),
    ("period", 52, 0x2f),
    ("slash", 53, 0x2c),
    ("Shift_R", 54, 0x3c),
    ("KP_Multiply", 55, 0x43),
    ("Alt_L", 56, 0x3a),
    ("space", 57, 0x31),
    ("F1", 59, 0x7a),
    ("F2", 60, 0x78),
    ("F3", 61, 0x63),
    ("F4", 62, 0x76),
    ("F5", 63, 0x60),
    ("F6", 64, 0x61),
    ("F7", 65, 0x62),
    ("F8", 66, 0x64),
    ("F9", 67, 0x65),
    ("F10", 68, 0x6d),
    ("KP_Subtract", 74, 0x4e),
    ("KP_Add", 78, 0x45),
    ("F11", 87, 0x67),
    ("F12", 88, 0x6f),
    // Beyond the scan codes of one byte.
    ("KP_7", 71, 0x59),
    ("KP_8", 72, 0x5b),
    ("KP_9", 73, 0x5c),
    ("KP_4", 75, 0x56),
    ("KP_5", 76, 0x57),
    ("KP_6", 77, 0x58),
    ("KP_1", 79, 0x53),
    ("KP_2", 80, 0x54),
    ("KP_3", 81, 0x55),
    ("KP_0", 82, 0x52),
    ("KP_Enter", 96, 0x4c),
    ("Control_R", 97, 0x3e),
    ("KP_Divide", 98, 0x4b),
    ("Home", 102, 0x73),
    ("Up", 103, 0x7e),
    ("Page_Up", 104, 0x74),
    ("Left", 105, 0x7b),
    ("Right", 106, 0x7c),
    ("End", 107, 0x77),
    ("Down", 108, 0x7d),
    ("Page_Down", 109, 0x79),
    ("Insert", 110, 0x72),
    ("Delete", 111, 0x75),
];

fn place(key: Key) -> Option<&'static (&'static str, u16, u16)> {
    let name = key.to_string();
    PLACES.iter().find(|(known, ..)| *known == name)
}

/// The key on Windows; `None` if it has none that can be pressed.
#[cfg(any(test, windows))]
pub(crate) fn windows(key: Key) -> Option<WindowsKey> {
    let named = |named| Some(WindowsKey::Named(named));
    let Key::Symbol(symbol) = key else { return None };
    match place(key)?.0 {
        "Left" => named(Named::Left),
        "Up" => named(Named::Up),
        "Right" => named(Named::Right),
        "Down" => named(Named::Down),
        "Home" => named(Named::Home),
        "End" => named(Named::End),
        "Page_Up" => named(Named::PageUp),
        "Page_Down" => named(Named::PageDown),
        "Insert" => named(Named::Insert),
        "Delete" => named(Named::Delete),
        "Control_R" => named(Named::ControlRight),
        "KP_Divide" => named(Named::Divide),
        // It cannot be told from the other one.
        "KP_Enter" => None,
        _ if (0xffb0..=0xffb9).contains(&symbol) => named(Named::Digit((symbol - 0xffb0) as u8)),
        _ => place(key).map(|(_, scan, _)| WindowsKey::Scan(*scan)),
    }
}

/// The key on macOS; `None` if it has none.
#[cfg(any(test, target_os = "macos"))]
pub(crate) fn macos(key: Key) -> Option<u16> {
    place(key).map(|(.., code)| *code)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::profile::Profile;

    #[test]
    fn every_place_is_a_key_and_no_two_are_one() {
        let (mut scans, mut codes) = (BTreeSet::new(), BTreeSet::new());
        for (name, scan, code) in PLACES {
            let key = Key::named(name).unwrap();
            assert!(scans.insert(scan) && codes.insert(code), "{name}");
            assert_eq!(macos(key), Some(*code));
            match windows(key) {
                Some(WindowsKey::Scan(found)) => assert!(found == *scan && found <= 0x58, "{name}"),
                Some(WindowsKey::Named(_)) => assert!(*scan > 0x58 || name.starts_with("KP_"), "{name}"),
                None => assert_eq!(*name, "KP_Enter"),
            }
        }
        assert_eq!((windows(Key::Code(25)), macos(Key::Code(25))), (None, None));
        // On X11 the kernel's code is counted from 8: `w` is `#25`.
        assert_eq!(windows(Key::named("w").unwrap()), Some(WindowsKey::Scan(25 - 8)));
    }

    #[test]
    fn shipped_profiles_have_their_keys() {
        for name in Profile::names() {
            for key in Profile::shipped(name).unwrap().keys() {
                assert!(windows(key).is_some() && macos(key).is_some(), "{name}: {key}");
            }
        }
    }
}

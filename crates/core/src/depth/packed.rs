//! Depths as text, for logs: two characters a value, a fifth of what a list of numbers takes.

use serde::{Deserialize, Deserializer, Serializer, de::Error};

use super::MAX_DEPTHS;

/// Six bits a character.
const ALPHABET: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
/// Before three characters instead of two.
const LONG: u8 = b'=';

pub(crate) fn serialize<S: Serializer>(cm: &[u16], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(&pack(cm))
}

pub(crate) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<u16>, D::Error> {
    let text = <std::borrow::Cow<'de, str>>::deserialize(deserializer)?;
    unpack(&text).ok_or_else(|| D::Error::custom("depths must be encoded as two base64 characters per value"))
}

fn pack(cm: &[u16]) -> String {
    let mut text = String::with_capacity(2 * cm.len());
    let six = |value: u16| char::from(ALPHABET[usize::from(value & 63)]);
    for &value in cm {
        if value >= 1 << 12 {
            text.push(char::from(LONG));
            text.push(six(value >> 12));
        }
        text.push(six(value >> 6));
        text.push(six(value));
    }
    text
}

/// `None` for a character outside the alphabet, an end within a value, or too many values.
fn unpack(text: &str) -> Option<Vec<u16>> {
    let six = |byte: Option<u8>| {
        let place = ALPHABET.iter().position(|&known| Some(known) == byte)?;
        u16::try_from(place).ok()
    };
    let mut bytes = text.bytes();
    let mut cm = Vec::with_capacity((text.len() / 2).min(MAX_DEPTHS));
    while let Some(first) = bytes.next() {
        if cm.len() == MAX_DEPTHS {
            return None;
        }
        let (high, middle) = if first == LONG {
            let high = six(bytes.next()).filter(|&high| high < 16)?;
            (high << 12, six(bytes.next())?)
        } else {
            (0, six(Some(first))?)
        };
        cm.push(high | middle << 6 | six(bytes.next())?);
    }
    Some(cm)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn by_hand() {
        assert_eq!(pack(&[0, 1, 64, 4095, 4096, 65535]), "AAABBA//=BAA=P//");
        for bad in ["A", "AA=", "A=A", "=QAA", "AÄ", "A ", "=B"] {
            assert_eq!(unpack(bad), None, "{bad}");
        }
        assert_eq!(unpack(&"AA".repeat(MAX_DEPTHS + 1)), None);
    }

    proptest! {
        #[test]
        fn what_is_packed_is_unpacked(cm in prop::collection::vec(any::<u16>(), 0..200)) {
            prop_assert_eq!(unpack(&pack(&cm)), Some(cm));
        }

        #[test]
        fn any_text_is_read_or_refused(text in ".{0,60}") {
            if let Some(cm) = unpack(&text) {
                prop_assert!(cm.len() <= text.len() / 2);
            }
        }
    }
}

//! Parameters: values, and the two ways in which integers travel in the float field of `PARAM_VALUE` and `PARAM_SET`.

use core::fmt;

/// How integers travel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ParameterEncoding {
    /// The bits of the integer (capability 16, PX4).
    Bytewise,
    /// The number, rounded to a float (capability 131072, ArduPilot).
    #[default]
    Cast,
}

impl ParameterEncoding {
    /// The encoding that `AUTOPILOT_VERSION.capabilities` declares; `None` if it declares neither.
    #[must_use]
    pub fn from_capabilities(capabilities: u64) -> Option<Self> {
        if capabilities & 16 != 0 { Some(Self::Bytewise) } else { (capabilities & 131_072 != 0).then_some(Self::Cast) }
    }
}

/// A parameter's value, with its type on the wire.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ParameterValue {
    /// An integer of 8 to 32 bits, with `MAV_PARAM_TYPE` 1 to 6.
    Integer(i64, u8),
    /// A number (`MAV_PARAM_TYPE_REAL32`, 9).
    Real(f32),
}

impl ParameterValue {
    /// An integer of type `INT32`.
    #[must_use]
    pub fn int(value: i32) -> Self {
        Self::Integer(value.into(), INT32)
    }

    /// The value in a message; `None` for a type that is not a 32-bit number, or a value that is none.
    #[must_use]
    pub fn decode(field: f32, kind: u8, encoding: ParameterEncoding) -> Option<Self> {
        if kind == REAL32 {
            return field.is_finite().then_some(Self::Real(field));
        }
        let bits = field.to_bits();
        let bounds = bounds(kind)?;
        let value = match encoding {
            ParameterEncoding::Bytewise => match kind {
                1 => i64::from(bits as u8),
                2 => i64::from(bits as u8 as i8),
                3 => i64::from(bits as u16),
                4 => i64::from(bits as u16 as i16),
                5 => i64::from(bits),
                _ => i64::from(bits as i32),
            },
            ParameterEncoding::Cast if !field.is_finite() => return None,
            ParameterEncoding::Cast => f64::from(field).round() as i64,
        };
        (bounds.0..=bounds.1).contains(&value).then_some(Self::Integer(value, kind))
    }

    /// The value as it travels: field and type.
    #[must_use]
    pub fn encode(self, encoding: ParameterEncoding) -> (f32, u8) {
        match (self, encoding) {
            (Self::Real(value), _) => (value, REAL32),
            (Self::Integer(value, kind), ParameterEncoding::Cast) => (value as f32, kind),
            (Self::Integer(value, kind), ParameterEncoding::Bytewise) => (f32::from_bits(value as u32), kind),
        }
    }

    /// The value as a number.
    #[must_use]
    pub fn number(self) -> f64 {
        match self {
            Self::Integer(value, _) => value as f64,
            Self::Real(value) => value.into(),
        }
    }
}

impl fmt::Display for ParameterValue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Integer(value, _) => write!(f, "{value}"),
            Self::Real(value) => write!(f, "{value}"),
        }
    }
}

/// `MAV_PARAM_TYPE_INT32`.
pub const INT32: u8 = 6;
/// `MAV_PARAM_TYPE_REAL32`.
pub const REAL32: u8 = 9;

/// Smallest and largest value of an integer type.
fn bounds(kind: u8) -> Option<(i64, i64)> {
    Some(match kind {
        1 => (0, u8::MAX.into()),
        2 => (i8::MIN.into(), i8::MAX.into()),
        3 => (0, u16::MAX.into()),
        4 => (i16::MIN.into(), i16::MAX.into()),
        5 => (0, u32::MAX.into()),
        6 => (i32::MIN.into(), i32::MAX.into()),
        _ => return None,
    })
}

/// A parameter's name as it travels: 16 bytes, with a zero at the end only if it is shorter.
#[must_use]
pub fn name_bytes(name: &str) -> [u8; 16] {
    let mut bytes = [0; 16];
    for (byte, c) in bytes.iter_mut().zip(name.bytes()) {
        *byte = c;
    }
    bytes
}

/// The name in those bytes; `None` if it is not printable ASCII.
#[must_use]
pub fn name_of(bytes: &[u8]) -> Option<&str> {
    let end = bytes.iter().position(|byte| *byte == 0).unwrap_or(bytes.len());
    let name = &bytes[..end];
    (!name.is_empty() && name.iter().all(u8::is_ascii_graphic)).then(|| core::str::from_utf8(name).ok()).flatten()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// As measured: PX4 sends 5 as the bits of an integer, which as a float is tiny; ArduPilot sends 5.0.
    #[test]
    fn the_two_encodings_of_five() {
        let five = ParameterValue::int(5);
        assert_eq!(five.encode(ParameterEncoding::Bytewise), (f32::from_bits(5), INT32));
        assert_eq!(five.encode(ParameterEncoding::Cast), (5.0, INT32));
        assert_eq!(ParameterEncoding::from_capabilities(2 | 16 | 64), Some(ParameterEncoding::Bytewise));
        assert_eq!(ParameterEncoding::from_capabilities(131_072), Some(ParameterEncoding::Cast));
        assert_eq!(ParameterEncoding::from_capabilities(2), None);
    }

    #[test]
    fn a_name_of_sixteen_bytes_has_no_zero() {
        assert_eq!(name_of(&name_bytes("ABCDEFGHIJKLMNOP")), Some("ABCDEFGHIJKLMNOP"));
        assert_eq!(name_of(&name_bytes("GF_ACTION")), Some("GF_ACTION"));
        assert_eq!((name_of(&[0; 16]), name_of(b"A\x07")), (None, None));
    }

    proptest! {
        #[test]
        fn what_is_encoded_is_decoded_the_same(value in any::<i32>(), kind in 1_u8..=6, real in -1e9_f32..1e9) {
            let (low, high) = bounds(kind).unwrap();
            let value = ParameterValue::Integer(i64::from(value).clamp(low, high), kind);
            let (field, kind) = value.encode(ParameterEncoding::Bytewise);
            prop_assert_eq!(ParameterValue::decode(field, kind, ParameterEncoding::Bytewise), Some(value));
            // Numbers up to 2^24 survive the cast.
            let small = ParameterValue::Integer((value.number() as i64).clamp(low.max(-0x100_0000), high.min(0x100_0000)), kind);
            let (field, kind) = small.encode(ParameterEncoding::Cast);
            prop_assert_eq!(ParameterValue::decode(field, kind, ParameterEncoding::Cast), Some(small));
            let (field, kind) = ParameterValue::Real(real).encode(ParameterEncoding::Cast);
            prop_assert_eq!(ParameterValue::decode(field, kind, ParameterEncoding::Bytewise), Some(ParameterValue::Real(real)));
        }

        #[test]
        fn no_field_panics(bits in any::<u32>(), kind in any::<u8>()) {
            for encoding in [ParameterEncoding::Bytewise, ParameterEncoding::Cast] {
                if let Some(value) = ParameterValue::decode(f32::from_bits(bits), kind, encoding) {
                    prop_assert!(value.number().is_finite());
                }
            }
        }
    }
}

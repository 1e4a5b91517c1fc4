//! What a program and the process of its network send to each other over pipes (`process.rs`, `worker.rs`).
//!
//! A message is its kind (one byte), its length (eight bytes, little endian) and that many bytes. The process receives one model,
//! then inputs, and sends one reply to each.

use std::io::{self, ErrorKind, Read, Write};

use crate::{Description, DetectError, Output};

/// Maximum length of a message to the process, bytes: a model.
pub(crate) const MAX_TO: u64 = crate::MAX_MODEL;
/// Maximum length of a message from the process, bytes: an output. YOLO's with masks at 1280 × 1280 pixels has 16 MB.
pub(crate) const MAX_FROM: u64 = 256 << 20;
/// Maximum number of classes and of dimensions.
const MAX_COUNT: u64 = 100_000;

/// A reply of the process.
#[derive(Debug)]
pub(crate) enum Reply {
    /// The model was loaded.
    Loaded(Description),
    /// It was run.
    Ran(Output),
    /// It could not be loaded or run.
    Failed(DetectError),
}

/// Writes a message.
pub(crate) fn send(to: &mut impl Write, kind: u8, payload: &[u8]) -> io::Result<()> {
    to.write_all(&[kind])?;
    to.write_all(&(payload.len() as u64).to_le_bytes())?;
    to.write_all(payload)?;
    to.flush()
}

/// Reads a message of at most `most` bytes; `None` at the end.
pub(crate) fn receive(from: &mut impl Read, most: u64) -> io::Result<Option<(u8, Vec<u8>)>> {
    let mut kind = [0; 1];
    match from.read_exact(&mut kind) {
        Err(error) if error.kind() == ErrorKind::UnexpectedEof => return Ok(None),
        other => other?,
    }
    let mut length = [0; 8];
    from.read_exact(&mut length)?;
    let length = u64::from_le_bytes(length);
    if length > most {
        return Err(io::Error::new(ErrorKind::FileTooLarge, format!("a message of {length} bytes")));
    }
    // Memory grows with what arrives, not with what was announced.
    let mut payload = Vec::new();
    from.by_ref().take(length).read_to_end(&mut payload)?;
    if payload.len() as u64 == length { Ok(Some((kind[0], payload))) } else { Err(ErrorKind::UnexpectedEof.into()) }
}

/// An input, as bytes.
pub(crate) fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

/// Bytes as an input; a rest of fewer than four is dropped.
pub(crate) fn to_floats(bytes: &[u8]) -> Vec<f32> {
    bytes.chunks_exact(4).map(|four| f32::from_le_bytes([four[0], four[1], four[2], four[3]])).collect()
}

impl Reply {
    /// Its kind and bytes.
    pub(crate) fn encode(&self) -> (u8, Vec<u8>) {
        let mut bytes = Vec::new();
        let number = |bytes: &mut Vec<u8>, value: usize| bytes.extend((value as u64).to_le_bytes());
        let text = |bytes: &mut Vec<u8>, text: &str| {
            number(bytes, text.len());
            bytes.extend(text.as_bytes());
        };
        let kind = match self {
            Self::Loaded(Description { input, names, end_to_end }) => {
                number(&mut bytes, input.0);
                number(&mut bytes, input.1);
                bytes.push(end_to_end.map_or(2, u8::from));
                bytes.push(u8::from(names.is_some()));
                let names = names.as_deref().unwrap_or_default();
                number(&mut bytes, names.len());
                for name in names {
                    text(&mut bytes, name);
                }
                b'l'
            }
            Self::Ran(Output { shape, values, masks }) => {
                bytes.push(u8::from(*masks));
                number(&mut bytes, shape.len());
                for side in shape {
                    number(&mut bytes, *side);
                }
                bytes.extend(floats(values));
                b'r'
            }
            Self::Failed(error) => {
                let (kind, words) = match error {
                    DetectError::Load(words) => (b'L', words.clone()),
                    DetectError::Unfit(words) => (b'U', words.clone()),
                    other => (b'R', other.to_string()),
                };
                bytes.extend(words.as_bytes());
                kind
            }
        };
        (kind, bytes)
    }

    /// Reads it; `None` if it is no reply.
    pub(crate) fn decode(kind: u8, bytes: &[u8]) -> Option<Self> {
        let mut rest = bytes;
        let words = || String::from_utf8_lossy(bytes).into_owned();
        Some(match kind {
            b'l' => {
                let input = (number(&mut rest)?, number(&mut rest)?);
                let end_to_end = match byte(&mut rest)? {
                    2 => None,
                    other => Some(other == 1),
                };
                let named = byte(&mut rest)? == 1;
                let names = (0..count(&mut rest)?).map(|_| text(&mut rest)).collect::<Option<Vec<_>>>()?;
                Self::Loaded(Description { input, names: named.then_some(names), end_to_end })
            }
            b'r' => {
                let masks = byte(&mut rest)? == 1;
                let shape = (0..count(&mut rest)?).map(|_| number(&mut rest)).collect::<Option<Vec<_>>>()?;
                let values = to_floats(rest);
                let size = shape.iter().try_fold(1_usize, |size, side| size.checked_mul(*side))?;
                (size == values.len()).then_some(Self::Ran(Output { shape, values, masks }))?
            }
            b'L' => Self::Failed(DetectError::Load(words())),
            b'U' => Self::Failed(DetectError::Unfit(words())),
            b'R' => Self::Failed(DetectError::Run(words())),
            _ => return None,
        })
    }
}

fn byte(rest: &mut &[u8]) -> Option<u8> {
    rest.split_off_first().copied()
}

fn number(rest: &mut &[u8]) -> Option<usize> {
    let eight = rest.split_off(..8)?;
    usize::try_from(u64::from_le_bytes(eight.try_into().ok()?)).ok()
}

fn count(rest: &mut &[u8]) -> Option<usize> {
    number(rest).filter(|count| *count as u64 <= MAX_COUNT)
}

fn text(rest: &mut &[u8]) -> Option<String> {
    let length = number(rest)?;
    Some(String::from_utf8_lossy(rest.split_off(..length)?).into_owned())
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn what_is_sent_is_what_arrives() {
        let loaded = Description { input: (64, 32), names: Some(vec!["ä".to_owned(), String::new()]), end_to_end: None };
        let ran = Output { shape: vec![1, 2, 3], values: vec![0.5; 6], masks: true };
        let mut pipe = Vec::new();
        for reply in [
            Reply::Loaded(loaded.clone()),
            Reply::Ran(Output { shape: ran.shape.clone(), values: ran.values.clone(), masks: true }),
            Reply::Failed(DetectError::Unfit("a".to_owned())),
        ] {
            let (kind, bytes) = reply.encode();
            send(&mut pipe, kind, &bytes).unwrap();
        }
        let mut pipe = &pipe[..];
        let mut next = || receive(&mut pipe, MAX_FROM).unwrap().map(|(kind, bytes)| Reply::decode(kind, &bytes).unwrap());
        assert!(matches!(next(), Some(Reply::Loaded(description)) if description == loaded));
        assert!(matches!(next(), Some(Reply::Ran(output)) if output.shape == ran.shape && output.values == ran.values));
        assert!(matches!(next(), Some(Reply::Failed(DetectError::Unfit(words))) if words == "a"));
        assert!(next().is_none());
        assert!(receive(&mut &[b'r', 255, 255, 255, 255, 0, 0, 0, 0][..], 1000).is_err(), "too long");
        assert!(receive(&mut &[b'r', 9, 0, 0, 0, 0, 0, 0, 0, 1][..], 1000).is_err(), "cut off");
    }

    proptest! {
        #[test]
        fn any_bytes_are_a_reply_or_none(kind: u8, bytes: Vec<u8>) {
            drop(Reply::decode(kind, &bytes));
            drop(receive(&mut &bytes[..], 1000));
        }
    }
}

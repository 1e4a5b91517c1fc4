//! What a program and the process of its network send to each other over pipes (`process.rs`, `worker.rs`).
//!
//! A message is its kind (one byte), its length (eight bytes, little endian) and that many bytes. The process receives one model,
//! then inputs, and sends one reply to each.

use std::io::{self, ErrorKind, Read, Write};

use crate::bounds::MAX_MODEL;
use crate::error::NetworkError;
use crate::exchange::{Description, Input, Outlet, Output};

/// Maximum length of a message to the process, bytes: a model.
pub(crate) const MAX_TO: u64 = MAX_MODEL;
/// Maximum length of a message from the process, bytes: an output. YOLO's with masks at 1280 × 1280 pixels has 16 MB.
pub(crate) const MAX_FROM: u64 = 256 << 20;
/// Maximum number of outputs, of entries of metadata and of dimensions.
const MAX_COUNT: u64 = 100_000;

/// A reply of the process.
#[derive(Debug)]
pub(crate) enum Reply {
    /// The model was loaded.
    Loaded(Description),
    /// It was run.
    Ran(Output),
    /// It could not be loaded or run.
    Failed(NetworkError),
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

/// Numbers as bytes.
fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

/// An input, as bytes.
pub(crate) fn input(input: Input<'_>) -> Vec<u8> {
    let numbers = [input.size.0, input.size.1, input.output];
    let mut bytes: Vec<u8> = numbers.iter().flat_map(|number| (*number as u64).to_le_bytes()).collect();
    bytes.extend(floats(input.values));
    bytes
}

/// Bytes as an input, whose numbers go into `values`; `None` if they are none.
pub(crate) fn to_input<'a>(mut bytes: &[u8], values: &'a mut Vec<f32>) -> Option<Input<'a>> {
    let rest = &mut bytes;
    let (width, height, output) = (number(rest)?, number(rest)?, number(rest)?);
    *values = to_floats(rest);
    Some(Input { size: (width, height), values, output }).filter(Input::is_whole)
}

/// Bytes as numbers; a rest of fewer than four is dropped.
fn to_floats(bytes: &[u8]) -> Vec<f32> {
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
            Self::Loaded(Description { input, outputs, metadata }) => {
                // 0 stands for any: no side is that long.
                let side = |bytes: &mut Vec<u8>, side: &Option<usize>| number(bytes, side.unwrap_or(0));
                side(&mut bytes, &input.0);
                side(&mut bytes, &input.1);
                number(&mut bytes, outputs.len());
                for Outlet { name, shape } in outputs {
                    text(&mut bytes, name);
                    number(&mut bytes, shape.len());
                    shape.iter().for_each(|length| side(&mut bytes, length));
                }
                number(&mut bytes, metadata.len());
                for (key, value) in metadata {
                    text(&mut bytes, key);
                    text(&mut bytes, value);
                }
                b'l'
            }
            Self::Ran(Output { shape, values }) => {
                number(&mut bytes, shape.len());
                for side in shape {
                    number(&mut bytes, *side);
                }
                bytes.extend(floats(values));
                b'r'
            }
            Self::Failed(error) => {
                let (kind, words) = match error {
                    NetworkError::Load(words) => (b'L', words.clone()),
                    NetworkError::Unfit(words) => (b'U', words.clone()),
                    NetworkError::Run(words) => (b'R', words.clone()),
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
                let rest = &mut rest;
                let side = |rest: &mut &[u8]| number(rest).map(|side| Some(side).filter(|side| *side > 0));
                let input = (side(rest)?, side(rest)?);
                let outlet = |rest: &mut &[u8]| {
                    let name = text(rest)?;
                    let shape = (0..count(rest)?).map(|_| side(rest)).collect::<Option<Vec<_>>>()?;
                    Some(Outlet { name, shape })
                };
                let outputs = (0..count(rest)?).map(|_| outlet(rest)).collect::<Option<Vec<_>>>()?;
                let entry = |rest: &mut &[u8]| Some((text(rest)?, text(rest)?));
                let metadata = (0..count(rest)?).map(|_| entry(rest)).collect::<Option<Vec<_>>>()?;
                Self::Loaded(Description { input, outputs, metadata })
            }
            b'r' => {
                let shape = (0..count(&mut rest)?).map(|_| number(&mut rest)).collect::<Option<Vec<_>>>()?;
                let values = to_floats(rest);
                let size = shape.iter().try_fold(1_usize, |size, side| size.checked_mul(*side))?;
                (size == values.len()).then_some(Self::Ran(Output { shape, values }))?
            }
            b'L' => Self::Failed(NetworkError::Load(words())),
            b'U' => Self::Failed(NetworkError::Unfit(words())),
            b'R' => Self::Failed(NetworkError::Run(words())),
            _ => return None,
        })
    }
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
        let loaded = Description {
            input: (Some(64), None),
            outputs: vec![Outlet { name: "ä".to_owned(), shape: vec![Some(1), None] }],
            metadata: vec![("names".to_owned(), String::new())],
        };
        let ran = Output { shape: vec![1, 2, 3], values: vec![0.5; 6] };
        let mut pipe = Vec::new();
        for reply in [
            Reply::Loaded(loaded.clone()),
            Reply::Ran(Output { shape: ran.shape.clone(), values: ran.values.clone() }),
            Reply::Failed(NetworkError::Unfit("a".to_owned())),
        ] {
            let (kind, bytes) = reply.encode();
            send(&mut pipe, kind, &bytes).unwrap();
        }
        let mut pipe = &pipe[..];
        let mut next = || receive(&mut pipe, MAX_FROM).unwrap().map(|(kind, bytes)| Reply::decode(kind, &bytes).unwrap());
        assert!(matches!(next(), Some(Reply::Loaded(description)) if description == loaded));
        assert!(matches!(next(), Some(Reply::Ran(output)) if output.shape == ran.shape && output.values == ran.values));
        assert!(matches!(next(), Some(Reply::Failed(NetworkError::Unfit(words))) if words == "a"));
        assert!(next().is_none());
        assert!(receive(&mut &[b'r', 255, 255, 255, 255, 0, 0, 0, 0][..], 1000).is_err(), "too long");
        assert!(receive(&mut &[b'r', 9, 0, 0, 0, 0, 0, 0, 0, 1][..], 1000).is_err(), "cut off");
    }

    #[test]
    fn an_input_that_is_sent_is_the_one_that_arrives() {
        let values = [0.5; 3 * 4 * 2];
        let bytes = input(Input { size: (4, 2), values: &values, output: 1 });
        let mut arrived = Vec::new();
        let input = to_input(&bytes, &mut arrived).unwrap();
        assert_eq!((input.size, input.values, input.output), ((4, 2), &values[..], 1));
        assert!(to_input(&bytes[..bytes.len() - 4], &mut Vec::new()).is_none(), "cut off");
    }

    proptest! {
        #[test]
        fn any_bytes_are_a_reply_or_none(kind: u8, bytes: Vec<u8>) {
            let _size = to_input(&bytes, &mut Vec::new()).map(|input| input.size);
            drop(Reply::decode(kind, &bytes));
            drop(receive(&mut &bytes[..], 1000));
        }
    }
}

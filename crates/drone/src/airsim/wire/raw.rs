//! One MessagePack object that is complete, but not read yet.

use rmp::Marker;
use serde::{Deserialize, Serialize};

use super::scan::{Limits, Scan};

/// How structs are written. Both are read everywhere.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Encoding {
    /// As maps with the names of their fields: AirSim 1.8.1 and its forks.
    #[default]
    Map,
    /// As arrays of their fields: Colosseum since July 2024.
    Array,
}

/// One MessagePack object.
#[derive(Clone, PartialEq, Eq)]
pub struct Raw(Vec<u8>);

/// An object is not what was asked for: the expected and the found type.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct ReadError(String);

impl Raw {
    /// Writes a value: text as `str`, bytes (`serde_bytes`) as `bin`, numbers as they are.
    ///
    /// # Panics
    /// If the value cannot be serialised at all, such as a sequence of unknown length. The types of
    /// [`structs`](super::structs), numbers, texts, and vectors of them can.
    #[must_use]
    pub fn of<T: Serialize + ?Sized>(value: &T, encoding: Encoding) -> Self {
        let mut bytes = Vec::new();
        let written = match encoding {
            Encoding::Map => value.serialize(&mut rmp_serde::Serializer::new(&mut bytes).with_struct_map()),
            Encoding::Array => value.serialize(&mut rmp_serde::Serializer::new(&mut bytes)),
        };
        written.expect("what is written has a known length, and memory takes it");
        Self(bytes)
    }

    /// An array of these objects.
    ///
    /// # Panics
    /// If there are 2³² or more.
    #[must_use]
    pub fn list(items: &[Self]) -> Self {
        let mut bytes = Vec::new();
        let count = u32::try_from(items.len()).expect("memory holds fewer");
        rmp::encode::write_array_len(&mut bytes, count).expect("memory takes it");
        items.iter().for_each(|item| bytes.extend_from_slice(&item.0));
        Self(bytes)
    }

    /// Nothing.
    #[must_use]
    pub fn nil() -> Self {
        Self(vec![0xc0])
    }

    pub(super) fn from_scanned(bytes: &[u8]) -> Self {
        Self(bytes.to_vec())
    }

    /// As it is sent.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        &self.0
    }

    fn marker(&self) -> Marker {
        Marker::from_u8(self.0.first().copied().unwrap_or(0xc0))
    }

    /// Whether it is nothing.
    #[must_use]
    pub fn is_nil(&self) -> bool {
        self.marker() == Marker::Null
    }

    /// How a struct that is this object was written; `None` if it is none.
    #[must_use]
    pub fn encoding(&self) -> Option<Encoding> {
        match self.marker() {
            Marker::FixMap(_) | Marker::Map16 | Marker::Map32 => Some(Encoding::Map),
            Marker::FixArray(_) | Marker::Array16 | Marker::Array32 => Some(Encoding::Array),
            _ => None,
        }
    }

    /// The objects of an array; `None` if it is none.
    #[must_use]
    pub fn items(&self) -> Option<Vec<Self>> {
        if self.encoding() != Some(Encoding::Array) {
            return None;
        }
        // Its length has been checked when it arrived.
        let unlimited = Limits { bytes: usize::MAX, objects: usize::MAX, depth: usize::MAX };
        let whole = Scan::new(unlimited).walk(&self.0).ok()??;
        let head = match self.marker() {
            Marker::Array16 => 3,
            Marker::Array32 => 5,
            _ => 1,
        };
        let starts = core::iter::once(head).chain(whole.ends.iter().copied());
        Some(starts.zip(&whole.ends).map(|(from, to)| Self(self.0[from..*to].to_vec())).collect())
    }

    /// Reads a value. Structs may be maps or arrays, and floats may be integers; unknown keys of maps are ignored.
    ///
    /// # Errors
    /// [`ReadError`] if it is something else.
    pub fn read<'a, T: Deserialize<'a>>(&'a self) -> Result<T, ReadError> {
        rmp_serde::from_slice(&self.0).map_err(|error| match error {
            rmp_serde::decode::Error::TypeMismatch(found) => ReadError(format!("{} was not expected here", kind(found))),
            other => ReadError(other.to_string()),
        })
    }

    /// Its text: of an error, say. What is no text, as far as it fits into a line.
    #[must_use]
    pub fn text(&self) -> String {
        self.read::<String>().unwrap_or_else(|_| format!("{self:?}"))
    }
}

/// What an object with this marker is, in words.
fn kind(marker: Marker) -> &'static str {
    match marker {
        Marker::Null => "nil",
        Marker::True | Marker::False => "a boolean",
        Marker::FixStr(_) | Marker::Str8 | Marker::Str16 | Marker::Str32 => "a text",
        Marker::Bin8 | Marker::Bin16 | Marker::Bin32 => "bytes",
        Marker::FixArray(_) | Marker::Array16 | Marker::Array32 => "an array",
        Marker::FixMap(_) | Marker::Map16 | Marker::Map32 => "a map",
        Marker::F32 | Marker::F64 => "a float",
        Marker::FixPos(_) | Marker::FixNeg(_) => "an integer",
        Marker::U8 | Marker::U16 | Marker::U32 | Marker::U64 => "an integer",
        Marker::I8 | Marker::I16 | Marker::I32 | Marker::I64 => "an integer",
        _ => "an extension of MessagePack",
    }
}

impl core::fmt::Debug for Raw {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        const SHOWN: usize = 64;
        let shown: String = self.0.iter().take(SHOWN).map(|byte| format!("{byte:02x}")).collect();
        write!(f, "Raw({shown}{})", if self.0.len() > SHOWN { "…" } else { "" })
    }
}

//! Finding the end of a MessagePack object in a stream, without building anything.

use rmp::Marker;

/// What a peer may send in one message. A stream that goes beyond is closed: what follows in it cannot be found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Bytes.
    pub bytes: usize,
    /// Objects, those inside of others counted.
    pub objects: usize,
    /// How deep they lie in one another.
    pub depth: usize,
}

impl Limits {
    /// What a server reads: no request of AirSim's clients is near it, a path of 10,000 points included.
    pub const REQUESTS: Self = Self { bytes: 1 << 20, objects: 1 << 16, depth: 16 };
    /// What a client reads: five pictures of 1920 × 1080 pixels, raw and as floats.
    pub const RESPONSES: Self = Self { bytes: 128 << 20, objects: 12 << 20, depth: 16 };
}

/// Why a stream cannot be read on. The connection is to be closed: where the next message starts is not known.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum FrameError {
    /// It is longer than allowed.
    #[error("a message is longer than {limit} bytes")]
    TooLong {
        /// Bytes.
        limit: usize,
    },
    /// It has more objects than allowed.
    #[error("a message has more than {limit} objects")]
    TooMany {
        /// Objects.
        limit: usize,
    },
    /// It is nested deeper than allowed.
    #[error("a message is nested deeper than {limit} levels")]
    TooDeep {
        /// Levels.
        limit: usize,
    },
    /// A byte that MessagePack does not use.
    #[error("0xc1 is not MessagePack: the peer speaks another protocol")]
    Reserved,
    /// MessagePack, but not msgpack-rpc.
    #[error("not a message of msgpack-rpc ({0}): the peer speaks another protocol")]
    NotAMessage(&'static str),
}

/// A walk over one object, which goes on where the bytes ended.
#[derive(Clone, Debug)]
pub(super) struct Scan {
    limits: Limits,
    /// Bytes walked over.
    at: usize,
    /// Bytes that belong to the last object and are still to come.
    skip: usize,
    /// For every array or map that is open, how many objects it still has.
    open: Vec<usize>,
    objects: usize,
    /// Ends of the objects directly inside of the outermost one.
    ends: Vec<usize>,
    begun: bool,
}

/// A complete object.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Whole {
    /// Its length, bytes.
    pub(super) length: usize,
    /// Where the objects directly inside of it end, bytes from its start.
    pub(super) ends: Vec<usize>,
}

impl Scan {
    pub(super) fn new(limits: Limits) -> Self {
        Self { limits, at: 0, skip: 0, open: Vec::new(), objects: 0, ends: Vec::new(), begun: false }
    }

    /// Walks on over `bytes`, which start where the object starts. `None`: more are needed.
    ///
    /// # Errors
    /// [`FrameError`] if the object goes beyond the limits, or is none.
    pub(super) fn walk(&mut self, bytes: &[u8]) -> Result<Option<Whole>, FrameError> {
        loop {
            if self.at.saturating_add(self.skip) > self.limits.bytes {
                return Err(FrameError::TooLong { limit: self.limits.bytes });
            }
            let here = self.skip.min(bytes.len().saturating_sub(self.at));
            (self.at, self.skip) = (self.at + here, self.skip - here);
            if self.skip > 0 {
                return Ok(None);
            }
            if self.begun && self.close() {
                return Ok(Some(Whole { length: self.at, ends: core::mem::take(&mut self.ends) }));
            }
            let Some(&first) = bytes.get(self.at) else { return Ok(None) };
            let Some(head) = head(Marker::from_u8(first), &bytes[self.at + 1..])? else { return Ok(None) };
            self.objects += 1;
            let ahead = head.inside.saturating_add(self.open.iter().fold(0, |sum: usize, left| sum.saturating_add(*left)));
            if self.objects.saturating_add(ahead) > self.limits.objects.saturating_add(1) {
                return Err(FrameError::TooMany { limit: self.limits.objects });
            }
            self.begun = true;
            self.at += 1 + head.bytes;
            self.skip = head.payload;
            if let Some(left) = self.open.last_mut() {
                *left -= 1;
            }
            if head.container {
                if self.open.len() >= self.limits.depth {
                    return Err(FrameError::TooDeep { limit: self.limits.depth });
                }
                self.open.push(head.inside);
            } else if self.open.len() == 1 {
                self.ends.push(self.at + self.skip);
            }
        }
    }

    /// Closes what has nothing left; whether the outermost object is complete.
    fn close(&mut self) -> bool {
        while self.open.last() == Some(&0) {
            self.open.pop();
            if self.open.len() == 1 {
                self.ends.push(self.at);
            }
        }
        self.open.is_empty()
    }
}

/// The head of an object.
struct Head {
    /// Bytes of its length, after the marker.
    bytes: usize,
    /// Bytes of its content.
    payload: usize,
    /// Objects in it: of a map, keys and values.
    inside: usize,
    container: bool,
}

/// Reads a head; `None` if its length has not all arrived.
fn head(marker: Marker, after: &[u8]) -> Result<Option<Head>, FrameError> {
    let scalar = |payload| Some(Head { bytes: 0, payload, inside: 0, container: false });
    // A length of so many bytes, and what the content has besides it.
    let sized = |bytes: usize, more: usize| {
        let length = number(after, bytes)?;
        Some(Head { bytes, payload: length.saturating_add(more), inside: 0, container: false })
    };
    let list = |bytes: usize, each: usize| {
        let count = number(after, bytes)?;
        Some(Head { bytes, payload: 0, inside: count.saturating_mul(each), container: true })
    };
    let fixed = |count: usize| Some(Head { bytes: 0, payload: 0, inside: count, container: true });
    Ok(match marker {
        Marker::FixPos(_) | Marker::FixNeg(_) | Marker::Null | Marker::True | Marker::False => scalar(0),
        Marker::U8 | Marker::I8 => scalar(1),
        Marker::U16 | Marker::I16 => scalar(2),
        Marker::U32 | Marker::I32 | Marker::F32 => scalar(4),
        Marker::U64 | Marker::I64 | Marker::F64 => scalar(8),
        Marker::FixStr(length) => scalar(usize::from(length)),
        Marker::Str8 | Marker::Bin8 => sized(1, 0),
        Marker::Str16 | Marker::Bin16 => sized(2, 0),
        Marker::Str32 | Marker::Bin32 => sized(4, 0),
        Marker::FixExt1 => scalar(2),
        Marker::FixExt2 => scalar(3),
        Marker::FixExt4 => scalar(5),
        Marker::FixExt8 => scalar(9),
        Marker::FixExt16 => scalar(17),
        Marker::Ext8 => sized(1, 1),
        Marker::Ext16 => sized(2, 1),
        Marker::Ext32 => sized(4, 1),
        Marker::FixArray(count) => fixed(usize::from(count)),
        Marker::Array16 => list(2, 1),
        Marker::Array32 => list(4, 1),
        Marker::FixMap(count) => fixed(2 * usize::from(count)),
        Marker::Map16 => list(2, 2),
        Marker::Map32 => list(4, 2),
        Marker::Reserved => return Err(FrameError::Reserved),
    })
}

/// A big-endian number of so many bytes.
fn number(bytes: &[u8], length: usize) -> Option<usize> {
    Some(bytes.get(..length)?.iter().fold(0, |sum, byte| sum << 8 | usize::from(*byte)))
}

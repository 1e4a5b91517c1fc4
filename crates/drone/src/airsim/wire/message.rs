//! Messages of msgpack-rpc: a request is `[0, id, method, params]`, a response `[1, id, error, result]`, a notification
//! `[2, method, params]`.

use serde::{Deserialize, Serialize};

use super::raw::{Encoding, Raw};
use super::scan::{FrameError, Limits, Scan};

/// A message.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Message {
    /// A call that is to be answered. Responses may come in any order.
    Request {
        /// Chosen by the client.
        id: u32,
        /// Its name.
        method: String,
        /// Its arguments.
        params: Vec<Raw>,
    },
    /// The answer to the request of this id.
    Response {
        /// Id of the request.
        id: u32,
        /// The result, or the error: mostly a text ([`Raw::text`]).
        outcome: Result<Raw, Raw>,
    },
    /// A call that is not answered.
    Notification {
        /// Its name.
        method: String,
        /// Its arguments.
        params: Vec<Raw>,
    },
}

impl Message {
    /// The message as bytes. Structs in it stay as they were written ([`Raw::of`]).
    #[must_use]
    pub fn encode(&self) -> Vec<u8> {
        let mut bytes = Vec::new();
        match self {
            Self::Request { id, method, params } => {
                bytes.push(0x94);
                put(&mut bytes, &0u8);
                put(&mut bytes, id);
                put(&mut bytes, method);
                bytes.extend_from_slice(Raw::list(params).bytes());
            }
            Self::Response { id, outcome } => {
                bytes.push(0x94);
                put(&mut bytes, &1u8);
                put(&mut bytes, id);
                let nil = Raw::nil();
                let (error, result) = match outcome {
                    Ok(result) => (&nil, result),
                    Err(error) => (error, &nil),
                };
                bytes.extend_from_slice(error.bytes());
                bytes.extend_from_slice(result.bytes());
            }
            Self::Notification { method, params } => {
                bytes.push(0x93);
                put(&mut bytes, &2u8);
                put(&mut bytes, method);
                bytes.extend_from_slice(Raw::list(params).bytes());
            }
        }
        bytes
    }

    /// A request.
    #[must_use]
    pub fn request(id: u32, method: &str, params: Vec<Raw>) -> Self {
        Self::Request { id, method: method.to_owned(), params }
    }

    /// The response with this error text.
    #[must_use]
    pub fn failure(id: u32, text: &str) -> Self {
        Self::Response { id, outcome: Err(Raw::of(&text, Encoding::Map)) }
    }

    fn parse(items: &[Raw]) -> Result<Self, FrameError> {
        let kind = items.first().and_then(|raw| raw.read::<u8>().ok());
        match (kind, items) {
            (Some(0), [_, id, method, params]) => {
                Ok(Self::Request { id: read(id, "its id")?, method: read(method, "its method")?, params: list(params)? })
            }
            (Some(1), [_, id, error, result]) => {
                let outcome = if error.is_nil() { Ok(result.clone()) } else { Err(error.clone()) };
                Ok(Self::Response { id: read(id, "its id")?, outcome })
            }
            (Some(2), [_, method, params]) => {
                Ok(Self::Notification { method: read(method, "its method")?, params: list(params)? })
            }
            (Some(0..=2), _) => Err(FrameError::NotAMessage("its length")),
            _ => Err(FrameError::NotAMessage("its type is not 0, 1 or 2")),
        }
    }
}

fn put<T: Serialize + ?Sized>(bytes: &mut Vec<u8>, value: &T) {
    bytes.extend_from_slice(Raw::of(value, Encoding::Map).bytes());
}

fn read<'a, T: Deserialize<'a>>(raw: &'a Raw, what: &'static str) -> Result<T, FrameError> {
    raw.read().map_err(|_| FrameError::NotAMessage(what))
}

fn list(raw: &Raw) -> Result<Vec<Raw>, FrameError> {
    raw.items().ok_or(FrameError::NotAMessage("its parameters are no array"))
}

/// Cuts a stream into messages.
#[derive(Debug)]
pub struct Decoder {
    limits: Limits,
    bytes: Vec<u8>,
    scan: Scan,
    broken: Option<FrameError>,
}

impl Decoder {
    /// A decoder at the start of a stream.
    #[must_use]
    pub fn new(limits: Limits) -> Self {
        Self { limits, bytes: Vec::new(), scan: Scan::new(limits), broken: None }
    }

    /// Adds received bytes. What lies here is at most one message and what was pushed since the last
    /// [`next_message`](Self::next_message) that returned `None`.
    pub fn push(&mut self, bytes: &[u8]) {
        if self.broken.is_none() {
            self.bytes.extend_from_slice(bytes);
        }
    }

    /// The next message, `None` until more bytes are pushed.
    ///
    /// # Errors
    /// [`FrameError`] if the stream cannot be read on; then every call returns it.
    pub fn next_message(&mut self) -> Result<Option<Message>, FrameError> {
        if let Some(broken) = &self.broken {
            return Err(broken.clone());
        }
        let next = self.cut();
        if let Err(error) = &next {
            (self.broken, self.bytes) = (Some(error.clone()), Vec::new());
        }
        next
    }

    fn cut(&mut self) -> Result<Option<Message>, FrameError> {
        // What is no array is no message: of a picture's bytes, say, nothing needs to be awaited.
        if self.bytes.first().is_some_and(|first| !matches!(first, 0x93 | 0x94)) {
            return Err(FrameError::NotAMessage("it is no array of three or four"));
        }
        let Some(whole) = self.scan.walk(&self.bytes)? else { return Ok(None) };
        let rest = self.bytes.split_off(whole.length);
        let bytes = core::mem::replace(&mut self.bytes, rest);
        self.scan = Scan::new(self.limits);
        let starts = core::iter::once(1).chain(whole.ends.iter().copied());
        let items = starts.zip(&whole.ends).map(|(from, to)| Raw::from_scanned(&bytes[from..*to]));
        Message::parse(&items.collect::<Vec<_>>()).map(Some)
    }
}

//! The flight log: `flight.mcap`, every input and output of a flight in one [MCAP](https://mcap.dev) file
//! (docs/reference/flight-log.md).
//!
//! A [`Log`] writes in a thread of its own, so that no setpoint waits for a disk. Messages reach the disk in chunks, each written
//! whole and closed at least twice a second of wall time: whatever ends the process, the log opens up to there.
//!
//! This module knows files and messages; what is told of a flight, and on which topics, is `spf-flight`'s.

pub mod export;
pub mod foxglove;
mod queue;
mod reader;
mod repair;
mod video;
mod writer;

pub use queue::{Log, LogFacts, LogSender};
pub use reader::{Entry, LogHead, LogReader, ReadError};
pub use repair::{RepairError, Repaired, Rewrite, repair, rewrite};
pub use video::{LogVideoError, video};
pub use writer::LogError;

use std::borrow::Cow;

use bytes::Bytes;
use schemars::JsonSchema;
use spf_core::time::Time;

/// Version of the log's topics and their messages. A reader refuses a later one.
pub const FORMAT: u32 = 1;

/// Name of the record that says that a file is a flight log, with `format` and `started_at_ns` (wall clock, Unix nanoseconds).
const HEAD: &str = "spf";
const FORMAT_KEY: &str = "format";
const STARTED_KEY: &str = "started_at_ns";

/// A topic: its name, and the form of its messages.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Topic {
    /// Its name, such as `/camera/image`.
    pub name: &'static str,
    /// How messages are encoded: `protobuf` or `json`.
    pub encoding: &'static str,
    /// What the form is called; Foxglove's names are known to its tools.
    pub schema: Cow<'static, str>,
    /// How the schema is written: `protobuf` or `jsonschema`.
    pub schema_encoding: &'static str,
    /// The schema.
    pub definition: Cow<'static, [u8]>,
}

impl Topic {
    /// A topic of one of Foxglove's own message types.
    #[must_use]
    pub fn of_foxglove<M: ::foxglove::Encode>(name: &'static str) -> Self {
        // Every message type of that crate has a schema; the fallback is MCAP's way to say that there is none.
        let schema = M::get_schema().unwrap_or_else(|| ::foxglove::Schema::new("", "", &b""[..]));
        Self { name, encoding: "protobuf", schema: schema.name.into(), schema_encoding: "protobuf", definition: schema.data }
    }

    /// A topic of JSON objects, described by a schema called `schema`.
    #[must_use]
    pub fn of_json<T: JsonSchema>(name: &'static str, schema: &'static str) -> Self {
        let definition = serde_json::to_vec(&schemars::schema_for!(T)).unwrap_or_default();
        Self { name, encoding: "json", schema: schema.into(), schema_encoding: "jsonschema", definition: definition.into() }
    }
}

/// A message on its way to the log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Message {
    /// Which topic: its place in the list the log was opened with.
    pub topic: usize,
    /// Flight time.
    pub time: Time,
    /// The encoded message.
    pub data: Bytes,
}

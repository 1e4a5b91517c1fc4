//! The flight log: `flight.mcap`, every input and output of a flight in one [MCAP](https://mcap.dev) file
//! (docs/reference/flight-log.md).
//!
//! A [`Log`] writes in its own thread, so that setpoints never wait for a disk. Messages are written in complete
//! chunks, at least two per second of wall time, so the log is readable up to the last chunk however the process ends.
//!
//! This module handles files and messages in general; the contents and topics of a flight's log are defined in
//! `spf-flight`.

pub mod export;
pub mod foxglove;
mod queue;
mod reader;
mod repair;
mod strings;
mod video;
mod whole;
mod writer;

pub use queue::{Log, LogFacts, LogSender};
pub use reader::{Entry, LogHead, LogReader, ReadError};
pub use repair::{RepairError, Repaired, Rewrite, repair, rewrite};
pub use video::{LogVideoError, video};
pub use whole::WholeLog;
pub use writer::LogError;

use std::borrow::Cow;

use bytes::Bytes;
use schemars::JsonSchema;
use spf_core::time::Time;

/// Version of the log's topics and messages. Readers reject later versions.
pub const FORMAT: u32 = 3;

/// Name of the metadata record that marks a file as a flight log, with `format` and `started_at_ns` (wall clock, Unix
/// nanoseconds; absent from a log made to be shared).
const HEAD: &str = "spf";
const FORMAT_KEY: &str = "format";
const STARTED_KEY: &str = "started_at_ns";

/// A topic: its name and the format of its messages.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Topic {
    /// Its name, such as `/camera/image`.
    pub name: &'static str,
    /// Message encoding: `protobuf` or `json`.
    pub encoding: &'static str,
    /// Name of the schema; Foxglove's names are known to its tools.
    pub schema: Cow<'static, str>,
    /// Schema encoding: `protobuf` or `jsonschema`.
    pub schema_encoding: &'static str,
    /// The schema.
    pub definition: Cow<'static, [u8]>,
}

impl Topic {
    /// A topic with one of Foxglove's message types.
    #[must_use]
    pub fn of_foxglove<M: ::foxglove::Encode>(name: &'static str) -> Self {
        // Every message type of that crate has a schema; the fallback is MCAP's representation of none.
        let schema = M::get_schema().unwrap_or_else(|| ::foxglove::Schema::new("", "", &b""[..]));
        Self { name, encoding: "protobuf", schema: schema.name.into(), schema_encoding: "protobuf", definition: schema.data }
    }

    /// A topic with JSON objects and a schema named `schema`.
    #[must_use]
    pub fn of_json<T: JsonSchema>(name: &'static str, schema: &'static str) -> Self {
        let definition = serde_json::to_vec(&schemars::schema_for!(T)).unwrap_or_default();
        Self { name, encoding: "json", schema: schema.into(), schema_encoding: "jsonschema", definition: definition.into() }
    }
}

/// A message to be logged.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Message {
    /// Index of its topic in the list with which the log was opened.
    pub topic: usize,
    /// Flight time.
    pub time: Time,
    /// The encoded message.
    pub data: Bytes,
}

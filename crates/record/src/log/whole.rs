//! Writes a whole log on the caller's thread, for copies of logs: without a queue, and without a clock.

use std::collections::BTreeMap;
use std::io::Write;

use mcap::Writer;
use mcap::records::MessageHeader;
use mcap::write::NoSeek;

use super::repair::Rewrite;
use super::{Message, Topic, writer};

/// A log being written to anything. The same messages give the same bytes: it has no wall-clock time.
pub struct WholeLog<W: Write> {
    writer: Writer<NoSeek<W>>,
    channels: Vec<u16>,
    sequence: u32,
}

impl<W: Write> WholeLog<W> {
    /// Begins a log with these topics, and with their own schemas.
    ///
    /// # Errors
    /// [`Rewrite`] if nothing can be written to `copy`.
    pub fn create(copy: W, topics: &[Topic]) -> Result<Self, Rewrite> {
        let mut writer = writer::options().create(NoSeek::new(copy))?;
        writer.write_metadata(&writer::head(None))?;
        let mut channels = Vec::with_capacity(topics.len());
        for topic in topics {
            let schema = writer.add_schema(&topic.schema, topic.schema_encoding, &topic.definition)?;
            channels.push(writer.add_channel(schema, topic.name, topic.encoding, &BTreeMap::new())?);
        }
        Ok(Self { writer, channels, sequence: 0 })
    }

    /// Adds a message. One of a topic that the log does not have is left out.
    ///
    /// # Errors
    /// [`Rewrite`] if it cannot be written.
    pub fn push(&mut self, message: &Message) -> Result<(), Rewrite> {
        let time = message.time.as_nanos();
        let Some(&channel_id) = self.channels.get(message.topic) else { return Ok(()) };
        let header = MessageHeader { channel_id, sequence: self.sequence, log_time: time, publish_time: time };
        self.sequence = self.sequence.wrapping_add(1);
        self.writer.write_to_known_channel(&header, &message.data).map_err(Rewrite::from)
    }

    /// Writes index and summary, and returns what the log was written to. It is not flushed.
    ///
    /// # Errors
    /// [`Rewrite`] if they cannot be written.
    pub fn finish(mut self) -> Result<W, Rewrite> {
        self.writer.finish()?;
        Ok(self.writer.into_inner().into_inner())
    }
}

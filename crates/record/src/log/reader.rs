//! Reads a log message by message, in the order of the file.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::Path;

use bytes::Bytes;
use mcap::McapError;
use mcap::read::{ChannelAccumulator, parse_record};
use mcap::records::{Metadata, Record};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use spf_core::time::Time;

use super::{FORMAT, FORMAT_KEY, HEAD, STARTED_KEY, strings};

/// Maximum size of a record or chunk, bytes, so that a crafted file cannot exhaust the memory.
const LONGEST_RECORD: usize = 64 * 1024 * 1024;

/// Why a log could not be read completely.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReadError {
    /// The file could not be opened or read.
    #[error("cannot read the file")]
    Read(#[source] io::Error),
    /// The file is truncated: the writing process was killed, or the disk was full.
    #[error("the log is truncated")]
    Torn,
    /// The file is not a valid MCAP file.
    #[error("not an MCAP file, or damaged")]
    Broken(#[source] McapError),
    /// The file was written by a version with another format.
    #[error("unsupported log format {0}; this version reads format {FORMAT}")]
    Format(u32),
}

impl From<McapError> for ReadError {
    fn from(error: McapError) -> Self {
        match error {
            McapError::Io(error) if error.kind() == io::ErrorKind::UnexpectedEof => Self::Torn,
            McapError::Io(error) => Self::Read(error),
            McapError::UnexpectedEof | McapError::UnexpectedEoc => Self::Torn,
            error => Self::Broken(error),
        }
    }
}

/// A message of a log.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// Name of its topic.
    pub topic: String,
    /// Encoding: `protobuf` or `json`.
    pub encoding: String,
    /// Name of its schema.
    pub schema: String,
    /// Flight time.
    pub time: Time,
    /// Number of the message in the log, from 0.
    pub sequence: u32,
    /// The message.
    pub data: Bytes,
}

/// A log's metadata.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LogHead {
    /// Version of its topics and messages.
    pub format: u32,
    /// Wall clock at the start, Unix nanoseconds; 0 in a log made to be shared, which does not tell it.
    pub started_at_ns: u64,
}

/// The messages of a log in the order of the file. It ends after the first error.
pub struct LogReader<R> {
    pieces: Pieces<R>,
    head: Option<LogHead>,
    failed: bool,
}

impl LogReader<BufReader<File>> {
    /// Opens a file.
    ///
    /// # Errors
    /// [`ReadError::Read`] if it cannot be opened, [`ReadError::Broken`] if it does not begin as an MCAP file does. An empty file, and
    /// one that ends within these first bytes, is a log of which the rest is missing.
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        let mut file = BufReader::new(spf_input::open(path).map_err(ReadError::Read)?);
        let begin = file.fill_buf().map_err(ReadError::Read)?;
        if begin.iter().zip(mcap::MAGIC).any(|(found, expected)| found != expected) {
            return Err(ReadError::Broken(McapError::BadMagic));
        }
        Ok(Self::new(file))
    }
}

impl<R: Read> LogReader<R> {
    /// Reads from any source. Chunks with a wrong checksum are errors; memory is bounded by the longest chunk, at most
    /// 64 MiB.
    pub fn new(source: R) -> Self {
        Self { pieces: Pieces::new(source), head: None, failed: false }
    }

    /// The log's metadata, known once the first message was read. `None` for an MCAP file that is not a flight log.
    #[must_use]
    pub fn head(&self) -> Option<LogHead> {
        self.head
    }

    fn take_head(&mut self, metadata: &BTreeMap<String, String>) -> Result<(), ReadError> {
        let number = |key: &str| metadata.get(key).and_then(|text| text.parse::<u64>().ok()).unwrap_or(0);
        let format = u32::try_from(number(FORMAT_KEY)).unwrap_or(u32::MAX);
        if format != FORMAT {
            return Err(ReadError::Format(format));
        }
        self.head = Some(LogHead { format, started_at_ns: number(STARTED_KEY) });
        Ok(())
    }

    fn entry(&mut self) -> Option<Result<Entry, ReadError>> {
        loop {
            match self.pieces.next()? {
                Err(error) => return Some(Err(error.into())),
                Ok(Piece::Metadata(metadata)) if metadata.name == HEAD => {
                    if let Err(error) = self.take_head(&metadata.metadata) {
                        return Some(Err(error));
                    }
                }
                Ok(Piece::Metadata(_)) => {}
                Ok(Piece::Message(message)) => return Some(Ok(entry_of(message))),
            }
        }
    }
}

impl<R: Read> Iterator for LogReader<R> {
    type Item = Result<Entry, ReadError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.failed {
            return None;
        }
        let entry = self.entry();
        self.failed = !matches!(entry, Some(Ok(_)));
        entry
    }
}

fn entry_of(message: mcap::Message<'static>) -> Entry {
    Entry {
        topic: message.channel.topic.clone(),
        encoding: message.channel.message_encoding.clone(),
        schema: message.channel.schema.as_ref().map(|schema| schema.name.clone()).unwrap_or_default(),
        time: Time::from_nanos(message.log_time),
        sequence: message.sequence,
        data: message.data.into_owned().into(),
    }
}

/// A part of a file.
pub(super) enum Piece {
    /// A metadata record.
    Metadata(Metadata),
    /// A message with its channel and schema.
    Message(mcap::Message<'static>),
}

/// The parts of a file, in order, to its regular end or an error.
pub(super) struct Pieces<R> {
    source: R,
    reader: LinearReader,
    channels: ChannelAccumulator<'static>,
    /// Index and summary follow the data, and repeat what is known.
    past_data: bool,
}

impl<R: Read> Pieces<R> {
    pub(super) fn new(source: R) -> Self {
        // Complete chunks only: the checksum is verified before the messages are read.
        let options = LinearReaderOptions::default().with_prevalidate_chunk_crcs(true).with_record_length_limit(LONGEST_RECORD);
        let reader = LinearReader::new_with_options(options);
        Self { source, reader, channels: ChannelAccumulator::default(), past_data: false }
    }

    fn read(&mut self) -> Result<Option<Piece>, McapError> {
        while let Some(event) = self.reader.next_event() {
            let (opcode, data) = match event? {
                LinearReadEvent::ReadRequest(size) => {
                    let got = read_some(&mut self.source, self.reader.insert(size))?;
                    self.reader.notify_read(got);
                    continue;
                }
                LinearReadEvent::Record { opcode, data } => (opcode, data),
            };
            // Without its content, the record is an error of the parser.
            let data = if strings::fit(opcode, data) { data } else { &[] };
            match parse_record(opcode, data)? {
                Record::DataEnd(_) => self.past_data = true,
                _ if self.past_data => {}
                Record::Schema { header, data } => {
                    self.channels.add_schema(header, Cow::Owned(data.into_owned()))?;
                }
                Record::Channel(channel) => self.channels.add_channel(channel)?,
                Record::Metadata(metadata) => return Ok(Some(Piece::Metadata(metadata))),
                Record::Message { header, data } => {
                    let unknown = McapError::UnknownChannel(header.sequence, header.channel_id);
                    let channel = self.channels.get(header.channel_id).ok_or(unknown)?;
                    return Ok(Some(Piece::Message(mcap::Message {
                        channel,
                        sequence: header.sequence,
                        log_time: header.log_time,
                        publish_time: header.publish_time,
                        data: Cow::Owned(data.into_owned()),
                    })));
                }
                _ => {}
            }
        }
        Ok(None)
    }
}

impl<R: Read> Iterator for Pieces<R> {
    type Item = Result<Piece, McapError>;

    fn next(&mut self) -> Option<Self::Item> {
        self.read().transpose()
    }
}

fn read_some(source: &mut impl Read, buffer: &mut [u8]) -> io::Result<usize> {
    loop {
        match source.read(buffer) {
            // Interrupted by a signal; returning here would mean the end of the file.
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            read => return read,
        }
    }
}

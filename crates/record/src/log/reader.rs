//! Reading a log message by message, in the order in which they were written.

use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::Path;

use bytes::Bytes;
use mcap::McapError;
use mcap::io::MessageReader;
use mcap::sans_io::LinearReaderOptions;
use spf_core::time::Time;

/// Longest record or chunk that is read, bytes: a crafted file must not take all memory.
const LONGEST_RECORD: usize = 64 * 1024 * 1024;

/// Why a log cannot be read, or not to its end.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReadError {
    /// The file cannot be opened or read.
    #[error("the file cannot be read")]
    Read(#[source] io::Error),
    /// The file ends in the middle: the process that wrote it was killed, or the disk was full.
    #[error("the log ends in the middle; `spf log repair` keeps everything before")]
    Torn,
    /// It is no MCAP file, or a broken one.
    #[error("the file is no MCAP file, or it is broken there")]
    Broken(#[source] McapError),
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
    /// Its topic.
    pub topic: String,
    /// How it is encoded: `protobuf` or `json`.
    pub encoding: String,
    /// What its form is called.
    pub schema: String,
    /// Flight time.
    pub time: Time,
    /// Its place among all messages of the log, counted from 0.
    pub sequence: u32,
    /// The message.
    pub data: Bytes,
}

/// The messages of a log in the order of the file. After the first error there is nothing more.
pub struct LogReader<R>(MessageReader<R>);

impl LogReader<BufReader<File>> {
    /// Opens a file.
    ///
    /// # Errors
    /// [`ReadError::Read`].
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        File::open(path).map(|file| Self::new(BufReader::new(file))).map_err(ReadError::Read)
    }
}

impl<R: Read> LogReader<R> {
    /// Reads from anywhere. Chunks with a wrong checksum are errors; memory is bounded by the longest chunk, at most 64 MiB.
    pub fn new(source: R) -> Self {
        let options = LinearReaderOptions::default().with_prevalidate_chunk_crcs(true).with_record_length_limit(LONGEST_RECORD);
        Self(MessageReader::new_with_options(source, options))
    }
}

impl<R: Read> Iterator for LogReader<R> {
    type Item = Result<Entry, ReadError>;

    fn next(&mut self) -> Option<Self::Item> {
        let message = match self.0.next()? {
            Ok(message) => message,
            Err(error) => return Some(Err(error.into())),
        };
        Some(Ok(Entry {
            topic: message.channel.topic.clone(),
            encoding: message.channel.message_encoding.clone(),
            schema: message.channel.schema.as_ref().map(|schema| schema.name.clone()).unwrap_or_default(),
            time: Time::from_nanos(message.log_time),
            sequence: message.sequence,
            data: message.data.into_owned().into(),
        }))
    }
}

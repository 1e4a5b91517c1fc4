//! Writes the file of a log in chunks.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufWriter, Seek, Write};
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use mcap::records::{MessageHeader, Metadata};
use mcap::write::NoSeek;
use mcap::{Compression, McapError, WriteOptions, Writer};

use super::{FORMAT, FORMAT_KEY, HEAD, Message, STARTED_KEY, Topic};

/// Uncompressed size at which a chunk is closed whatever its age; the writer buffers this much.
const CHUNK_SIZE: u64 = 128 * 1024;

/// Why the log could not be written. A flight continues without it.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LogError {
    /// The file could not be created or written.
    #[error("cannot write the flight log `{path}`: check the disk space and the folder's permissions")]
    Write {
        /// The file.
        path: PathBuf,
        /// The cause.
        #[source]
        source: io::Error,
    },
    /// The messages could not be encoded.
    #[error("cannot encode the flight log `{path}`")]
    Form {
        /// The file.
        path: PathBuf,
        /// The cause.
        #[source]
        source: McapError,
    },
    /// The writing thread panicked.
    #[error("cannot write the flight log `{path}`: internal error")]
    Panicked {
        /// The file.
        path: PathBuf,
    },
    /// The writing thread could not be started.
    #[error("cannot start a thread to write the flight log `{path}`")]
    Thread {
        /// The file.
        path: PathBuf,
        /// The cause.
        #[source]
        source: io::Error,
    },
}

impl LogError {
    pub(super) fn of(path: &Path, error: McapError) -> Self {
        let path = path.to_owned();
        match error {
            McapError::Io(source) => Self::Write { path, source },
            source => Self::Form { path, source },
        }
    }
}

/// Writes messages; each chunk is written as a whole.
pub(super) struct LogWriter {
    path: PathBuf,
    writer: Writer<NoSeek<BufWriter<File>>>,
    file: File,
    channels: Vec<u16>,
    sequence: u32,
    /// Whether there are messages since the last chunk was closed.
    open: bool,
    /// End of the last complete chunk.
    whole: u64,
}

impl LogWriter {
    pub(super) fn create(path: &Path, topics: &[Topic]) -> Result<Self, LogError> {
        Self::begin(path, topics).map_err(|error| LogError::of(path, error))
    }

    fn begin(path: &Path, topics: &[Topic]) -> Result<Self, McapError> {
        let file = File::create(path)?;
        // Prevents a repair at the same time. Not all file systems support locks, and Windows' locks would exclude
        // readers.
        if cfg!(unix) {
            file.try_lock().ok();
        }
        let writer = NoSeek::new(BufWriter::new(file.try_clone()?));
        let mut writer = options().create(writer)?;
        writer.write_metadata(&head(Some(SystemTime::now())))?;
        let mut channels = Vec::with_capacity(topics.len());
        for topic in topics {
            let schema = writer.add_schema(&topic.schema, topic.schema_encoding, &topic.definition)?;
            channels.push(writer.add_channel(schema, topic.name, topic.encoding, &BTreeMap::new())?);
        }
        let mut log = Self { path: path.to_owned(), writer, file, channels, sequence: 0, open: true, whole: 0 };
        log.close_chunk()?;
        Ok(log)
    }

    /// Adds a message to the open chunk.
    pub(super) fn push(&mut self, message: &Message) -> Result<(), McapError> {
        let time = message.time.as_nanos();
        let Some(&channel_id) = self.channels.get(message.topic) else { return Ok(()) };
        // Numbered across all topics, so that readers of single topics can restore the order.
        let header = MessageHeader { channel_id, sequence: self.sequence, log_time: time, publish_time: time };
        self.sequence = self.sequence.wrapping_add(1);
        self.open = true;
        self.writer.write_to_known_channel(&header, &message.data)
    }

    /// Whether there are messages outside of closed chunks.
    pub(super) fn is_open(&self) -> bool {
        self.open
    }

    /// Writes everything so far.
    pub(super) fn close_chunk(&mut self) -> Result<(), McapError> {
        self.writer.flush()?;
        self.open = false;
        self.whole = self.file.stream_position()?;
        Ok(())
    }

    /// Writes index and summary. Returns the size of the file, bytes.
    pub(super) fn finish(mut self) -> Result<u64, LogError> {
        if let Err(error) = self.close_chunk().and_then(|()| self.writer.finish()) {
            return Err(self.fail(error));
        }
        let Self { path, writer, file, whole, .. } = self;
        let ended = writer.into_inner().into_inner().flush().and_then(|()| file.metadata());
        // A partial index is useless.
        let ended = ended.inspect_err(|_| drop(file.set_len(whole)));
        ended.map(|data| data.len()).map_err(|source| LogError::Write { path, source })
    }

    /// Ends the log after a failure: the file is truncated after its last complete chunk, so that it remains readable.
    pub(super) fn fail(self, error: McapError) -> LogError {
        let Self { path, writer, mut file, whole, .. } = self;
        // Dropping it tries to finish the file, and may write part of that.
        drop(writer);
        // If truncating fails, a reader stops there; the original error matters more.
        file.set_len(whole).and_then(|()| file.flush()).ok();
        LogError::of(&path, error)
    }
}

/// Options of the MCAP writer. Chunks are assembled in memory and written as a whole: after a crash, the contents of an
/// incomplete one would be uncertain.
pub(super) fn options() -> WriteOptions {
    WriteOptions::new()
        .compression(Some(Compression::Lz4))
        .chunk_size(Some(CHUNK_SIZE))
        .disable_seeking(true)
        .library(concat!("spf ", env!("CARGO_PKG_VERSION")))
}

/// The metadata of a log that starts now; of a copy without its wall-clock time if `now` is `None`.
pub(super) fn head(now: Option<SystemTime>) -> Metadata {
    let started = now.map(|now| now.duration_since(UNIX_EPOCH).map_or(0, |since| since.as_nanos()));
    let entries = [(FORMAT_KEY, Some(FORMAT.to_string())), (STARTED_KEY, started.map(|nanos| nanos.to_string()))];
    let metadata = entries.into_iter().filter_map(|(key, value)| Some((key.to_owned(), value?))).collect();
    Metadata { name: HEAD.to_owned(), metadata }
}

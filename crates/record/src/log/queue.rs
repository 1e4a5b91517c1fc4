//! The log's thread and its queue.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use mcap::McapError;

use super::writer::{LogError, LogWriter};
use super::{Message, Topic};

/// Maximum number of queued messages: half a minute of a flight's inputs and outputs.
const WAITING: usize = 4096;
/// Maximum number of large messages (images) among them: at some 100 KiB each, they use most of the memory.
const LARGE_WAITING: usize = 64;
/// Minimum size of a large message, bytes.
const LARGE: usize = 16 * 1024;
/// Maximum age of an open chunk, wall time.
const CHUNK_AGE: Duration = Duration::from_millis(500);

/// Facts about a finished log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LogFacts {
    /// Size of the file, bytes.
    pub bytes: u64,
    /// Number of messages dropped because the disk was too slow.
    pub lost: u64,
}

/// A log being written.
#[derive(Debug)]
pub struct Log {
    sender: LogSender,
    path: PathBuf,
    writer: JoinHandle<Result<u64, LogError>>,
}

/// Sends messages to the log; can be shared by several threads.
#[derive(Clone, Debug)]
pub struct LogSender {
    queue: SyncSender<Message>,
    patient: bool,
    large: Arc<AtomicUsize>,
    lost: Arc<AtomicU64>,
}

impl Log {
    /// Creates a log with these topics at `path`. A `patient` log waits for a slow disk, for flights in virtual time;
    /// otherwise messages are dropped and counted if the disk is too slow, large ones first.
    ///
    /// # Errors
    /// [`LogError`] if the file cannot be created, or no thread can be started.
    pub fn create(path: &Path, topics: &[Topic], patient: bool) -> Result<Self, LogError> {
        let writer = LogWriter::create(path, topics)?;
        let (queue, messages) = sync_channel(WAITING);
        let (large, lost) = (Arc::new(AtomicUsize::new(0)), Arc::new(AtomicU64::new(0)));
        let taken = large.clone();
        let thread = std::thread::Builder::new().name("flight log".to_owned());
        let writer = thread.spawn(move || write_all(writer, &messages, &taken));
        let writer = writer.map_err(|source| LogError::Thread { path: path.to_owned(), source })?;
        Ok(Self { sender: LogSender { queue, patient, large, lost }, path: path.to_owned(), writer })
    }

    /// A sender for messages.
    #[must_use]
    pub fn sender(&self) -> LogSender {
        self.sender.clone()
    }

    /// Whether the file can no longer be written; [`finish`](Self::finish) says why.
    #[must_use]
    pub fn has_failed(&self) -> bool {
        // The queue is open as long as the log is, so that only a failure ends the thread.
        self.writer.is_finished()
    }

    /// Finishes the file. Waits until every other [`LogSender`] has been dropped.
    ///
    /// # Errors
    /// [`LogError`]: everything written before can be read, or repaired.
    pub fn finish(self) -> Result<LogFacts, LogError> {
        let Self { sender, writer, path } = self;
        let lost = sender.lost.clone();
        drop(sender);
        let bytes = writer.join().unwrap_or_else(|_| Err(LogError::Panicked { path }))?;
        Ok(LogFacts { bytes, lost: lost.load(Ordering::Relaxed) })
    }

    /// Path of the file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }
}

impl LogSender {
    /// Sends a message. Returns false if it was dropped because the disk is too slow. After a failure of the log
    /// nothing happens: [`Log::finish`] reports it.
    pub fn send(&self, message: Message) -> bool {
        let large = message.data.len() >= LARGE;
        if large && self.large.fetch_add(1, Ordering::Relaxed) >= LARGE_WAITING && !self.patient {
            return self.leave_out(large);
        }
        if self.patient {
            self.queue.send(message).ok();
            return true;
        }
        match self.queue.try_send(message) {
            Err(TrySendError::Full(_)) => self.leave_out(large),
            Ok(()) | Err(TrySendError::Disconnected(_)) => true,
        }
    }

    fn leave_out(&self, large: bool) -> bool {
        self.lost.fetch_add(1, Ordering::Relaxed);
        if large {
            self.large.fetch_sub(1, Ordering::Relaxed);
        }
        false
    }
}

fn write_all(mut writer: LogWriter, messages: &Receiver<Message>, large: &AtomicUsize) -> Result<u64, LogError> {
    match write_until_closed(&mut writer, messages, large) {
        Ok(()) => writer.finish(),
        Err(error) => Err(writer.fail(error)),
    }
}

fn write_until_closed(writer: &mut LogWriter, messages: &Receiver<Message>, large: &AtomicUsize) -> Result<(), McapError> {
    let mut closed = Instant::now();
    loop {
        match messages.recv_timeout(CHUNK_AGE.saturating_sub(closed.elapsed())) {
            Ok(message) => {
                if message.data.len() >= LARGE {
                    large.fetch_sub(1, Ordering::Relaxed);
                }
                writer.push(&message)?;
            }
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return Ok(()),
        }
        if closed.elapsed() >= CHUNK_AGE {
            if writer.is_open() {
                writer.close_chunk()?;
            }
            closed = Instant::now();
        }
    }
}

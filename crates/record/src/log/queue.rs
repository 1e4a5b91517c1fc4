//! The log's own thread, and the queue before it.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use mcap::McapError;

use super::writer::{LogError, LogWriter};
use super::{Message, Topic};

/// Messages that may wait for the disk: half a minute of a flight's inputs and outputs.
const WAITING: usize = 4096;
/// Large messages (images) that may be among them: at some 100 KiB each, they are what fills the memory.
const LARGE_WAITING: usize = 64;
/// From this size on a message is large, bytes.
const LARGE: usize = 16 * 1024;
/// A chunk is closed at this age, wall time.
const CHUNK_AGE: Duration = Duration::from_millis(500);

/// What a log holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LogFacts {
    /// Size of the file.
    pub bytes: u64,
    /// Messages for which the disk was too slow.
    pub lost: u64,
}

/// A log being written.
#[derive(Debug)]
pub struct Log {
    sender: LogSender,
    path: PathBuf,
    writer: JoinHandle<Result<u64, LogError>>,
}

/// Where messages go in. Any number of threads may hold one.
#[derive(Clone, Debug)]
pub struct LogSender {
    queue: SyncSender<Message>,
    patient: bool,
    large: Arc<AtomicUsize>,
    lost: Arc<AtomicU64>,
}

impl Log {
    /// Starts a log with these topics at `path`. A `patient` one waits for a slow disk, for flights in virtual time; otherwise what
    /// the disk cannot take is left out and counted, large messages first.
    ///
    /// # Errors
    /// [`LogError`] when the file cannot be made, or no thread be started.
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

    /// Where messages go in.
    #[must_use]
    pub fn sender(&self) -> LogSender {
        self.sender.clone()
    }

    /// Ends the file; every other [`LogSender`] has to be gone by now, for it waits for them.
    ///
    /// # Errors
    /// [`LogError`]: what was written until then can be read, or repaired.
    pub fn finish(self) -> Result<LogFacts, LogError> {
        let Self { sender, writer, .. } = self;
        let lost = sender.lost.clone();
        drop(sender);
        // A panic of the writer is a bug and goes on here.
        let bytes = writer.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))?;
        Ok(LogFacts { bytes, lost: lost.load(Ordering::Relaxed) })
    }

    /// The file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }
}

impl LogSender {
    /// Puts a message into the log. False when the disk is too slow and it was left out; after a failure of the log nothing
    /// happens: [`Log::finish`] tells.
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

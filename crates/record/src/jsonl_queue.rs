//! JSON Lines files written by a thread of their own, for whoever must not wait for a disk.

use std::path::{Path, PathBuf};
use std::sync::mpsc::{SyncSender, TrySendError, sync_channel};
use std::thread::{Builder, JoinHandle};

use serde::Serialize;

use crate::jsonl::{self, JsonLines};
use crate::out_dir::FileError;

/// Maximum number of rows queued.
const WAITING: usize = 256;

/// A JSON Lines file whose rows are written in order by a thread. A row that finds the queue full is dropped and counted,
/// or, in a `patient` one, waits.
#[derive(Debug)]
pub struct JsonLinesQueue {
    path: PathBuf,
    rows: SyncSender<Vec<u8>>,
    writer: JoinHandle<Result<(), FileError>>,
    patient: bool,
    lost: u64,
}

impl JsonLinesQueue {
    /// Starts the thread, which creates an empty file at `path`. A `patient` one waits for a slow disk, for flights in
    /// virtual time.
    ///
    /// # Errors
    /// [`FileError::Write`] if no thread can be started; a file that cannot be created is reported by
    /// [`finish`](Self::finish).
    pub fn create(path: &Path, patient: bool) -> Result<Self, FileError> {
        let (rows, waiting) = sync_channel::<Vec<u8>>(WAITING);
        let at = path.to_owned();
        let write = move || {
            let mut file = JsonLines::create(&at)?;
            waiting.iter().try_for_each(|row| file.push_encoded(&row))
        };
        let thread = Builder::new().name("rows".to_owned()).spawn(write);
        let writer = thread.map_err(|source| FileError::Write { path: path.to_owned(), source })?;
        Ok(Self { path: path.to_owned(), rows, writer, patient, lost: 0 })
    }

    /// Queues a row. Unless patient, it never waits, and a row is dropped if the disk is too slow; after a failure of the file, which
    /// [`finish`](Self::finish) reports, nothing happens.
    ///
    /// # Errors
    /// [`FileError::Json`] if the row has no JSON form.
    pub fn push<T: Serialize>(&mut self, row: &T) -> Result<(), FileError> {
        let row = jsonl::encode(&self.path, row)?;
        if self.patient {
            self.rows.send(row).ok();
        } else if let Err(TrySendError::Full(_)) = self.rows.try_send(row) {
            self.lost += 1;
        }
        Ok(())
    }

    /// Waits until every queued row is written. Returns the number of dropped rows.
    ///
    /// # Errors
    /// [`FileError`] of the first row that could not be written.
    pub fn finish(self) -> Result<u64, FileError> {
        drop(self.rows);
        let failed = |_| Err(FileError::Panicked { path: self.path });
        self.writer.join().unwrap_or_else(failed).map(|()| self.lost)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_written_in_order() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("decisions.jsonl");
        let mut rows = JsonLinesQueue::create(&path, true).unwrap();
        (0..1000).for_each(|row| rows.push(&row).unwrap());
        assert_eq!(rows.finish().unwrap(), 0);
        let text: String = (0..1000).map(|row| format!("{row}\n")).collect();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), text);
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn a_full_disk_is_reported_at_the_end() {
        let mut rows = JsonLinesQueue::create(Path::new("/dev/full"), false).unwrap();
        (0..10).for_each(|row| rows.push(&row).unwrap());
        assert!(matches!(rows.finish(), Err(FileError::Write { .. })));
    }

    /// A FIFO that is opened and never read is a disk that stalls for ever.
    #[test]
    #[cfg(target_os = "linux")]
    fn a_stalled_disk_delays_no_row_and_the_lost_ones_are_counted() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("stalled");
        assert!(std::process::Command::new("mkfifo").arg(&path).status().unwrap().success());
        // Opened for both directions, so that opening the other end does not wait.
        let reader = std::fs::File::options().read(true).write(true).open(&path).unwrap();
        let mut rows = JsonLinesQueue::create(&path, false).unwrap();
        let row = "x".repeat(1000);
        let begun = std::time::Instant::now();
        (0..1000).for_each(|_| rows.push(&row).unwrap());
        assert!(begun.elapsed().as_secs() < 5, "only blocking takes that long");
        assert!(rows.lost >= 1000 - WAITING as u64 - 70, "64 KiB of a pipe, and the queue: {}", rows.lost);
        let lost = rows.lost;
        // Once it is read again, the rest arrives.
        let drain = std::thread::spawn(move || {
            std::io::copy(&mut std::io::Read::take(reader, (1000 - lost) * 1003), &mut std::io::sink())
        });
        assert_eq!(rows.finish().unwrap(), lost);
        assert_eq!(drain.join().unwrap().unwrap(), (1000 - lost) * 1003);
    }
}

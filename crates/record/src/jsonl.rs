//! JSON Lines files, written row by row by a thread of their own: whoever flies a craft must not wait for a disk.

use std::fs::File;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{SyncSender, TrySendError, sync_channel};
use std::thread::{Builder, JoinHandle};

use serde::Serialize;

use crate::out_dir::FileError;

/// Maximum number of rows queued.
const WAITING: usize = 256;

/// A file such as `decisions.jsonl`. A row that finds the queue full is dropped and counted, or, in a `patient` one, waits.
/// Each row is passed to the operating system as a whole, so a process that is killed leaves only complete lines.
#[derive(Debug)]
pub struct JsonLines {
    path: PathBuf,
    rows: SyncSender<Vec<u8>>,
    writer: JoinHandle<Result<(), FileError>>,
    patient: bool,
    lost: u64,
}

impl JsonLines {
    /// Starts the thread, which creates an empty file at `path`. A `patient` one waits for a slow disk, for flights in
    /// virtual time.
    ///
    /// # Errors
    /// [`FileError::Write`] if no thread can be started; a file that cannot be created is reported by
    /// [`finish`](Self::finish).
    pub fn create(path: &Path, patient: bool) -> Result<Self, FileError> {
        let (rows, waiting) = sync_channel::<Vec<u8>>(WAITING);
        let (at, path) = (path.to_owned(), path.to_owned());
        let write = move || {
            let written = File::create(&at).and_then(|mut file| waiting.iter().try_for_each(|row| file.write_all(&row)));
            written.map_err(|source| FileError::Write { path: at, source })
        };
        match Builder::new().name("rows".to_owned()).spawn(write) {
            Ok(writer) => Ok(Self { path, rows, writer, patient, lost: 0 }),
            Err(source) => Err(FileError::Write { path, source }),
        }
    }

    /// Queues a row; non-finite numbers become `null`. After a failure of the file, which [`finish`](Self::finish) reports,
    /// nothing happens.
    ///
    /// # Errors
    /// [`FileError::Json`] if the row has no JSON form; nothing is written then.
    pub fn push<T: Serialize>(&mut self, row: &T) -> Result<(), FileError> {
        let mut row = serde_json::to_vec(row).map_err(|source| FileError::Json { path: self.path.clone(), source })?;
        row.push(b'\n');
        if self.patient {
            self.rows.send(row).ok();
        } else if let Err(TrySendError::Full(_)) = self.rows.try_send(row) {
            self.lost += 1;
        }
        Ok(())
    }

    /// Whether the file can no longer be written; [`finish`](Self::finish) says why.
    #[must_use]
    pub fn has_failed(&self) -> bool {
        // As long as the queue is open, only a failure ends the thread.
        self.writer.is_finished()
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
    use std::collections::BTreeMap;

    use super::*;

    #[test]
    fn rows_are_written_in_order() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("decisions.jsonl");
        let mut rows = JsonLines::create(&path, true).unwrap();
        (0..1000).for_each(|row| rows.push(&row).unwrap());
        assert_eq!(rows.finish().unwrap(), 0);
        let text: String = (0..1000).map(|row| format!("{row}\n")).collect();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), text);
    }

    #[test]
    fn rows_are_one_a_line_and_what_has_no_json_form_is_left_out() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("decisions.jsonl");
        let mut rows = JsonLines::create(&path, false).unwrap();
        rows.push(&BTreeMap::from([("text", "two\nlines"), ("kind", "x")])).unwrap();
        let unusable = BTreeMap::from([((1, 2), 3)]);
        assert!(matches!(rows.push(&unusable), Err(FileError::Json { .. })));
        rows.push(&2).unwrap();
        assert_eq!(rows.finish().unwrap(), 0);
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "{\"kind\":\"x\",\"text\":\"two\\nlines\"}\n2\n");
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn a_full_disk_is_an_error_that_names_the_file() {
        let mut rows = JsonLines::create(Path::new("/dev/full"), false).unwrap();
        (0..10).for_each(|row| rows.push(&row).unwrap());
        while !rows.has_failed() {
            std::thread::yield_now();
        }
        let error = rows.finish().unwrap_err();
        assert!(matches!(error, FileError::Write { .. }) && error.to_string().contains("/dev/full"), "{error}");
    }

    /// A FIFO that is opened and never read behaves like a stalled disk.
    #[test]
    #[cfg(target_os = "linux")]
    fn a_stalled_disk_delays_no_row_and_the_lost_ones_are_counted() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("stalled");
        assert!(std::process::Command::new("mkfifo").arg(&path).status().unwrap().success());
        // Opened for both directions, so that opening the other end does not wait.
        let reader = File::options().read(true).write(true).open(&path).unwrap();
        let mut rows = JsonLines::create(&path, false).unwrap();
        let row = "x".repeat(1000);
        let begun = std::time::Instant::now();
        (0..1000).for_each(|_| rows.push(&row).unwrap());
        assert!(begun.elapsed().as_secs() < 60, "only blocking takes that long");
        assert!(rows.lost >= 1000 - WAITING as u64 - 70, "64 KiB of a pipe, and the queue: {}", rows.lost);
        let lost = rows.lost;
        // When reading resumes, the rest arrives.
        let drain = std::thread::spawn(move || {
            std::io::copy(&mut std::io::Read::take(reader, (1000 - lost) * 1003), &mut std::io::sink())
        });
        assert_eq!(rows.finish().unwrap(), lost);
        assert_eq!(drain.join().unwrap().unwrap(), (1000 - lost) * 1003);
    }
}

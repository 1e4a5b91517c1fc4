//! Deletes a recorded flight: its own files alone, and never one that is being recorded.

use std::io::{Read as _, Seek as _, SeekFrom};
use std::path::Path;
use std::time::{Duration, SystemTime};

/// The files that a flight writes (docs/reference/flight-files.md). The first one goes last: it marks the folder as a flight.
const FILES: [&str; 7] =
    ["summary.json", "decisions.jsonl", "queries.jsonl", "flight.mcap", "vlm.jsonl", "video.mp4", "trajectory.svg"];
/// The end of a complete log (mcap.dev/spec, magic).
const COMPLETE: &[u8] = b"\x89MCAP0\r\n";
/// A log without its end that was not written to for this long is that of a program that was killed.
const ABANDONED: Duration = Duration::from_secs(60);

/// Deletes the files of a flight, and its folder if nothing else is in it.
///
/// # Errors
/// Why not, for a person; no path of the machine is in it.
pub(super) fn remove(folder: &Path) -> Result<&'static str, &'static str> {
    // Not through a link, which may lead anywhere.
    let plain = |path: &Path| path.symlink_metadata().map(|data| data.file_type());
    if !plain(folder).is_ok_and(|kind| kind.is_dir()) {
        return Err("the flight's folder is a link: delete it by hand");
    }
    if is_recorded(folder) {
        return Err("the flight is being recorded: it can be deleted when it is over");
    }
    for name in FILES.iter().rev() {
        let path = folder.join(name);
        let Ok(kind) = plain(&path) else { continue };
        if kind.is_dir() || std::fs::remove_file(&path).is_err() {
            return Err("a file of the flight cannot be deleted: check the folder's permissions");
        }
    }
    match std::fs::remove_dir(folder) {
        Ok(()) => Ok("deleted"),
        Err(_) => Ok("deleted; other files in its folder were left"),
    }
}

/// Whether a program still writes it: its log has no end yet.
fn is_recorded(folder: &Path) -> bool {
    let path = folder.join("flight.mcap");
    // What a link leads to, this flight does not write.
    if path.symlink_metadata().is_ok_and(|data| data.is_symlink()) {
        return false;
    }
    let Ok(mut log) = spf_input::open(&path) else { return false };
    let mut end = [0; COMPLETE.len()];
    let read = log.seek(SeekFrom::End(-(COMPLETE.len() as i64))).and_then(|_| log.read_exact(&mut end));
    let is_complete = read.is_ok() && end == COMPLETE;
    let modified = log.metadata().and_then(|data| data.modified());
    let is_fresh = modified.is_ok_and(|at| SystemTime::now().duration_since(at).is_ok_and(|since| since < ABANDONED));
    !is_complete && is_fresh
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_files_of_a_flight_that_is_over_are_deleted() {
        let base = tempfile::tempdir().unwrap();
        let flight = |name: &str, log: &[u8]| {
            let folder = base.path().join(name);
            std::fs::create_dir(&folder).unwrap();
            std::fs::write(folder.join("summary.json"), "{}").unwrap();
            std::fs::write(folder.join("flight.mcap"), log).unwrap();
            folder
        };
        let recorded = flight("recorded", b"\x89MCAP0\r\n and more");
        assert!(remove(&recorded).unwrap_err().contains("being recorded") && recorded.join("summary.json").exists());
        let over = flight("over", b"\x89MCAP0\r\n and more \x89MCAP0\r\n");
        assert_eq!((remove(&over), over.exists()), (Ok("deleted"), false));
        let noted = flight("noted", COMPLETE);
        std::fs::write(noted.join("notes.txt"), "mine").unwrap();
        assert!(remove(&noted).unwrap().contains("left") && noted.join("notes.txt").exists());
        assert!(!noted.join("flight.mcap").exists());
        #[cfg(unix)]
        {
            let linked = base.path().join("linked");
            let target = flight("target", COMPLETE);
            std::os::unix::fs::symlink(&target, &linked).unwrap();
            assert!(remove(&linked).unwrap_err().contains("link") && target.join("summary.json").exists());
            // A pipe in place of the log is not waited for.
            let piped = flight("piped", COMPLETE);
            std::fs::remove_file(piped.join("flight.mcap")).unwrap();
            assert!(std::process::Command::new("mkfifo").arg(piped.join("flight.mcap")).status().unwrap().success());
            assert_eq!((remove(&piped), piped.exists()), (Ok("deleted"), false));
        }
    }
}

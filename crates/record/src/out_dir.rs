//! The output folder of a flight.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use serde::Serialize;

/// Default parent folder of flights, below the working directory.
pub const FLIGHTS: &str = "flights";

/// File that marks a folder as taken: every flight has it, and only one process can create it.
const CLAIM: &str = "decisions.jsonl";

/// Why an output folder could not be created.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum OutDirError {
    /// The folder could not be created or read.
    #[error("cannot use the folder `{path}` for the flight's files")]
    Folder {
        /// The folder.
        path: PathBuf,
        /// The cause.
        #[source]
        source: io::Error,
    },
    /// The given folder is not empty; it may hold another flight.
    #[error("the folder `{path}` is not empty")]
    NotEmpty {
        /// The folder.
        path: PathBuf,
    },
}

/// Why a file could not be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FileError {
    /// Writing failed.
    #[error("cannot write `{path}`: check the disk space and the folder's permissions")]
    Write {
        /// The file.
        path: PathBuf,
        /// The cause.
        #[source]
        source: io::Error,
    },
    /// The thread that wrote the file failed.
    #[error("cannot write `{path}`: internal error")]
    Panicked {
        /// The file.
        path: PathBuf,
    },
    /// The value has no JSON form: a map with keys that are not strings.
    #[error("cannot write `{path}`: its content cannot be represented as JSON")]
    Json {
        /// The file.
        path: PathBuf,
        /// The cause.
        #[source]
        source: serde_json::Error,
    },
}

/// The output folder of one flight.
///
/// ```
/// use spf_record::OutDir;
///
/// let base = std::env::temp_dir().join(format!("spf-doc-{}", std::process::id()));
/// let folder = OutDir::fresh(&base, "Fly to the red crane")?;
/// assert!(folder.path().ends_with("001-fly-to-the-red-crane"));
/// folder.write_json("note.json", &["any value"])?;
/// # std::fs::remove_dir_all(base)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OutDir {
    path: PathBuf,
}

impl OutDir {
    /// Takes the folder `named`, or a new folder `flights/NNN-slug` below the working directory, with a slug made from
    /// `hint` (the instruction). Concurrent processes never get the same folder.
    ///
    /// # Errors
    /// See [`OutDir::at`] and [`OutDir::fresh`].
    pub fn create(named: Option<&Path>, hint: &str) -> Result<Self, OutDirError> {
        named.map_or_else(|| Self::fresh(Path::new(FLIGHTS), hint), Self::at)
    }

    /// Creates a new folder `NNN-slug` in `base`, numbered after the highest number there.
    ///
    /// # Errors
    /// [`OutDirError::Folder`] if it cannot be created.
    pub fn fresh(base: &Path, hint: &str) -> Result<Self, OutDirError> {
        let failed = |path: &Path| {
            let path = path.to_owned();
            move |source| OutDirError::Folder { path, source }
        };
        fs::create_dir_all(base).map_err(failed(base))?;
        let mut number = 1 + highest_number(base).map_err(failed(base))?;
        let slug = slug(hint);
        loop {
            let path = base.join(if slug.is_empty() { format!("{number:03}") } else { format!("{number:03}-{slug}") });
            match fs::create_dir(&path) {
                Ok(()) => return Ok(Self { path }),
                // Another process was faster: creating the folder acts as the lock.
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => number += 1,
                Err(error) => return Err(failed(&path)(error)),
            }
        }
    }

    /// Takes the folder `path`: created if it does not exist, otherwise it must be empty.
    ///
    /// # Errors
    /// [`OutDirError::NotEmpty`] if it is not empty, [`OutDirError::Folder`] if it cannot be created or read.
    pub fn at(path: &Path) -> Result<Self, OutDirError> {
        let failed = |source| OutDirError::Folder { path: path.to_owned(), source };
        fs::create_dir_all(path).map_err(failed)?;
        if fs::read_dir(path).map_err(failed)?.next().is_some() {
            return Err(OutDirError::NotEmpty { path: path.to_owned() });
        }
        match File::create_new(path.join(CLAIM)) {
            Ok(_) => Ok(Self { path: path.to_owned() }),
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => Err(OutDirError::NotEmpty { path: path.to_owned() }),
            Err(error) => Err(failed(error)),
        }
    }

    /// Path of the folder.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Gives back the folder of a flight that did not start, so that it can be taken again.
    pub fn give_back(&self) {
        // Files that cannot be removed stay; the error to come matters more.
        drop(fs::remove_file(self.file(CLAIM)));
        drop(fs::remove_dir(self.path()));
    }

    /// Path of the file `name` in it.
    #[must_use]
    pub fn file(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }

    /// Writes a file atomically: it is complete or absent, even after a power failure.
    ///
    /// # Errors
    /// [`FileError::Write`] if writing fails.
    pub fn write(&self, name: &str, content: &[u8]) -> Result<(), FileError> {
        let path = self.file(name);
        let beside = self.file(&format!(".{name}.part"));
        let written = (|| {
            let mut file = File::create(&beside)?;
            file.write_all(content)?;
            file.sync_all()?;
            fs::rename(&beside, &path)
        })();
        written.map_err(|source| {
            // The partial file is useless; a failure to remove it adds nothing to the error.
            fs::remove_file(&beside).ok();
            FileError::Write { path, source }
        })
    }

    /// Writes a value as indented JSON with a final newline. Keys are in field order (for maps: in the map's order), so
    /// equal values give equal bytes; non-finite numbers become `null`.
    ///
    /// # Errors
    /// [`FileError::Write`] if writing fails, [`FileError::Json`] if the value has no JSON form.
    pub fn write_json<T: Serialize>(&self, name: &str, value: &T) -> Result<(), FileError> {
        let mut text = serde_json::to_vec_pretty(value).map_err(|source| FileError::Json { path: self.file(name), source })?;
        text.push(b'\n');
        self.write(name, &text)
    }

    /// Writes `summary.json`.
    ///
    /// # Errors
    /// See [`OutDir::write_json`].
    pub fn write_summary<T: Serialize>(&self, summary: &T) -> Result<(), FileError> {
        self.write_json("summary.json", summary)
    }
}

/// The highest number with which the name of an entry of `base` starts; 0 if there is none.
fn highest_number(base: &Path) -> io::Result<u64> {
    let mut highest = 0;
    for entry in fs::read_dir(base)? {
        let name = entry?.file_name();
        let name = name.to_string_lossy();
        let digits = name.split(|c: char| !c.is_ascii_digit()).next().unwrap_or_default();
        // Longer numbers come from other naming schemes, such as dates, and should not be continued.
        if digits.len() <= 6 {
            highest = highest.max(digits.parse().unwrap_or(0));
        }
    }
    Ok(highest)
}

/// The words of `hint`, in lower case, joined by hyphens, at most 40 characters.
fn slug(hint: &str) -> String {
    let mut slug = String::new();
    for word in hint.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty()) {
        let word = word.to_lowercase();
        let room = 40 - slug.chars().count().min(40);
        if slug.is_empty() {
            slug.extend(word.chars().take(room));
        } else if word.chars().count() < room {
            slug.push('-');
            slug.push_str(&word);
        } else {
            break;
        }
    }
    slug
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slugs_are_short_and_plain() {
        assert_eq!(slug("Take off, and fly to the red crane!"), "take-off-and-fly-to-the-red-crane");
        assert_eq!(slug("  ../../etc/passwd "), "etc-passwd");
        assert_eq!(slug("Flieg zum großen Kran"), "flieg-zum-großen-kran");
        assert_eq!(slug(&"word ".repeat(50)).len(), 39);
        assert_eq!(slug(&"x".repeat(99)).len(), 40);
        assert_eq!(slug("…"), "");
    }

    #[test]
    fn folders_are_numbered_on() {
        let base = tempfile::tempdir().unwrap();
        let first = OutDir::fresh(base.path(), "to the crane").unwrap();
        assert!(first.path().ends_with("001-to-the-crane"));
        fs::create_dir(base.path().join("041-x")).unwrap();
        fs::create_dir(base.path().join("20261121")).unwrap();
        assert!(OutDir::fresh(base.path(), "").unwrap().path().ends_with("042"));
    }

    #[test]
    fn simultaneous_runs_never_share_a_folder() {
        let base = tempfile::tempdir().unwrap();
        let paths: Vec<_> = std::thread::scope(|scope| {
            let runs: Vec<_> = (0..16).map(|_| scope.spawn(|| OutDir::fresh(base.path(), "same").unwrap())).collect();
            runs.into_iter().map(|run| run.join().unwrap().path).collect()
        });
        let different: std::collections::BTreeSet<_> = paths.iter().collect();
        assert_eq!(different.len(), 16, "{paths:?}");

        let named = base.path().join("named");
        let taken = std::thread::scope(|scope| {
            let runs: Vec<_> = (0..16).map(|_| scope.spawn(|| OutDir::at(&named).is_ok())).collect();
            runs.into_iter().filter_map(|run| run.join().unwrap().then_some(())).count()
        });
        assert_eq!(taken, 1);
    }

    #[test]
    fn a_folder_with_files_is_refused() {
        let base = tempfile::tempdir().unwrap();
        fs::write(base.path().join("letter.txt"), "mine").unwrap();
        let error = OutDir::create(Some(base.path()), "").unwrap_err().to_string();
        assert!(error.contains("is not empty"), "{error}");
        let error = OutDir::at(&base.path().join("letter.txt")).unwrap_err();
        assert!(matches!(error, OutDirError::Folder { .. }), "{error}");
    }

    #[test]
    fn a_summary_is_indented_ordered_and_leaves_no_part_behind() {
        #[derive(Serialize)]
        struct Summary {
            outcome: &'static str,
            final_distance_m: f64,
            collisions: u32,
        }
        let base = tempfile::tempdir().unwrap();
        let out = OutDir::fresh(base.path(), "x").unwrap();
        out.write_summary(&Summary { outcome: "reached", final_distance_m: f64::NAN, collisions: 0 }).unwrap();
        let text = fs::read_to_string(out.file("summary.json")).unwrap();
        assert_eq!(text, "{\n  \"outcome\": \"reached\",\n  \"final_distance_m\": null,\n  \"collisions\": 0\n}\n");
        assert_eq!(fs::read_dir(out.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_file_that_cannot_be_written_is_named() {
        let base = tempfile::tempdir().unwrap();
        let out = OutDir::fresh(base.path(), "x").unwrap();
        fs::create_dir(out.file("summary.json")).unwrap();
        let error = out.write_summary(&1).unwrap_err().to_string();
        assert!(error.contains("summary.json"), "{error}");
        assert_eq!(fs::read_dir(out.path()).unwrap().count(), 1, "the part is removed");
    }
}

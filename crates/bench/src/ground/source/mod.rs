//! Datasets: folders of images with ground truth (docs/guide/grounding.md, "Datasets").

mod coco;
mod layouts;
mod plain;
mod sim;

use std::collections::BTreeSet;
use std::io::Read;
use std::path::{Path, PathBuf};

use spf_core::query::{ImageBox, ImagePoint};

use super::truth::{Mask, TruthError};
use super::{Item, Shape, Truth, photo};
use crate::fnv;
pub use sim::SimExample;

/// Maximum size of a file of rows, bytes.
const LONGEST: u64 = 512 << 20;

/// Why a dataset cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SourceError {
    /// A file could not be read.
    #[error("cannot read `{}`", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The cause.
        #[source]
        source: std::io::Error,
    },
    /// Unknown format.
    #[error("no dataset in a known format in `{}`", path.display())]
    Unknown {
        /// The path.
        path: PathBuf,
    },
    /// A file of a known format is invalid.
    #[error("`{}`{}: {what}", path.display(), row.map_or(String::new(), |row| format!(", row {row}")))]
    Form {
        /// The file.
        path: PathBuf,
        /// Its row or entry, from 1.
        row: Option<usize>,
        /// What is wrong.
        what: String,
    },
}

/// A dataset of images with instructions.
#[derive(Clone, Debug)]
pub struct Source {
    /// Its format, in words.
    pub form: &'static str,
    /// Its items, in order.
    pub items: Vec<Item>,
    /// Digest of the annotation files (FNV-1a, 64 bits): for distinguishing datasets, not for security.
    pub digest: u64,
}

/// Reads a dataset: a folder, or its file that lists the images.
///
/// # Errors
/// [`SourceError`] if it cannot be read or its format is unknown.
pub fn open(path: &Path) -> Result<Source, SourceError> {
    let file = if path.is_dir() { find(path)? } else { path.to_owned() };
    let folder = file.parent().unwrap_or(Path::new("")).to_owned();
    let text = read(&file)?;
    let mut content = text.clone();
    let (form, items) = if file.file_name().is_some_and(|name| name == "dataset.json") {
        let rows = read(&folder.join("examples.jsonl"))?;
        content.push_str(&rows);
        ("a dataset of `spf sim dataset`", sim::items(&folder, &text, &rows)?)
    } else if file.extension().is_some_and(|end| end == "jsonl") {
        ("images with a JSONL of targets", plain::items(&folder, &file, &text)?)
    } else {
        let value: serde_json::Value = serde_json::from_str(&text).map_err(|error| form(&file, None, error.to_string()))?;
        if value.get("annotations").is_some() {
            ("COCO", coco::items(&folder, &file, &value)?)
        } else {
            layouts::items(&folder, &file, &value)?
        }
    };
    let mut keys = BTreeSet::new();
    if let Some((row, twice)) = items.iter().enumerate().find(|(_, item)| !keys.insert(item.key.as_str())) {
        return Err(self::form(&file, Some(row + 1), format!("duplicate id `{}`", twice.key)));
    }
    if items.is_empty() {
        Err(form_of(&file, "it is empty"))
    } else {
        Ok(Source { form, items, digest: fnv(content.as_bytes()) })
    }
}

impl Source {
    /// Reads every mask, so that every question can be graded.
    ///
    /// # Errors
    /// [`TruthError`] for the first mask that cannot be read or is empty.
    pub fn check_masks(&self) -> Result<(), TruthError> {
        let targets =
            self.items.iter().filter_map(|item| if let Truth::Target(target) = &item.truth { Some(target) } else { None });
        let files = targets.filter_map(|target| if let Shape::MaskFile(path) = &target.shape { Some(path) } else { None });
        files.into_iter().try_for_each(|path| Mask::read(path).map(drop))
    }
}

/// The file that lists the images of a folder.
fn find(folder: &Path) -> Result<PathBuf, SourceError> {
    for name in ["dataset.json", "question.json", "data.json"] {
        if folder.join(name).is_file() {
            return Ok(folder.join(name));
        }
    }
    let entries = std::fs::read_dir(folder).map_err(|source| SourceError::Read { path: folder.to_owned(), source })?;
    let mut files: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    files.sort();
    let of = |end: &str| files.iter().find(|file| file.extension().is_some_and(|found| found == end)).cloned();
    of("jsonl").or_else(|| of("json")).ok_or_else(|| SourceError::Unknown { path: folder.to_owned() })
}

fn read(path: &Path) -> Result<String, SourceError> {
    let wrong = |source| SourceError::Read { path: path.to_owned(), source };
    let mut text = String::new();
    spf_input::open(path).map_err(wrong)?.take(LONGEST).read_to_string(&mut text).map_err(wrong)?;
    Ok(text)
}

fn form(path: &Path, row: Option<usize>, what: impl Into<String>) -> SourceError {
    SourceError::Form { path: path.to_owned(), row, what: what.into() }
}

fn form_of(path: &Path, what: &str) -> SourceError {
    form(path, None, what)
}

/// A file named in a dataset, beside it or in one of the usual folders. Names that lead out of the folder are rejected,
/// since datasets come from others.
fn beside(folder: &Path, name: &str, folders: &[&str]) -> Option<PathBuf> {
    let relative = Path::new(name);
    if !stays(name) {
        return None;
    }
    let places = std::iter::once(folder.join(relative)).chain(folders.iter().map(|inner| folder.join(inner).join(relative)));
    places.into_iter().find(|path| path.is_file())
}

/// Whether a relative name stays inside the folder it is joined to.
fn stays(name: &str) -> bool {
    Path::new(name).components().all(|part| matches!(part, std::path::Component::Normal(_) | std::path::Component::CurDir))
}

/// Turns pixels into fractions of an image.
#[derive(Clone, Copy, Debug)]
struct Pixels {
    width: f64,
    height: f64,
}

impl Pixels {
    fn of(image: &Path) -> Result<Self, photo::PhotoError> {
        photo::size(image).map(|(width, height)| Self { width: f64::from(width.max(1)), height: f64::from(height.max(1)) })
    }

    const FRACTIONS: Self = Self { width: 1.0, height: 1.0 };

    fn point(self, [x, y]: [f64; 2]) -> ImagePoint {
        ImagePoint { u: x / self.width, v: y / self.height }
    }

    fn area(self, [x0, y0, x1, y1]: [f64; 4]) -> ImageBox {
        let (a, b) = (self.point([x0.min(x1), y0.min(y1)]), self.point([x0.max(x1), y0.max(y1)]));
        ImageBox { left: a.u, top: a.v, right: b.u, bottom: b.v }
    }
}

//! Recordings of replies, and their playback: the same flight, bit for bit, without a model.
//!
//! A recording is a JSON Lines file: a header, then one line per query. It contains no keys and no images. A server
//! given by its address is named by that address.

use std::collections::VecDeque;
use std::fs::File;
use std::hash::Hasher as _;
use std::io::{BufRead, BufReader, BufWriter, Write};
use std::path::Path;

use fnv::FnvHasher;
use serde::{Deserialize, Serialize};
use spf_core::query::QueryId;
use spf_core::time::Duration;

use crate::{Answer, ImageSpec, QueryImage, QueryRequest, Usage, Vlm, VlmError};

/// Version of the recording format.
const FORMAT: u32 = 1;
/// Maximum length of a line, bytes: a reply of 64 KiB and a long prompt, escaped.
const LONGEST_LINE: u64 = 1 << 20;
/// Maximum number of queries in a recording.
const MOST_ROWS: usize = 1_000_000;

/// Header of a recording.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Head {
    spf_recording: u32,
    /// The VLM, as named on the command line.
    vlm: String,
    #[serde(flatten)]
    image_spec: ImageSpec,
}

/// A query and its reply.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Row {
    query: QueryId,
    /// Digest of the prompt: a different query must not get this reply.
    prompt_fnv1a: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    text: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    error: Option<RecordedError>,
    latency_ns: u64,
    model: String,
    account: Usage,
}

/// An error, by code and message.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct RecordedError {
    code: String,
    message: String,
}

/// Why a recording cannot be written or read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CassetteError {
    /// Reading or writing the file failed.
    #[error("cannot open the recording")]
    File(#[from] std::io::Error),
    /// The file could not be created.
    #[error("cannot create the recording `{path}`; existing files are not overwritten")]
    Create {
        /// Its path.
        path: std::path::PathBuf,
        /// The cause.
        #[source]
        source: std::io::Error,
    },
    /// An invalid line.
    #[error("invalid line {line} of the recording: {reason}")]
    Line {
        /// Line number.
        line: usize,
        /// What is wrong with it.
        reason: String,
    },
}

/// Records the replies of another VLM.
pub struct Recording {
    vlm: Box<dyn Vlm>,
    /// `None` once it could not be written to.
    file: Option<BufWriter<File>>,
}

impl Recording {
    /// Records the replies of `vlm`, for a camera with images of this size, in a new file.
    ///
    /// # Errors
    /// [`CassetteError::Create`] if it cannot be created; an existing file is not overwritten.
    pub fn new(vlm: Box<dyn Vlm>, path: &Path, camera: (u32, u32)) -> Result<Self, CassetteError> {
        let made = File::create_new(path).map_err(|source| CassetteError::Create { path: path.to_owned(), source })?;
        let mut file = BufWriter::new(made);
        let image_spec = vlm.image_spec(camera);
        write_line(&mut file, &Head { spf_recording: FORMAT, vlm: vlm.name().to_owned(), image_spec })?;
        Ok(Self { vlm, file: Some(file) })
    }
}

fn write_line(file: &mut BufWriter<File>, line: &impl Serialize) -> std::io::Result<()> {
    serde_json::to_writer(&mut *file, line)?;
    file.write_all(b"\n")?;
    file.flush()
}

impl Vlm for Recording {
    fn name(&self) -> &str {
        self.vlm.name()
    }

    fn image_spec(&self, camera: (u32, u32)) -> ImageSpec {
        self.vlm.image_spec(camera)
    }

    fn temperature(&self) -> Option<f64> {
        self.vlm.temperature()
    }

    fn answer(&mut self, request: &QueryRequest<'_>, image: &mut dyn QueryImage) -> Answer {
        let answer = self.vlm.answer(request, image);
        let recorded = |error: &VlmError| RecordedError { code: error.code().to_owned(), message: error.to_string() };
        let row = Row {
            query: request.query.id,
            prompt_fnv1a: digest(&request.query.prompt),
            text: answer.text.as_ref().ok().cloned(),
            error: answer.text.as_ref().err().map(recorded),
            latency_ns: u64::try_from(answer.latency.as_nanos()).unwrap_or(u64::MAX),
            model: answer.model.clone(),
            account: answer.account.clone(),
        };
        // A full disk ends the recording, not the flight.
        if let Some(Err(error)) = self.file.as_mut().map(|file| write_line(file, &row)) {
            tracing::warn!(%error, "the recording of VLM replies ends here");
            self.file = None;
        }
        answer
    }
}

/// Plays recorded replies.
#[derive(Clone, Debug)]
pub struct Replay {
    head: Head,
    rows: VecDeque<Row>,
}

impl Replay {
    /// Opens a recording.
    ///
    /// # Errors
    /// [`CassetteError`] if it cannot be read.
    pub fn open(path: &Path) -> Result<Self, CassetteError> {
        Self::read(BufReader::new(spf_input::open(path)?))
    }

    /// Reads a recording from any source.
    ///
    /// # Errors
    /// [`CassetteError`] if it cannot be read.
    pub fn read(mut lines: impl BufRead) -> Result<Self, CassetteError> {
        let head: Head = read_line(&mut lines, 1)?.ok_or_else(|| wrong(1, "empty file"))?;
        if head.spf_recording != FORMAT {
            return Err(wrong(1, format!("unsupported format {}; expected {FORMAT}", head.spf_recording)));
        }
        let mut rows = VecDeque::new();
        while let Some(row) = read_line(&mut lines, rows.len() + 2)? {
            if rows.len() == MOST_ROWS {
                return Err(wrong(rows.len() + 2, format!("more than {MOST_ROWS} replies")));
            }
            rows.push_back(row);
        }
        Ok(Self { head, rows })
    }
}

fn wrong(line: usize, reason: impl Into<String>) -> CassetteError {
    CassetteError::Line { line, reason: reason.into() }
}

fn read_line<T: for<'a> Deserialize<'a>>(lines: &mut impl BufRead, line: usize) -> Result<Option<T>, CassetteError> {
    let mut text = Vec::new();
    std::io::Read::take(&mut *lines, LONGEST_LINE).read_until(b'\n', &mut text)?;
    if text.is_empty() {
        return Ok(None);
    }
    serde_json::from_slice(&text).map(Some).map_err(|error| wrong(line, error.to_string()))
}

impl Vlm for Replay {
    fn name(&self) -> &str {
        &self.head.vlm
    }

    fn image_spec(&self, _camera: (u32, u32)) -> ImageSpec {
        self.head.image_spec
    }

    fn answer(&mut self, request: &QueryRequest<'_>, _image: &mut dyn QueryImage) -> Answer {
        let query = request.query;
        let refused = |reason: String| Answer {
            text: Err(VlmError::Replay(reason)),
            latency: Duration::ZERO,
            model: String::new(),
            account: Usage::default(),
        };
        let Some(row) = self.rows.pop_front() else {
            return refused(format!("it ends before query {}", query.id.0));
        };
        if row.query != query.id || row.prompt_fnv1a != digest(&query.prompt) {
            return refused(format!(
                "query {} differs from the recorded one: the recording is of a different flight",
                query.id.0
            ));
        }
        let text = match (row.text, row.error) {
            (Some(text), _) => Ok(text),
            (None, Some(RecordedError { code, message })) => Err(VlmError::Recorded { code, message }),
            (None, None) => Err(VlmError::Replay(format!("query {} has neither text nor error", query.id.0))),
        };
        Answer { text, latency: Duration::from_nanos(row.latency_ns), model: row.model, account: row.account }
    }
}

/// FNV-1a, 64 bits, in hexadecimal.
fn digest(text: &str) -> String {
    let mut hasher = FnvHasher::default();
    hasher.write(text.as_bytes());
    format!("{:016x}", hasher.finish())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn digests_by_the_reference() {
        // The empty text gives the offset basis; the value for "a" is from the FNV reference.
        assert_eq!((digest("").as_str(), digest("a").as_str()), ("cbf29ce484222325", "af63dc4c8601ec8c"));
    }

    #[test]
    fn other_files_are_refused_by_line() {
        let refused = |text: &str| Replay::read(text.as_bytes()).unwrap_err().to_string();
        let (vlm, image_spec) = ("gemini".to_owned(), ImageSpec::default());
        let head = serde_json::to_string(&Head { spf_recording: 1, vlm, image_spec }).unwrap();
        assert!(Replay::read(head.as_bytes()).is_ok());
        assert!(refused("").contains("line 1"));
        assert!(refused(&format!("{head}\n{{\"query\":0")).contains("line 2"));
        assert!(refused(&head.replace("\"spf_recording\":1", "\"spf_recording\":2")).contains("expected 1"));
    }

    proptest! {
        #[test]
        fn no_bytes_panic(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
            let _ = Replay::read(bytes.as_slice());
        }
    }
}

//! A log of a flight made to be sent to somebody else, and read by them (docs/reference/flight-log.md).
//!
//! A shared log is a flight log like any other: every reader of logs reads it, and its flight's head carries a [`SharedMark`] that
//! says what was left out. What is known to be harmless is kept; all else is not (`redact`). Its positions are metres from where
//! the craft started, as in every log: no global position was ever in it.
//!
//! [`share`] makes one, [`check`] reads one and decides again.

mod free_text;
mod mark;
mod redact;

pub use mark::{LEFT_OUT, LeftOut, Pictures, SharedMark, SourceEnd};
pub(crate) use redact::Redactor;

use std::collections::BTreeMap;
use std::io::Write;

use bytes::Bytes;
use spf_core::time::Time;
use spf_media::jpeg::{Jpeg, decode_within};
use spf_record::log::{Entry, Message, ReadError, Rewrite, WholeLog, foxglove};

use crate::log::{Channel, FlightHeader, topics};
use crate::replay::{Changes, Replay, ReplayError, Report, head, of_truncated, row};

/// Quality of the images of a shared log, and the most pixels that one of a flight log has.
const QUALITY: u8 = 85;
const PIXELS: u64 = 4096 * 4096;

/// Why a log could not be shared, or a shared one not be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ShareError {
    /// The flight's log cannot be read, or is none of a flight.
    #[error(transparent)]
    Log(#[from] ReplayError),
    /// A message of the log does not have the format of its topic.
    #[error("cannot parse message {sequence} on `{topic}`")]
    Message {
        /// The topic.
        topic: String,
        /// Sequence number of the message.
        sequence: u32,
    },
    /// The log was made to be shared already.
    #[error("the log was shared before: send it as it is")]
    Already,
    /// The shared log could not be written.
    #[error("cannot write the shared log")]
    Write(#[source] std::io::Error),
    /// The shared log could not be encoded.
    #[error("cannot encode the shared log")]
    Form(#[source] Box<dyn std::error::Error + Send + Sync>),
    /// A log that was not made to be shared.
    #[error("the log was not made by `spf log share`")]
    NotShared,
    /// A shared log that lacks its end.
    #[error("the file is truncated: a part of it did not arrive")]
    Torn,
}

impl From<ReadError> for ShareError {
    fn from(error: ReadError) -> Self {
        Self::Log(error.into())
    }
}

impl From<Rewrite> for ShareError {
    fn from(error: Rewrite) -> Self {
        match error {
            Rewrite::Write(error) => Self::Write(error),
            Rewrite::Form(error) => Self::Form(error.into()),
        }
    }
}

/// What was shared.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Shared {
    /// The mark of the log.
    pub mark: SharedMark,
    /// Number of messages that were kept, by topic.
    pub kept: BTreeMap<String, u64>,
    /// Number of messages that were left out, by topic.
    pub dropped: BTreeMap<String, u64>,
}

/// Writes to `copy` what may be shared of a log, which `read` opens from its start as often as it is asked.
///
/// `known` are words that this computer is known by, such as the user's name and the keys of vendors: they are left out of every
/// text. Images are decoded and encoded again, so that nothing but their pixels is in them.
///
/// # Errors
/// [`ShareError`] if the log cannot be read from its start or has a damaged message, or if the copy cannot be written. A truncated
/// log is shared as far as it goes, and the [mark](SharedMark::source) says so.
pub fn share<W, R>(
    read: impl Fn() -> Result<R, ReadError>,
    copy: W,
    pictures: Pictures,
    known: &[String],
) -> Result<(Shared, W), ShareError>
where
    W: Write,
    R: IntoIterator<Item = Result<Entry, ReadError>>,
{
    // Once to find what is left out, which the head tells, and once to write.
    let mut found = Selection::begin(read()?.into_iter(), known)?;
    let mut source = SourceEnd::Whole;
    for entry in read()?.into_iter().skip(1) {
        match entry {
            Ok(entry) => _ = found.message(&entry, Pictures::LeftOut)?,
            Err(ReadError::Torn) => source = SourceEnd::Truncated,
            Err(error) => return Err(error.into()),
        }
    }
    let mut left_out = found.redactor.left_out().clone();
    left_out.insert(LeftOut::Clock);
    if pictures == Pictures::LeftOut && found.dropped.contains_key(Channel::Image.name()) {
        left_out.insert(LeftOut::Pictures);
    }
    let mark = SharedMark { by: env!("CARGO_PKG_VERSION").to_owned(), source, left_out };

    let mut selection = Selection::begin(read()?.into_iter(), known)?;
    let mut log = WholeLog::create(copy, &topics())?;
    let head = FlightHeader { shared: Some(mark.clone()), ..selection.head.clone() };
    let head = serde_json::to_vec(&head).map_err(|error| ShareError::Form(error.into()))?;
    let head = selection.redactor.row(Channel::Flight, &head).ok_or(ReplayError::NoHead)?;
    log.push(&Message { topic: Channel::Flight as usize, time: Time::ZERO, data: head })?;
    for entry in read()?.into_iter().skip(1) {
        let Ok(entry) = entry else { break };
        if let Some(message) = selection.message(&entry, pictures)? {
            log.push(&message)?;
        }
    }
    let Selection { mut kept, dropped, .. } = selection;
    *kept.entry(Channel::Flight.name().to_owned()).or_default() += 1;
    Ok((Shared { mark, kept, dropped }, log.finish()?))
}

/// The messages of a log that may be shared.
struct Selection {
    head: FlightHeader,
    redactor: Redactor,
    kept: BTreeMap<String, u64>,
    dropped: BTreeMap<String, u64>,
}

impl Selection {
    fn begin(mut entries: impl Iterator<Item = Result<Entry, ReadError>>, known: &[String]) -> Result<Self, ShareError> {
        let head = head(&mut entries)?;
        if head.shared.is_some() {
            return Err(ShareError::Already);
        }
        let mut redactor = Redactor::new(&head, known.to_vec());
        let row = serde_json::to_vec(&head).map_err(|error| ShareError::Form(error.into()))?;
        redactor.row(Channel::Flight, &row);
        Ok(Self { head, redactor, kept: BTreeMap::new(), dropped: BTreeMap::new() })
    }

    /// What may be shared of a message, if any of it may.
    fn message(&mut self, entry: &Entry, pictures: Pictures) -> Result<Option<Message>, ShareError> {
        let channel = Channel::of_topic(&entry.topic);
        let data = match channel {
            Some(channel) => self.data(channel, entry, pictures)?,
            None => {
                self.redactor.note(LeftOut::Unknown);
                None
            }
        };
        let count = if data.is_some() { &mut self.kept } else { &mut self.dropped };
        *count.entry(entry.topic.clone()).or_default() += 1;
        let message = |(channel, data): (Channel, Bytes)| Message { topic: channel as usize, time: entry.time, data };
        Ok(channel.zip(data).map(message))
    }

    fn data(&mut self, channel: Channel, entry: &Entry, pictures: Pictures) -> Result<Option<Bytes>, ShareError> {
        Ok(match channel {
            Channel::Image => match pictures {
                Pictures::Kept => foxglove::image_again(&entry.data, encoded_again),
                Pictures::LeftOut => None,
            },
            Channel::Annotations | Channel::Scene | Channel::Map | Channel::Log => {
                self.redactor.note(LeftOut::ForViewers);
                None
            }
            Channel::Calibration
            | Channel::Transforms
            | Channel::PoseKnown
            | Channel::PoseTrue
            | Channel::Plan
            | Channel::Path => {
                let data = foxglove::numbers_only(&entry.schema, &entry.data);
                if data.is_none() {
                    self.redactor.note(LeftOut::Unknown);
                }
                data
            }
            Channel::Flight
            | Channel::Wake
            | Channel::Telemetry
            | Channel::Frame
            | Channel::Depth
            | Channel::Ranges
            | Channel::Gimbal
            | Channel::Track
            | Channel::Reply
            | Channel::Operator
            | Channel::Link
            | Channel::Gap
            | Channel::Query
            | Channel::Cancel
            | Channel::TrackStart
            | Channel::Command
            | Channel::Decision
            | Channel::Note
            | Channel::Finished
            | Channel::Truth
            | Channel::PoseDeviation
            | Channel::Summary => {
                let damaged = || ShareError::Message { topic: entry.topic.clone(), sequence: entry.sequence };
                Some(self.redactor.row(channel, &entry.data).ok_or_else(damaged)?)
            }
        })
    }
}

/// The same image without whatever else its file has: a camera's name, a place, a thumbnail.
fn encoded_again(jpeg: &[u8]) -> Option<Bytes> {
    let image = decode_within(jpeg, PIXELS).ok()?;
    Jpeg::encode(&image, QUALITY).ok().map(|jpeg| Bytes::copy_from_slice(jpeg.bytes()))
}

/// A shared log that was read to its end.
#[derive(Clone, Debug)]
pub struct Opened {
    /// The flight's head.
    pub head: FlightHeader,
    /// Its mark.
    pub mark: SharedMark,
    /// Number of messages.
    pub messages: u64,
    /// Number of images.
    pub pictures: u64,
    /// The summary of the flight; `None` if the flight's own log had lost it.
    pub summary: Option<crate::summary::Summary>,
    /// The lines of `decisions.jsonl`.
    pub decisions: Vec<Bytes>,
    /// The pilot's decisions made again, compared with those of the flight.
    pub report: Report,
    /// Where that had to end, because the disk was too slow for the messages after it; `None` if it did not.
    pub gap: Option<Time>,
}

/// Reads a shared log to its end, and makes the pilot's decisions again.
///
/// # Errors
/// [`ShareError::NotShared`] for another log, [`ShareError::Torn`] for a file that lacks its end, and [`ShareError::Log`].
pub fn check(entries: impl IntoIterator<Item = Result<Entry, ReadError>>) -> Result<Opened, ShareError> {
    let torn = |error| match error {
        ReplayError::Read(ReadError::Torn) => ShareError::Torn,
        error => ShareError::Log(error),
    };
    let mut entries = entries.into_iter();
    let head = head(&mut entries).map_err(torn)?;
    let mark = head.shared.clone().ok_or(ShareError::NotShared)?;
    let mut replay = Replay::new(&head, &Changes::default())?;
    let (mut messages, mut pictures, mut summary, mut decisions, mut gap) = (1, 0, None, Vec::new(), None);
    for entry in entries {
        let entry = entry.map_err(|error| torn(error.into()))?;
        messages += 1;
        match Channel::of_topic(&entry.topic) {
            Some(Channel::Image) => pictures += 1,
            Some(Channel::Summary) => summary = Some(row(&entry)?),
            Some(Channel::Decision) => decisions.push(entry.data.clone()),
            _ => {}
        }
        if gap.is_none() {
            match replay.take(&entry) {
                Err(ReplayError::Gap(at)) => gap = Some(at),
                taken => taken?,
            }
        }
    }
    let report = replay.end(of_truncated(&head) || gap.is_some());
    Ok(Opened { head, mark, messages, pictures, summary, decisions, report, gap })
}

//! Replays a flight from its log: the pilot gets the recorded inputs at their recorded times, and its outputs are
//! compared with the recorded ones.
//!
//! No craft is flown and no VLM is queried. Parsing, projection, policy, executor and envelope run as in flight, so a
//! log is a regression test for all of them.

use std::collections::BTreeMap;
use std::sync::Arc;

use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;
use spf_core::grounding::GroundingProfile;
use spf_core::prompt::{PromptError, PromptText};
use spf_core::time::Time;
use spf_pilot::{Event, Pilot, PilotSettings};
use spf_record::log::{Entry, ReadError};

use crate::log::{Channel, FlightHeader, LinkNews, LinkRow, OperatorRow, ReplyRow, output};
use crate::pilot::pilot;
use crate::policy::PolicyKind;
use crate::share::{LEFT_OUT, Redactor, SourceEnd};

/// Why a log cannot be replayed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReplayError {
    /// The file cannot be read from its start.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// It does not start with a flight's head.
    #[error("the log does not begin with a header on `/flight`")]
    NoHead,
    /// A message does not match its topic's format.
    #[error("cannot parse message {sequence} on `{topic}`")]
    Message {
        /// The topic.
        topic: String,
        /// Sequence number of the message.
        sequence: u32,
        /// The parse error.
        #[source]
        source: serde_json::Error,
    },
    /// A policy unknown to this version.
    #[error("unknown policy `{0}`")]
    Policy(String),
    /// The prompt in the head is invalid.
    #[error("cannot parse the prompt in the log")]
    Prompt(#[from] PromptError),
    /// Messages were dropped at this time because the disk was too slow.
    #[error("messages are missing at {0}, because the disk was too slow: cannot replay beyond that point")]
    Gap(Time),
}

/// Changes to the method, to see their effect.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Changes {
    /// Replacement settings.
    pub settings: Option<PilotSettings>,
    /// Replacement coordinate convention for parsing replies.
    pub grounding: Option<GroundingProfile>,
}

/// A difference between recorded and replayed outputs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Difference {
    /// Flight time, seconds.
    pub time_s: f64,
    /// The topic.
    pub topic: &'static str,
    /// Position in the message (a JSON pointer); empty if one of the messages is missing.
    pub at: String,
    /// The recorded value.
    pub recorded: Option<Value>,
    /// The replayed value.
    pub replayed: Option<Value>,
    /// Number of further differences between the two messages.
    pub more: usize,
}

/// The result of a replay.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Report {
    /// Number of inputs, including wake-ups.
    pub inputs: u64,
    /// Number of recorded outputs compared.
    pub outputs: u64,
    /// Whether the log ends before the flight does.
    pub torn: bool,
    /// Every difference, or as many as were to be kept.
    pub differences: Vec<Difference>,
    /// Number of differences that were not kept.
    #[serde(skip_serializing_if = "is_zero")]
    pub unkept: u64,
}

/// Replays a log entry by entry. Memory use grows only with the differences.
///
/// # Errors
/// [`ReplayError`]. A truncated log is replayed as far as it goes.
pub fn replay(entries: impl IntoIterator<Item = Result<Entry, ReadError>>, changes: &Changes) -> Result<Report, ReplayError> {
    replay_keeping(entries, changes, usize::MAX)
}

/// The same, keeping this many differences; the others are counted, and memory use is bounded.
///
/// # Errors
/// As [`replay`].
pub fn replay_keeping(
    entries: impl IntoIterator<Item = Result<Entry, ReadError>>,
    changes: &Changes,
    most: usize,
) -> Result<Report, ReplayError> {
    let mut entries = entries.into_iter();
    let head = head(&mut entries)?;
    let mut replay = Replay { most, ..Replay::new(&head, changes)? };
    for entry in entries {
        let entry = match entry {
            Ok(entry) => entry,
            Err(ReadError::Torn) => return Ok(replay.end(true)),
            Err(error) => return Err(error.into()),
        };
        replay.take(&entry)?;
    }
    Ok(replay.end(of_truncated(&head)))
}

/// The flight's head, which is the first message of a log.
///
/// # Errors
/// [`ReplayError::NoHead`], or an error while reading.
pub fn head(entries: &mut impl Iterator<Item = Result<Entry, ReadError>>) -> Result<FlightHeader, ReplayError> {
    let first = entries.next().ok_or(ReplayError::NoHead)??;
    if first.topic != Channel::Flight.name() {
        return Err(ReplayError::NoHead);
    }
    row(&first)
}

/// The prompt of a flight: its own, or the built-in one, which also stands for one that a shared log leaves out: no policy reads a
/// prompt, and a shared log does not compare the texts made of it.
///
/// # Errors
/// [`ReplayError::Prompt`] if the recorded prompt is invalid.
pub fn prompt_of(head: &FlightHeader, policy: PolicyKind) -> Result<Arc<PromptText>, ReplayError> {
    Ok(match &head.prompt {
        Some(file) if file != LEFT_OUT => Arc::new(PromptText::parse(file)?),
        _ => PromptText::shipped(policy.prompt()),
    })
}

/// Parses a message in one of our own formats.
///
/// # Errors
/// [`ReplayError::Message`] if it does not match.
pub fn row<T: DeserializeOwned>(entry: &Entry) -> Result<T, ReplayError> {
    serde_json::from_slice(&entry.data).map_err(|source| ReplayError::Message {
        topic: entry.topic.clone(),
        sequence: entry.sequence,
        source,
    })
}

/// Messages by channel, in order.
type Outputs = BTreeMap<Channel, Vec<Vec<u8>>>;

/// Whether a log made to be shared was made of a truncated one.
pub(crate) fn of_truncated(head: &FlightHeader) -> bool {
    head.shared.as_ref().is_some_and(|mark| mark.source == SourceEnd::Truncated)
}

/// A pilot being replayed.
pub(crate) struct Replay {
    pilot: Pilot,
    /// Of a log made to be shared, what it leaves out is left out of the replayed outputs too.
    redactor: Option<Redactor>,
    now: Time,
    /// Outputs since the last input, replayed and recorded.
    replayed: Outputs,
    recorded: Outputs,
    report: Report,
    /// Number of differences to keep.
    most: usize,
}

fn is_zero(count: &u64) -> bool {
    *count == 0
}

impl Replay {
    pub(crate) fn new(head: &FlightHeader, changes: &Changes) -> Result<Self, ReplayError> {
        let policy = PolicyKind::of_name(&head.policy).ok_or_else(|| ReplayError::Policy(head.policy.clone()))?;
        let changed = FlightHeader {
            settings: changes.settings.unwrap_or(head.settings),
            grounding: changes.grounding.unwrap_or(head.grounding),
            ..head.clone()
        };
        let pilot = pilot(&changed, &policy, prompt_of(head, policy)?);
        let (replayed, recorded) = (Outputs::new(), Outputs::new());
        let redactor = head.shared.as_ref().map(|_| Redactor::new(head, Vec::new()));
        let report = Report::default();
        let mut replay = Self { pilot, redactor, now: Time::ZERO, replayed, recorded, report, most: usize::MAX };
        replay.poll();
        Ok(replay)
    }

    pub(crate) fn take(&mut self, entry: &Entry) -> Result<(), ReplayError> {
        let Some(channel) = Channel::of_topic(&entry.topic) else { return Ok(()) };
        if channel == Channel::Gap {
            return Err(ReplayError::Gap(entry.time));
        }
        if channel.is_output() {
            self.report.outputs += 1;
            let recorded = self.told(channel, &entry.data);
            self.recorded.entry(channel).or_default().push(recorded);
        } else if channel.is_input() {
            let event = event(channel, entry)?;
            self.compare();
            self.report.inputs += 1;
            self.now = entry.time;
            if let Some(event) = event {
                self.pilot.handle(self.now, event);
            }
            self.poll();
        }
        Ok(())
    }

    /// Collects all current actions of the pilot.
    fn poll(&mut self) {
        while let Some(action) = self.pilot.poll(self.now) {
            if let Some((channel, data)) = output(&action, &self.pilot) {
                let replayed = self.told(channel, &data);
                self.replayed.entry(channel).or_default().push(replayed);
            }
        }
    }

    /// An output as the log tells it.
    fn told(&mut self, channel: Channel, data: &[u8]) -> Vec<u8> {
        let shared = self.redactor.as_mut().and_then(|redactor| redactor.row(channel, data));
        shared.map_or_else(|| data.to_vec(), |shared| shared.to_vec())
    }

    /// Compares the outputs between two inputs, topic by topic.
    fn compare(&mut self) {
        let (replayed, recorded) = (core::mem::take(&mut self.replayed), core::mem::take(&mut self.recorded));
        let channels = replayed.keys().chain(recorded.keys()).copied().collect::<std::collections::BTreeSet<_>>();
        for channel in channels {
            let of = |outputs: &Outputs, index: usize| outputs.get(&channel).and_then(|list| list.get(index)).cloned();
            let longest = [&replayed, &recorded].map(|outputs| outputs.get(&channel).map_or(0, Vec::len)).into_iter().max();
            for index in 0..longest.unwrap_or(0) {
                let (then, now) = (of(&recorded, index), of(&replayed, index));
                if then != now && self.report.differences.len() >= self.most {
                    self.report.unkept += 1;
                } else if then != now {
                    let difference = difference(self.now, channel, then.as_deref(), now.as_deref());
                    self.report.differences.push(difference);
                }
            }
        }
    }

    pub(crate) fn end(mut self, torn: bool) -> Report {
        self.report.torn = torn;
        // The last outputs of a truncated log may be missing.
        if !torn {
            self.compare();
        }
        self.report
    }
}

/// The pilot input in a message; `None` for a wake-up.
fn event(channel: Channel, entry: &Entry) -> Result<Option<Event>, ReplayError> {
    Ok(Some(match channel {
        Channel::Telemetry => Event::Telemetry(row(entry)?),
        Channel::Frame => Event::Frame(row(entry)?),
        Channel::Depth => Event::Depth(row(entry)?),
        Channel::Gimbal => Event::Gimbal(row(entry)?),
        Channel::Ranges => Event::Ranges(row(entry)?),
        Channel::Track => Event::Track(row(entry)?),
        Channel::Operator => Event::Operator(row::<OperatorRow>(entry)?.event),
        Channel::Link => match row::<LinkRow>(entry)?.link {
            LinkNews::Lost => Event::LinkLost,
            LinkNews::Restored => Event::LinkRestored,
            LinkNews::LetGo(news) => Event::LetGo(news),
        },
        Channel::Reply => match row::<ReplyRow>(entry)? {
            ReplyRow { id, text: Some(text), part: true, .. } => Event::Chunk { id, text },
            ReplyRow { id, text: Some(text), .. } => Event::Reply { id, text },
            ReplyRow { failed, spent: true, .. } => Event::Spent { reason: failed.unwrap_or_default() },
            ReplyRow { id, failed, .. } => Event::ReplyFailed { id, reason: failed.unwrap_or_default() },
        },
        _ => return Ok(None),
    }))
}

fn difference(now: Time, channel: Channel, then: Option<&[u8]>, again: Option<&[u8]>) -> Difference {
    let value = |data: Option<&[u8]>| data.and_then(|data| serde_json::from_slice::<Value>(data).ok());
    let (then, again) = (value(then), value(again));
    let mut places = Vec::new();
    if let (Some(then), Some(again)) = (&then, &again) {
        part(String::new(), then, again, &mut places);
    }
    let (at, recorded, replayed) = if places.is_empty() { (String::new(), then, again) } else { places.swap_remove(0) };
    let more = places.len();
    Difference { time_s: now.as_secs_f64(), topic: channel.name(), at, recorded, replayed, more }
}

/// A place where two values differ, with both values.
type Place = (String, Option<Value>, Option<Value>);

/// Collects every place where two values differ.
fn part(at: String, then: &Value, again: &Value, places: &mut Vec<Place>) {
    match (then, again) {
        (Value::Object(then), Value::Object(again)) => {
            let keys = then.keys().chain(again.keys().filter(|key| !then.contains_key(*key)));
            for key in keys {
                let at = format!("{at}/{}", key.replace('~', "~0").replace('/', "~1"));
                both(at, then.get(key), again.get(key), places);
            }
        }
        (Value::Array(then), Value::Array(again)) => {
            for index in 0..then.len().max(again.len()) {
                both(format!("{at}/{index}"), then.get(index), again.get(index), places);
            }
        }
        _ if then != again => places.push((at, Some(then.clone()), Some(again.clone()))),
        _ => {}
    }
}

fn both(at: String, then: Option<&Value>, again: Option<&Value>, places: &mut Vec<Place>) {
    match (then, again) {
        (Some(then), Some(again)) => part(at, then, again, places),
        (then, again) => places.push((at, then.cloned(), again.cloned())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_difference_names_its_place() {
        let of = |then: Value, again: Value| {
            let bytes = |value: &Value| serde_json::to_vec(value).unwrap();
            difference(Time::from_millis(1500), Channel::Command, Some(&bytes(&then)), Some(&bytes(&again)))
        };
        let found = of(json!({"a": 1, "b": {"c/d": [1, 2, 3]}}), json!({"a": 1, "b": {"c/d": [1, 5]}}));
        assert_eq!((found.time_s, found.topic, &*found.at), (1.5, "/command", "/b/c~1d/1"));
        assert_eq!((found.recorded, found.replayed, found.more), (Some(json!(2)), Some(json!(5)), 1));
        let gone = difference(Time::ZERO, Channel::Query, Some(b"{\"a\":1}"), None);
        assert_eq!((&*gone.at, gone.recorded, gone.replayed), ("", Some(json!({"a": 1})), None));
    }
}

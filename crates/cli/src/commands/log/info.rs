//! `spf log info`: contents of a flight log.

use std::collections::BTreeMap;

use serde::Serialize;
use spf_core::time::Time;
use spf_flight::log::{Channel, FlightHeader};
use spf_flight::summary::{Summary, VerifiedBy};
use spf_flight::words;
use spf_pilot::Outcome;
use spf_record::log::{LogReader, ReadError};

use super::{unreadable, warn_truncated};
use crate::args::Info;
use crate::error::CliError;
use crate::exit::Exit;
use crate::printer::{Printer, one_line, table};

/// Contents of a log.
#[derive(Debug, Default, Serialize)]
struct Content {
    format: u32,
    started_at_ns: u64,
    /// False if it is truncated.
    whole: bool,
    bytes: u64,
    /// Flight time of the latest message, seconds.
    until_s: f64,
    messages: u64,
    instruction: Option<String>,
    vlm: Option<String>,
    seed: Option<u64>,
    outcome: Option<Outcome>,
    verified: Option<bool>,
    verified_by: Option<VerifiedBy>,
    topics: BTreeMap<String, TopicContent>,
}

#[derive(Debug, Default, Serialize)]
struct TopicContent {
    schema: String,
    encoding: String,
    messages: u64,
    /// Before compression.
    bytes: u64,
}

/// Prints the contents of a log.
pub(super) fn info(args: &Info, printer: &Printer) -> Result<Exit, CliError> {
    let content = content(args)?;
    if args.json {
        let text = serde_json::to_string(&content).map_err(|error| CliError::internal("cannot write JSON").because(&error))?;
        printer.data(&text);
        return Ok(Exit::Success);
    }
    if let Some(instruction) = &content.instruction {
        let outcome = content.outcome.map_or("no outcome recorded", words::outcome);
        let vlm = content.vlm.as_deref().unwrap_or("unknown");
        printer.result(&format!("\"{}\", VLM {}: {outcome}", one_line(instruction), one_line(vlm)));
    }
    let Content { format, until_s, messages, bytes, .. } = content;
    let size = bytes as f64 / 1e6;
    printer.result(&format!("format {format}, {until_s:.1} s, {messages} messages, {size:.1} MB"));
    let mut rows = vec![["topic", "schema", "encoding", "messages", "bytes"].map(str::to_owned).to_vec()];
    rows.extend(content.topics.iter().map(|(topic, of)| {
        vec![one_line(topic), one_line(&of.schema), one_line(&of.encoding), of.messages.to_string(), of.bytes.to_string()]
    }));
    printer.result(&table(&rows));
    if !content.whole {
        warn_truncated(&args.file, printer);
    }
    Ok(Exit::Success)
}

fn content(args: &Info) -> Result<Content, CliError> {
    let mut reader = LogReader::open(&args.file).map_err(|error| unreadable(&args.file, &error))?;
    let mut content = Content { whole: true, ..Content::default() };
    let mut until = Time::ZERO;
    for entry in reader.by_ref() {
        let entry = match entry {
            Ok(entry) => entry,
            Err(ReadError::Torn) if content.messages > 0 => {
                content.whole = false;
                break;
            }
            Err(error) => return Err(unreadable(&args.file, &error)),
        };
        content.messages += 1;
        until = until.max(entry.time);
        match Channel::of_topic(&entry.topic) {
            Some(Channel::Flight) => content.flight(&entry.data),
            Some(Channel::Summary) => content.summary(&entry.data),
            _ => {}
        }
        let topic = content.topics.entry(entry.topic).or_default();
        topic.messages += 1;
        topic.bytes += entry.data.len() as u64;
        (topic.schema, topic.encoding) = (entry.schema, entry.encoding);
    }
    if let Some(head) = reader.head() {
        (content.format, content.started_at_ns) = (head.format, head.started_at_ns);
    }
    content.until_s = until.as_secs_f64();
    content.bytes = std::fs::metadata(&args.file).map_or(0, |data| data.len());
    Ok(content)
}

impl Content {
    fn flight(&mut self, data: &[u8]) {
        if let Ok(head) = serde_json::from_slice::<FlightHeader>(data) {
            self.seed = head.sim.map(|sim| sim.seed);
            (self.instruction, self.vlm) = (Some(head.instruction), Some(head.vlm));
        }
    }

    fn summary(&mut self, data: &[u8]) {
        if let Ok(summary) = serde_json::from_slice::<Summary>(data) {
            (self.outcome, self.verified, self.verified_by) = (Some(summary.outcome), summary.verified, summary.verified_by);
        }
    }
}

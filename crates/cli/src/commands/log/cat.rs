//! `spf log cat`: messages as JSON lines.

use std::collections::BTreeSet;
use std::io::{BufWriter, Write};

use serde_json::{Value, json};
use spf_flight::log::Channel;
use spf_record::log::{Entry, LogReader, ReadError, foxglove};

use super::{unreadable, warn_truncated};
use crate::args::Cat;
use crate::error::{CliError, nearest};
use crate::exit::Exit;
use crate::printer::Printer;

/// Prints messages.
pub(super) fn cat(args: &Cat, printer: &Printer) -> Result<Exit, CliError> {
    let wanted = wanted(&args.topics);
    let reader = LogReader::open(&args.file).map_err(|error| unreadable(&args.file, &error))?;
    let mut out = BufWriter::new(std::io::stdout().lock());
    let (mut seen, mut torn, mut any) = (BTreeSet::new(), false, false);
    for entry in reader {
        let entry = match entry {
            Ok(entry) => entry,
            Err(ReadError::Torn) if any => {
                torn = true;
                break;
            }
            Err(error) => return Err(unreadable(&args.file, &error)),
        };
        any = true;
        if (wanted.is_empty() || wanted.contains(&entry.topic)) && writeln!(out, "{}", line(&entry)).is_err() {
            // The reader has closed the pipe.
            return Ok(Exit::Success);
        }
        seen.insert(entry.topic);
    }
    out.flush().ok();
    if torn {
        warn_truncated(&args.file, printer);
    }
    match wanted.iter().find(|topic| !seen.contains(*topic) && Channel::of_topic(topic).is_none()) {
        None => Ok(Exit::Success),
        Some(topic) => Err(unknown(topic, &seen)),
    }
}

/// Topics by name; the slash may be omitted.
fn wanted(topics: &[String]) -> BTreeSet<String> {
    topics.iter().map(|topic| if topic.starts_with('/') { topic.clone() } else { format!("/{topic}") }).collect()
}

fn line(entry: &Entry) -> Value {
    let message = match entry.encoding.as_str() {
        "json" => serde_json::from_slice(&entry.data).ok(),
        _ => foxglove::to_json(&entry.schema, &entry.data),
    };
    json!({"time_s": entry.time.as_secs_f64(), "topic": entry.topic, "message": message})
}

fn unknown(topic: &str, seen: &BTreeSet<String>) -> CliError {
    let error = CliError::usage(format!("unknown topic `{topic}`"));
    match nearest(topic, seen.iter().map(String::as_str)) {
        Some(near) => error.hint(format!("did you mean `{near}`?")),
        None => error.hint("`spf log info` lists the topics of a log"),
    }
}

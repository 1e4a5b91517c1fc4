//! Replays a recorded flight, and tells what differs from then.

use std::path::Path;
use std::time::{Duration, Instant};

use serde_json::json;
use spf_flight::replay::{Changes, replay_keeping};
use spf_record::log::{LogReader, ReadError};

/// Maximum number of differences told.
const TOLD: usize = 200;
/// Maximum length of a value that is told, characters.
const VALUE: usize = 400;
/// What is told of a log that cannot be read.
pub(super) const UNREADABLE: &str = "the flight's log cannot be read";
/// Time limit of a replay.
const LONGEST: Duration = Duration::from_secs(120);

/// The differences of a replay as JSON; an error for a person, without paths. It is given up once `flying`: a flight needs the
/// processor.
pub(super) fn differences(log: &Path, flying: impl Fn() -> bool) -> Result<String, String> {
    let unreadable = |_| UNREADABLE.to_owned();
    let reader = LogReader::open(log).map_err(unreadable)?;
    let (until, mut given_up) = (Instant::now() + LONGEST, None);
    let entries = reader.map(|entry| {
        if flying() {
            given_up = Some("a flight has begun: replay it when that one is over");
        } else if Instant::now() >= until {
            given_up = Some("the replay takes longer than 2 minutes: use `spf replay`");
        }
        // The log ends here.
        if given_up.is_some() { Err(ReadError::Torn) } else { entry }
    });
    let report = replay_keeping(entries, &Changes::default(), TOLD);
    if let Some(why) = given_up {
        return Err(why.to_owned());
    }
    let report = report.map_err(|error| format!("the flight cannot be replayed: {error}"))?;
    let value =
        |value: &Option<serde_json::Value>| value.as_ref().map(|value| value.to_string().chars().take(VALUE).collect::<String>());
    let told = report.differences.iter().map(|difference| {
        json!({
            "t": difference.time_s, "topic": difference.topic, "at": difference.at, "more": difference.more,
            "recorded": value(&difference.recorded), "replayed": value(&difference.replayed),
        })
    });
    let told: Vec<_> = told.collect();
    Ok(json!({
        "inputs": report.inputs, "outputs": report.outputs, "torn": report.torn,
        "differences": report.differences.len() as u64 + report.unkept, "told": told,
    })
    .to_string())
}

//! Replays a recorded flight, and tells what differs from then.

use std::path::Path;

use serde_json::json;
use spf_flight::replay::{Changes, replay};
use spf_record::log::LogReader;

/// Maximum number of differences told.
const TOLD: usize = 200;
/// Maximum length of a value that is told, characters.
const VALUE: usize = 400;

/// The differences of a replay as JSON; an error for a person, without paths.
pub(super) fn differences(folder: &Path) -> Result<String, String> {
    let unreadable = |_| "the flight's log cannot be read".to_owned();
    let reader = LogReader::open(&folder.join("flight.mcap")).map_err(unreadable)?;
    let report = replay(reader, &Changes::default()).map_err(|error| format!("the flight cannot be replayed: {error}"))?;
    let value =
        |value: &Option<serde_json::Value>| value.as_ref().map(|value| value.to_string().chars().take(VALUE).collect::<String>());
    let told = report.differences.iter().take(TOLD).map(|difference| {
        json!({
            "t": difference.time_s, "topic": difference.topic, "at": difference.at, "more": difference.more,
            "recorded": value(&difference.recorded), "replayed": value(&difference.replayed),
        })
    });
    let told: Vec<_> = told.collect();
    Ok(json!({
        "inputs": report.inputs, "outputs": report.outputs, "torn": report.torn,
        "differences": report.differences.len(), "told": told,
    })
    .to_string())
}

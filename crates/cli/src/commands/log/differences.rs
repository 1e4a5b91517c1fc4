//! What a replay does differently, as lines.

use serde_json::Value;
use spf_flight::replay::{Difference, Report};

use crate::printer::Printer;

/// Prints every difference.
pub(in crate::commands) fn differences(report: &Report, printer: &Printer) {
    for difference in &report.differences {
        printer.result(&line(difference));
    }
}

fn line(difference: &Difference) -> String {
    let Difference { time_s, topic, at, recorded, replayed, more } = difference;
    let value = |value: &Option<Value>| value.as_ref().map_or_else(|| "nothing".to_owned(), Value::to_string);
    let (then, now) = (value(recorded), value(replayed));
    let more = if *more > 0 { format!(" (and {more} more fields)") } else { String::new() };
    format!("{time_s:8.3} s  {topic} {at}: recorded {then}, now {now}{more}")
}

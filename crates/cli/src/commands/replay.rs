//! `spf replay`: replays a recorded flight without flying.

use serde_json::Value;
use spf_flight::replay::{Changes, Difference, Report, replay as fly_again};
use spf_record::log::LogReader;

use super::log::{unreadable, unreplayable, warn_truncated};
use super::reask::reask;
use crate::args::Replay;
use crate::error::CliError;
use crate::exit::Exit;
use crate::printer::Printer;

/// Replays a log and prints every difference.
pub(crate) fn replay(args: &Replay, printer: &Printer) -> Result<Exit, CliError> {
    if let Some(vlm) = &args.vlm {
        return reask(args, vlm, printer);
    }
    let reader = LogReader::open(&args.file).map_err(|error| unreadable(&args.file, &error))?;
    let report = fly_again(reader, &Changes::default()).map_err(|error| unreplayable(&args.file, &error))?;
    if args.json {
        let text = serde_json::to_string(&report).map_err(|error| CliError::internal("cannot write JSON").because(&error))?;
        printer.data(&text);
    } else {
        tell(&report, printer);
    }
    if report.torn {
        warn_truncated(&args.file, printer);
    }
    Ok(if report.differences.is_empty() { Exit::Success } else { Exit::Internal })
}

/// Prints every difference.
pub(super) fn differences(report: &Report, printer: &Printer) {
    for difference in &report.differences {
        printer.result(&line(difference));
    }
}

fn tell(report: &Report, printer: &Printer) {
    differences(report, printer);
    let Report { inputs, outputs, differences, .. } = report;
    printer.result(&match differences.len() {
        0 => format!("no difference: {inputs} inputs replayed, {outputs} identical outputs"),
        1 => format!("1 difference in {outputs} outputs after {inputs} inputs"),
        many => format!("{many} differences in {outputs} outputs after {inputs} inputs"),
    });
}

fn line(difference: &Difference) -> String {
    let Difference { time_s, topic, at, recorded, replayed, more } = difference;
    let value = |value: &Option<Value>| value.as_ref().map_or_else(|| "nothing".to_owned(), Value::to_string);
    let (then, now) = (value(recorded), value(replayed));
    let more = if *more > 0 { format!(" (and {more} more fields)") } else { String::new() };
    format!("{time_s:8.3} s  {topic} {at}: recorded {then}, now {now}{more}")
}

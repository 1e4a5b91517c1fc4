//! `spf replay`: replays a recorded flight without flying.

use spf_flight::replay::{Changes, Report, replay as fly_again};
use spf_record::log::LogReader;

use super::log::differences::differences;
use super::log::{unreadable, unreplayable, warn_truncated};
use super::reask::reask;
use crate::args::Replay;
use crate::error::CliError;
use crate::exit::Exit;
use crate::printer::Printer;

/// Replays a log and prints every difference.
pub(crate) fn replay(args: &Replay, printer: &Printer) -> Result<Exit, CliError> {
    if let Some(vlm) = args.settings.text("--vlm") {
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

fn tell(report: &Report, printer: &Printer) {
    differences(report, printer);
    let Report { inputs, outputs, differences, .. } = report;
    printer.result(&match differences.len() {
        0 => format!("no difference: {inputs} inputs replayed, {outputs} identical outputs"),
        1 => format!("1 difference in {outputs} outputs after {inputs} inputs"),
        many => format!("{many} differences in {outputs} outputs after {inputs} inputs"),
    });
}

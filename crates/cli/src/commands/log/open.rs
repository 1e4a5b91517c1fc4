//! `spf log open`: a file made by `spf log share`, read and decided again.

use serde::Serialize;
use spf_core::time::Time;
use spf_flight::rows::Rows;
use spf_flight::share::{Opened, ShareError, SharedMark, check};
use spf_flight::summary::in_seconds;
use spf_flight::words;
use spf_pilot::Outcome;
use spf_record::OutDir;
use spf_record::log::LogReader;

use super::differences::differences;
use super::share::{decided_again, size};
use super::{unreadable, unreplayable};
use crate::args::Open;
use crate::error::CliError;
use crate::exit::Exit;
use crate::printer::{Printer, one_line};

/// What `--json` prints.
#[derive(Serialize)]
struct Content<'a> {
    instruction: &'a str,
    recorded_by: &'a str,
    drone: &'a str,
    vlm: &'a str,
    outcome: Option<Outcome>,
    shared: &'a SharedMark,
    messages: u64,
    pictures: u64,
    replay: &'a spf_flight::replay::Report,
    /// Flight time, nanoseconds, up to which the decisions could be made again; null if to the end.
    gap: Option<Time>,
}

/// Reads the file, makes the pilot's decisions again, and unpacks it if a folder is given.
pub(super) fn open(args: &Open, printer: &Printer) -> Result<Exit, CliError> {
    let reader = LogReader::open(&args.file).map_err(|error| unreadable(&args.file, &error))?;
    let opened = check(reader).map_err(|error| refused(args, &error))?;
    if let Some(folder) = &args.out {
        unpack(args, folder, &opened)?;
    }
    let Opened { head, mark, messages, pictures, summary, report, .. } = &opened;
    let outcome = summary.as_ref().map(|summary| summary.outcome);
    if args.json {
        let content = Content {
            instruction: &head.instruction,
            recorded_by: &head.program,
            drone: &head.drone,
            vlm: &head.vlm,
            outcome,
            shared: mark,
            messages: *messages,
            pictures: *pictures,
            replay: report,
            gap: opened.gap,
        };
        let text = serde_json::to_string(&content).map_err(|error| CliError::internal("cannot write JSON").because(&error))?;
        printer.data(&text);
    } else {
        let told = outcome.map_or("no outcome recorded", words::outcome);
        printer.result(&format!(
            "\"{}\", {} with {}: {told}",
            one_line(&head.instruction),
            one_line(&head.drone),
            one_line(&head.vlm)
        ));
        let bytes = args.file.metadata().map_or(0, |data| data.len());
        let (by, shared_by) = (one_line(&head.program), one_line(&mark.by));
        printer.result(&format!(
            "{}, {messages} messages, {pictures} images; recorded by spf {by}, shared by {shared_by}",
            size(bytes)
        ));
        for left_out in &mark.left_out {
            printer.result(&format!("left out: {}", left_out.words()));
        }
        differences(report, printer);
        printer.result(&decided_again(&opened));
        if !report.differences.is_empty() && head.program != env!("CARGO_PKG_VERSION") {
            printer.result("another version flew it: differences may come from that");
        }
    }
    if let Some(folder) = &args.out {
        printer.log(&format!("unpacked to {}", folder.display()));
    }
    Ok(if report.differences.is_empty() { Exit::Success } else { Exit::Internal })
}

fn refused(args: &Open, error: &ShareError) -> CliError {
    let path = args.file.display();
    let refused = || CliError::usage(format!("cannot open `{path}`")).because(error);
    match error {
        ShareError::Log(error) => unreplayable(&args.file, error),
        ShareError::NotShared => {
            refused().hint(format!("it is a flight's own log: `spf replay {path}`, or `spf log share` makes one to send"))
        }
        ShareError::Torn => refused().hint("ask for it again; `spf log info` tells the part that is there"),
        _ => refused(),
    }
}

/// Writes a flight's folder: the log, and the files that are made of its messages.
fn unpack(args: &Open, folder: &std::path::Path, opened: &Opened) -> Result<(), CliError> {
    let failed =
        |error: &dyn std::error::Error| CliError::usage(format!("--out: cannot unpack to `{}`", folder.display())).because(error);
    let out = OutDir::at(folder).map_err(|error| failed(&error).hint("give a new or an empty folder"))?;
    std::fs::copy(&args.file, out.file("flight.mcap")).map_err(|error| failed(&error))?;
    let rows: Vec<Rows> = opened.decisions.iter().filter_map(|row| Some(Rows::of(serde_json::from_slice(row).ok()?))).collect();
    let lines = |rows: Vec<&serde_json::Value>| rows.iter().map(|row| format!("{row}\n")).collect::<String>();
    let decisions = lines(rows.iter().map(|rows| &rows.decision).collect());
    out.write("decisions.jsonl", decisions.as_bytes()).map_err(|error| failed(&error))?;
    let queries = lines(rows.iter().filter_map(|rows| rows.query.as_ref()).collect());
    out.write("queries.jsonl", queries.as_bytes()).map_err(|error| failed(&error))?;
    if let Some(summary) = &opened.summary {
        out.write_summary(&in_seconds(summary)).map_err(|error| failed(&error))?;
    }
    Ok(())
}

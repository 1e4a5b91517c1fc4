//! `spf log export`: the messages of a topic as one table.

use std::path::{Path, PathBuf};

use spf_flight::log::Channel;
use spf_record::log::export::{Export, ExportError, Format};

use super::{spare, unreadable, warn_truncated};
use crate::args::Export as Args;
use crate::error::CliError;
use crate::exit::Exit;
use crate::printer::Printer;

/// Columns with data of the flight, and their positions in the log's head.
const CONTEXT: [(&str, &str); 6] = [
    ("flight.instruction", "/instruction"),
    ("flight.vlm", "/vlm"),
    ("flight.preset", "/preset"),
    ("flight.policy", "/policy"),
    ("flight.scene", "/sim/scene"),
    ("flight.seed", "/sim/seed"),
];

/// Columns of decisions that people look at; the others are exported with `--all-columns`.
const DECISIONS: [&str; 18] = [
    "time_s",
    "number",
    "reading.reply.status",
    "reading.reply.target",
    "reading.reply.depth",
    "reading.waypoint.u",
    "reading.waypoint.v",
    "reading.step",
    "reading.displacement.right",
    "reading.displacement.forward",
    "reading.displacement.up",
    "step",
    "latency_s",
    "pose.position.east",
    "pose.position.north",
    "pose.position.up",
    "pose.attitude.heading",
    "anchor.range",
];

/// Maximum depth of nested folders; links that lead back would never end.
const DEPTH: usize = 16;

/// Writes a table.
pub(super) fn export(args: &Args, printer: &Printer) -> Result<Exit, CliError> {
    let format = Format::of_path(&args.output).ok_or_else(|| {
        CliError::usage(format!("--output: `{}` has no supported extension", args.output.display()))
            .hint("use .csv, .jsonl or .parquet")
    })?;
    spare(&args.output, args.overwrite)?;
    let mut logs = Vec::new();
    for path in &args.logs {
        find(path, 0, &mut logs)?;
    }
    if logs.is_empty() {
        return Err(CliError::usage("no flight logs found").hint("give a log, or a folder with flight.mcap files"));
    }
    printer.log(&format!("reading {} {} …", logs.len(), if logs.len() == 1 { "log" } else { "logs" }));
    let topic = if args.topic.starts_with('/') { args.topic.clone() } else { format!("/{}", args.topic) };
    let columns = (!args.all_columns && topic == Channel::Decision.name()).then_some(&DECISIONS[..]);
    let export = Export { logs: &logs, topic: &topic, context: &CONTEXT, context_topic: Channel::Flight.name(), columns };
    let table = export.write(format, &args.output).map_err(|error| match &error {
        ExportError::NotBuilt => CliError::usage(format!("--output: cannot write `{}`", args.output.display()))
            .because(&error)
            .hint("cargo install --path crates/cli --features parquet; or use .csv or .jsonl"),
        ExportError::Empty(_) => {
            CliError::usage("nothing to export").because(&error).hint("`spf log info` lists the topics of a log")
        }
        ExportError::Read { path, source } => unreadable(path, source),
        _ => CliError::internal("cannot write the table").because(&error),
    })?;
    for path in &table.torn {
        warn_truncated(path, printer);
    }
    let (rows, columns) = (table.rows, table.columns.len());
    let more = if export.columns.is_some() { "; --all-columns has the rest" } else { "" };
    printer.result(&format!("{}: {rows} rows, {columns} columns, from {} logs{more}", args.output.display(), logs.len()));
    Ok(Exit::Success)
}

/// A log, or every `*.mcap` below a folder in order of names; each is named by its path as given.
fn find(path: &Path, depth: usize, logs: &mut Vec<(String, PathBuf)>) -> Result<(), CliError> {
    let unreadable = |error: std::io::Error| {
        CliError::usage(format!("cannot read `{}`", path.display())).because(&error).hint("give a log, or a folder of flights")
    };
    if !path.metadata().map_err(unreadable)?.is_dir() {
        logs.push((path.display().to_string(), path.to_owned()));
        return Ok(());
    }
    let entries = std::fs::read_dir(path).map_err(unreadable)?.collect::<Result<Vec<_>, _>>().map_err(unreadable)?;
    let mut paths: Vec<PathBuf> = entries.into_iter().map(|entry| entry.path()).collect();
    paths.sort();
    for inside in paths {
        let is_log = inside.extension().is_some_and(|ending| ending == "mcap");
        if is_log || (inside.is_dir() && depth < DEPTH) {
            find(&inside, depth + 1, logs)?;
        }
    }
    Ok(())
}

//! `spf bench`: runs tasks in trials and reports success rates (docs/guide/bench.md).

mod ask;
mod check;
mod report;
mod run;
mod show;

use std::path::Path;

use spf_bench::run::{StoreError, merge};
use spf_bench::task::{SUITES, Task, TaskError, shipped};
use spf_bench::trial::{VlmUnderTest, split_latency};

use crate::args::{Bench, BenchMerge};
use crate::commands::vlm::{Pace, is_human, pointing};
use crate::error::{CliError, nearest};
use crate::exit::Exit;
use crate::printer::Printer;
use crate::settings::Settings;

/// Runs one of the bench's commands.
pub(crate) fn bench(command: &Bench, printer: &mut Printer) -> Result<Exit, CliError> {
    match command {
        Bench::Run(args) => run::run(args, printer),
        Bench::Ask(args) => ask::ask(args, printer),
        Bench::Check(args) => check::check(args, printer),
        Bench::Merge(args) => merge_shares(args, printer),
        Bench::Report(args) => report::report(args, printer),
        Bench::Show(args) => show::show(args, printer),
        Bench::List => list(printer),
    }
}

/// A task by its file, or a built-in one by its name.
fn task_of(name: &str) -> Result<Task, CliError> {
    let refused = |error: &TaskError| CliError::usage(format!("invalid task `{name}`")).because(error);
    if name.contains(['/', '.']) || Path::new(name).exists() {
        return Task::load(name).map_err(|error| refused(&error));
    }
    shipped(name).map_err(|error| refused(&error))?.ok_or_else(|| {
        let known = SUITES.iter().flat_map(|suite| suite.names());
        let hint = match nearest(name, known) {
            Some(near) => format!("did you mean `{near}`?"),
            None => "`spf bench list` lists the built-in tasks; a file path must contain a `/` or a `.`".to_owned(),
        };
        CliError::usage(format!("unknown task `{name}`")).hint(hint)
    })
}

/// The VLM for a name as in `spf fly --vlm`; an oracle's latency may be fixed.
pub(crate) fn pointer(settings: &mut Settings, name: &str) -> Result<VlmUnderTest, CliError> {
    let (vlm, latency) = split_latency(name);
    settings.fly.vlm.argument("--vlm", vlm);
    if is_human(vlm) {
        return Err(CliError::usage("`spf bench` does not support --vlm human").hint("spf fly \"…\" --vlm human"));
    }
    let pointing = pointing(settings, None, Pace::Virtual)?;
    let latency = latency.or(pointing.latency.map(|latency| latency.as_secs_f64()));
    Ok(VlmUnderTest { name: name.to_owned(), vlm_factory: pointing.vlm_factory, latency })
}

/// The error if results cannot be stored, with a remedy.
pub(crate) fn store_error(error: &StoreError) -> CliError {
    match error {
        StoreError::Other { .. } => CliError::usage("the folder holds results of a run with different settings")
            .because(error)
            .hint("use another folder, or repeat the command that created this one"),
        StoreError::InUse(_) => {
            CliError::usage("the folder is in use").because(error).hint("wait for that run to end, or use another folder")
        }
        StoreError::Replaced(_) => CliError::internal("the rows of this run are lost")
            .because(error)
            .hint("repeat the command with another folder, -o DIR; end a run with Ctrl-C before its folder is deleted"),
        StoreError::Questions(_) => CliError::usage("cannot go on with the questions and answers").because(error),
        StoreError::Shards(_) => CliError::usage("cannot merge the shards").because(error).hint(
            "give the folders of all \
            shards, each finished",
        ),
        _ => CliError::internal("cannot store the results").because(error),
    }
}

fn merge_shares(args: &BenchMerge, printer: &Printer) -> Result<Exit, CliError> {
    let trials = merge(&args.shards, &args.output).map_err(|error| store_error(&error))?;
    printer.log(&format!("merged {trials} trials of {} shards", args.shards.len()));
    printer.result(&args.output.join("results.jsonl").display().to_string());
    Ok(Exit::Success)
}

fn list(printer: &Printer) -> Result<Exit, CliError> {
    for suite in SUITES {
        printer.result(&format!("{}: {}", suite.name, suite.description));
        let tasks = suite.tasks().map_err(|error| CliError::internal("invalid built-in task").because(&error))?;
        for task in tasks {
            printer.result(&format!("  {:30} {:18} {}", task.id, task.category.words(), task.instruction));
        }
    }
    Ok(Exit::Success)
}

//! `spf bench`: runs tasks in trials and reports success rates (docs/guide/bench.md).

mod ask;
mod check;
mod foreign;
mod list;
mod report;
mod run;
mod show;

pub(crate) use spf_api::bench::store_error;
use spf_bench::run::merge;
use spf_bench::trial::{Networks, VlmUnderTest, split_latency};

use crate::args::{Bench, BenchMerge};
use crate::commands::vlm::{Pace, is_human, pointing};
use crate::commands::{depth_model, detector};
use crate::error::CliError;
use crate::exit::Exit;
use crate::printer::Printer;
use crate::settings::{Flags, Settings, Takes};

/// Runs one of the bench's commands.
pub(crate) fn bench(command: &Bench, printer: &mut Printer) -> Result<Exit, CliError> {
    match command {
        Bench::Run(args) => run::run(args, printer),
        Bench::Ask(args) => ask::ask(args, printer),
        Bench::Check(args) => check::check(args, printer),
        Bench::Merge(args) => merge_shares(args, printer),
        Bench::Report(args) => report::report(args, printer),
        Bench::Show(args) => show::show(args, printer),
        Bench::List(args) => list::list(args, printer),
        Bench::Import(args) => foreign::import(args, printer),
    }
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

/// The networks that take the place of what the simulator gives a method: those of the command line alone, as everything of a run is
/// in its command.
fn networks<T: Takes>(settings: &Settings, flags: &Flags<T>) -> Result<Networks, CliError> {
    let is_given = |flag: &str| flags.text(flag).is_some();
    let detector = if is_given("--detector") { detector::in_the_bench(settings)? } else { None };
    let depth = if is_given("--depth-model") { depth_model::plan(settings)?.map(|(plan, _)| plan) } else { None };
    Ok(Networks { detector, depth })
}

fn merge_shares(args: &BenchMerge, printer: &Printer) -> Result<Exit, CliError> {
    let trials = merge(&args.shards, &args.output).map_err(|error| store_error(&error))?;
    printer.log(&format!("merged {trials} trials of {} shards", args.shards.len()));
    printer.result(&args.output.join("results.jsonl").display().to_string());
    Ok(Exit::Success)
}

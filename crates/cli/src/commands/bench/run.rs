//! `spf bench run`.

use std::path::Path;

use serde_json::json;
use spf_api::bench::{method, tasks};
use spf_bench::contrast::{Contrast, Scoring, contrasts};
use spf_bench::run::{Plan, Progress, RunManifest, RunOptions, Shard, read_records, run as run_plan, shell_word};
use spf_bench::stats::Rate;
use spf_bench::table::{Line, table as lines, words};
use spf_bench::task::suite;
use spf_bench::trial::{Record, VlmUnderTest, run_id};
use spf_vlm::service::{RunEnd, Service};

use super::{networks, pointer, store_error};
use crate::args::BenchRun;
use crate::commands::fly::signals::interrupts;
use crate::commands::vlm::{Estimate, agreed, dollars, failure, listed, obeying, service};
use crate::error::CliError;
use crate::exit::Exit;
use crate::printer::{Printer, table};
use crate::settings::Settings;

/// The highest limit of a cost, US dollars.
const MOST_USD: f64 = 1e6;

/// Flies tasks and prints success rates.
pub(super) fn run(args: &BenchRun, printer: &mut Printer) -> Result<Exit, CliError> {
    let mut settings = Settings::of(&args.settings, printer)?;
    let (tasks, files) = tasks(args.suite.as_deref(), &args.task, "spf bench run --suite paper -o out")?;
    let max_cost = settings.fly.max_cost_usd.get()?;
    let per_trial = args.max_cost_per_trial;
    if per_trial.is_some_and(|cost| !(0.0..=MOST_USD).contains(&cost)) {
        return Err(CliError::usage("--max-cost-per-trial must be a number of US dollars from 0 to 1000000")
            .hint("--max-cost-per-trial 0.1"));
    }
    // A limit of either kind needs a price.
    if let (None, Some(cost)) = (max_cost, per_trial) {
        settings.fly.max_cost_usd.argument("--max-cost-per-trial", &cost.to_string());
    }
    let own = args.suite.as_deref().and_then(suite).map_or(("spf", "oracle:default"), |suite| (suite.methods, suite.vlms));
    let vlms = args.vlm.as_deref().unwrap_or(own.1);
    let methods = listed(args.method.as_deref().unwrap_or(own.0)).into_iter().map(method).collect::<Result<Vec<_>, _>>()?;
    let pointers: Vec<VlmUnderTest> =
        listed(vlms).into_iter().map(|name| pointer(&mut settings, name)).collect::<Result<_, _>>()?;
    // A stand-in that obeys signs is announced wherever it is named.
    listed(vlms).into_iter().filter_map(obeying).for_each(|sentence| printer.log(&sentence));
    if methods.is_empty() || pointers.is_empty() {
        return Err(CliError::usage("no method or no VLM given").hint("--method spf --vlm oracle:default"));
    }
    let shard = shard(args)?;
    let jobs = args.jobs.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from));
    let options = RunOptions { jobs, videos: args.videos, command: command(args, vlms), files, asked: None };
    let plan = Plan {
        tasks,
        methods,
        pointers,
        trials: args.trials,
        seed: args.seed,
        max_cost_usd: per_trial,
        networks: networks(&settings, &args.settings)?,
    };
    let head = plan.head(shard, vlms);
    let total = plan.draws().iter().flatten().count();
    let before = read_records(&args.output).unwrap_or_default();
    let estimates = estimates(&plan, vlms, total, &settings, &before)?;
    if !agreed(&estimates, args.yes, max_cost.is_some(), printer)? {
        return Ok(Exit::Aborted);
    }
    let service = service(max_cost, &interrupts()?, printer)?;
    service.charge(spent(&before, &args.output));
    if shard != Shard::WHOLE {
        printer.log(&format!("shard {}/{}, counted from 0", shard.index, shard.count));
    }
    let mut begun = false;
    let mut paid = Paid::of(&before, &estimates);
    let ended = {
        let printer = &mut *printer;
        run_plan(&plan, &head, &args.output, &options, &service, &mut |progress, record| {
            if !begun {
                begun = true;
                if progress.done > 0 {
                    printer.log(&format!("{} of {} trials already done", progress.done, progress.of));
                }
                printer.start_count("trials", progress.of as u64, progress.done as u64);
            }
            paid.add(record);
            printer.count_with(progress.done as u64, &dollars(&service, paid.for_all(&service, progress)));
            if let Some((record, why)) = record.and_then(|record| Some((record, record.error.as_ref()?))) {
                printer.log(&format!("warning: cannot fly {}: {why}", record.run_id));
            }
        })
    };
    printer.end_live();
    let ended = ended.map_err(|error| store_error(&error))?;
    if ended.stopped {
        return early(&service, ended, printer);
    }
    let records = read_records(&args.output).map_err(|error| store_error(&error))?;
    let lines = lines(&records);
    if printer.is_json() {
        printer.data(&json_of(&lines).to_string());
    } else {
        printer.result(&table(&rows(&lines)));
        let pairs = contrasts(&records, Scoring::Strict, &[]);
        if !pairs.is_empty() {
            printer.result(&format!("\n{}", table(&compared(&pairs))));
        }
        printer.result(&args.output.join("results.jsonl").display().to_string());
    }
    Ok(Exit::Success)
}

/// The end of a run of which trials are missing.
fn early(service: &Service, Progress { done, of, .. }: Progress, printer: &Printer) -> Result<Exit, CliError> {
    let end = service.ended().unwrap_or(RunEnd::Stopped);
    let kept = format!("{done} of {of} trials are done and kept; the same command flies the others");
    if let Some(error) = failure(&end, &kept) {
        return Err(error);
    }
    printer.log(&match end {
        RunEnd::Spent { spent, limit } => {
            format!("${spent:.4} of ${limit} are spent (--max-cost): {kept}, with a higher limit")
        }
        _ => format!("stopped after {done} of {of} trials; repeat the command to resume"),
    });
    Ok(Exit::Aborted)
}

/// What a folder has cost, US dollars: its rows, and flights that the end of a run left without one.
fn spent(before: &[Record], folder: &Path) -> f64 {
    let unfinished = RunManifest::read(folder).ok().flatten().map_or(0.0, |made| made.unfinished_usd);
    before.iter().filter_map(|record| record.cost_usd).sum::<f64>() + unfinished
}

/// What trials with a cost have cost.
struct Paid {
    usd: f64,
    trials: usize,
    /// The estimate for the trials that were missing, where nothing is known better.
    guessed: Option<f64>,
}

impl Paid {
    fn of(before: &[Record], estimates: &[Estimate]) -> Self {
        let guessed = estimates.iter().map(Estimate::cost).sum();
        let mut paid = Self { usd: 0.0, trials: 0, guessed };
        before.iter().for_each(|record| paid.add(Some(record)));
        paid
    }

    fn add(&mut self, record: Option<&Record>) {
        if let Some(cost) = record.and_then(|record| record.cost_usd) {
            self.usd += cost;
            self.trials += 1;
        }
    }

    /// What all trials will have cost; `None` if that is not known.
    fn for_all(&self, service: &Service, progress: Progress) -> Option<f64> {
        let left = progress.of - progress.done;
        match self.trials {
            0 if progress.done == 0 => self.guessed.map(|guessed| service.spent_usd() + guessed),
            0 => None,
            trials => Some(service.spent_usd() + left as f64 * self.usd / trials as f64),
        }
    }
}

/// The command for the same rows: the given arguments, without folder, shard, number of jobs and the limit of the whole cost.
fn command(args: &BenchRun, vlms: &str) -> String {
    let mut words: Vec<String> = ["spf", "bench", "run"].map(str::to_owned).to_vec();
    let mut give = |name: &str, value: Option<String>| {
        words.extend(value.into_iter().flat_map(|value| [name.to_owned(), shell_word(&value)]));
    };
    give("--suite", args.suite.clone());
    args.task.iter().for_each(|task| give("--task", Some(task.clone())));
    give("--method", args.method.clone());
    give("--vlm", Some(vlms.to_owned()));
    let given = |flag: &str| args.settings.text(flag).map(str::to_owned);
    give("--vlm-latency", given("--vlm-latency"));
    give("--send-key-to", given("--send-key-to"));
    give("--detector", given("--detector"));
    give("--depth-model", given("--depth-model"));
    give("--trials", Some(args.trials.to_string()));
    give("--seed", Some(args.seed.to_string()));
    give("--vlm-price", given("--vlm-price"));
    give("--vlm-models", given("--vlm-models"));
    give("--max-cost-per-trial", args.max_cost_per_trial.map(|cost| cost.to_string()));
    give("--config", args.settings.file().map(|path| path.display().to_string()));
    words.join(" ")
}

/// What the models of a plan will take, for the trials that are still to be flown.
fn estimates(plan: &Plan, vlms: &str, total: usize, settings: &Settings, before: &[Record]) -> Result<Vec<Estimate>, CliError> {
    let trials = total / plan.pointers.len().max(1);
    let estimate = |name| {
        let done: Vec<_> = before.iter().filter(|record| is_of(record, name)).collect();
        Estimate::of_flights(settings, name, trials.saturating_sub(done.len()), &done)
    };
    listed(vlms).into_iter().map(estimate).filter_map(Result::transpose).collect()
}

/// Whether a trial was flown with this VLM.
fn is_of(record: &Record, vlm: &str) -> bool {
    let of = run_id(&record.task, &record.method, vlm, 0);
    record.run_id.rsplit_once('/').map(|(whole, _)| whole) == of.rsplit_once('/').map(|(whole, _)| whole)
}

fn shard(args: &BenchRun) -> Result<Shard, CliError> {
    let shard = match &args.shard {
        Some(text) => Some(text.parse()),
        None => Shard::of_environment(|name| std::env::var(name).ok()).transpose(),
    };
    let hint = "--shard 0/4 to --shard 3/4 cover the whole run (docs/guide/cluster.md)";
    shard
        .transpose()
        .map(|shard| shard.unwrap_or(Shard::WHOLE))
        .map_err(|error| CliError::usage("cannot determine the shard").because(&error).hint(hint))
}

fn rows(lines: &[Line]) -> Vec<Vec<String>> {
    let head = ["METHOD", "VLM", "TASKS", "STRICT", "PAPER", "COLLIDED"].map(str::to_owned).to_vec();
    let row = |line: &Line| {
        let rates = [line.strict, line.paper, line.collided].map(words);
        [vec![line.method.clone(), line.vlm.clone(), line.group()], rates.to_vec()].concat()
    };
    std::iter::once(head).chain(lines.iter().map(row)).collect()
}

/// Pairs of methods on the same sampled starts.
fn compared(pairs: &[Contrast]) -> Vec<Vec<String>> {
    let head = ["PAIRED", "STRICT, POINTS", "ONLY FIRST : ONLY SECOND", "P (MCNEMAR, HOLM)"].map(str::to_owned).to_vec();
    let row = |pair: &Contrast| {
        let [first, second] = pair.pair.each_ref().map(|(method, vlm)| format!("{method} {vlm}"));
        let [value, low, high] = pair.points();
        let apart = pair.paired.discordant;
        vec![
            format!("{first} − {second}"),
            format!("{value:+.1} [{low:.1}, {high:.1}]"),
            format!("{} : {}", apart.first, apart.second),
            pair.format_p(),
        ]
    };
    std::iter::once(head).chain(pairs.iter().map(row)).collect()
}

fn json_of(lines: &[Line]) -> serde_json::Value {
    let rate = |rate: Rate| {
        let estimate = rate.estimate();
        json!({ "hits": rate.hits, "of": rate.of, "low": estimate.map(|e| e.low), "high": estimate.map(|e| e.high) })
    };
    let line = |line: &Line| {
        json!({
            "method": line.method, "vlm": line.vlm, "set": line.set, "category": line.category,
            "strict": rate(line.strict), "paper": rate(line.paper), "collided": rate(line.collided),
        })
    };
    lines.iter().map(line).collect()
}

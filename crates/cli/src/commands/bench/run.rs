//! `spf bench run`.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use serde_json::json;
use spf_bench::contrast::{Contrast, Scoring, contrasts};
use spf_bench::run::{Plan, RunOptions, Shard, read_records, run as run_plan, shell_word};
use spf_bench::stats::Rate;
use spf_bench::table::{Line, table as lines, words};
use spf_bench::task::{SUITES, Task, suite};
use spf_bench::trial::{Method, Record, VlmUnderTest, run_id};

use super::{pointer, store_error, task_of};
use crate::args::BenchRun;
use crate::commands::fly::signals::interrupts;
use crate::commands::vlm::{Estimate, agreed, listed, obeying};
use crate::error::{CliError, nearest};
use crate::exit::Exit;
use crate::printer::{Printer, table};
use crate::settings::Settings;

/// Flies tasks and prints success rates.
pub(super) fn run(args: &BenchRun, printer: &mut Printer) -> Result<Exit, CliError> {
    let mut settings = Settings::load(args.config.as_deref(), printer)?;
    let (tasks, files) = tasks(args)?;
    settings.vlm.latency_s.flag(args.vlm_latency.as_deref());
    settings.vlm.send_key_to.flag(args.send_key_to.as_deref());
    let max_cost = args.max_cost.map(|cost| cost.to_string());
    settings.fly.max_cost_usd.flag(max_cost.as_deref());
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
    let options = RunOptions { jobs, videos: args.videos, command: command(args, vlms), files };
    let plan = Plan { tasks, methods, pointers, trials: args.trials, seed: args.seed, max_cost_usd: args.max_cost };
    let head = plan.head(shard, vlms);
    let total = plan.draws().iter().flatten().count();
    if !agreed(&estimates(&plan, vlms, total, &settings, &args.output)?, args.yes, printer) {
        return Ok(Exit::Aborted);
    }
    let interrupts = interrupts()?;
    if shard != Shard::WHOLE {
        printer.log(&format!("shard {}/{}, counted from 0", shard.index, shard.count));
    }
    let mut begun = false;
    let ended = {
        let printer = &mut *printer;
        run_plan(&plan, &head, &args.output, &options, &|| interrupts.load(Ordering::Relaxed) > 0, &mut |progress, record| {
            if !begun {
                begun = true;
                if progress.done > 0 {
                    printer.log(&format!("{} of {} trials already done", progress.done, progress.of));
                }
                printer.start_count("trials", progress.of as u64, progress.done as u64);
            }
            printer.count(progress.done as u64);
            if let Some((record, why)) = record.and_then(|record| Some((record, record.error.as_ref()?))) {
                printer.log(&format!("warning: cannot fly {}: {why}", record.run_id));
            }
        })
    };
    printer.end_live();
    let ended = ended.map_err(|error| store_error(&error))?;
    if ended.stopped {
        printer.log(&format!("stopped after {} of {} trials; repeat the command to resume", ended.done, ended.of));
        return Ok(Exit::Aborted);
    }
    let records = read_records(&args.output).map_err(|error| store_error(&error))?;
    let lines = lines(&records);
    if printer.is_json() {
        printer.data(&json_of(&lines).to_string());
    } else {
        printer.result(&table(&rows(&lines)));
        let pairs = contrasts(&records, Scoring::SelfStop, &[]);
        if !pairs.is_empty() {
            printer.result(&format!("\n{}", table(&compared(&pairs))));
        }
        printer.result(&args.output.join("results.jsonl").display().to_string());
    }
    Ok(Exit::Success)
}

/// The command for the same rows: the given arguments, without folder, shard and number of jobs.
fn command(args: &BenchRun, vlms: &str) -> String {
    let mut words: Vec<String> = ["spf", "bench", "run"].map(str::to_owned).to_vec();
    let mut give = |name: &str, value: Option<String>| {
        words.extend(value.into_iter().flat_map(|value| [name.to_owned(), shell_word(&value)]));
    };
    give("--suite", args.suite.clone());
    args.task.iter().for_each(|task| give("--task", Some(task.clone())));
    give("--method", args.method.clone());
    give("--vlm", Some(vlms.to_owned()));
    give("--vlm-latency", args.vlm_latency.clone());
    give("--send-key-to", args.send_key_to.clone());
    give("--trials", Some(args.trials.to_string()));
    give("--seed", Some(args.seed.to_string()));
    give("--max-cost", args.max_cost.map(|cost| cost.to_string()));
    give("--config", args.config.as_ref().map(|path| path.display().to_string()));
    words.join(" ")
}

/// What the models of a plan will take, for the trials that are still to be flown.
fn estimates(plan: &Plan, vlms: &str, total: usize, settings: &Settings, folder: &Path) -> Result<Vec<Estimate>, CliError> {
    let before = read_records(folder).unwrap_or_default();
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

/// Tasks that are not built in: id and file.
type Files = BTreeMap<String, String>;

/// All selected tasks, and the files of those that are not built in.
fn tasks(args: &BenchRun) -> Result<(Vec<Arc<Task>>, Files), CliError> {
    let (mut tasks, mut files) = (Vec::new(), Files::new());
    if let Some(name) = &args.suite {
        let suite = suite(name).ok_or_else(|| {
            let names: Vec<&str> = SUITES.iter().map(|suite| suite.name).collect();
            let error = CliError::usage(format!("unknown suite `{name}`"));
            match nearest(name, names.iter().copied()) {
                Some(near) => error.hint(format!("did you mean `{near}`?")),
                None => error.hint(format!("suites: {}", names.join(", "))),
            }
        })?;
        tasks = suite.tasks().map_err(|error| CliError::internal("invalid built-in task").because(&error))?;
    }
    for name in &args.task {
        let task = task_of(name)?;
        if *name != task.id {
            files.insert(task.id.clone(), name.clone());
        }
        tasks.push(Arc::new(task));
    }
    let mut ids: Vec<&str> = tasks.iter().map(|task| task.id.as_str()).collect();
    ids.sort_unstable();
    if let Some(twice) = ids.windows(2).find(|pair| pair[0] == pair[1]) {
        return Err(CliError::usage(format!("duplicate task id `{}`", twice[0])).hint("task ids must be unique in a run"));
    }
    if tasks.is_empty() {
        return Err(CliError::usage("no task given").hint("spf bench run --suite paper -o out"));
    }
    Ok((tasks, files))
}

fn method(name: &str) -> Result<Method, CliError> {
    Method::of_name(name).ok_or_else(|| {
        let known: Vec<&str> = Method::all().map(Method::name).collect();
        let error = CliError::usage(format!("--method: unknown method `{name}`"));
        match nearest(name, known.iter().copied()) {
            Some(near) => error.hint(format!("did you mean `{near}`?")),
            None => error.hint(format!("methods: {}", known.join(", "))),
        }
    })
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
    let head = ["METHOD", "VLM", "TASKS", "SELF STOP", "JUDGE STOP", "COLLIDED"].map(str::to_owned).to_vec();
    let row = |line: &Line| {
        let rates = [line.self_stop, line.judge_stop, line.collided].map(words);
        [vec![line.method.clone(), line.vlm.clone(), line.group()], rates.to_vec()].concat()
    };
    std::iter::once(head).chain(lines.iter().map(row)).collect()
}

/// Pairs of methods on the same sampled starts.
fn compared(pairs: &[Contrast]) -> Vec<Vec<String>> {
    let head = ["PAIRED", "SELF STOP, POINTS", "ONLY FIRST : ONLY SECOND", "P (MCNEMAR, HOLM)"].map(str::to_owned).to_vec();
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
            "self_stop": rate(line.self_stop), "judge_stop": rate(line.judge_stop), "collided": rate(line.collided),
        })
    };
    lines.iter().map(line).collect()
}

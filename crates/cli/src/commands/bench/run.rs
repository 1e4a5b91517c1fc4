//! `spf bench run`.

use std::sync::Arc;
use std::sync::atomic::Ordering;

use serde_json::json;
use spf_bench::contrast::{Contrast, contrasts};
use spf_bench::run::{Plan, Shard, read_records, run as run_plan};
use spf_bench::stats::Rate;
use spf_bench::table::{Line, table as lines, words};
use spf_bench::task::{SUITES, Task, suite};
use spf_bench::trial::{Method, Pointer};

use super::{pointer, store_error, task_of};
use crate::args::BenchRun;
use crate::commands::fly::interrupts;
use crate::error::{CliError, nearest};
use crate::exit::Exit;
use crate::printer::{Printer, table};
use crate::settings::Settings;

/// Flies tasks and prints how often they were done.
pub(super) fn run(args: &BenchRun, printer: &mut Printer) -> Result<Exit, CliError> {
    let mut settings = Settings::load(args.config.as_deref())?;
    let tasks = tasks(args)?;
    let own = args.suite.as_deref().and_then(suite).map_or("spf", |suite| suite.methods);
    let methods = listed(args.method.as_deref().unwrap_or(own)).map(method).collect::<Result<Vec<_>, _>>()?;
    let pointers: Vec<Pointer> = listed(&args.vlm).map(|name| pointer(&mut settings, name)).collect::<Result<_, _>>()?;
    if methods.is_empty() || pointers.is_empty() {
        return Err(CliError::usage("no method or no VLM is named").hint("--method spf --vlm oracle:default"));
    }
    let shard = shard(args)?;
    let plan = Plan { tasks, methods, pointers, trials: args.trials, seed: args.seed, max_cost_usd: args.max_cost };
    let head = plan.head(shard, &args.vlm);
    let jobs = args.jobs.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from));
    let interrupts = interrupts()?;
    if shard != Shard::WHOLE {
        printer.say(&format!("share {} of {}", shard.index, shard.count));
    }
    let mut begun = false;
    let ended = {
        let printer = &mut *printer;
        run_plan(&plan, &head, &args.output, jobs, &|| interrupts.load(Ordering::Relaxed) > 0, &mut |progress, record| {
            if !begun {
                begun = true;
                if progress.done > 0 {
                    printer.say(&format!("{} of {} trials are there already", progress.done, progress.of));
                }
                printer.start_count(progress.of as u64, progress.done as u64);
            }
            printer.count(progress.done as u64);
            if let Some((record, why)) = record.and_then(|record| Some((record, record.error.as_ref()?))) {
                printer.say(&format!("warning: {} could not be flown: {why}", record.run_id));
            }
        })
    };
    printer.end_live();
    let ended = ended.map_err(|error| store_error(&error))?;
    if ended.stopped {
        printer.say(&format!("stopped after {} of {} trials; the same command goes on", ended.done, ended.of));
        return Ok(Exit::Aborted);
    }
    let records = read_records(&args.output).map_err(|error| store_error(&error))?;
    let lines = lines(&records);
    if printer.is_json() {
        printer.data(&json_of(&lines).to_string());
    } else {
        printer.result(&table(&rows(&lines)));
        let pairs = contrasts(&records);
        if !pairs.is_empty() {
            printer.result(&format!("\n{}", table(&compared(&pairs))));
        }
        printer.result(&args.output.join("results.jsonl").display().to_string());
    }
    Ok(Exit::Success)
}

fn listed(text: &str) -> impl Iterator<Item = &str> {
    text.split(',').map(str::trim).filter(|name| !name.is_empty())
}

fn tasks(args: &BenchRun) -> Result<Vec<Arc<Task>>, CliError> {
    let mut tasks = Vec::new();
    if let Some(name) = &args.suite {
        let suite = suite(name).ok_or_else(|| {
            let names: Vec<&str> = SUITES.iter().map(|suite| suite.name).collect();
            let error = CliError::usage(format!("there is no suite `{name}`"));
            match nearest(name, names.iter().copied()) {
                Some(near) => error.hint(format!("did you mean `{near}`?")),
                None => error.hint(format!("suites: {}", names.join(", "))),
            }
        })?;
        tasks = suite.tasks().map_err(|error| CliError::internal("a shipped task is refused").because(&error))?;
    }
    for name in &args.task {
        tasks.push(Arc::new(task_of(name)?));
    }
    let mut ids: Vec<&str> = tasks.iter().map(|task| task.id.as_str()).collect();
    ids.sort_unstable();
    if let Some(twice) = ids.windows(2).find(|pair| pair[0] == pair[1]) {
        return Err(CliError::usage(format!("two tasks have the id `{}`", twice[0])).hint("rows are told apart by it"));
    }
    if tasks.is_empty() {
        return Err(CliError::usage("no task is named").hint("spf bench run --suite paper -o out"));
    }
    Ok(tasks)
}

fn method(name: &str) -> Result<Method, CliError> {
    Method::of_name(name).ok_or_else(|| {
        let known = Method::ALL.map(Method::name);
        let error = CliError::usage(format!("--method: there is no method `{name}`"));
        match nearest(name, known) {
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
    let hint = "--shard 0/4 to --shard 3/4 are all of it (docs/cluster.md)";
    shard
        .transpose()
        .map(|shard| shard.unwrap_or(Shard::WHOLE))
        .map_err(|error| CliError::usage("the share of trials is not known").because(&error).hint(hint))
}

fn group(line: &Line) -> String {
    match (line.set, line.category) {
        (Some(set), Some(category)) => format!("{}, {}", set.words(), category.words()),
        (Some(set), None) => format!("{}, all", set.words()),
        _ => "all".to_owned(),
    }
}

fn rows(lines: &[Line]) -> Vec<Vec<String>> {
    let head = ["METHOD", "VLM", "TASKS", "SELF STOP", "JUDGE STOP", "COLLIDED"].map(str::to_owned).to_vec();
    let row = |line: &Line| {
        let rates = [line.self_stop, line.judge_stop, line.collided].map(words);
        [vec![line.method.clone(), line.vlm.clone(), group(line)], rates.to_vec()].concat()
    };
    std::iter::once(head).chain(lines.iter().map(row)).collect()
}

/// Pairs of methods on the same draws.
fn compared(pairs: &[Contrast]) -> Vec<Vec<String>> {
    let head = ["PAIRED", "SELF STOP, POINTS", "ONLY FIRST : ONLY SECOND", "P (MCNEMAR, HOLM)"].map(str::to_owned).to_vec();
    let row = |pair: &Contrast| {
        let [first, second] = pair.who.each_ref().map(|(method, vlm)| format!("{method} {vlm}"));
        let [value, low, high] = {
            let e = pair.self_stop.difference;
            [e.value, e.low, e.high].map(|share| 100.0 * share)
        };
        let apart = pair.self_stop.discordant;
        vec![
            format!("{first} − {second}"),
            format!("{value:+.1} [{low:.1}, {high:.1}]"),
            format!("{} : {}", apart.first, apart.second),
            if pair.p_holm < 0.0001 { "< 0.0001".to_owned() } else { format!("{:.4}", pair.p_holm) },
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

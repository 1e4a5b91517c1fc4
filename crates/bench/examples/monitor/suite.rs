//! A suite of the bench with and without a monitor.

use std::error::Error;
use std::sync::Arc;

use rayon::prelude::*;
use spf_bench::task::{Task, suite};
use spf_bench::trial::{Method, Record, Trial, VlmUnderTest, draw};

use super::tokens::{Counts, counted, median};

const METHODS: [&str; 3] = ["spf-default", "spf-monitor", "spf-news"];

fn flown(task: &Arc<Task>, method: &str, errors: &str, seed: u64) -> Result<(Record, [u64; 4]), String> {
    let counts = Counts::default();
    let name = format!("oracle:{errors}");
    let vlm_factory = counted(errors, &counts).map_err(|error| error.to_string())?;
    let pointer = Some(VlmUnderTest { vlm_factory, name, latency: None });
    let method = Method::of_name(method).ok_or("no such method")?;
    let drawn = draw(task, seed).map_err(|error| error.to_string())?;
    let trial = Trial { task: task.clone(), method, pointer, seed, max_cost_usd: None };
    Ok((trial.fly(&drawn, None).record, counts.taken()))
}

/// Flies the suite, with all methods or one, and prints the table; the flights that ended by a false `done` go to the standard error.
pub(crate) fn run(name: &str, seeds: u64, only: Option<&str>) -> Result<(), Box<dyn Error>> {
    let tasks = suite(name).ok_or("no such suite")?.tasks()?;
    println!(
        "| errors | method | flights | success | false done | collided | seconds of successes | queries, monitor's | tokens |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    for errors in ["default", "poor"] {
        for method in METHODS.into_iter().filter(|method| only.is_none_or(|only| only == *method)) {
            let trials: Vec<(&Arc<Task>, u64)> = tasks.iter().flat_map(|task| (0..seeds).map(move |seed| (task, seed))).collect();
            let all: Result<Vec<_>, String> = trials.par_iter().map(|(task, seed)| flown(task, method, errors, *seed)).collect();
            let all = all?;
            let count = |what: &dyn Fn(&Record) -> bool| all.iter().filter(|(record, _)| what(record)).count();
            for ((record, _), (_, seed)) in all.iter().zip(&trials).filter(|((record, _), _)| record.scores.false_stop) {
                eprintln!("false done: {errors} {method} {} seed {seed}", record.task);
            }
            let seconds = |record: &Record| record.flight.as_ref().map(|flight| flight.finished_at_s);
            let successes = all.iter().filter(|(record, _)| record.scores.self_stop);
            let mean = |index: usize| all.iter().map(|(_, counts)| counts[index]).sum::<u64>() / all.len().max(1) as u64;
            println!(
                "| {errors} | `{method}` | {} | {} | {} | {} | {:.1} | {}, {} | {} |",
                all.len(),
                count(&|record| record.scores.self_stop),
                count(&|record| record.scores.false_stop),
                count(&|record| record.scores.collided),
                median(successes.filter_map(|(record, _)| seconds(record)).collect()),
                mean(0),
                mean(1),
                mean(2) + mean(3),
            );
        }
    }
    Ok(())
}

//! Runs many trials on several threads into a folder, and resumes interrupted runs.

pub mod asked;
mod files;
mod film;
mod manifest;
mod shard;
mod store;

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::channel;

use rayon::{ThreadPool, ThreadPoolBuilder};
use spf_vlm::service::Service;

use asked::Asked;
pub use files::StoreError;
pub use film::video_of;
pub use manifest::{RunManifest, shell_word};
pub use shard::{Shard, ShardError};
pub use store::{RunHeader, Store, merge, read_head, read_paths, read_records};

use crate::fnv;
use crate::task::Task;
use crate::trial::{Flown, Lost, Method, Networks, Record, Trial, VlmUnderTest, draw};

/// A plan of trials.
pub struct Plan {
    /// The tasks, in order.
    pub tasks: Vec<Arc<Task>>,
    /// The methods, in order.
    pub methods: Vec<Method>,
    /// The VLMs, in order; the blind control is flown once for all of them.
    pub pointers: Vec<VlmUnderTest>,
    /// Number of trials (seeds) per task.
    pub trials: u64,
    /// Seed of the first trial; the others follow.
    pub seed: u64,
    /// Cost limit per trial, US dollars.
    pub max_cost_usd: Option<f64>,
    /// What takes the place of what the simulator gives the methods.
    pub networks: Networks,
}

impl Plan {
    /// Trials in groups: those of a group start from the same sampled pose in the same sampled scene.
    #[must_use]
    pub fn draws(&self) -> Vec<Vec<Trial>> {
        let mut draws = Vec::new();
        for task in &self.tasks {
            for number in 0..self.trials {
                draws.push(self.draw(task, self.seed.wrapping_add(number)));
            }
        }
        draws
    }

    fn draw(&self, task: &Arc<Task>, seed: u64) -> Vec<Trial> {
        let (max_cost_usd, networks) = (self.max_cost_usd, &self.networks);
        let trial =
            |method, pointer| Trial { task: task.clone(), method, pointer, seed, max_cost_usd, networks: networks.clone() };
        let trials = |method: Method| -> Vec<Trial> {
            if method.uses_vlm() {
                self.pointers.iter().map(|pointer| trial(method, Some(pointer.clone()))).collect()
            } else {
                vec![trial(method, None)]
            }
        };
        self.methods.iter().flat_map(|method| trials(*method)).collect()
    }

    /// Its head, for one shard. `pointing` describes what the VLM names stand for.
    #[must_use]
    pub fn head(&self, shard: Shard, pointing: &str) -> RunHeader {
        let trials = self.draws().iter().flatten().map(Trial::run_id).collect();
        let Networks { detector, depth } = &self.networks;
        let detector = detector.as_ref().map(|network| format!(" detector {}", network.name));
        let depth = depth.as_ref().map(|network| format!(" depth {} {:?}", network.details, network.period));
        let networks = [detector, depth].map(Option::unwrap_or_default).concat();
        let all = format!("{:?} {pointing} {:?}{networks}", self.tasks, self.max_cost_usd);
        RunHeader::new(trials, shard, format!("{:016x}", fnv(all.as_bytes())))
    }
}

/// Progress of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Progress {
    /// Number of trials of this shard.
    pub of: usize,
    /// Number of completed trials.
    pub done: usize,
    /// Whether it was stopped early.
    pub stopped: bool,
}

/// How a plan is run, without effect on its rows.
#[derive(Clone)]
pub struct RunOptions {
    /// Number of parallel trials.
    pub jobs: usize,
    /// Whether to record videos.
    pub videos: bool,
    /// The command for the same rows, stored in `run.json`.
    pub command: String,
    /// Tasks that are not built in: id and file.
    pub files: BTreeMap<String, String>,
    /// The folder to which the questions are written, if somebody answers them; not with videos.
    pub asked: Option<Asked>,
}

/// Runs the missing trials of one shard. `on_progress` receives the progress. Once the `service` has ended, its trials end without
/// a row, and no further one starts.
///
/// # Errors
/// [`StoreError`] if results cannot be stored.
pub fn run(
    plan: &Plan,
    head: &RunHeader,
    folder: &Path,
    options: &RunOptions,
    service: &Arc<Service>,
    on_progress: &mut dyn FnMut(Progress, Option<&Record>),
) -> Result<Progress, StoreError> {
    let (mut store, there) = Store::open(folder, head)?;
    let made = RunManifest::begin(folder, &options.command, &options.files)?;
    options.asked.as_ref().map_or(Ok(()), Asked::begin)?;
    let is_there = |trial: &Trial| there.binary_search(&trial.run_id()).is_ok();
    let own = plan.draws().into_iter().enumerate().filter(|(number, _)| head.shard.has(*number)).map(|(_, trials)| trials);
    let own: Vec<Vec<Trial>> = own.collect();
    let of = own.iter().map(Vec::len).sum();
    let left: Vec<Vec<Trial>> = own
        .into_iter()
        .map(|trials| trials.into_iter().filter(|trial| !is_there(trial)).collect())
        .filter(|trials: &Vec<Trial>| !trials.is_empty())
        .collect();
    let mut progress = Progress { of, done: of - left.iter().map(Vec::len).sum::<usize>(), stopped: false };
    on_progress(progress, None);
    let next = AtomicUsize::new(0);
    let mut unfinished_usd = 0.0;
    let (rows, arrived) = channel();
    std::thread::scope(|scope| {
        for _ in 0..options.jobs.clamp(1, left.len().max(1)) {
            let (rows, next, left) = (rows.clone(), &next, &left);
            scope.spawn(move || {
                let own = threads(options.jobs);
                loop {
                    let number = next.fetch_add(1, Ordering::Relaxed);
                    let Some(trials) = left.get(number) else { return };
                    let fly = || fly_draw(trials, folder, options, service, &mut |flown| rows.send(flown).is_ok());
                    // Towards the end some jobs have finished: the others may use all threads.
                    let is_last = number + options.jobs > left.len();
                    if !own.as_ref().filter(|_| !is_last).map_or_else(fly, |own| own.install(fly)) {
                        return;
                    }
                }
            });
        }
        drop(rows);
        for flown in arrived {
            let flown = match flown {
                Ok(Err(lost)) => {
                    unfinished_usd += lost.cost_usd;
                    continue;
                }
                Ok(Ok(flown)) => Ok(flown),
                Err(error) => Err(error),
            };
            let kept = flown.and_then(|flown| store.push(&flown).map(|()| flown.record));
            if kept.is_err() {
                service.stop();
            }
            let record = kept?;
            progress.done += 1;
            on_progress(progress, Some(&record));
        }
        Ok(())
    })?;
    progress.stopped = progress.done < of;
    store.finish(head)?;
    if !left.is_empty() {
        made.end(folder, unfinished_usd, progress.done == of)?;
    }
    Ok(progress)
}

/// A thread pool for one of `jobs` parallel jobs: with a shared one they would spend their time waiting for each other.
/// `None` if the system cannot provide it.
fn threads(jobs: usize) -> Option<ThreadPool> {
    ThreadPoolBuilder::new().num_threads((rayon::current_num_threads() / jobs.max(1)).max(1)).build().ok()
}

/// Flies the trials from one sampled start; false if the run is to end.
fn fly_draw(
    trials: &[Trial],
    folder: &Path,
    options: &RunOptions,
    service: &Arc<Service>,
    send: &mut dyn FnMut(Result<Result<Flown, Lost>, StoreError>) -> bool,
) -> bool {
    let Some(first) = trials.first() else { return true };
    let mut drawn = None;
    for trial in trials {
        if service.is_ended() {
            return false;
        }
        let flown = match (drawn.get_or_insert_with(|| draw(&first.task, first.seed)), &options.asked) {
            (Ok(drawn), Some(asked)) => asked.fly(trial, drawn, service),
            (Ok(drawn), None) if options.videos => film::fly(trial, drawn, folder, service),
            (Ok(drawn), None) => Ok(trial.fly_served(drawn, None, service)),
            (Err(error), _) => Ok(Ok(trial.failed(None, error))),
        };
        if !send(flown) {
            return false;
        }
    }
    true
}

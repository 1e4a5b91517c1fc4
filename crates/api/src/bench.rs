//! Trials of the bench: a suite of tasks, flown by methods with VLMs, or by the caller, with success rates. The rows are those of
//! `spf bench run`, and a run that was stopped is gone on with by the same request.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::thread::Builder;

use spf_bench::run::{Plan, Progress, RunOptions, Shard, StoreError, read_records, run};
use spf_bench::task::{SUITES, Task, TaskError, shipped, suite};
use spf_bench::trial::{Method, Networks, Record, VlmUnderTest, split_latency};
use spf_core::time::Duration;
use spf_vlm::service::{RunEnd, Service, WallClock};

use crate::error::{Error, nearest};
use crate::question::{Question, asking};
use crate::vlm::named;

/// The method of a caller's policy: the steps that it answers are those of text actions in numbers.
pub const CALLERS_METHOD: &str = "plain-numeric";

/// The caller of a run as the VLM of its methods.
#[derive(Clone, Debug, PartialEq)]
pub struct Caller {
    /// Its name in rows, without a `/`.
    pub name: String,
    /// The time in seconds that an answer counts as having taken.
    pub latency_s: f64,
}

/// A run: each task, with each method and each VLM, as many times as there are trials.
#[derive(Clone, Debug, PartialEq)]
pub struct BenchRequest {
    /// A suite, such as `paper`.
    pub suite: Option<String>,
    /// Tasks by their names or files, in addition.
    pub tasks: Vec<String>,
    /// Methods; without any `spf-default`. A caller that is the policy is flown as [`CALLERS_METHOD`].
    pub methods: Vec<String>,
    /// VLMs by their names; without any the caller, or else `oracle:default`.
    pub vlms: Vec<String>,
    /// The caller as a VLM, in addition.
    pub caller: Option<Caller>,
    /// Number of trials of each task.
    pub trials: u64,
    /// Seed of the first of them; the others follow.
    pub seed: u64,
    /// The folder of the rows: a new one, or that of the same request.
    pub folder: PathBuf,
    /// Number of trials flown at once; `None` for one per core.
    pub jobs: Option<usize>,
    /// Limit of the cost of the whole run, US dollars.
    pub max_cost_usd: Option<f64>,
}

impl BenchRequest {
    /// The call, for the head of the results: what tells the trials of one run from those of another.
    fn in_words(&self) -> String {
        let Self { suite, tasks, methods, vlms, caller, trials, seed, .. } = self;
        let lists = [("tasks", tasks), ("methods", methods), ("vlm", vlms)];
        let mut said: Vec<String> = suite.iter().map(|name| format!("{name:?}")).collect();
        said.extend(lists.iter().filter(|(_, names)| !names.is_empty()).map(|(key, names)| format!("{key}={names:?}")));
        said.extend(caller.iter().map(|Caller { name, latency_s }| format!("name={name:?}, vlm_latency_s={latency_s}")));
        format!("spf.bench.run({}, trials={trials}, seed={seed})", said.join(", "))
    }
}

/// What a run needs of its caller, or tells it.
#[derive(Debug)]
pub enum BenchHappening {
    /// A query to the caller.
    Question(Question),
    /// So many of so many trials are done.
    Progress {
        /// Number done.
        done: usize,
        /// Number in all.
        of: usize,
    },
    /// The run is over: [`Benching::finish`] says how.
    Ended,
}

enum Sent {
    Asked(Question),
    Progress(Progress),
    Ended(Result<Progress, StoreError>),
}

/// A run in threads of its own. Dropped, it stops, and keeps the trials that are done.
pub struct Benching {
    sent: Receiver<Sent>,
    ended: Option<Result<Progress, StoreError>>,
    service: Arc<Service>,
    folder: PathBuf,
}

impl core::fmt::Debug for Benching {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Benching").field("folder", &self.folder).finish_non_exhaustive()
    }
}

impl Benching {
    /// Waits for what happens next, at most for `most`; `None` if nothing did.
    pub fn wait(&mut self, most: Duration) -> Option<BenchHappening> {
        if self.ended.is_some() {
            return Some(BenchHappening::Ended);
        }
        match self.sent.recv_timeout(most) {
            Ok(Sent::Asked(question)) => Some(BenchHappening::Question(question)),
            Ok(Sent::Progress(Progress { done, of, .. })) => Some(BenchHappening::Progress { done, of }),
            Ok(Sent::Ended(result)) => {
                self.ended = Some(result);
                Some(BenchHappening::Ended)
            }
            Err(RecvTimeoutError::Timeout) => None,
            Err(RecvTimeoutError::Disconnected) => Some(BenchHappening::Ended),
        }
    }

    /// Stops: the trials under way end without a row.
    pub fn stop(&self) {
        self.service.stop();
    }

    /// The rows; waits for the end. Questions are not answered meanwhile.
    ///
    /// # Errors
    /// The run ended early, or rows could not be stored. What is done is kept, and the same request goes on.
    pub fn finish(mut self) -> Result<Vec<Record>, Error> {
        while !matches!(self.wait(Duration::from_secs(60)), Some(BenchHappening::Ended)) {}
        let ended = self.ended.take().ok_or_else(|| Error::internal("the run ended with an internal error"))?;
        let Progress { of, done, stopped } = ended.map_err(|error| store_error(&error))?;
        if stopped {
            let kept = format!("{done} of {of} trials are done and kept in {}", self.folder.display());
            let error = match self.service.ended() {
                Some(RunEnd::Spent { spent, limit }) => Error::failed(format!("${spent:.4} of ${limit} are spent; {kept}")),
                Some(RunEnd::Refused { vlm, error } | RunEnd::Down { vlm, error, .. } | RunEnd::Unanswered { vlm, error }) => {
                    Error::failed(format!("{vlm} does not answer; {kept}")).because(&error)
                }
                _ => Error::failed(format!("stopped; {kept}")),
            };
            return Err(error.hint("the same call flies the others"));
        }
        rows(&self.folder)
    }
}

impl Drop for Benching {
    fn drop(&mut self) {
        self.stop();
    }
}

/// The rows in the folder of a run, a finished one or not.
///
/// # Errors
/// They cannot be read.
pub fn rows(folder: &Path) -> Result<Vec<Record>, Error> {
    read_records(folder).map_err(|error| store_error(&error))
}

/// Starts a run.
///
/// # Errors
/// A usage error for unknown tasks, methods and VLMs. What is wrong with the folder is told by [`Benching::finish`].
pub fn start(request: &BenchRequest) -> Result<Benching, Error> {
    let BenchRequest { trials, seed, .. } = *request;
    let (tasks, files) = tasks(request.suite.as_deref(), &request.tasks, "a suite is `paper`, a task `real-nav-chair`")?;
    let methods = match &request.methods[..] {
        [] => vec![method("spf-default")?],
        names => names.iter().map(|name| method(name)).collect::<Result<_, _>>()?,
    };
    let (send, sent) = channel();
    let mut pointers: Vec<VlmUnderTest> =
        request.vlms.iter().map(|name| pointer(name, request.max_cost_usd)).collect::<Result<_, _>>()?;
    if let Some(Caller { name, latency_s }) = &request.caller {
        if name.is_empty() || name.contains('/') {
            return Err(Error::usage(format!("`{name}` cannot be the name of a VLM in rows")).hint("a name without a `/`"));
        }
        let send = send.clone();
        let ask = Arc::new(move |question| send.send(Sent::Asked(question)).is_ok());
        let vlm_factory = asking(name, *latency_s, ask)?.vlm_factory;
        pointers.push(VlmUnderTest { name: name.clone(), vlm_factory, latency: None });
    }
    if pointers.is_empty() {
        pointers.push(pointer("oracle:default", None)?);
    }
    let names: Vec<&str> = pointers.iter().map(|pointer| pointer.name.as_str()).collect();
    let latency = request.caller.as_ref().map_or(String::new(), |caller| format!("@{}", caller.latency_s));
    let shown = names.join(",") + &latency;
    let plan = Plan { tasks, methods, pointers, trials, seed, max_cost_usd: None, networks: Networks::default() };
    let head = plan.head(Shard::WHOLE, &shown);
    let jobs = request.jobs.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from)).max(1);
    let options = RunOptions { jobs, videos: false, command: request.in_words(), files, asked: None };
    let service = Service::new(Arc::new(WallClock::default()), request.max_cost_usd, |wait| {
        tracing::warn!(vlm = wait.vlm, error = %wait.error, "no answer; asked again");
    });
    let (running, folder) = (service.clone(), request.folder.clone());
    let fly = move || {
        let mut tell = |progress, _: Option<&Record>| drop(send.send(Sent::Progress(progress)));
        let ended = run(&plan, &head, &folder, &options, &running, &mut tell);
        // Nobody may be there any more.
        drop(send.send(Sent::Ended(ended)));
    };
    Builder::new()
        .name("bench".to_owned())
        .spawn(fly)
        .map_err(|error| Error::internal("cannot start a thread for the run").because(&error))?;
    Ok(Benching { sent, ended: None, service, folder: request.folder.clone() })
}

/// A VLM by its name; an oracle's latency may be fixed.
fn pointer(name: &str, max_cost_usd: Option<f64>) -> Result<VlmUnderTest, Error> {
    let (vlm, latency) = split_latency(name);
    Ok(VlmUnderTest { name: name.to_owned(), vlm_factory: named(vlm, max_cost_usd.is_some())?.vlm_factory, latency })
}

/// Tasks that are not built in: id and file.
pub type Files = BTreeMap<String, String>;

/// All selected tasks, and the files of those that are not built in; `example` selects some.
///
/// # Errors
/// A usage error for an unknown suite or task, an invalid file, an id that stands twice, and for none.
pub fn tasks(suite_name: Option<&str>, names: &[String], example: &str) -> Result<(Vec<Arc<Task>>, Files), Error> {
    let (mut tasks, mut files) = (Vec::new(), Files::new());
    if let Some(name) = suite_name {
        let suite = suite(name).ok_or_else(|| {
            let names: Vec<&str> = SUITES.iter().map(|suite| suite.name).collect();
            let error = Error::usage(format!("unknown suite `{name}`"));
            match nearest(name, names.iter().copied()) {
                Some(near) => error.hint(format!("did you mean `{near}`?")),
                None => error.hint(format!("suites: {}", names.join(", "))),
            }
        })?;
        tasks = suite.tasks().map_err(|error| Error::internal("invalid built-in task").because(&error))?;
    }
    for name in names {
        let task = task_of(name)?;
        if *name != task.id {
            files.insert(task.id.clone(), name.clone());
        }
        tasks.push(Arc::new(task));
    }
    let mut ids: Vec<&str> = tasks.iter().map(|task| task.id.as_str()).collect();
    ids.sort_unstable();
    if let Some(twice) = ids.windows(2).find(|pair| pair[0] == pair[1]) {
        return Err(Error::usage(format!("duplicate task id `{}`", twice[0])).hint("task ids must be unique in a run"));
    }
    if tasks.is_empty() {
        return Err(Error::usage("no task given").hint(example));
    }
    Ok((tasks, files))
}

/// A task by its file, or a built-in one by its name.
///
/// # Errors
/// A usage error for an unknown name, and an invalid file.
pub fn task_of(name: &str) -> Result<Task, Error> {
    let refused = |error: &TaskError| {
        let what = if matches!(error, TaskError::Foreign { .. }) { "cannot fly the task" } else { "invalid task" };
        Error::usage(format!("{what} `{name}`")).because(error)
    };
    if name.contains(['/', '.']) || Path::new(name).exists() {
        return Task::load(name).map_err(|error| refused(&error));
    }
    shipped(name).map_err(|error| refused(&error))?.ok_or_else(|| {
        let known = SUITES.iter().flat_map(|suite| suite.names());
        let hint = match nearest(name, known) {
            Some(near) => format!("did you mean `{near}`?"),
            None => "`spf bench list` lists the built-in tasks; a file path must contain a `/` or a `.`".to_owned(),
        };
        Error::usage(format!("unknown task `{name}`")).hint(hint)
    })
}

/// The method with this name.
///
/// # Errors
/// A usage error for an unknown one.
pub fn method(name: &str) -> Result<Method, Error> {
    Method::of_name(name).ok_or_else(|| {
        let known: Vec<&str> = Method::all().map(Method::name).collect();
        let error = Error::usage(format!("unknown method `{name}`"));
        match nearest(name, known.iter().copied()) {
            Some(near) => error.hint(format!("did you mean `{near}`?")),
            None => error.hint(format!("methods: {}", known.join(", "))),
        }
    })
}

/// The error if results cannot be stored, with a remedy.
#[must_use]
pub fn store_error(error: &StoreError) -> Error {
    match error {
        StoreError::Other { .. } => Error::usage("the folder holds results of a run with different settings")
            .because(error)
            .hint("use another folder, or repeat the command that created this one"),
        StoreError::InUse(_) => {
            Error::usage("the folder is in use").because(error).hint("wait for that run to end, or use another folder")
        }
        StoreError::Replaced(_) => Error::internal("the rows of this run are lost")
            .because(error)
            .hint("repeat it with another folder; end a run with Ctrl-C before its folder is deleted"),
        StoreError::Questions(_) => Error::usage("cannot go on with the questions and answers").because(error),
        StoreError::Shards(_) => {
            Error::usage("cannot merge the shards").because(error).hint("give the folders of all shards, each finished")
        }
        _ => Error::internal("cannot store the results").because(error),
    }
}

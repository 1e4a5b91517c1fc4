//! Runs whose VLM's service fails: for an hour of a night, for good, or until somebody pays. The clock is the test's.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, LazyLock, Mutex};

use spf_bench::run::{Plan, Progress, RunManifest, RunOptions, Shard, run};
use spf_bench::task::Task;
use spf_bench::trial::{Method, Networks, VlmUnderTest};
use spf_core::time::Duration;
use spf_flight::sim::{VlmFactory, oracle_factory};
use spf_oracle::ErrorFile;
use spf_vlm::service::{PATIENCE, RunClock, RunEnd, Service, Wait};
use spf_vlm::{Answer, ImageSpec, QueryImage, QueryRequest, Vlm, VlmError};

const HOUR: Duration = Duration::from_secs(3600);
/// What a query takes on this clock: a night for a few flights.
const QUERY: Duration = Duration::from_secs(15 * 60);
const CENT: f64 = 0.01;
const TRIALS: usize = 2;

/// A task whose flights are short.
const TASK: &str = include_str!("drink.toml");

/// A clock that goes on while somebody waits or a query is answered.
#[derive(Default)]
struct NightClock(AtomicU64);

impl NightClock {
    fn pass(&self, time: Duration) {
        self.0.fetch_add(u64::try_from(time.as_nanos()).unwrap(), Ordering::SeqCst);
    }
}

impl RunClock for NightClock {
    fn now(&self) -> Duration {
        Duration::from_nanos(self.0.load(Ordering::SeqCst))
    }

    fn wait(&self, time: Duration, is_over: &dyn Fn() -> bool) {
        if !is_over() {
            self.pass(time);
        }
    }
}

/// Whether a server fails at this query, by its number and the time.
type Fails = Arc<dyn Fn(usize, Duration) -> Option<VlmError> + Send + Sync>;

/// The oracle behind a server that may fail; an answer costs a cent.
struct Served {
    vlm: Box<dyn Vlm>,
    clock: Arc<NightClock>,
    asked: Arc<AtomicUsize>,
    fails: Fails,
}

impl Vlm for Served {
    fn name(&self) -> &str {
        self.vlm.name()
    }

    fn image_spec(&self, camera: (u32, u32)) -> ImageSpec {
        self.vlm.image_spec(camera)
    }

    fn answer(&mut self, request: &QueryRequest<'_>, image: &mut dyn QueryImage) -> Answer {
        let number = self.asked.fetch_add(1, Ordering::SeqCst);
        if let Some(error) = (self.fails)(number, self.clock.now()) {
            let latency = Duration::from_millis(300);
            return Answer { text: Err(error), latency, model: "m".to_owned(), account: spf_vlm::Usage::default() };
        }
        self.clock.pass(QUERY);
        let mut answer = self.vlm.answer(request, image);
        (answer.account.requests, answer.account.cost_usd) = (1, Some(CENT));
        answer
    }
}

struct Night {
    end: Option<RunEnd>,
    progress: Progress,
    waits: Vec<Wait>,
    took: Duration,
    asked: usize,
    spent: f64,
}

/// Two flights of a task in a folder.
fn night(
    folder: &Path,
    max_cost: Option<f64>,
    fails: impl Fn(usize, Duration) -> Option<VlmError> + Send + Sync + 'static,
) -> Night {
    let clock = Arc::new(NightClock::default());
    let (asked, fails): (Arc<AtomicUsize>, Fails) = (Arc::default(), Arc::new(fails));
    let name = "oracle:default".to_owned();
    let oracle = oracle_factory(name.clone(), ErrorFile::named("default").unwrap());
    let vlm_factory: VlmFactory = {
        let (clock, asked) = (clock.clone(), asked.clone());
        Arc::new(move |world, seed| {
            let (clock, asked, fails) = (clock.clone(), asked.clone(), fails.clone());
            Ok(Box::new(Served { vlm: oracle(world, seed)?, clock, asked, fails }))
        })
    };
    let plan = Plan {
        tasks: vec![Arc::new(Task::parse(TASK, "drink.toml").unwrap())],
        methods: vec![Method::of_name("spf").unwrap()],
        pointers: vec![VlmUnderTest { name, vlm_factory, latency: None }],
        trials: TRIALS as u64,
        seed: 0,
        max_cost_usd: None,
        networks: Networks::default(),
    };
    let head = plan.head(Shard::WHOLE, "oracle:default");
    let options = RunOptions { jobs: 1, videos: false, command: "spf bench run".to_owned(), files: BTreeMap::new(), asked: None };
    let waits = Arc::new(Mutex::new(Vec::new()));
    let heard = waits.clone();
    let service = Service::new(clock.clone(), max_cost, move |wait| heard.lock().unwrap().push(wait.clone()));
    service.charge(RunManifest::read(folder).unwrap().map_or(0.0, |made| made.unfinished_usd));
    let progress = run(&plan, &head, folder, &options, &service, &mut |_, _| {}).unwrap();
    let waits = waits.lock().unwrap().clone();
    let spent = service.spent_usd();
    Night { end: service.ended(), progress, waits, took: clock.now(), asked: asked.load(Ordering::SeqCst), spent }
}

fn vendor(status: u16, message: &str, retry_after: Option<Duration>) -> VlmError {
    VlmError::Vendor { host: "api.example".to_owned(), status, code: None, message: message.to_owned(), retry_after }
}

fn rows(folder: &Path) -> String {
    std::fs::read_to_string(folder.join("results.jsonl")).unwrap()
}

/// A night without any failure: its end, and its rows.
static CALM: LazyLock<(Night, String)> = LazyLock::new(|| {
    let folder = tempfile::tempdir().unwrap();
    let night = night(folder.path(), None, |_, _| None);
    assert_eq!((night.end.clone(), night.progress.done), (None, TRIALS));
    assert!(night.took > 3 * HOUR, "{:?}", night.took);
    (night, rows(folder.path()))
});

/// An hour without network, then overload and a rate limit, cost the night an hour and no row.
#[test]
fn a_night_with_an_hour_without_service_has_the_same_rows() {
    let rough = tempfile::tempdir().unwrap();
    let (undisturbed, calm) = &*CALM;
    let disturbed = night(rough.path(), None, |number, now| {
        let dead = (HOUR..2 * HOUR).contains(&now);
        let error = match number % 3 {
            0 => VlmError::Network { host: "api.example".to_owned(), reason: "no route to host".to_owned() },
            1 => vendor(503, "overloaded", None),
            _ => vendor(429, "slow down", Some(Duration::from_secs(90))),
        };
        dead.then_some(error)
    });
    assert_eq!((disturbed.end, disturbed.progress.done, disturbed.progress.stopped), (None, TRIALS, false));
    assert_eq!(rows(rough.path()), *calm);
    let failing = disturbed.waits.last().unwrap().failing;
    assert!((HOUR / 2..=HOUR).contains(&failing), "{:?}", disturbed.waits);
    let longer = disturbed.took - undisturbed.took;
    // From the first query that failed, up to one query after the hour began, to the first try after it ended.
    let longest_pause = Duration::from_secs(5 * 60);
    assert!((HOUR - QUERY..=HOUR + longest_pause).contains(&longer), "{longer:?}");
    assert!(disturbed.waits.len() < 25, "{}", disturbed.waits.len());
}

/// Whatever ends a run leaves the rows of whole flights, and the same command flies the others.
#[test]
fn a_run_that_its_service_ended_is_resumed() {
    let rough = tempfile::tempdir().unwrap();
    let (whole, calm) = &*CALM;
    let folder = rough.path();
    // A wrong key: no row, and a reason.
    let refused = night(folder, None, |_, _| Some(vendor(401, "bad key", None)));
    assert_eq!((refused.progress.done, refused.asked, rows(folder).as_str()), (0, 1, ""));
    let Some(RunEnd::Refused { error, .. }) = refused.end else { panic!("{:?}", refused.end) };
    assert_eq!(error.code(), "key");
    // The credit is used up within a flight; what it cost is remembered.
    let within = whole.asked / 2 + 1;
    let broke = night(folder, None, move |number, _| (number >= within).then(|| vendor(402, "no credit", None)));
    let made = RunManifest::read(folder).unwrap().unwrap();
    assert!(matches!(broke.end, Some(RunEnd::Refused { .. })) && broke.progress.done == 1);
    assert!(made.unfinished_usd > 0.0 && made.ended.is_none(), "{made:?}");
    let paid: f64 = rows(folder)
        .lines()
        .map(|row| serde_json::from_str::<serde_json::Value>(row).unwrap()["cost_usd"].as_f64().unwrap())
        .sum();
    assert!((broke.spent - paid - made.unfinished_usd).abs() < 1e-9, "{} {paid} {made:?}", broke.spent);
    // Dead for good: given up after two hours, not one minute earlier.
    let dead = night(folder, None, |_, _| Some(vendor(500, "boom", None)));
    assert!(matches!(dead.end, Some(RunEnd::Down { failing, .. }) if failing == PATIENCE), "{:?}", dead.end);
    assert_eq!((dead.took, dead.progress.done), (PATIENCE, broke.progress.done));
    // Then well, but for two bad moments.
    let well = night(folder, None, |number, _| match number {
        0 => Some(vendor(429, "slow down", None)),
        3 => Some(vendor(500, "boom", None)),
        _ => None,
    });
    assert_eq!((well.end, well.progress.done, well.waits.len()), (None, TRIALS, 2));
    assert_eq!(rows(folder), *calm);
    assert!(RunManifest::read(folder).unwrap().unwrap().ended.is_some());
}

#[test]
fn the_money_of_a_run_ends_it_and_a_model_that_never_answers_has_no_row() {
    let folder = tempfile::tempdir().unwrap();
    let limited = night(folder.path(), Some(3.0 * CENT), |_, _| None);
    assert!(matches!(limited.end, Some(RunEnd::Spent { .. })), "{:?}", limited.end);
    assert_eq!((limited.asked, limited.progress.done, limited.progress.stopped), (3, 0, true));
    // Nothing is left for the same limit.
    let again = night(folder.path(), Some(3.0 * CENT), |_, _| None);
    assert_eq!((again.asked, rows(folder.path()).as_str()), (0, ""));
    let late =
        |_, _| Some(VlmError::Deadline { host: "h".to_owned(), waited: Duration::from_secs(20), stage: "no data".to_owned() });
    let mute = night(folder.path(), None, late);
    assert!(matches!(mute.end, Some(RunEnd::Unanswered { .. })), "{:?}", mute.end);
    assert_eq!(rows(folder.path()), "");
    // One that declines has answered, and fails.
    let declines = night(folder.path(), None, |_, _| Some(VlmError::Declined("no".to_owned())));
    assert_eq!((declines.end, declines.progress.done), (None, TRIALS));
}

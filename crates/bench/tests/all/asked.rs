//! Trials whose questions somebody answers through a folder: here a script, with the oracle's own answers.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use spf_bench::run::asked::{Asked, write};
use spf_bench::run::{Plan, RunOptions, Shard, StoreError, read_paths, read_records, run};
use spf_bench::task::Task;
use spf_bench::trial::{Flown, Method, Networks, Record, Trial, VlmUnderTest, draw};
use spf_flight::sim::{VlmFactory, oracle_factory};
use spf_oracle::ErrorFile;
use spf_vlm::folder::{FolderOptions, OPEN, Points, QuestionFolder};
use spf_vlm::service::{RunEnd, Service};
use spf_vlm::{Answer, QueryImage, QueryRequest, Vlm};

const TASK: &str = include_str!("drink.toml");
const RUN_ID: &str = "drink/spf/asked-a-script/0";
const LATENCY_S: f64 = 1.5;
const WHO: &str = "a script";

/// Keeps what the oracle says.
struct Heard {
    vlm: Box<dyn Vlm>,
    texts: Arc<Mutex<Vec<String>>>,
}

impl Vlm for Heard {
    fn name(&self) -> &str {
        self.vlm.name()
    }

    fn answer(&mut self, request: &QueryRequest<'_>, image: &mut dyn QueryImage) -> Answer {
        let answer = self.vlm.answer(request, image);
        self.texts.lock().unwrap().push(answer.text.clone().unwrap());
        answer
    }
}

fn task() -> Arc<Task> {
    Arc::new(Task::parse(TASK, "drink.toml").unwrap())
}

/// The flight by the oracle itself, and its answers.
fn by_the_oracle() -> (Flown, Vec<String>) {
    let name = "oracle:perfect".to_owned();
    let oracle = oracle_factory(name.clone(), ErrorFile::named("perfect").unwrap());
    let texts: Arc<Mutex<Vec<String>>> = Arc::default();
    let heard = texts.clone();
    let vlm_factory: VlmFactory =
        Arc::new(move |world, seed| Ok(Box::new(Heard { vlm: oracle(world, seed)?, texts: heard.clone() })));
    let pointer = Some(VlmUnderTest { name, vlm_factory, latency: Some(LATENCY_S) });
    let trial = Trial {
        task: task(),
        method: Method::of_name("spf").unwrap(),
        pointer,
        seed: 0,
        max_cost_usd: None,
        networks: Networks::default(),
    };
    let flown = trial.fly(&draw(&trial.task, 0).unwrap(), None);
    let texts = texts.lock().unwrap().clone();
    (flown, texts)
}

/// Runs the trial with the answers in a folder; whether it is complete, and why it ended otherwise.
fn asked(folder: &Path, waits: bool, long_side: Option<u32>) -> Result<(bool, Option<RunEnd>), StoreError> {
    // The oracle's coordinates.
    let points = Points::YxThousandths;
    let options = FolderOptions { name: format!("asked:{WHO}"), points, long_side, quality: 90, waits };
    let plan = Plan {
        tasks: vec![task()],
        methods: vec![Method::of_name("spf").unwrap()],
        pointers: vec![VlmUnderTest {
            name: options.name.clone(),
            vlm_factory: Arc::new(|_, _| Err("not asked".into())),
            latency: Some(LATENCY_S),
        }],
        trials: 1,
        seed: 0,
        max_cost_usd: None,
        networks: Networks::default(),
    };
    let head = plan.head(Shard::WHOLE, "asked");
    let asked = Asked::new(QuestionFolder::new(folder, options, Arc::new(|_| {}), None), WHO.to_owned());
    let options =
        RunOptions { jobs: 1, videos: false, command: "spf bench ask".to_owned(), files: BTreeMap::new(), asked: Some(asked) };
    let service = Service::impatient();
    let ended = run(&plan, &head, folder, &options, &service, &mut |_, _| {})?;
    write(folder, WHO, &head.trials, &read_records(folder)?)?;
    Ok((!ended.stopped, service.ended()))
}

fn at(folder: &Path, name: &str) -> PathBuf {
    folder.join(RUN_ID).join(name)
}

fn name(letter: char, number: usize, end: &str) -> String {
    format!("{letter}{number:04}.{end}")
}

/// Answers the questions from `first` on as they appear, with these answers.
fn answer_from(folder: &Path, first: usize, texts: &[String]) -> std::thread::JoinHandle<()> {
    let (folder, texts) = (folder.to_owned(), texts.to_vec());
    std::thread::spawn(move || {
        for number in first..=texts.len() {
            while !at(&folder, &name('q', number, "txt")).exists() {
                std::thread::sleep(Duration::from_millis(10));
            }
            assert!(at(&folder, &name('q', number, "png")).exists(), "the picture is there before the prompt");
            fs::write(at(&folder, &name('a', number, "txt")), &texts[number - 1]).unwrap();
        }
    })
}

/// The row without what tells who answered.
fn anonymous(mut record: Record) -> Record {
    record.run_id.clear();
    record.answered_by = None;
    record.vlm_details.provider.clear();
    record.vlm_details.models.clear();
    // Of a query that is open as the flight ends, only a folder has the answer by then.
    record.n_vlm_calls = 0;
    let flight = record.flight.as_mut().unwrap();
    flight.vlm.clear();
    flight.vlm_use = None;
    record
}

#[test]
fn the_oracles_answers_fly_the_oracles_flight_and_a_stop_changes_nothing() {
    let (flown, texts) = by_the_oracle();
    assert!(texts.len() >= 4 && flown.record.error.is_none(), "{} {:?}", texts.len(), flown.record.error);
    let whole = tempfile::tempdir().unwrap();
    let answers = answer_from(whole.path(), 1, &texts);
    assert_eq!(asked(whole.path(), true, None).unwrap(), (true, None));
    answers.join().unwrap();
    let record = read_records(whole.path()).unwrap().remove(0);
    assert_eq!((record.run_id.as_str(), record.answered_by.as_deref()), (RUN_ID, Some(WHO)));
    assert_eq!(record.latency_model, "fixed 1.5 s");
    assert_eq!(record.n_vlm_calls as usize, texts.len());
    assert_eq!(anonymous(record), anonymous(flown.record));
    assert_eq!(read_paths(whole.path()).unwrap()[RUN_ID].places, flown.path.places);
    assert_eq!(fs::read_to_string(whole.path().join(OPEN)).unwrap(), "");
    let table = fs::read_to_string(whole.path().join("table.md")).unwrap();
    assert!(
        table.contains("answered by a script, seeing prompt and picture only") && table.contains("| drink | spf |"),
        "{table}"
    );
    assert_eq!(fs::read_to_string(whole.path().join("table.csv")).unwrap().lines().count(), 2);
    let page = fs::read_to_string(at(whole.path(), "index.html")).unwrap();
    assert_eq!(page.matches("<section").count(), texts.len());
    assert!(page.contains("q0001.png") && page.contains("depth label"), "{page}");

    // One question at a time, then the rest.
    let torn = tempfile::tempdir().unwrap();
    for (text, number) in texts.iter().zip(1..=2) {
        assert_eq!(asked(torn.path(), false, None).unwrap(), (false, None));
        assert!(read_records(torn.path()).unwrap().is_empty());
        let open = fs::read_to_string(torn.path().join(OPEN)).unwrap();
        assert_eq!(open.trim_end().rsplit('\t').next().unwrap(), format!("{RUN_ID}/{}", name('a', number, "txt")));
        fs::write(at(torn.path(), &name('a', number, "txt")), text).unwrap();
    }
    let answers = answer_from(torn.path(), 3, &texts);
    assert_eq!(asked(torn.path(), true, None).unwrap(), (true, None));
    answers.join().unwrap();
    let mut names: Vec<PathBuf> = fs::read_dir(whole.path().join(RUN_ID)).unwrap().map(|entry| entry.unwrap().path()).collect();
    names.extend(["results.jsonl", "paths.jsonl", "table.md", "table.csv", "index.html"].map(|name| whole.path().join(name)));
    for path in names {
        let other = torn.path().join(path.strip_prefix(whole.path()).unwrap());
        assert!(fs::read(&path).unwrap() == fs::read(&other).unwrap(), "{}", path.display());
    }
}

#[test]
fn a_question_that_has_changed_ends_the_run_and_loses_nothing() {
    let folder = tempfile::tempdir().unwrap();
    assert_eq!(asked(folder.path(), false, None).unwrap(), (false, None));
    fs::write(at(folder.path(), "a0001.txt"), r#"{"status": "done", "point": null}"#).unwrap();
    // As of another program: the same question in another size.
    let (complete, end) = asked(folder.path(), false, Some(320)).unwrap();
    assert!(!complete && read_records(folder.path()).unwrap().is_empty());
    assert!(matches!(&end, Some(RunEnd::Refused { error, .. }) if error.to_string().contains("q0001.png` differs")), "{end:?}");
    // With the old one the flight goes on: the second question is the one that confirms.
    assert_eq!(asked(folder.path(), false, None).unwrap(), (false, None));
    assert!(at(folder.path(), "q0002.txt").exists() && at(folder.path(), "a0001.txt").exists());
    // A reply that cannot be read is one of the row's failures, and not an error of the run.
    fs::write(at(folder.path(), "a0002.txt"), r#"{"status": "lost"}"#).unwrap();
    assert_eq!(asked(folder.path(), false, None).unwrap(), (false, None));
    assert!(
        fs::read_to_string(at(folder.path(), "q0003.txt")).unwrap().contains("could not be"),
        "the prompt says what was wrong"
    );
}

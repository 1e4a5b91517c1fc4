//! The reading of every built-in task's instruction in the task's own scene, and how it compares with what the task states. The
//! bench flies what the task states; a reading that asks for something else would make a task that nobody can fulfil who does as
//! the instruction says.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

use spf_bench::task::SUITES;
use spf_flight::sim::LoadedScene;
use spf_oracle::language::Verb;
use spf_oracle::read_instruction;

#[test]
fn every_task_is_read_as_before() {
    let mut scenes: BTreeMap<String, LoadedScene> = BTreeMap::new();
    let mut read = String::new();
    let mut ids = BTreeSet::new();
    // A task of several suites is read once.
    for task in SUITES.iter().flat_map(|suite| suite.tasks().unwrap()).filter(|task| ids.insert(task.id.clone())) {
        let loaded = match task.objects.is_empty() {
            true => scenes.entry(task.scene.clone()).or_insert_with(|| LoadedScene::load(&task.scene).unwrap()),
            false => &mut task.load_scene(&task.scene).unwrap(),
        };
        let objects = loaded.placed(&loaded.cast.starts());
        let reading = read_instruction(&task.instruction, &objects, Some(loaded.scene.start));
        writeln!(read, "{}: {}", task.id, task.instruction).unwrap();
        for step in &reading.steps {
            let key = |id: &u16| loaded.tags.iter().find(|tags| tags.id == *id).unwrap().key.as_str();
            let keys: Vec<&str> = step.candidates.iter().map(key).collect();
            writeln!(read, "  {:?} {}: {}", step.verb, step.target, keys.join(" ")).unwrap();
        }
        for words in reading.ignored.iter().map(|unknown| &unknown.word).chain(&reading.directions) {
            writeln!(read, "  ignored: {words}").unwrap();
        }
    }
    insta::assert_snapshot!(read);
}

/// Each stage that a task states is the one that its instruction asks for. Where the parser of `spf fly` takes other objects, the
/// snapshot says which.
#[test]
fn tasks_state_what_their_instructions_ask_for() {
    let mut scenes: BTreeMap<String, LoadedScene> = BTreeMap::new();
    let mut otherwise = String::new();
    let mut ids = BTreeSet::new();
    for task in SUITES.iter().flat_map(|suite| suite.tasks().unwrap()).filter(|task| ids.insert(task.id.clone())) {
        let loaded = match task.objects.is_empty() {
            true => scenes.entry(task.scene.clone()).or_insert_with(|| LoadedScene::load(&task.scene).unwrap()),
            false => &mut task.load_scene(&task.scene).unwrap(),
        };
        let reading = read_instruction(&task.instruction, &loaded.placed(&loaded.cast.starts()), Some(loaded.scene.start));
        let brief = task.brief(loaded, loaded.scene.start.position);
        let verbs: (Vec<_>, Vec<_>) =
            (reading.steps.iter().map(|step| step.verb).collect(), brief.stages.iter().map(|stage| stage.verb).collect());
        assert_eq!(verbs.0, verbs.1, "{}", task.id);
        for (step, stage) in reading.steps.iter().zip(&brief.stages).filter(|(_, stage)| stage.verb != Verb::Scan) {
            assert!(!stage.objects.is_empty(), "{}", task.id);
            let keys = |ids: &[u16], others: &[u16]| {
                let only = ids.iter().filter(|id| !others.contains(id));
                only.map(|id| loaded.key(*id)).collect::<Vec<_>>().join(" ")
            };
            let (read, stated) = (keys(&step.candidates, &stage.objects), keys(&stage.objects, &step.candidates));
            if !(read.is_empty() && stated.is_empty()) {
                writeln!(otherwise, "{}: only read: {read}; only stated: {stated}", task.id).unwrap();
            }
        }
    }
    insta::assert_snapshot!(otherwise);
}

//! The reading of every built-in task's instruction in the task's own scene. A change of the language must leave all of them
//! as they are: otherwise results of the bench from before and after it cannot be compared.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

use spf_bench::task::SUITES;
use spf_flight::sim::LoadedScene;
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

//! What `spf sim scenes NAME --say` lists is read whole, and fulfilled.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use serde_json::Value;
use spf_api::reading::{Given, lines};
use spf_flight::sim::LoadedScene;

use super::harness::Lab;

/// The lines of the list: scene, kind, difficulty, instruction.
fn sayings() -> Vec<[String; 4]> {
    let lab = Lab::new();
    let run = lab.spf(&["sim", "scenes", "--say", "--json"]);
    let listing: Value = serde_json::from_str(&run.stdout).unwrap();
    let text = |value: &Value| value.as_str().unwrap().to_owned();
    let mut all = Vec::new();
    for scene in listing["scenes"].as_array().unwrap() {
        for saying in scene["say"].as_array().unwrap() {
            let [kind, difficulty, instruction] = ["kind", "difficulty", "instruction"].map(|key| text(&saying[key]));
            all.push([text(&scene["name"]), kind, difficulty, instruction]);
        }
    }
    all
}

/// Flies lines, two at once, and says of each whether it was fulfilled, with its outcome and its distance.
fn flown(sayings: &[[String; 4]]) -> Vec<(bool, String)> {
    let lab = Lab::new();
    let (next, found) = (AtomicUsize::new(0), Mutex::new(BTreeMap::new()));
    let fly = || {
        loop {
            let at = next.fetch_add(1, Ordering::Relaxed);
            let Some([scene, kind, _, instruction]) = sayings.get(at) else { return };
            let out = format!("{at}");
            let mut args = vec!["fly", instruction, "--scene", scene, "--no-video", "--json", "--out", &out];
            if kind == "follow" {
                args.extend(["--follow-time", "20"]);
            }
            let run = lab.spf(&args);
            let summary: Value = serde_json::from_str(&run.stdout).unwrap_or_default();
            std::fs::remove_dir_all(lab.path(&out)).ok();
            let row = format!(
                "{}\t{}\t{}\t{}",
                summary["outcome"].as_str().unwrap_or("none"),
                summary["verified"],
                summary["collisions"],
                summary["final_distance_m"]
            );
            found.lock().unwrap_or_else(PoisonError::into_inner).insert(at, (run.code == Some(0), row));
        }
    };
    std::thread::scope(|scope| {
        for _ in 0..2 {
            scope.spawn(fly);
        }
    });
    found.into_inner().unwrap_or_else(PoisonError::into_inner).into_values().collect()
}

#[test]
fn every_line_is_read_whole_and_one_in_twenty_five_is_fulfilled() {
    let sayings = sayings();
    let mut scenes: BTreeMap<String, Arc<LoadedScene>> = BTreeMap::new();
    for [scene, _, _, instruction] in &sayings {
        let loaded = scenes.entry(scene.clone()).or_insert_with(|| Arc::new(LoadedScene::load(scene).unwrap()));
        let read = lines(instruction, loaded, None, Given::AsArgument, false);
        assert!(read.as_ref().is_ok_and(|lines| !lines[0].contains("not in this scene")), "{scene}: {instruction}: {read:?}");
    }
    let some: Vec<[String; 4]> = sayings.into_iter().step_by(25).collect();
    for ([scene, _, _, instruction], (fulfilled, row)) in some.iter().zip(flown(&some)) {
        assert!(fulfilled, "{scene}: {instruction}: {row}");
    }
}

mod figures {
    use std::fmt::Write as _;

    use super::*;
    use crate::documents::root;

    /// Flies every line, and writes docs/results/say.tsv.
    #[test]
    #[ignore = "long: five minutes (CONTRIBUTING.md, Long checks)"]
    fn all_that_can_be_said_is_flown() {
        let sayings = sayings();
        let mut table =
            "scene\tkind\tdifficulty\tinstruction\tfulfilled\toutcome\tverified\tcollisions\tfinal_distance_m\n".to_owned();
        let rows = flown(&sayings);
        for (cells, (fulfilled, row)) in sayings.iter().zip(&rows) {
            writeln!(table, "{}\t{fulfilled}\t{row}", cells.join("\t")).unwrap();
        }
        std::fs::write(root().join("docs/results/say.tsv"), table).unwrap();
        let missed = sayings.iter().zip(&rows).filter(|(_, (fulfilled, _))| !fulfilled);
        let missed: Vec<&String> = missed.map(|(cells, _)| &cells[3]).collect();
        assert!(missed.is_empty(), "{missed:?}");
    }
}

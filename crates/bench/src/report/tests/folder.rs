//! Folders of results with synthetic rows.

use std::path::PathBuf;

use serde_json::{Value, json};

use crate::trial::run_id;

/// Fields that differ from a row of a real trial (`row.json`).
pub(super) struct Row<'a> {
    pub(super) method: &'a str,
    pub(super) vlm: &'a str,
    pub(super) seed: u64,
    pub(super) done: bool,
    pub(super) instruction: &'a str,
    pub(super) cause: &'a str,
    pub(super) touched: Option<&'a str>,
    pub(super) scene: &'a str,
    pub(super) model: Option<&'a str>,
    pub(super) latency_ms: f64,
}

impl Default for Row<'_> {
    fn default() -> Self {
        Self {
            method: "spf",
            vlm: "oracle:default",
            seed: 0,
            done: true,
            instruction: "find something to drink",
            cause: "the flight time was spent",
            touched: None,
            scene: "yard@3",
            model: None,
            latency_ms: 1500.0,
        }
    }
}

impl Row<'_> {
    fn id(&self) -> String {
        run_id("drink", self.method, self.vlm, self.seed)
    }

    fn json(&self) -> Value {
        let mut row: Value = serde_json::from_str(include_str!("row.json")).unwrap();
        let new = json!({
            "run_id": self.id(), "task": "drink", "set": "real_world", "method": self.method, "scene_id": self.scene,
            "seed": self.seed, "vlm": self.vlm, "instruction": self.instruction, "cause": self.cause,
            "completion_time_s": 20.0 + self.seed as f64, "outcome": if self.done { "reached" } else { "timeout" },
        });
        for (key, value) in new.as_object().unwrap() {
            row[key] = value.clone();
        }
        row["scores"]["strict"] = self.done.into();
        row["latency_ms"]["p50"] = self.latency_ms.into();
        row["touched"] = self.touched.iter().map(|object| json!({"object": object, "at_s": 3.25})).collect();
        row["vlm_details"]["models"] = self.model.iter().map(|model| json!(model)).collect();
        row
    }

    fn path(&self) -> Value {
        let places: Vec<[f64; 3]> = (0..8).map(|i| [f64::from(i), 0.25 * self.seed as f64, 1.0]).collect();
        json!({ "run_id": self.id(), "targets": [["vending_machine"]], "from_s": 4.2, "places": places })
    }
}

fn lines(values: impl Iterator<Item = Value>) -> String {
    values.map(|value| format!("{value}\n")).collect()
}

pub(super) struct Folder(tempfile::TempDir);

impl Folder {
    pub(super) fn of(rows: &[Row<'_>]) -> Self {
        let folder = Self(tempfile::tempdir().unwrap());
        folder.put("results.jsonl", &lines(rows.iter().map(Row::json)));
        folder.put("paths.jsonl", &lines(rows.iter().map(Row::path)));
        let trials: Vec<String> = rows.iter().map(Row::id).collect();
        let head = json!({ "format": 3, "program": "0.1.0", "trials": trials, "shard": { "index": 0, "count": 1 }, "plan": "7" });
        folder.put("bench.json", &head.to_string());
        folder.made_by("spf bench run --task ./drink.toml --trials 4")
    }

    pub(super) fn made_by(self, command: &str) -> Self {
        let files = json!({ "drink": "./drink.toml" });
        let made = json!({ "command": command, "files": files, "began": "2026-01-02", "ended": "2026-01-03" });
        self.put("run.json", &made.to_string());
        self
    }

    pub(super) fn path(&self) -> PathBuf {
        self.0.path().to_owned()
    }

    pub(super) fn text(&self, name: &str) -> String {
        std::fs::read_to_string(self.0.path().join(name)).unwrap()
    }

    pub(super) fn put(&self, name: &str, text: &str) {
        self.put_bytes(name, text.as_bytes());
    }

    pub(super) fn put_bytes(&self, name: &str, bytes: &[u8]) {
        std::fs::write(self.0.path().join(name), bytes).unwrap();
    }

    pub(super) fn remove(&self, name: &str) {
        std::fs::remove_file(self.0.path().join(name)).unwrap();
    }
}

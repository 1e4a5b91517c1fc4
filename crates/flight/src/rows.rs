//! The rows of `decisions.jsonl` and `queries.jsonl`, for people and their scripts.

use serde::Serialize;
use serde_json::{Value, json};
use spf_pilot::Decision;
use spf_record::jsonl::JsonLines;
use spf_record::out_dir::OutDir;
use spf_record::people::for_people;

use crate::problems::{Problems, in_full, slow};

pub(crate) const DECISIONS: &str = "decisions.jsonl";
const QUERIES: &str = "queries.jsonl";

/// A decision as the log has it.
#[derive(Serialize)]
struct Row<'a> {
    #[serde(flatten)]
    decision: &'a Decision,
    /// Distance flown since take-off, as estimated, metres.
    flown_m: f64,
}

/// The two files of a flight. One that fails is reported, and no longer written.
pub(crate) struct RowFiles {
    decisions: Option<JsonLines>,
    queries: Option<JsonLines>,
}

impl RowFiles {
    /// Creates them; `patient` ones wait for a slow disk.
    pub(crate) fn create(out: &OutDir, patient: bool, problems: &mut Problems) -> Self {
        let mut file = |name| problems.kept(name, JsonLines::create(&out.file(name), patient));
        Self { decisions: file(DECISIONS), queries: file(QUERIES) }
    }

    pub(crate) fn push(&mut self, decision: &Decision, flown_m: f64, problems: &mut Problems) {
        let Some(row) = problems.kept(DECISIONS, serde_json::to_value(Row { decision, flown_m })) else { return };
        let Rows { decision, query } = Rows::of(row);
        put(&mut self.decisions, DECISIONS, &decision, problems);
        if let Some(query) = query {
            put(&mut self.queries, QUERIES, &query, problems);
        }
    }

    /// The file that can no longer be written, if one cannot.
    pub(crate) fn failed(&self) -> Option<&'static str> {
        let files = [(DECISIONS, &self.decisions), (QUERIES, &self.queries)];
        files.into_iter().find(|(_, file)| file.as_ref().is_some_and(JsonLines::has_failed)).map(|(name, _)| name)
    }

    pub(crate) fn finish(self, problems: &mut Problems) {
        for (name, file) in [(DECISIONS, self.decisions), (QUERIES, self.queries)] {
            let lost = file.and_then(|file| problems.kept(name, file.finish())).unwrap_or(0);
            if lost > 0 {
                problems.note(name, slow(lost, "rows", name));
            }
        }
    }
}

fn put(file: &mut Option<JsonLines>, name: &str, row: &Value, problems: &mut Problems) {
    if let Some(Err(error)) = file.as_mut().map(|rows| rows.push(row)) {
        problems.note(name, in_full(&error));
        *file = None;
    }
}

/// A row of `decisions.jsonl`, and that of `queries.jsonl` with the prompt, which is most of what a decision would have.
#[derive(Clone, Debug, PartialEq)]
pub struct Rows {
    /// The decision, whose query has its `id`.
    pub decision: Value,
    /// The query of this `id`; `None` if the decision has no prompt.
    pub query: Option<Value>,
}

impl Rows {
    /// The rows of a decision, as the log has it.
    #[must_use]
    pub fn of(mut decision: Value) -> Self {
        let asked = decision.get_mut("query").and_then(Value::as_object_mut);
        let query = asked.and_then(|query| {
            let prompt = query.shift_remove("prompt")?;
            Some(json!({"id": query.get("id"), "prompt": prompt}))
        });
        Self { decision: for_people(decision), query }
    }
}

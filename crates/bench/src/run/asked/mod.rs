//! Trials whose questions somebody answers: a person, or a model that sees the prompt and the picture only.
//!
//! The questions and answers of a trial are in a folder named by its id, with a page to look through them. The rows say who
//! answered, and have a table of their own: they are no figures of a vendor's model.

mod page;
mod table;

use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

use spf_core::query::ImagePoint;
use spf_core::reply::ObstacleBox;
use spf_core::time::Time;
use spf_flight::run::Observer;
use spf_flight::sim::VlmFactory;
use spf_flight::words;
use spf_pilot::{Action, Note, Pilot};
use spf_vlm::Vlm;
use spf_vlm::folder::{QuestionFolder, log};
use spf_vlm::service::Service;

use super::files::{StoreError, failed, replace};
use crate::trial::{Flown, Lost, Record, Sampled, Trial, VlmUnderTest};
pub(crate) use table::{APART, HEADS, cells};
pub use table::{Line, csv, lines, markdown, said};

/// Who answers, and where the questions are.
#[derive(Clone)]
pub struct Asked {
    folder: QuestionFolder,
    who: String,
}

impl Asked {
    /// Questions in this folder, which `who` answers.
    #[must_use]
    pub fn new(folder: QuestionFolder, who: String) -> Self {
        Self { folder, who }
    }

    pub(super) fn begin(&self) -> Result<(), StoreError> {
        self.folder.begin().map_err(StoreError::Questions)
    }

    /// Flies a trial with the answers that are there, and waits for the others; then writes its page.
    pub(super) fn fly(&self, trial: &Trial, drawn: &Sampled, service: &Arc<Service>) -> Result<Result<Flown, Lost>, StoreError> {
        let run_id = trial.run_id();
        let vlm = self.folder.vlm(&run_id).map_err(StoreError::Questions)?;
        // A flight has one VLM, requested once.
        let vlm = Mutex::new(Some(vlm));
        let vlm_factory: VlmFactory = Arc::new(move |_, _| {
            let vlm = vlm.lock().unwrap_or_else(PoisonError::into_inner).take();
            Ok(Box::new(vlm.ok_or("the questions of this flight are already being asked")?) as Box<dyn Vlm>)
        });
        let pointer = trial.pointer.clone().map(|pointer| VlmUnderTest { vlm_factory, ..pointer });
        let mut followed = Followed::default();
        let flown = Trial { pointer, ..trial.clone() }.fly_served_observed(drawn, None, &mut [&mut followed], service);
        let flown = flown.map(|mut flown| {
            flown.record.answered_by = Some(self.who.clone());
            flown
        });
        let at = self.folder.of_flight(&run_id);
        let rows = log(&at).map_err(StoreError::Questions)?.into_iter().map(|row| {
            let path = at.join(&row.prompt);
            let prompt = std::fs::read_to_string(&path).map_err(failed(&path))?;
            Ok((row, prompt))
        });
        let rows = rows.collect::<Result<Vec<_>, StoreError>>()?;
        let record = flown.as_ref().ok().map(|flown| &flown.record);
        let page = page::flight(&run_id, &trial.task.instruction, &self.who, &rows, &followed.of, record);
        replace(&at.join("index.html"), &page)?;
        Ok(flown)
    }
}

/// Writes the tables and the page of a folder: `table.md`, `table.csv`, `index.html`.
///
/// # Errors
/// [`StoreError`] if they cannot be written.
pub fn write(folder: &Path, who: &str, planned: &[String], records: &[Record]) -> Result<(), StoreError> {
    replace(&folder.join("table.md"), &markdown(who, planned.len(), records))?;
    replace(&folder.join("table.csv"), &csv(records))?;
    replace(&folder.join("index.html"), &page::run(who, planned, records))
}

/// What followed from an answer.
#[derive(Clone, Debug, Default)]
struct Effect {
    /// The query.
    query: u64,
    /// When it was asked.
    asked: Option<Time>,
    /// The point of the answer, and the one flown to.
    pointed: Option<ImagePoint>,
    flown_to: Option<ImagePoint>,
    /// The obstacles that the answer lists.
    boxes: Vec<ObstacleBox>,
    /// What the pilot reported until its next decision.
    lines: Vec<String>,
}

/// Notes what follows from each answer.
#[derive(Default)]
struct Followed {
    of: Vec<Effect>,
}

impl Observer for Followed {
    fn action(&mut self, now: Time, action: &Action, _: &Pilot) {
        let line = match action {
            Action::Note(Note::Decision(decision)) => {
                let reading = &decision.reading;
                self.of.push(Effect {
                    query: decision.query.id.0,
                    asked: Some(decision.queried_at),
                    pointed: reading.reply.as_ref().and_then(|reply| reply.point),
                    flown_to: reading.waypoint,
                    boxes: reading.reply.as_ref().map(|reply| reply.boxes.clone()).unwrap_or_default(),
                    lines: Vec::new(),
                });
                words::decision(decision)
            }
            Action::Note(note) => words::note(note),
            Action::Finished(ending) => format!("{}: {}", words::outcome(ending.outcome), ending.cause),
            _ => return,
        };
        if let Some(last) = self.of.last_mut() {
            last.lines.push(format!("{:.1} s: {line}", now.as_secs_f64()));
        }
    }
}

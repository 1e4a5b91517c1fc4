//! Observes a trial: feeds the judge, and takes measurements.

use std::sync::{Arc, OnceLock};

use spf_core::geometry::EnuPosition;
use spf_core::time::Time;
use spf_flight::run::Observer;
use spf_flight::sim::SimWorld;
use spf_pilot::{Action, Note, Outcome, Phase, Pilot};

use super::path::Trace;
use super::signs::{SignFigures, SignWatch};
use crate::judge::{EVALUATION_INTERVAL, Judge};

/// Results of judge and measurements.
#[derive(Clone, Debug, Default)]
pub(super) struct Findings {
    /// When the judge would first have reported success by the paper's rules.
    pub(super) paper: Option<Time>,
    /// Whether it would report success at `Finished`.
    pub(super) holds_at_end: bool,
    /// Whether there was no collision until `Finished`.
    pub(super) untouched: bool,
    /// Distance to the last goal's surface at `Finished`, and the minimum during the flight, metres.
    pub(super) distance: Option<f64>,
    pub(super) least_distance: Option<f64>,
    /// Whether a target of the last goal is clearly visible at `Finished`.
    pub(super) sees: Option<bool>,
    /// Minimum distance to anything solid while flying, metres.
    pub(super) clearance: Option<f64>,
    /// The true path, one position per evaluation.
    pub(super) path: Vec<EnuPosition>,
    /// The path for display.
    pub(super) trace: Trace,
    /// Latency of each reply and age of each frame, seconds.
    pub(super) latencies: Vec<f64>,
    pub(super) frame_ages: Vec<f64>,
    /// Number of rejected replies, failed queries and envelope interventions.
    pub(super) refused: u32,
    pub(super) given_up: u32,
    pub(super) interventions: u32,
    pub(super) first_motion: Option<Time>,
    pub(super) outcome: Option<Outcome>,
    /// Its cause in the words of the pilot, which do not know of the ground truth of `spf fly`.
    pub(super) cause: Option<String>,
    pub(super) signs: Option<SignFigures>,
}

/// Observes one flight. The world is known once the VLM is created in it.
pub(super) struct Watcher {
    world: Arc<OnceLock<SimWorld>>,
    judge: Judge,
    signs: Option<SignWatch>,
    next: Time,
    ended: bool,
    findings: Findings,
}

impl Watcher {
    pub(super) fn new(world: Arc<OnceLock<SimWorld>>, judge: Judge, signs: Option<SignWatch>) -> Self {
        Self { world, judge, signs, next: Time::ZERO, ended: false, findings: Findings::default() }
    }

    pub(super) fn into_findings(self) -> (Findings, Judge) {
        (Findings { signs: self.signs.map(|signs| signs.figures), ..self.findings }, self.judge)
    }

    /// Evaluates; at the `end` in any case.
    fn look(&mut self, now: Time, pilot: &Pilot, end: bool) {
        let Some(world) = self.world.get() else { return };
        world.advance_to(now);
        let (truth, moment) = (world.truth(), world.now());
        let found = &mut self.findings;
        if !end && found.paper.is_some() && self.judge.waits_for_the_end() {
            self.judge.pass(&moment);
        } else {
            self.judge.look(now, &moment);
        }
        found.untouched = truth.collided_with.is_empty();
        if self.judge.holds_by_paper() && found.untouched {
            found.paper.get_or_insert(now);
        }
        let least = |a: Option<f64>, b: Option<f64>| [a, b].into_iter().flatten().reduce(f64::min);
        found.distance = self.judge.distance(&moment);
        found.least_distance = least(found.least_distance, found.distance);
        if matches!(pilot.phase(), Phase::Flying | Phase::Held | Phase::Manual | Phase::Hovering) {
            let loaded = world.loaded();
            let at = moment.pose.position;
            let moving = loaded.cast.objects().filter_map(|id| loaded.distance_to(id, &moment.actors, at));
            let near = moving.chain(loaded.collider.nearest(at).map(|near| near.distance)).reduce(f64::min);
            found.clearance = least(found.clearance, near);
            found.path.push(at);
            found.trace.push(now, at);
            if let Some(signs) = &mut self.signs {
                signs.look(loaded, &moment, truth.velocity);
            }
        }
        found.first_motion = pilot.first_motion();
    }
}

impl Observer for Watcher {
    fn time(&mut self, now: Time, pilot: &Pilot) {
        if now >= self.next && !self.ended {
            self.look(now, pilot, false);
            self.next = now + EVALUATION_INTERVAL;
        }
    }

    fn action(&mut self, now: Time, action: &Action, pilot: &Pilot) {
        match action {
            Action::Finished(ending) => {
                self.look(now, pilot, true);
                self.ended = true;
                self.findings.outcome = Some(ending.outcome);
                self.findings.cause = Some(ending.cause.clone());
                self.findings.holds_at_end = self.judge.holds();
                self.findings.sees = self.world.get().and_then(|world| self.judge.sees(&world.now()));
            }
            Action::Note(Note::Decision(decision)) => {
                self.findings.latencies.push(decision.latency_s);
                self.findings.frame_ages.push(decision.frame_age_s);
                self.findings.refused += u32::from(decision.reading.refused.is_some());
            }
            Action::Note(Note::Envelope(_)) => self.findings.interventions += 1,
            Action::Note(Note::QueryFailed { .. }) => self.findings.given_up += 1,
            _ => {}
        }
    }
}

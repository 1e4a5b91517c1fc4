//! The methods compared by the bench.

use std::sync::Arc;

use spf_baselines::classical::{Act, Sought};
use spf_core::time::duration_from_secs;
use spf_flight::methods::{BenchSettings, Family, MethodRow, rows};
use spf_flight::pilot::PolicyMaker;
use spf_flight::policy::{PolicyKind, Seeker};
use spf_flight::sim::VlmFactory;
use spf_oracle::language::Verb;
use spf_oracle::{Brief, BriefStage};
use spf_pilot::{PilotSettings, Preset};
use spf_vlm::{Answer, QueryImage, QueryRequest, Usage, Vlm};

use crate::task::{Task, TaskSet};

/// A method: a row of the table of methods (`crates/flight/data/methods.toml`) with bench settings.
#[derive(Clone, Copy, Debug)]
pub struct Method {
    row: &'static MethodRow,
    settings: &'static BenchSettings,
}

impl Method {
    /// All methods, in table order.
    pub fn all() -> impl Iterator<Item = Self> {
        rows().iter().filter_map(|row| row.bench.as_ref().map(|settings| Self { row, settings }))
    }

    /// Its name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        &self.row.name
    }

    /// The method with this name.
    #[must_use]
    pub fn of_name(name: &str) -> Option<Self> {
        Self::all().find(|method| method.name() == name)
    }

    /// Whether it queries a VLM; the blind control does not.
    #[must_use]
    pub fn uses_vlm(self) -> bool {
        !self.settings.blind
    }

    /// Whether a geofence is drawn around the straight path.
    pub(super) fn is_fenced(self) -> bool {
        self.settings.fence
    }

    /// Whether the envelope brakes before obstacles, and whether the craft has a depth sensor.
    pub(super) fn brake_and_depth(self) -> (bool, bool) {
        (self.settings.brake, self.settings.depth_sensor)
    }

    /// Whether the boxes of replies are those of a detector.
    pub(super) fn has_detector(self) -> bool {
        self.settings.detector
    }

    pub(super) fn policy(self) -> PolicyKind {
        PolicyKind::of_row(self.row)
    }

    /// Creates its policy for a task with this brief, of which only one without a language model learns anything.
    pub(super) fn policy_maker(self, brief: &Brief) -> Arc<dyn PolicyMaker> {
        match self.row.policy {
            Family::Classical {} => Arc::new(Seeker { stages: brief.stages.iter().map(sought).collect() }),
            _ => Arc::new(self.policy()),
        }
    }

    pub(super) fn preset(self) -> Preset {
        self.settings.preset()
    }

    /// Its pilot settings for a task: the preset with the method's changes.
    pub(super) fn settings(self, task: &Task) -> PilotSettings {
        PilotSettings {
            avoid: task.avoid || self.settings.avoid,
            max_time: duration_from_secs(task.max_time),
            max_decisions: task.max_decisions,
            ..self.settings.settings(median_step(task.set))
        }
    }
}

impl PartialEq for Method {
    fn eq(&self, other: &Self) -> bool {
        self.name() == other.name()
    }
}

impl Eq for Method {}

/// The median step of SPF in the scenes of a set, metres (docs/explanation/baselines.md).
fn median_step(set: TaskSet) -> f64 {
    match set {
        TaskSet::Simulation => 6.7,
        TaskSet::RealWorld => 1.9,
    }
}

/// A stage as a pilot without a language model is told it. Around, over, behind and up are no flights to a box: it flies to the
/// object, and fails.
fn sought(stage: &BriefStage) -> Sought {
    let act = match stage.verb {
        Verb::GoTo | Verb::Around | Verb::Over | Verb::Up | Verb::Behind => Act::Reach,
        Verb::Through => Act::Through,
        Verb::Scan => Act::Turn,
        Verb::Follow => Act::Follow,
    };
    Sought { act, appearances: stage.appearances.clone(), other: stage.other }
}

/// Number of moves of the blind control before it declares itself done.
const MOVES: usize = 5;
/// Latency of each of its replies, seconds: the oracle's median.
const LATENCY_S: f64 = 1.5;

/// The VLM of the blind control: straight on by `metres` several times, then done. It uses neither images nor the
/// instruction.
struct Blind {
    metres: f64,
}

impl Vlm for Blind {
    fn name(&self) -> &str {
        NO_VLM
    }

    fn answer(&mut self, request: &QueryRequest<'_>, _image: &mut dyn QueryImage) -> Answer {
        Answer {
            text: Ok(self.text(request.query.memory.actions.len())),
            latency: duration_from_secs(LATENCY_S),
            model: NO_VLM.to_owned(),
            account: Usage::default(),
        }
    }
}

impl Blind {
    /// The reply after `moves` moves.
    fn text(&self, moves: usize) -> String {
        if moves >= MOVES {
            return "{\"actions\":[],\"done\":true}".to_owned();
        }
        format!("{{\"actions\":[{{\"cmd\":\"forward\",\"value\":{}}}],\"done\":false}}", self.metres)
    }
}

/// The VLM name of methods that query no VLM.
pub const NO_VLM: &str = "none";

/// The VLM of the blind control.
pub(super) fn blind(metres: f64) -> VlmFactory {
    Arc::new(move |_, _| Ok(Box::new(Blind { metres })))
}

#[cfg(test)]
mod tests {
    use spf_baselines::actions::{Action, parse_actions};
    use spf_core::step::StepRule;
    use spf_motion::executor::{Ending, Motion};
    use spf_pilot::QueryTiming;

    use super::*;

    #[test]
    fn a_method_is_found_by_its_name() {
        assert!(Method::all().all(|method| Method::of_name(method.name()) == Some(method)));
        assert_eq!(Method::of_name("chance"), None);
    }

    #[test]
    fn an_ablation_changes_what_its_name_states() {
        let task = crate::task::shipped("real-long-cones").unwrap().unwrap();
        let settings = |name| Method::of_name(name).unwrap().settings(&task);
        let [spf, stop] = ["spf", "spf-stop"].map(settings);
        assert_eq!((spf.step, spf.max_decisions), (StepRule::PAPER, task.max_decisions));
        assert_eq!(settings("spf-step-median"), PilotSettings { step: StepRule::Fixed(1.9), ..spf });
        assert_eq!(settings("spf-step-1m"), PilotSettings { step: StepRule::Fixed(1.0), ..spf });
        assert_eq!(settings("spf-sequential"), PilotSettings { motion: Motion::Sequential, ..spf });
        assert_eq!(settings("spf-timed"), PilotSettings { ending: Ending::Timed, ..spf });
        assert_eq!(stop, PilotSettings { think: QueryTiming::Stop, ..spf });
        assert_eq!((task.avoid, settings("spf-avoid")), (false, PilotSettings { avoid: true, ..spf }));
        let paper = settings("spf-paper");
        assert_eq!(settings("spf-paper-avoid"), PilotSettings { avoid: true, ..paper });
        assert_eq!(settings("spf-once"), PilotSettings { confirm_done: false, ..spf });
        let fenced = |name| Method::of_name(name).unwrap().is_fenced();
        assert_eq!(settings("spf-fence"), spf);
        assert!(fenced("spf-fence") && fenced("spf-once-fence") && !fenced("spf-once") && !fenced("spf"));
        assert_eq!(settings("spf-stop-sequential"), PilotSettings { motion: Motion::Sequential, ..stop });
    }

    #[test]
    fn the_blind_control_queries_nothing() {
        let blind: Vec<&str> = Method::all().filter(|method| !method.uses_vlm()).map(Method::name).collect();
        assert_eq!(blind, ["straight"]);
        assert_eq!(Method::of_name("straight").unwrap().policy().name(), "plain");
    }

    #[test]
    fn the_blind_control_goes_straight_on_and_is_done() {
        let blind = Blind { metres: 5.0 };
        let go = parse_actions(&blind.text(0)).unwrap();
        assert_eq!((go.actions, go.done), (vec![Action::Forward(5.0)], false));
        let end = parse_actions(&blind.text(MOVES)).unwrap();
        assert!(end.done && end.actions.is_empty());
    }
}

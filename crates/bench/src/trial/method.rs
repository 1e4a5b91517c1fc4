//! The methods that are compared.

use std::sync::Arc;

use spf_core::executor::{Ending, Motion};
use spf_core::pilot::{PilotSettings, Preset, Think};
use spf_core::step::StepRule;
use spf_core::time::duration_from_secs;
use spf_flight::policy::PolicyKind;
use spf_flight::sim::WhoPoints;
use spf_vlm::{Account, Answer, Asked, Picture, Vlm};

use crate::task::{Set, Task};

/// A way of flying that is compared with others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// Points, preset `default`.
    Spf,
    /// Points, preset `paper`.
    SpfPaper,
    /// `Spf`, where the task has obstacle mode with boxes from a detector in place of the reply's.
    SpfDetector,
    /// `Spf` with every step as long as the median of its adaptive ones.
    SpfStepMedian,
    /// `Spf` with steps of a metre.
    SpfStepMetre,
    /// `Spf`, one primitive after the other.
    SpfSequential,
    /// `Spf`, its primitives ended by time alone.
    SpfTimed,
    /// `Spf`, holding while the VLM thinks.
    SpfStop,
    /// The same, one primitive after the other.
    SpfStopSequential,
    /// Choices among numbered arrows, with the median of SPF's steps for a step.
    Pivot,
    /// The same with steps of a metre.
    PivotMetre,
    /// Three runs of choices at once, agreeing on the mean.
    PivotParallel,
    /// Programs from a list of every object, with replanning.
    TypeFly,
    /// The same from a list of the classes of COCO.
    TypeFlyCoco,
    /// The same with one program, as SPF was compared with.
    TypeFlyOnce,
    /// Actions in words.
    Plain,
    /// Actions as four numbers.
    PlainNumeric,
    /// One of a few fixed moves.
    PlainDiscrete,
    /// Straight on, looking at nothing: what can be had by chance.
    Straight,
}

impl Method {
    /// All, in the order of tables.
    pub const ALL: [Self; 19] = [
        Self::Spf,
        Self::SpfPaper,
        Self::SpfDetector,
        Self::SpfStepMedian,
        Self::SpfStepMetre,
        Self::SpfSequential,
        Self::SpfTimed,
        Self::SpfStop,
        Self::SpfStopSequential,
        Self::Pivot,
        Self::PivotMetre,
        Self::PivotParallel,
        Self::TypeFly,
        Self::TypeFlyCoco,
        Self::TypeFlyOnce,
        Self::Plain,
        Self::PlainNumeric,
        Self::PlainDiscrete,
        Self::Straight,
    ];

    /// Its name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Spf => "spf",
            Self::SpfPaper => "spf-paper",
            Self::SpfDetector => "spf-detector",
            Self::SpfStepMedian => "spf-step-median",
            Self::SpfStepMetre => "spf-step-1m",
            Self::SpfSequential => "spf-sequential",
            Self::SpfTimed => "spf-timed",
            Self::SpfStop => "spf-stop",
            Self::SpfStopSequential => "spf-stop-sequential",
            Self::Pivot => "pivot",
            Self::PivotMetre => "pivot-1m",
            Self::PivotParallel => "pivot-parallel",
            Self::TypeFly => "typefly",
            Self::TypeFlyCoco => "typefly-coco",
            Self::TypeFlyOnce => "typefly-once",
            Self::Plain => "plain",
            Self::PlainNumeric => "plain-numeric",
            Self::PlainDiscrete => "plain-discrete",
            Self::Straight => "straight",
        }
    }

    /// The method of that name.
    #[must_use]
    pub fn of_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|method| method.name() == name)
    }

    /// Whether somebody has to be asked; the blind control asks nobody.
    #[must_use]
    pub fn asks(self) -> bool {
        self != Self::Straight
    }

    pub(super) fn policy(self) -> PolicyKind {
        match self {
            Self::Spf
            | Self::SpfPaper
            | Self::SpfStepMedian
            | Self::SpfStepMetre
            | Self::SpfSequential
            | Self::SpfTimed
            | Self::SpfStop
            | Self::SpfStopSequential => PolicyKind::Spf,
            Self::SpfDetector => PolicyKind::SpfDetector,
            Self::Pivot | Self::PivotMetre => PolicyKind::Pivot,
            Self::PivotParallel => PolicyKind::PivotParallel,
            Self::TypeFly => PolicyKind::TypeFly,
            Self::TypeFlyCoco => PolicyKind::TypeFlyCoco,
            Self::TypeFlyOnce => PolicyKind::TypeFlyOnce,
            Self::Plain | Self::Straight => PolicyKind::Plain,
            Self::PlainNumeric => PolicyKind::PlainNumeric,
            Self::PlainDiscrete => PolicyKind::PlainDiscrete,
        }
    }

    pub(super) fn preset(self) -> Preset {
        match self {
            Self::SpfPaper => Preset::Paper,
            _ => Preset::Default,
        }
    }

    /// How it is flown on a task: the preset, but for what the method is about.
    pub(super) fn settings(self, task: &Task) -> PilotSettings {
        let preset = PilotSettings::preset(self.preset());
        let stops = matches!(self, Self::SpfStop | Self::SpfStopSequential);
        let queues = matches!(self, Self::SpfSequential | Self::SpfStopSequential);
        PilotSettings {
            step: self.step(task.set),
            motion: if queues { Motion::Sequential } else { preset.motion },
            ending: if self == Self::SpfTimed { Ending::Timed } else { preset.ending },
            think: if stops { Think::Stop } else { preset.think },
            avoid: task.avoid,
            max_time: duration_from_secs(task.max_time),
            max_decisions: task.max_decisions,
            ..preset
        }
    }

    /// How far a decision goes on a task of this set: PIVOT, which knows no depth, is given a fixed step.
    fn step(self, set: Set) -> StepRule {
        match self {
            Self::SpfStepMedian | Self::Pivot | Self::PivotParallel => StepRule::Fixed(median_step(set)),
            Self::SpfStepMetre | Self::PivotMetre => StepRule::FIXED,
            _ => StepRule::PAPER,
        }
    }
}

/// The median of the steps that SPF flies in the scenes of a set, metres (docs/baselines.md).
fn median_step(set: Set) -> f64 {
    match set {
        Set::Simulation => 6.7,
        Set::RealWorld => 1.9,
    }
}

/// Moves of the blind control before it says that it is done.
const MOVES: usize = 5;
/// What each of them takes to be answered, seconds: the median of the oracle's.
const LATENCY_S: f64 = 1.5;

/// Who answers the blind control: straight on by `metres` some times, then done. It looks at no picture and reads no
/// instruction.
struct Blind {
    metres: f64,
}

impl Vlm for Blind {
    fn name(&self) -> &str {
        NOBODY
    }

    fn answer(&mut self, asked: &Asked<'_>, _picture: &mut dyn Picture) -> Answer {
        Answer {
            text: Ok(self.text(asked.query.memory.actions.len())),
            latency: duration_from_secs(LATENCY_S),
            model: NOBODY.to_owned(),
            account: Account::default(),
        }
    }
}

impl Blind {
    /// `moves` were made.
    fn text(&self, moves: usize) -> String {
        if moves >= MOVES {
            return "{\"actions\":[],\"done\":true}".to_owned();
        }
        format!("{{\"actions\":[{{\"cmd\":\"forward\",\"value\":{}}}],\"done\":false}}", self.metres)
    }
}

/// The name of who points where nobody does.
pub const NOBODY: &str = "none";

/// Who answers the blind control.
pub(super) fn blind(metres: f64) -> WhoPoints {
    Arc::new(move |_, _| Ok(Box::new(Blind { metres })))
}

#[cfg(test)]
mod tests {
    use spf_core::actions::parse_actions;

    use super::*;

    #[test]
    fn a_method_is_found_by_its_name() {
        assert!(Method::ALL.iter().all(|method| Method::of_name(method.name()) == Some(*method)));
        assert_eq!(Method::of_name("chance"), None);
    }

    #[test]
    fn an_ablation_changes_what_its_name_says() {
        let task = crate::task::shipped("real-long-cones").unwrap().unwrap();
        let [spf, median, metre, queue, timed, stop] =
            [Method::Spf, Method::SpfStepMedian, Method::SpfStepMetre, Method::SpfSequential, Method::SpfTimed, Method::SpfStop]
                .map(|method| method.settings(&task));
        assert_eq!((spf.step, spf.max_decisions), (StepRule::PAPER, task.max_decisions));
        assert_eq!(median, PilotSettings { step: StepRule::Fixed(1.9), ..spf });
        assert_eq!(metre, PilotSettings { step: StepRule::Fixed(1.0), ..spf });
        assert_eq!(queue, PilotSettings { motion: Motion::Sequential, ..spf });
        assert_eq!(timed, PilotSettings { ending: Ending::Timed, ..spf });
        assert_eq!(stop, PilotSettings { think: Think::Stop, ..spf });
        assert_eq!(Method::SpfStopSequential.settings(&task), PilotSettings { motion: Motion::Sequential, ..stop });
    }

    #[test]
    fn the_blind_control_goes_straight_on_and_is_done() {
        let blind = Blind { metres: 5.0 };
        let go = parse_actions(&blind.text(0)).unwrap();
        assert_eq!((go.actions, go.done), (vec![spf_core::actions::Action::Forward(5.0)], false));
        let end = parse_actions(&blind.text(MOVES)).unwrap();
        assert!(end.done && end.actions.is_empty());
    }
}

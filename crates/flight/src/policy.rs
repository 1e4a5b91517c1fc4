//! Which policy decides a flight.

use spf_baselines::pivot::{Pivot, PivotSettings};
use spf_baselines::plain::{Plain, PlainSettings, prompt_kind};
use spf_baselines::typefly::{TypeFly, TypeFlySettings};
use spf_core::actions::ActForm;
use spf_core::avoid::PathShape;
use spf_core::executor::Motion;
use spf_core::policy::Policy;
use spf_core::policy::spf::{Spf, SpfSettings};
use spf_core::prompt::PromptKind;
use spf_core::step::StepRule;

use crate::pilot::{PolicyMaker, PolicyParts};

/// Which policy decides.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PolicyKind {
    /// Points (the method).
    Spf,
    /// Points, and in obstacle mode boxes from a detector in place of the reply's.
    SpfDetector,
    /// Text actions (the baseline).
    Plain,
    /// The same as four numbers.
    PlainNumeric,
    /// The same as one of a few fixed moves.
    PlainDiscrete,
    /// Choices among numbered arrows (the PIVOT baseline).
    Pivot,
    /// The same three times at once, agreeing on the mean.
    PivotParallel,
    /// Programs written from a list of detections (the TypeFly baseline), with replanning and every object listed.
    TypeFly,
    /// The same with only the classes of COCO listed.
    TypeFlyCoco,
    /// The same as SPF was compared with: classes of COCO, one program, "go to" as one turn and one hop.
    TypeFlyOnce,
}

/// Metres that PIVOT flies at a time where the settings name no fixed step: the median of SPF's in rooms and yards, for the craft
/// may be in one (docs/baselines.md).
const PIVOT_STEP: f64 = 1.9;

impl PolicyKind {
    /// All, in the order of help texts.
    pub const ALL: [Self; 10] = [
        Self::Spf,
        Self::SpfDetector,
        Self::Plain,
        Self::PlainNumeric,
        Self::PlainDiscrete,
        Self::Pivot,
        Self::PivotParallel,
        Self::TypeFly,
        Self::TypeFlyCoco,
        Self::TypeFlyOnce,
    ];

    /// Its name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Spf => "spf",
            Self::SpfDetector => "spf-detector",
            Self::Plain => "plain",
            Self::PlainNumeric => "plain-numeric",
            Self::PlainDiscrete => "plain-discrete",
            Self::Pivot => "pivot",
            Self::PivotParallel => "pivot-parallel",
            Self::TypeFly => "typefly",
            Self::TypeFlyCoco => "typefly-coco",
            Self::TypeFlyOnce => "typefly-once",
        }
    }

    /// The policy of that name.
    #[must_use]
    pub fn of_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }

    /// Which prompts it takes.
    #[must_use]
    pub fn prompt(self) -> PromptKind {
        match self {
            Self::Spf | Self::SpfDetector => PromptKind::Point,
            Self::Plain => prompt_kind(ActForm::Commands),
            Self::PlainNumeric => prompt_kind(ActForm::Numeric),
            Self::PlainDiscrete => prompt_kind(ActForm::Discrete),
            Self::Pivot | Self::PivotParallel => PromptKind::Choose,
            Self::TypeFly | Self::TypeFlyCoco | Self::TypeFlyOnce => PromptKind::Program,
        }
    }
}

impl PolicyMaker for PolicyKind {
    fn name(&self) -> &str {
        (*self).name()
    }

    fn prompt(&self) -> PromptKind {
        (*self).prompt()
    }

    fn policy(&self, parts: PolicyParts) -> Box<dyn Policy> {
        let PolicyParts { settings, craft, eyesight, prompt, seed } = parts;
        let image_size = eyesight.image_size;
        match *self {
            Self::Plain | Self::PlainNumeric | Self::PlainDiscrete => {
                let form = match *self {
                    Self::PlainNumeric => ActForm::Numeric,
                    Self::PlainDiscrete => ActForm::Discrete,
                    _ => ActForm::Commands,
                };
                let settings = PlainSettings { confirm_done: settings.confirm_done, image_size, form };
                Box::new(Plain::new(settings).with_prompt(prompt))
            }
            Self::Pivot | Self::PivotParallel => {
                let step = match settings.step {
                    StepRule::Fixed(metres) => metres,
                    StepRule::Adaptive { .. } => PIVOT_STEP,
                };
                let settings = PivotSettings {
                    runs: if *self == Self::Pivot { 1 } else { 3 },
                    lifting: settings.lifting,
                    confirm_done: settings.confirm_done,
                    image_size,
                    seed,
                    ..PivotSettings::published(craft, step)
                };
                Box::new(Pivot::new(settings).with_prompt(prompt))
            }
            Self::TypeFly | Self::TypeFlyCoco | Self::TypeFlyOnce => {
                let settings = TypeFlySettings {
                    replanning: *self != Self::TypeFlyOnce,
                    coco: *self != Self::TypeFly,
                    image_size,
                    ..TypeFlySettings::new(craft)
                };
                Box::new(TypeFly::new(settings).with_prompt(prompt))
            }
            Self::Spf | Self::SpfDetector => {
                let settings = SpfSettings {
                    step: settings.step,
                    lifting: settings.lifting,
                    avoid: settings.avoid,
                    confirm_done: settings.confirm_done,
                    grounding: eyesight.grounding,
                    image_size,
                    craft,
                    shape: match settings.motion {
                        Motion::Sequential => PathShape::LevelThenClimb,
                        Motion::Blended | Motion::Manoeuvres => PathShape::Straight,
                    },
                };
                let spf = Spf::new(settings).with_prompt(prompt);
                Box::new(if *self == Self::SpfDetector { spf.with_detector() } else { spf })
            }
        }
    }
}

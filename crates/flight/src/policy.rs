//! Policy selection: a row of the [table of methods](crate::methods), and the policy it creates.

use core::fmt;

use spf_baselines::classical::{Classical, ClassicalSettings, Sought};
use spf_baselines::pivot::{Pivot, PivotSettings};
use spf_baselines::plain::{Plain, PlainSettings, prompt_kind};
use spf_baselines::typefly::{TypeFly, TypeFlySettings};
use spf_core::prompt::PromptKind;
use spf_core::query::ActForm;
use spf_core::step::StepRule;
use spf_motion::executor::Motion;
use spf_pilot::policy::Policy;
use spf_pilot::policy::spf::{Spf, SpfSettings};
use spf_space::avoid::PathShape;

use crate::methods::{Family, MethodRow, rows};
use crate::pilot::{PolicyMaker, PolicyParts};

/// PIVOT's step in metres where the settings contain no fixed step: the median of SPF's steps in office and yard,
/// because the craft may be in one of them (docs/explanation/baselines.md).
const PIVOT_STEP: f64 = 1.9;

/// A policy: a row of the table of methods that `spf fly` offers.
#[derive(Clone, Copy)]
pub struct PolicyKind(&'static MethodRow);

impl PolicyKind {
    /// All policies, in the order of the help text.
    #[must_use]
    pub fn all() -> Vec<Self> {
        let mut all: Vec<Self> = rows().iter().filter(|row| row.fly.is_some()).map(Self).collect();
        all.sort_by_key(|kind| kind.0.policy.place());
        all
    }

    /// The policy with this name; `None` if unknown.
    #[must_use]
    pub fn of_name(name: &str) -> Option<Self> {
        rows().iter().find(|row| row.fly.is_some() && row.name == name).map(Self)
    }

    /// The policy with this name in a log, where the bench's classical one occurs as well; `None` if unknown.
    #[must_use]
    pub(crate) fn of_log(name: &str) -> Option<Self> {
        let classical = Self::of(Family::Classical {});
        Self::of_name(name).or_else(|| (classical.name() == name).then_some(classical))
    }

    /// The policy of a row as named in logs: itself, or the one that it is a variant of.
    #[must_use]
    pub fn of_row(row: &MethodRow) -> Self {
        Self::of(row.policy)
    }

    /// SPF.
    #[must_use]
    pub fn spf() -> Self {
        Self::of(Family::Spf {})
    }

    /// Text actions.
    pub(crate) fn plain() -> Self {
        Self::of(Family::Plain { form: ActForm::Commands })
    }

    fn of(family: Family) -> Self {
        let is_named = |row: &&MethodRow| (row.fly.is_some() || family == Family::Classical {}) && row.policy == family;
        let row = rows().iter().find(is_named);
        Self(row.expect("every policy of the embedded table has a name"))
    }

    /// Its name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        &self.0.name
    }

    /// Its description in the help text.
    #[must_use]
    pub fn words(self) -> &'static str {
        self.0.fly.as_deref().unwrap_or_default()
    }

    /// The kind of prompt it uses; unused for a policy that sends no query.
    #[must_use]
    pub fn prompt(self) -> PromptKind {
        match self.0.policy {
            Family::Spf {} => PromptKind::Point,
            Family::Plain { form } => prompt_kind(form),
            Family::Pivot { .. } => PromptKind::Choose,
            Family::TypeFly { .. } => PromptKind::Program,
            // It sends the built-in prompt for a list only.
            Family::Classical {} => PromptKind::Point,
        }
    }
}

impl PartialEq for PolicyKind {
    fn eq(&self, other: &Self) -> bool {
        self.name() == other.name()
    }
}

impl Eq for PolicyKind {}

impl fmt::Debug for PolicyKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("PolicyKind").field(&self.name()).finish()
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
        let PolicyParts { settings, craft, image_spec, prompt, seed } = parts;
        let image_size = image_spec.image_size;
        match self.0.policy {
            Family::Spf {} => {
                let settings = SpfSettings {
                    step: settings.step,
                    lifting: settings.lifting,
                    avoid: settings.avoid,
                    confirm_done: settings.confirm_done,
                    grounding: image_spec.grounding,
                    image_size,
                    craft,
                    depth: settings.depth,
                    method: settings.method,
                    keep_m: settings.keeps(),
                    close_up: settings.close_up,
                    near_m: settings.near_m,
                    shape: match settings.motion {
                        Motion::Sequential => PathShape::LevelThenClimb,
                        Motion::Blended | Motion::Manoeuvres => PathShape::Straight,
                    },
                };
                Box::new(Spf::new(settings).with_prompt(prompt))
            }
            Family::Plain { form } => {
                let settings = PlainSettings { confirm_done: settings.confirm_done, image_size, form, near_m: settings.near_m };
                Box::new(Plain::new(settings).with_prompt(prompt))
            }
            Family::Pivot { runs } => {
                let step = match settings.step {
                    StepRule::Fixed(metres) => metres,
                    StepRule::Adaptive { .. } => PIVOT_STEP,
                };
                let settings = PivotSettings {
                    runs,
                    lifting: settings.lifting,
                    confirm_done: settings.confirm_done,
                    avoid: settings.avoid,
                    image_size,
                    seed,
                    near_m: settings.near_m,
                    ..PivotSettings::published(craft, step)
                };
                Box::new(Pivot::new(settings).with_prompt(prompt))
            }
            Family::TypeFly { coco, replanning } => {
                let near_m = settings.near_m;
                let settings = TypeFlySettings { replanning, coco, image_size, near_m, ..TypeFlySettings::new(craft) };
                Box::new(TypeFly::new(settings).with_prompt(prompt))
            }
            Family::Classical {} => {
                Seeker { stages: Vec::new() }.policy(PolicyParts { settings, craft, image_spec, prompt, seed })
            }
        }
    }
}

/// The classical policy with its targets, which come from a task of the bench and not from the instruction.
#[derive(Clone, Debug)]
pub struct Seeker {
    /// What it flies to, in order; without any it finds nothing.
    pub stages: Vec<Sought>,
}

impl PolicyMaker for Seeker {
    fn name(&self) -> &str {
        PolicyKind::of(Family::Classical {}).name()
    }

    fn prompt(&self) -> PromptKind {
        PolicyKind::of(Family::Classical {}).prompt()
    }

    fn policy(&self, parts: PolicyParts) -> Box<dyn Policy> {
        let PolicyParts { settings, craft, image_spec, .. } = parts;
        let settings =
            ClassicalSettings { craft, image_size: image_spec.image_size, near_m: settings.near_m, avoid: settings.avoid };
        Box::new(Classical::new(settings, self.stages.clone()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_decides_a_row_has_a_name() {
        for row in rows() {
            let kind = PolicyKind::of_row(row);
            if row.policy == (Family::Classical {}) {
                assert_eq!((kind.name(), row.fly.is_some(), PolicyKind::of_name(kind.name())), ("classical", false, None));
                continue;
            }
            assert_eq!(PolicyKind::of_name(kind.name()), Some(kind), "{}", row.name);
            assert!(row.fly.is_none() || kind.name() == row.name, "{}", row.name);
        }
        assert_eq!((PolicyKind::spf().name(), PolicyKind::plain().name()), ("spf", "plain"));
        assert_eq!(PolicyKind::of_name("spf-paper"), None, "a method of the bench alone is no policy");
    }
}

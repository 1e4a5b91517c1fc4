//! The table of methods, from the built-in file `data/methods.toml`. Each row is a value of `spf fly --policy`, of the
//! bench's `--method`, or both.

use std::sync::LazyLock;

use serde::Deserialize;
use spf_core::query::ActForm;
use spf_core::step::StepRule;
use spf_motion::executor::{Ending, Motion};
use spf_pilot::method::{Measured, Method};
use spf_pilot::{PilotSettings, Preset, QueryTiming};
use thiserror::Error;

const SHIPPED: &str = include_str!("../data/methods.toml");

static ROWS: LazyLock<Vec<MethodRow>> =
    LazyLock::new(|| read(SHIPPED).unwrap_or_else(|error| panic!("crates/flight/data/methods.toml: {error}")));

/// Number of parallel PIVOT runs; the upper limit is the maximum number of open queries.
const RUNS: std::ops::RangeInclusive<usize> = 1..=8;
/// Range of a fixed step, metres, as for `spf fly --step`.
const FIXED_M: std::ops::RangeInclusive<f64> = 0.05..=50.0;

/// The rows of the table, in order.
///
/// # Panics
/// Never: a test parses the table.
#[must_use]
pub fn rows() -> &'static [MethodRow] {
    &ROWS
}

/// A named flight method.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[cfg_attr(test, derive(serde::Serialize))]
#[serde(deny_unknown_fields)]
pub struct MethodRow {
    /// Its name on the command line, in logs and in results.
    pub name: String,
    /// Description, one line.
    pub about: String,
    /// Policy family.
    pub policy: Family,
    /// The description in the help of `spf fly --policy`; `None` if `spf fly` does not offer it.
    pub fly: Option<String>,
    /// How the bench flies it; `None` if it is not a bench method.
    pub bench: Option<BenchSettings>,
}

/// A policy family with its parameters. A family without options has braces too (`Name {}`), so that a row with an
/// unknown option is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[cfg_attr(test, derive(serde::Serialize))]
#[serde(tag = "family", rename_all = "lowercase", deny_unknown_fields)]
pub enum Family {
    /// Image points (the SPF method).
    Spf {},
    /// Text actions (the baseline).
    Plain {
        /// Form of the actions.
        #[serde(default)]
        form: ActForm,
    },
    /// Choices among numbered arrows (the PIVOT baseline).
    Pivot {
        /// Number of parallel runs, whose mean is used; 1 to 8.
        #[serde(default = "one")]
        runs: usize,
    },
    /// Programs written from a list of detections (the TypeFly baseline).
    TypeFly {
        /// Whether only COCO classes are listed.
        #[serde(default)]
        coco: bool,
        /// Whether the planner is queried again; without it only the first program is flown, with "go to" as one turn
        /// and one hop.
        #[serde(default = "yes")]
        replanning: bool,
    },
    /// Flight to what a detector lists, by class and colour, without a language model. Its targets are data of the bench's tasks, so
    /// `spf fly` does not offer it.
    Classical {},
}

impl Family {
    /// Position of its members in the help of `spf fly`.
    pub(crate) fn place(self) -> usize {
        match self {
            Self::Spf {} => 0,
            Self::Plain { .. } => 1,
            Self::Pivot { .. } => 2,
            Self::TypeFly { .. } => 3,
            Self::Classical {} => 4,
        }
    }
}

/// How the bench flies a method: differences from the preset.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[cfg_attr(test, derive(serde::Serialize))]
#[serde(default, deny_unknown_fields)]
pub struct BenchSettings {
    /// The preset, if not [`Preset::Default`].
    pub preset: Option<Preset>,
    /// Step length.
    pub step: Option<Step>,
    /// Sequential or blended motion.
    pub motion: Option<Motion>,
    /// Whether time or the measured distance ends a primitive.
    pub ending: Option<Ending>,
    /// Whether the craft holds while the VLM thinks.
    pub think: Option<QueryTiming>,
    /// Whether a `done` must be confirmed by a second query while holding.
    pub confirm_done: Option<bool>,
    /// Whether obstacle mode is on in every task, not only in those that require it.
    pub avoid: bool,
    /// Whether the boxes of replies in obstacle mode are those of a detector of COCO's classes.
    pub detector: bool,
    /// What leads the craft between two answers, if not each reply's own step.
    pub method: Option<Leads>,
    /// Whether the envelope brakes before known obstacles.
    pub brake: bool,
    /// Whether the craft stays with a target that a reply follows, by a tracker.
    pub track: bool,
    /// Whether the craft has a depth sensor.
    pub depth_sensor: bool,
    /// Whether a geofence is drawn around the straight path from the start to the goals.
    pub fence: bool,
    /// Whether it flies straight on without frames or queries.
    pub blind: bool,
}

/// What leads a craft of the bench between two answers.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[cfg_attr(test, derive(serde::Serialize))]
#[serde(rename_all = "snake_case")]
pub enum Leads {
    /// [`Method::Boxes`].
    Boxes,
    /// [`Method::Depth`], by a depth sensor.
    Depth,
}

impl Leads {
    fn method(self) -> Method {
        match self {
            Self::Boxes => Method::Boxes,
            Self::Depth => Method::Depth(Measured::View),
        }
    }
}

/// A step that does not depend on depth.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[cfg_attr(test, derive(serde::Serialize))]
#[serde(rename_all = "snake_case")]
pub enum Step {
    /// The median step of SPF in the scenes of the task's set.
    Median,
    /// Metres, 0.05 to 50.
    FixedM(f64),
}

impl BenchSettings {
    /// The preset it is based on.
    #[must_use]
    pub fn preset(&self) -> Preset {
        self.preset.unwrap_or(Preset::Default)
    }

    /// The pilot settings for a task where the median step of SPF is `median_m` metres.
    #[must_use]
    pub fn settings(&self, median_m: f64) -> PilotSettings {
        let preset = PilotSettings::preset(self.preset());
        PilotSettings {
            step: match self.step {
                None => preset.step,
                Some(Step::Median) => StepRule::Fixed(median_m),
                Some(Step::FixedM(metres)) => StepRule::Fixed(metres),
            },
            motion: self.motion.unwrap_or(preset.motion),
            ending: self.ending.unwrap_or(preset.ending),
            think: self.think.unwrap_or(preset.think),
            confirm_done: self.confirm_done.unwrap_or(preset.confirm_done),
            method: self.method.map_or(Method::Paper, Leads::method),
            track: self.track,
            ..preset
        }
    }
}

/// Why a table of methods is invalid.
#[derive(Clone, Debug, PartialEq, Error)]
pub(crate) enum MethodsError {
    /// Invalid TOML, an unknown key or word, or a value of the wrong type.
    #[error("{0}")]
    Format(String),
    /// A name that cannot be used in a list or in a trial's name.
    #[error("invalid name `{0}`: use lower-case letters, digits and single dashes, starting with a letter")]
    Name(String),
    /// A row without a description.
    #[error("`{0}` has no `about`: add a description")]
    About(String),
    /// Duplicate name.
    #[error("duplicate name `{0}`")]
    Twice(String),
    /// A row that is used by neither command.
    #[error("`{0}` has neither `fly` nor `bench`: set at least one")]
    Unused(String),
    /// A number out of range.
    #[error("`{key}` of `{name}` is {value}, but must be {must}")]
    Value {
        /// The row.
        name: String,
        /// The key.
        key: &'static str,
        /// The value found.
        value: f64,
        /// The range in words.
        must: &'static str,
    },
    /// A bench row whose flight logs could not name a policy.
    #[error("no row with `fly` has the same policy as `{0}`, so logs of its flights could not name their policy: add one")]
    Nameless(String),
    /// Two identical policies.
    #[error(
        "`{0}` and `{1}` both have `fly` and the same policy, so the name in a log would be ambiguous: remove `fly` from one"
    )]
    Alike(String, String),
    /// A blind control that would need frames.
    #[error("`{0}` is blind, but only the policy `plain` with `form = \"commands\"` works without frames")]
    Blind(String),
}

#[derive(Deserialize)]
#[cfg_attr(test, derive(serde::Serialize))]
#[serde(deny_unknown_fields)]
struct File {
    method: Vec<MethodRow>,
}

fn one() -> usize {
    1
}

fn yes() -> bool {
    true
}

/// Parses a table.
///
/// # Errors
/// [`MethodsError`] for the first invalid row.
fn read(text: &str) -> Result<Vec<MethodRow>, MethodsError> {
    let File { method: rows } =
        toml::from_str(text).map_err(|error| MethodsError::Format(error.to_string().trim().to_owned()))?;
    for (index, row) in rows.iter().enumerate() {
        row.check()?;
        let name = || row.name.clone();
        if rows[..index].iter().any(|other| other.name == row.name) {
            return Err(MethodsError::Twice(name()));
        }
        let alike = |other: &&MethodRow| other.fly.is_some() && other.policy == row.policy;
        if let Some(other) = rows[..index].iter().find(alike).filter(|_| row.fly.is_some()) {
            return Err(MethodsError::Alike(other.name.clone(), name()));
        }
        if row.policy != (Family::Classical {}) && !rows.iter().any(|other| alike(&other)) {
            return Err(MethodsError::Nameless(name()));
        }
    }
    Ok(rows)
}

impl MethodRow {
    /// Validates a row on its own.
    fn check(&self) -> Result<(), MethodsError> {
        let name = || self.name.clone();
        let word = |part: &str| !part.is_empty() && part.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit());
        if !self.name.starts_with(|c: char| c.is_ascii_lowercase()) || !self.name.split('-').all(word) {
            return Err(MethodsError::Name(name()));
        }
        if self.about.trim().is_empty() || self.fly.as_deref().is_some_and(|words| words.trim().is_empty()) {
            return Err(MethodsError::About(name()));
        }
        if self.fly.is_none() && self.bench.is_none() {
            return Err(MethodsError::Unused(name()));
        }
        let wrong = |key, value, must| Err(MethodsError::Value { name: name(), key, value, must });
        match self.policy {
            Family::Pivot { runs } if !RUNS.contains(&runs) => return wrong("runs", runs as f64, "1 to 8"),
            _ => {}
        }
        match self.bench {
            // NaN is in no range.
            Some(BenchSettings { step: Some(Step::FixedM(metres)), .. }) if !FIXED_M.contains(&metres) => {
                wrong("fixed_m", metres, "0.05 to 50")
            }
            Some(BenchSettings { blind: true, .. }) if self.policy != (Family::Plain { form: ActForm::Commands }) => {
                Err(MethodsError::Blind(name()))
            }
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests;

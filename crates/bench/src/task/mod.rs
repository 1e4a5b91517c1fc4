//! Tasks as data: where, from where, what is said, and what counts as done (docs/guide/bench.md).

mod file;
mod select;
mod shipped;

use spf_core::craft::CraftKind;
use spf_core::geometry::Pose;
use spf_scene::{Lighting, SceneLook, Weather};
use thiserror::Error;

pub use select::{Rank, Selector};
pub(crate) use select::{centre, select_all};
pub use shipped::{SUITES, Suite, shipped, suite};

/// Longest task file that is read, bytes.
pub const MAX_BYTES: usize = 256 << 10;

/// Why a task file was refused.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum TaskError {
    /// The file could not be read.
    #[error("cannot read the task file `{path}`")]
    Read {
        /// The path.
        path: String,
        /// Why.
        #[source]
        source: std::io::Error,
    },
    /// The file is no task.
    #[error("{file}:{line}: {message}{}", hint.as_ref().map(|h| format!("\n\nhint: {h}")).unwrap_or_default())]
    Invalid {
        /// The file.
        file: String,
        /// Line, from 1.
        line: usize,
        /// What is wrong.
        message: String,
        /// What to do.
        hint: Option<String>,
    },
}

/// Which of the paper's two sets a task belongs to; it decides the judge's radius.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Set {
    /// Large scenes; success within 5 m.
    Simulation,
    /// Rooms and yards; success within 1 m.
    RealWorld,
}

impl Set {
    /// The judge's radius about the target's nearest surface, metres.
    #[must_use]
    pub fn radius(self) -> f64 {
        match self {
            Self::Simulation => 5.0,
            Self::RealWorld => 1.0,
        }
    }

    /// In words for people.
    #[must_use]
    pub fn words(self) -> &'static str {
        match self {
            Self::Simulation => "simulation",
            Self::RealWorld => "real-world",
        }
    }
}

/// The paper's groups of tasks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Category {
    /// Fly there.
    Navigation,
    /// Fly there past something in the way.
    ObstacleAvoidance,
    /// Several things in order.
    LongHorizon,
    /// What is meant has to be inferred.
    Reasoning,
    /// What is meant has to be found.
    Search,
    /// What is meant walks.
    Follow,
}

impl Category {
    /// In words for people.
    #[must_use]
    pub fn words(self) -> &'static str {
        match self {
            Self::Navigation => "navigation",
            Self::ObstacleAvoidance => "obstacle avoidance",
            Self::LongHorizon => "long horizon",
            Self::Reasoning => "reasoning",
            Self::Search => "search",
            Self::Follow => "follow",
        }
    }
}

/// Whether the target is in view at the start.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum View {
    /// In every draw.
    Always,
    /// In no draw: not a pixel of any target.
    Never,
    /// In every second draw.
    Half,
    /// It is not looked at.
    Any,
}

/// Where trials begin.
#[derive(Clone, Debug, PartialEq)]
pub struct Start {
    /// Whether every trial begins at the scene's own start and heading; then nothing is drawn, and the rest does not apply.
    pub own: bool,
    /// Whether the target is in view.
    pub view: View,
    /// Metres from the start to the nearest surface of a target, least and most.
    pub range: [f64; 2],
    /// Metres east, from and to; none: the scene's bounds.
    pub east: Option<[f64; 2]>,
    /// Metres north, from and to.
    pub north: Option<[f64; 2]>,
    /// What view and range are about; empty: the targets of the first goal.
    pub of: Vec<Selector>,
    /// One of these stands on the straight way to the target, at most so far from it on the map, metres.
    pub past: Option<(Vec<Selector>, f64)>,
    /// Whether something solid meets the straight way from take-off height to the target; none: it may, or may not.
    pub blocked: Option<bool>,
}

/// Wind that a trial is flown in: it blows from anywhere, by the trial's seed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Winds {
    /// Minimum and most speed, metres per second.
    pub speed: [f64; 2],
    /// Standard deviation of the gusts along each axis, metres per second.
    pub gust: f64,
    /// Time constant of the gusts, seconds.
    pub gust_time: f64,
}

/// One thing to be done. Goals are met in order.
#[derive(Clone, Debug, PartialEq)]
pub struct Goal {
    /// What.
    pub kind: GoalKind,
    /// To which objects of the scene; nothing for a scan.
    pub targets: Vec<Selector>,
}

/// The predicates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum GoalKind {
    /// Within the judge's radius of one of them, which is clearly visible.
    Reach {
        /// Another one than the goal before was met with.
        other: bool,
        /// At least at this fraction of the target's height.
        up_share: f64,
    },
    /// The same with so many of them, one after another, in any order.
    Visit {
        /// How many.
        count: usize,
    },
    /// Through so many of these openings, and on by so many metres.
    Through {
        /// How many; none: all of them.
        count: Option<usize>,
        /// Metres from where the last was crossed.
        beyond: f64,
    },
    /// About one of them by this angle, no farther than that from its surface.
    Around {
        /// Radians.
        angle: f64,
        /// Metres.
        within: f64,
    },
    /// Over one of them: above its footprint and its top, from one side to another.
    Over,
    /// Behind one of them, seen from the start.
    Behind {
        /// At most so far from its surface, metres.
        within: f64,
    },
    /// All around is seen.
    Scan {
        /// What turns and the field of view come to, radians.
        angle: f64,
    },
    /// Near one of them and in view of it for a fraction of the time that has just gone by.
    Follow {
        /// Metres from its surface.
        within: f64,
        /// Share.
        share: f64,
        /// Seconds.
        window: f64,
    },
}

impl GoalKind {
    /// Whether it holds as long as it holds; the others are met once and for all.
    #[must_use]
    pub fn is_momentary(&self) -> bool {
        matches!(self, Self::Reach { .. } | Self::Follow { .. })
    }
}

/// A way that the judge must accept or reject: the file's own test of its predicate. It is flown in the scene as the file has
/// it, at an even speed.
#[derive(Clone, Debug, PartialEq)]
pub struct Trajectory {
    /// What it shows.
    pub why: String,
    /// Whether the judge must accept it.
    pub accepted: bool,
    /// Metres per second.
    pub speed: f64,
    /// Places are metres from this object, wherever it is by then.
    pub beside: Option<String>,
    /// Corners.
    pub path: Vec<Pose>,
    /// Seconds of rest at the end.
    pub rest: f64,
}

/// A task.
#[derive(Clone, Debug, PartialEq)]
pub struct Task {
    /// Its name.
    pub id: String,
    /// What is said.
    pub instruction: String,
    /// Simulation or real world.
    pub set: Set,
    /// The paper's group.
    pub category: Category,
    /// Scene, a built-in name or a path.
    pub scene: String,
    /// Whether each trial flies in a variant of it.
    pub variants: bool,
    /// Light and weather that are not left to the variant.
    pub conditions: SceneLook,
    /// Wind; none: still air.
    pub wind: Option<Winds>,
    /// Minimum and most seconds by which every answer of the VLM comes later, drawn by question; none: it comes when it comes.
    pub vlm_delay: Option<[f64; 2]>,
    /// In what is flown.
    pub craft: CraftKind,
    /// Obstacle mode.
    pub avoid: bool,
    /// Flight time after which it is a timeout, seconds.
    pub max_time: f64,
    /// Decisions after which it is a timeout.
    pub max_decisions: u32,
    /// Where trials begin.
    pub start: Start,
    /// What is to be done.
    pub goals: Vec<Goal>,
    /// Ways that the judge is tested with.
    pub trajectories: Vec<Trajectory>,
}

impl Task {
    /// Reads a task file.
    ///
    /// # Errors
    /// [`TaskError`] when it cannot be read or is no task.
    pub fn load(path: &str) -> Result<Self, TaskError> {
        let text = std::fs::read_to_string(path).map_err(|source| TaskError::Read { path: path.to_owned(), source })?;
        Self::parse(&text, path)
    }

    /// Reads the text of a task file; `file` is its name in errors.
    ///
    /// # Errors
    /// [`TaskError::Invalid`] with file, line and what to do.
    pub fn parse(text: &str, file: &str) -> Result<Self, TaskError> {
        file::parse(text, file)
    }

    /// What view and range of the start are about.
    #[must_use]
    pub fn start_targets(&self) -> &[Selector] {
        if self.start.of.is_empty() { self.goals.first().map_or(&[], |goal| &goal.targets) } else { &self.start.of }
    }

    /// Light and weather by name, for people.
    #[must_use]
    pub fn conditions_words(&self) -> [Option<&'static str>; 2] {
        [self.conditions.lighting.map(Lighting::name), self.conditions.weather.map(Weather::name)]
    }
}

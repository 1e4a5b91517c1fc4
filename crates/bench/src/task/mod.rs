//! Tasks as data: scene, start, instruction and success criteria (docs/guide/bench.md).

mod file;
mod foreign;
mod hostile;
mod select;
mod shipped;
mod stage;

use spf_core::craft::CraftKind;
use spf_core::geometry::Pose;
use spf_scene::{Lighting, SceneLook, Weather};
use thiserror::Error;

pub use foreign::{Benchmark, Destination, ForeignTask, LONGEST_INSTRUCTION, MOST_CORNERS, MOST_METRES, MOST_WORDINGS, Wording};
pub use hostile::{Hostile, SignContent};
pub use select::{Rank, Selector};
pub(crate) use select::{centre, select_all};
pub use shipped::{SUITES, Suite, shipped, suite};
pub use stage::Stage;

/// Maximum size of a task file, bytes.
pub const MAX_BYTES: usize = 256 << 10;

/// Why a task file is invalid.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum TaskError {
    /// The file could not be read.
    #[error("cannot read the task file `{path}`")]
    Read {
        /// The path.
        path: String,
        /// The cause.
        #[source]
        source: std::io::Error,
    },
    /// The file is not a valid task.
    #[error("{file}:{line}: {message}{}", hint.as_ref().map(|h| format!("\n\nhint: {h}")).unwrap_or_default())]
    Invalid {
        /// The file.
        file: String,
        /// Line, from 1.
        line: usize,
        /// The problem.
        message: String,
        /// How to fix it.
        hint: Option<String>,
    },
    /// The task belongs to another benchmark, and needs its simulator.
    #[error(
        "{file}: a task of {} in its scene {scene}, which {} serves; trials are flown in this simulator's own scenes\n\n\
        hint: spf bench show {file}",
        benchmark.name(), benchmark.simulator()
    )]
    Foreign {
        /// The file.
        file: String,
        /// Whose task it is.
        benchmark: Benchmark,
        /// The benchmark's name of the scene.
        scene: String,
    },
}

/// The paper's set that a task belongs to, which determines the success radius.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TaskSet {
    /// Large scenes; success within 5 m.
    Simulation,
    /// Rooms and yards; success within 1 m.
    RealWorld,
}

impl TaskSet {
    /// The success radius around the target's nearest surface, metres.
    #[must_use]
    pub fn radius(self) -> f64 {
        match self {
            Self::Simulation => 5.0,
            Self::RealWorld => 1.0,
        }
    }

    /// The least distance at which the paper's appendix scores a success, metres.
    #[must_use]
    pub fn nearest(self) -> f64 {
        match self {
            Self::Simulation => 1.0,
            Self::RealWorld => 0.0,
        }
    }

    /// Display text.
    #[must_use]
    pub fn words(self) -> &'static str {
        match self {
            Self::Simulation => "simulation",
            Self::RealWorld => "real-world",
        }
    }
}

/// The paper's categories of tasks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Category {
    /// Fly to a target.
    Navigation,
    /// Fly to a target past an obstacle.
    ObstacleAvoidance,
    /// Several targets in order.
    LongHorizon,
    /// The target must be inferred.
    Reasoning,
    /// The target must be found.
    Search,
    /// The target walks.
    Follow,
}

impl Category {
    /// Display text.
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
pub enum InView {
    /// In the first frame of every trial.
    Always,
    /// In no trial: not one pixel of any target is visible.
    Never,
    /// In every second trial.
    Half,
    /// Not checked.
    Any,
}

/// Start of trials.
#[derive(Clone, Debug, PartialEq)]
pub struct Start {
    /// Whether every trial begins at the scene's own start and heading; then nothing is sampled, and the
    /// other fields do not apply.
    pub own: bool,
    /// Whether the target is in view.
    pub view: InView,
    /// Distance from the start to the nearest surface of a target, minimum and maximum, metres.
    pub range: [f64; 2],
    /// Range in metres east; `None` for the scene's bounds.
    pub east: Option<[f64; 2]>,
    /// Range in metres north; `None` for the scene's bounds.
    pub north: Option<[f64; 2]>,
    /// The targets of view and range; empty for those of the first goal.
    pub of: Vec<Selector>,
    /// Objects of which one is on the straight path to the target, with their maximum horizontal distance from it,
    /// metres.
    pub past: Option<(Vec<Selector>, f64)>,
    /// Whether the straight path from take-off height to the target is blocked by a solid object; `None` if not
    /// checked.
    pub blocked: Option<bool>,
}

/// Wind of a trial: from any direction, by the trial's seed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Winds {
    /// Minimum and maximum speed, m/s.
    pub speed: [f64; 2],
    /// Standard deviation of the gusts along each axis, m/s.
    pub gust: f64,
    /// Time constant of the gusts, seconds.
    pub gust_time: f64,
}

/// A goal. Goals are met in order.
#[derive(Clone, Debug, PartialEq)]
pub struct Goal {
    /// The predicate.
    pub kind: GoalKind,
    /// Its targets in the scene; empty for a scan.
    pub targets: Vec<Selector>,
}

/// Predicates of goals.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum GoalKind {
    /// Within the success radius of a target, which is clearly visible.
    Reach {
        /// Whether the target must differ from that of the previous goal.
        other: bool,
        /// Minimum height, as a fraction of the target's height.
        up_share: f64,
    },
    /// Reach several targets, in any order.
    Visit {
        /// Number of targets.
        count: usize,
    },
    /// Through several of these openings, and on by a distance.
    Through {
        /// Number of openings; `None` for all of them.
        count: Option<usize>,
        /// Distance beyond the last one, metres.
        beyond: f64,
    },
    /// Around a target by an angle, within a distance of its surface.
    Around {
        /// Angle, radians.
        angle: f64,
        /// Maximum distance, metres.
        within: f64,
    },
    /// Over a target: above its footprint and its top, from one side to another.
    Over,
    /// Behind a target, as seen from the start.
    Behind {
        /// Maximum distance from its surface, metres.
        within: f64,
    },
    /// Look all around.
    Scan {
        /// Total of yaw and field of view, radians.
        angle: f64,
    },
    /// Near a target with it in view, for a fraction of a time window.
    Follow {
        /// Maximum distance from its surface, metres.
        within: f64,
        /// Fraction of the window, 0..=1.
        fraction: f64,
        /// Length of the window, seconds.
        window: f64,
    },
}

impl GoalKind {
    /// Whether it only holds at the current instant; the others stay met.
    #[must_use]
    pub fn is_momentary(&self) -> bool {
        matches!(self, Self::Reach { .. } | Self::Follow { .. })
    }
}

/// A test trajectory that the judge must accept or reject. It is flown in the scene as given in the file, at constant
/// speed.
#[derive(Clone, Debug, PartialEq)]
pub struct Trajectory {
    /// What it demonstrates.
    pub why: String,
    /// Whether the judge must accept it.
    pub accepted: bool,
    /// Speed, m/s.
    pub speed: f64,
    /// Key of the object to which positions are relative, wherever it is at the time.
    pub beside: Option<String>,
    /// Corners.
    pub path: Vec<Pose>,
    /// Rest at the end, seconds.
    pub rest: f64,
}

/// A task.
#[derive(Clone, Debug, PartialEq)]
pub struct Task {
    /// Its id.
    pub id: String,
    /// The instruction.
    pub instruction: String,
    /// Simulation or real world.
    pub set: TaskSet,
    /// The paper's category.
    pub category: Category,
    /// Scene, a built-in name or a path.
    pub scene: String,
    /// Objects added to it, as `[[objects]]` tables of a scene file; empty for none.
    pub objects: String,
    /// What makes it a task with a hostile sign.
    pub hostile: Option<Hostile>,
    /// Whether each trial uses a variant of it.
    pub variants: bool,
    /// Light and weather, if not determined by the variant.
    pub conditions: SceneLook,
    /// Wind; `None` for still air.
    pub wind: Option<Winds>,
    /// Range of the additional delay of every VLM reply, seconds, sampled per query; `None` for none.
    pub vlm_delay: Option<[f64; 2]>,
    /// Craft model.
    pub craft: CraftKind,
    /// Whether obstacle mode is on.
    pub avoid: bool,
    /// Flight time limit, seconds.
    pub max_time: f64,
    /// Limit on the number of decisions.
    pub max_decisions: u32,
    /// Start of trials.
    pub start: Start,
    /// The goals.
    pub goals: Vec<Goal>,
    /// What the oracle flies, as `[[stages]]` of its file or as its goals have it.
    pub stages: Vec<Stage>,
    /// Test trajectories for the judge.
    pub trajectories: Vec<Trajectory>,
}

/// A task file: of this simulator, or of another benchmark.
#[derive(Clone, Debug, PartialEq)]
pub enum TaskFile {
    /// A task of this simulator.
    Own(Box<Task>),
    /// A task of another benchmark: its file has a table `[foreign]`.
    Foreign(Box<ForeignTask>),
}

impl TaskFile {
    /// Reads a task file.
    ///
    /// # Errors
    /// [`TaskError`] if it cannot be read or is invalid.
    pub fn load(path: &str) -> Result<Self, TaskError> {
        let text = spf_input::read_text(std::path::Path::new(path))
            .map_err(|source| TaskError::Read { path: path.to_owned(), source })?;
        Self::parse(&text, path)
    }

    /// Parses the text of a task file; `file` is its name in errors.
    ///
    /// # Errors
    /// [`TaskError::Invalid`] with file, line and a hint.
    pub fn parse(text: &str, file: &str) -> Result<Self, TaskError> {
        if text.len() <= MAX_BYTES && foreign::is_foreign(text) {
            return ForeignTask::parse(text, file).map(|task| Self::Foreign(Box::new(task)));
        }
        file::parse(text, file).map(|task| Self::Own(Box::new(task)))
    }

    /// The task, if it belongs to this simulator.
    fn own(self, file: &str) -> Result<Task, TaskError> {
        match self {
            Self::Own(task) => Ok(*task),
            Self::Foreign(task) => {
                Err(TaskError::Foreign { file: file.to_owned(), benchmark: task.benchmark, scene: task.scene })
            }
        }
    }
}

impl Task {
    /// Reads a task file.
    ///
    /// # Errors
    /// [`TaskError`] if it cannot be read, is invalid, or belongs to another benchmark.
    pub fn load(path: &str) -> Result<Self, TaskError> {
        TaskFile::load(path)?.own(path)
    }

    /// Parses the text of a task file; `file` is its name in errors.
    ///
    /// # Errors
    /// [`TaskError::Invalid`] with file, line and a hint; [`TaskError::Foreign`] for a task of another benchmark.
    pub fn parse(text: &str, file: &str) -> Result<Self, TaskError> {
        TaskFile::parse(text, file)?.own(file)
    }

    /// The targets of the start's view and range.
    #[must_use]
    pub fn start_targets(&self) -> &[Selector] {
        if self.start.of.is_empty() { self.goals.first().map_or(&[], |goal| &goal.targets) } else { &self.start.of }
    }

    /// Display names of light and weather.
    #[must_use]
    pub fn conditions_words(&self) -> [Option<&'static str>; 2] {
        [self.conditions.lighting.map(Lighting::name), self.conditions.weather.map(Weather::name)]
    }
}

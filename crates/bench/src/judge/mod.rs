//! The judge: decides from the scene itself whether a task is done (docs/guide/bench.md). Policies have no access to it.
//!
//! It receives the true pose and the true positions of all actors several times per second, and keeps the state it
//! needs.

mod geometry;
mod goal;
mod sight;
mod trajectory;

use std::sync::Arc;

use spf_core::geometry::Pose;
use spf_core::time::Time;
use spf_flight::sim::{LoadedScene, WorldSnapshot};
use spf_scene::geometry::ObjectId;
use thiserror::Error;

use crate::task::{Task, select_all};
use goal::Watch;
pub use sight::{CLEAR_HEIGHT, JudgeCamera};
pub use trajectory::{Judgement, judge_trajectory};

/// Interval of evaluations, flight time; conditions that hold for less may be missed.
pub const EVALUATION_INTERVAL: core::time::Duration = core::time::Duration::from_millis(200);

/// The scene has no object that matches a goal.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("no object in the scene `{scene}` matches goal {goal} of the task `{task}`")]
pub struct NoTarget {
    /// The scene.
    pub scene: String,
    /// The task.
    pub task: String,
    /// The goal's number, from 1.
    pub goal: usize,
}

/// Input of the judge.
pub(crate) struct JudgeInput<'a> {
    pub(crate) at: Time,
    pub(crate) snapshot: &'a WorldSnapshot,
    pub(crate) before: Option<&'a WorldSnapshot>,
    pub(crate) loaded: &'a LoadedScene,
    pub(crate) start: &'a Pose,
    pub(crate) radius: f64,
    /// The least distance from a target at which the paper scores a success, metres.
    pub(crate) nearest: f64,
    pub(crate) field: f64,
}

/// Judges one flight.
pub struct Judge {
    loaded: Arc<LoadedScene>,
    start: Pose,
    radius: f64,
    nearest: f64,
    sight: JudgeCamera,
    goals: Vec<Watch>,
    /// Index of the current goal; all are met if there is none.
    current: usize,
    last: Option<WorldSnapshot>,
    holds: bool,
    holds_by_paper: bool,
}

impl Judge {
    /// A judge for a task in a scene, for a flight from `start`.
    ///
    /// # Errors
    /// [`NoTarget`] if the scene lacks the target of a goal.
    pub fn new(task: &Task, loaded: Arc<LoadedScene>, start: Pose) -> Result<Self, NoTarget> {
        let mut goals = Vec::new();
        for (goal, number) in task.goals.iter().zip(1..) {
            let targets = select_all(&goal.targets, &loaded, start.position);
            if targets.is_empty() && !goal.targets.is_empty() {
                return Err(NoTarget { scene: loaded.scene.name.clone(), task: task.id.clone(), goal: number });
            }
            goals.push(Watch::new(goal.kind, targets));
        }
        let (sight, nearest) = (JudgeCamera::of(task.craft), task.set.nearest());
        Ok(Self {
            loaded,
            start,
            radius: task.set.radius(),
            nearest,
            sight,
            goals,
            current: 0,
            last: None,
            holds: false,
            holds_by_paper: false,
        })
    }

    /// Evaluates an instant.
    pub fn look(&mut self, at: Time, snapshot: &WorldSnapshot) {
        let shown = JudgeInput {
            at,
            snapshot,
            before: self.last.as_ref(),
            loaded: &self.loaded,
            start: &self.start,
            radius: self.radius,
            nearest: self.nearest,
            field: 2.0 * self.sight.camera().half_fov().0,
        };
        self.holds = false;
        self.holds_by_paper = false;
        // One goal per evaluation: the end of one must not start the next.
        let is_last = self.current + 1 == self.goals.len();
        if let Some(goal) = self.goals.get_mut(self.current) {
            let met = goal.look(&shown, &mut self.sight);
            self.holds_by_paper = is_last && goal.is_scored_by_paper(met, &shown, &mut self.sight);
            if met && !(is_last && goal.is_momentary()) {
                self.current += 1;
                let met_with = self.goals[self.current - 1].met_with();
                if let Some(next) = self.goals.get_mut(self.current) {
                    next.begin(met_with);
                }
            }
            self.holds = met && is_last;
        }
        let is_over = self.current == self.goals.len();
        self.holds |= is_over;
        self.holds_by_paper |= is_over;
        self.last = Some(snapshot.clone());
    }

    /// Whether only the final instant still matters, because the last goal depends on the current state alone: a judge
    /// that has reported success once then only needs [`Judge::pass`] until the end.
    #[must_use]
    pub fn waits_for_the_end(&self) -> bool {
        self.current + 1 == self.goals.len() && self.goals.last().is_some_and(Watch::forgets)
    }

    /// Records an instant without evaluating it.
    pub fn pass(&mut self, snapshot: &WorldSnapshot) {
        self.last = Some(snapshot.clone());
    }

    /// Whether the judge would report success as of the last evaluation, apart from collisions.
    #[must_use]
    pub fn holds(&self) -> bool {
        self.holds
    }

    /// Whether the paper's judge would have scored a success as of the last evaluation, apart from collisions (its appendix,
    /// "Evaluation"): the task is completed as the instruction asks, or the target is clearly visible within 1 m, in the simulation
    /// set within 1 to 5 m. So a target that is reached counts from 1 m on there, and one that is followed counts at that distance
    /// as well as by the share of time that the task asks for. A task that asks for a motion is completed by that motion alone.
    #[must_use]
    pub fn holds_by_paper(&self) -> bool {
        self.holds_by_paper
    }

    /// Number of goals met.
    #[must_use]
    pub fn met(&self) -> usize {
        self.current
    }

    /// The targets of the last goal.
    #[must_use]
    pub fn last_targets(&self) -> &[ObjectId] {
        self.goals.last().map_or(&[], Watch::targets)
    }

    /// The targets of every goal, in order.
    pub fn targets(&self) -> impl Iterator<Item = &[ObjectId]> {
        self.goals.iter().map(Watch::targets)
    }

    /// Distance to the nearest surface of the last goal's targets, metres; `None` for a scan.
    #[must_use]
    pub fn distance(&self, snapshot: &WorldSnapshot) -> Option<f64> {
        nearest(&self.loaded, self.last_targets(), snapshot).map(|(_, distance)| distance)
    }

    /// Whether one of the last goal's targets is clearly visible; `None` for a scan.
    pub fn sees(&mut self, snapshot: &WorldSnapshot) -> Option<bool> {
        let targets = self.last_targets().to_vec();
        (!targets.is_empty()).then(|| !self.sight.clearly(&self.loaded, snapshot, &targets).is_empty())
    }
}

/// The object whose surface is nearest to the camera, and its distance.
pub(crate) fn nearest(loaded: &LoadedScene, objects: &[ObjectId], snapshot: &WorldSnapshot) -> Option<(ObjectId, f64)> {
    let distance = |id: &ObjectId| Some((*id, loaded.distance_to(*id, &snapshot.actors, snapshot.pose.position)?));
    objects.iter().filter_map(distance).min_by(|a, b| a.1.total_cmp(&b.1))
}

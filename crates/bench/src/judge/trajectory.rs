//! A task's test trajectories, which the judge must accept or reject.

use std::sync::Arc;

use spf_core::geometry::{Attitude, EnuPosition, Pose, wrap_angle};
use spf_core::time::Time;
use spf_flight::sim::{LoadedScene, WorldSnapshot};
use spf_scene::actors::Traffic;
use spf_sim::model::Model;

use super::{EVALUATION_INTERVAL, Judge, NoTarget};
use crate::task::{Task, Trajectory};

/// The judge's result for a trajectory.
#[derive(Clone, Debug, PartialEq)]
pub struct Judgement {
    /// Whether it is accepted: done at the end, without a collision.
    pub accepted: bool,
    /// Whether the paper's judge would have counted it at some instant, before anything was touched.
    pub by_paper: bool,
    /// Key of the first object touched.
    pub touched: Option<String>,
    /// Number of goals met.
    pub met: usize,
    /// Distance to the last goal's nearest surface, metres.
    pub distance: Option<f64>,
    /// Whether it is clearly visible.
    pub sees: Option<bool>,
}

/// Moves along a trajectory kinematically, and judges it.
///
/// # Errors
/// [`NoTarget`] if the scene lacks the target of a goal.
pub fn judge_trajectory(task: &Task, loaded: &Arc<LoadedScene>, trajectory: &Trajectory) -> Result<Judgement, NoTarget> {
    let mut traffic = Traffic::new(loaded.cast.clone(), 0);
    let craft = Model::of(task.craft).craft;
    let mut judge: Option<Judge> = None;
    let (mut touched, mut by_paper) = (None, false);
    let mut last: Option<WorldSnapshot> = None;
    for (at, on_rails) in samples(trajectory) {
        traffic.advance_to(at);
        let actors = traffic.places_at(at).unwrap_or_default();
        let pose = beside(loaded, trajectory, on_rails, &actors);
        let snapshot = WorldSnapshot { pose, actors };
        if let Some(before) = &last {
            let contact = loaded.collider.sweep(before.pose.position, pose.position, craft.radius).map(|contact| contact.object);
            let walked_into = loaded.cast.objects().find(|id| {
                loaded.distance_to(*id, &snapshot.actors, pose.position).is_some_and(|distance| distance < craft.radius)
            });
            touched = touched.or_else(|| contact.or(walked_into).map(|id| loaded.key(id)));
        }
        let judge = match &mut judge {
            Some(judge) => judge,
            None => judge.insert(Judge::new(task, loaded.clone(), pose)?),
        };
        judge.look(at, &snapshot);
        by_paper |= judge.holds_by_paper() && touched.is_none();
        last = Some(snapshot);
    }
    let end = last.zip(judge);
    Ok(end.map_or(
        Judgement { accepted: false, by_paper, touched: None, met: 0, distance: None, sees: None },
        |(snapshot, mut judge)| Judgement {
            accepted: judge.holds() && touched.is_none(),
            by_paper,
            met: judge.met(),
            distance: judge.distance(&snapshot),
            sees: judge.sees(&snapshot),
            touched,
        },
    ))
}

/// The pose at each evaluation of the judge, to the end of the path and through the final rest.
fn samples(trajectory: &Trajectory) -> Vec<(Time, Pose)> {
    /// Turning on the spot takes time too: radians per second.
    const TURN: f64 = 1.0;
    let mut samples = Vec::new();
    let mut at = Time::ZERO;
    let mut push = |pose: Pose| {
        samples.push((at, pose));
        at += EVALUATION_INTERVAL;
    };
    let step = EVALUATION_INTERVAL.as_secs_f64();
    for pair in trajectory.path.windows(2) {
        let [from, to] = [pair[0], pair[1]];
        let turn = wrap_angle(to.attitude.heading - from.attitude.heading);
        let seconds = (from.position.distance(to.position) / trajectory.speed).max(turn.abs() / TURN);
        let steps = libm::ceil(seconds / step).max(1.0);
        for i in 0..steps as usize {
            push(between(&from, &to, turn, i as f64 / steps));
        }
    }
    if let Some(end) = trajectory.path.last() {
        for _ in 0..=libm::ceil(trajectory.rest / step) as usize {
            push(*end);
        }
    }
    samples
}

fn between(from: &Pose, to: &Pose, turn: f64, fraction: f64) -> Pose {
    let mix = |a: f64, b: f64| a + (b - a) * fraction;
    let (a, b) = (from.position, to.position);
    Pose {
        position: EnuPosition { east: mix(a.east, b.east), north: mix(a.north, b.north), up: mix(a.up, b.up) },
        attitude: Attitude { heading: wrap_angle(from.attitude.heading + turn * fraction), ..Attitude::default() },
    }
}

/// The pose in the world, if the path is relative to a moving object.
fn beside(loaded: &LoadedScene, trajectory: &Trajectory, mut pose: Pose, actors: &[spf_scene::actors::ActorPlace]) -> Pose {
    let object = trajectory.beside.as_ref().and_then(|key| loaded.scene.by_key(key));
    if let Some(object) = object {
        let bounds = loaded.bounds(object, actors);
        pose.position.east += 0.5 * (bounds.min.east + bounds.max.east);
        pose.position.north += 0.5 * (bounds.min.north + bounds.max.north);
    }
    pose
}

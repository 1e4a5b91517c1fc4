//! Samples the scene, conditions and start of a trial from task and seed, equally for all methods.

use std::sync::Arc;

use spf_core::geometry::{Attitude, EnuPosition, Pose, wrap_angle};
use spf_core::rng::RandomStream;
use spf_flight::sim::{LoadedScene, SceneLoadError, WorldSnapshot};
use spf_scene::geometry::ObjectId;
use spf_sim::model::Model;
use spf_sim::wind::Wind;
use thiserror::Error;

use crate::fnv;
use crate::judge::{JudgeCamera, nearest};
use crate::task::{InView, Selector, Task, centre, select_all};

/// Maximum number of variants tried per trial.
const VARIANTS: u64 = 40;
/// Maximum number of positions tried per variant.
const PLACES: u64 = 3000;
/// Maximum number of positions at which visibility is checked.
const LOOKS: u32 = 40;
/// Maximum height of the start above the target's base, metres.
const FOOT_M: f64 = 2.0;
/// Distance below a scene's upper bound (indoors the ceiling) from which ground is searched, metres.
const CEILING_M: f64 = 0.05;
/// Clearance at take-off and along an unobstructed path, metres.
const ROOM_M: f64 = 0.3;
/// Maximum offset of a target in view from the image centre, as a fraction of half the field of view.
const MIDDLE: f64 = 0.7;
/// Bearings beyond this are behind the craft, radians.
const BEHIND: f64 = 1.6;

/// Why the scene and start of a trial could not be sampled.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SampleError {
    /// The scene could not be loaded.
    #[error("cannot load the scene `{scene}` of the task `{task}`")]
    Scene {
        /// The scene.
        scene: String,
        /// The task.
        task: String,
        /// The cause.
        #[source]
        source: Box<SceneLoadError>,
    },
    /// No suitable start was found.
    #[error("no valid start for the task `{task}` with seed {seed}: relax `start` in the task file")]
    NoStart {
        /// The task.
        task: String,
        /// The seed.
        seed: u64,
    },
}

/// The sampled scene and start of a trial.
#[derive(Clone)]
pub struct Sampled {
    /// The scene with its layout and lighting.
    pub loaded: Arc<LoadedScene>,
    /// Its name, with the number of the variant.
    pub scene: String,
    /// The wind.
    pub wind: Wind,
    /// The start, on the ground.
    pub start: Pose,
    /// Whether a target is clearly visible from above the start; `None` if not checked.
    pub in_view: Option<bool>,
    /// The target for which the start was sampled.
    pub focus: Option<ObjectId>,
    /// Distance from above the start to the nearest target, metres.
    pub range: Option<f64>,
}

/// Samples the scene, conditions and start of a trial.
///
/// # Errors
/// [`SampleError`] if the scene cannot be loaded, or no suitable start is found.
pub fn draw(task: &Task, seed: u64) -> Result<Sampled, SampleError> {
    // Key of the task in random streams.
    let word = fnv(task.drawn_as().as_bytes());
    let in_view = match task.start.view {
        InView::Always => Some(true),
        InView::Never => Some(false),
        // Every second seed; which parity comes first depends on the task.
        InView::Half => Some((seed ^ RandomStream::new(0, "bench view", &[word]).below(2) as u64).is_multiple_of(2)),
        InView::Any => None,
    };
    for attempt in 0..if task.variants { VARIANTS } else { 1 } {
        let number = (RandomStream::new(seed, "bench variant", &[word, attempt]).uniform() * 1e9) as u64;
        let scene = if task.variants { format!("{}@{number}", task.scene) } else { task.scene.clone() };
        let loaded = task.load_scene(&scene);
        let loaded = Arc::new(loaded.map_err(|source| SampleError::Scene {
            scene: scene.clone(),
            task: task.id.clone(),
            source: Box::new(source),
        })?);
        let rng = RandomStream::new(seed, "bench start", &[word, attempt]);
        let found = if task.start.own { own_start(task, &loaded) } else { start(task, &loaded, in_view, rng) };
        if let Some(drawn) = found {
            // Added objects make it another scene, which its name alone does not load.
            let scene = if task.objects.is_empty() { scene } else { format!("{scene}+{}", task.id) };
            return Ok(Sampled { scene, wind: wind(task, seed, word), ..drawn });
        }
    }
    Err(SampleError::NoStart { task: task.id.clone(), seed })
}

/// The wind of a trial: within the task's speeds, from any direction.
fn wind(task: &Task, seed: u64, word: u64) -> Wind {
    let Some(winds) = task.wind else { return Wind::default() };
    let mut rng = RandomStream::new(seed, "bench wind", &[word]);
    let [least, most] = winds.speed;
    let speed = least + (most - least) * rng.uniform();
    let (sin, cos) = libm::sincos(rng.uniform() * core::f64::consts::TAU);
    Wind { east: speed * sin, north: speed * cos, gust: winds.gust, gust_time: winds.gust_time }
}

/// The scene's own start; `None` if the scene lacks a target.
fn own_start(task: &Task, loaded: &Arc<LoadedScene>) -> Option<Sampled> {
    let place = Place::at(loaded.scene.start, select_all(task.start_targets(), loaded, loaded.scene.start.position), loaded);
    let snapshot = place.snapshot(task, loaded);
    let near = nearest(loaded, &place.lasting, &snapshot);
    (!place.targets.is_empty() || task.start_targets().is_empty()).then(|| Sampled {
        loaded: loaded.clone(),
        scene: String::new(),
        wind: Wind::default(),
        start: place.start,
        in_view: None,
        focus: near.map(|(id, _)| id),
        range: near.map(|(_, range)| range),
    })
}

/// A start in a scene; `None` if none is found.
fn start(task: &Task, loaded: &Arc<LoadedScene>, in_view: Option<bool>, mut draw: RandomStream) -> Option<Sampled> {
    let mut sight = JudgeCamera::of(task.craft);
    let mut looks = 0;
    let has = |selectors: &[Selector]| selectors.is_empty() || !select_all(selectors, loaded, EnuPosition::default()).is_empty();
    let goals = task.goals.iter().map(|goal| &goal.targets).chain(task.stages.iter().map(|stage| &stage.targets));
    if !(goals.chain([&task.start.of]).all(|selectors| has(selectors))) {
        return None;
    }
    for _ in 0..PLACES {
        let place = Place::draw(task, loaded, in_view, &mut draw);
        if !place.is_free(task, loaded) || !place.is_right(task, loaded) {
            continue;
        }
        let snapshot = place.snapshot(task, loaded);
        let found = |in_view| Sampled {
            loaded: loaded.clone(),
            scene: String::new(),
            wind: Wind::default(),
            start: place.start,
            in_view,
            focus: place.focus,
            range: nearest(loaded, &place.lasting, &snapshot).map(|(_, range)| range),
        };
        let Some(wanted) = in_view else { return Some(found(None)) };
        looks += 1;
        if looks > LOOKS {
            return None;
        }
        let fits = if wanted {
            !sight.clearly(loaded, &snapshot, &place.lasting).is_empty()
        } else {
            // No pixel of it is visible at first, but it can be found by turning.
            !sight.glimpses(loaded, &snapshot, &place.targets) && {
                let turned = place.turned_to_focus(task, loaded);
                !sight.clearly(loaded, &turned, &place.lasting).is_empty()
            }
        };
        if fits {
            return Some(found(in_view));
        }
    }
    None
}

/// A candidate for the start.
struct Place {
    start: Pose,
    targets: Vec<ObjectId>,
    /// Stationary targets, or all if there are none: a car that drives away should not determine the start.
    lasting: Vec<ObjectId>,
    focus: Option<ObjectId>,
    /// Angle between the heading and the target's bearing, radians.
    off: f64,
}

impl Place {
    fn draw(task: &Task, loaded: &LoadedScene, in_view: Option<bool>, rng: &mut RandomStream) -> Self {
        let bounds = loaded.scene.bounds;
        let mut within = |[from, to]: [f64; 2]| from + (to - from) * rng.uniform();
        let east = within(task.start.east.unwrap_or([bounds.min.east, bounds.max.east]));
        let north = within(task.start.north.unwrap_or([bounds.min.north, bounds.max.north]));
        let above = EnuPosition { east, north, up: bounds.max.up - CEILING_M };
        let (aside, turn) = (rng.uniform() * 2.0 - 1.0, rng.uniform());
        let up = loaded.collider.ground_below(above).map_or(0.0, |ground| ground.up);
        let at = EnuPosition { east, north, up };
        let start = Pose { position: at, attitude: Attitude::default() };
        let place = Self::at(start, select_all(task.start_targets(), loaded, at), loaded);
        let focus = place.lasting.get(rng.below(place.lasting.len())).copied();
        let bearing = focus.and_then(|id| loaded.scene.object(id)).map_or(0.0, |object| {
            let to = centre(&object.bounds);
            libm::atan2(to.east - east, to.north - north)
        });
        let half = task.craft.camera().half_fov().0;
        let off = match in_view {
            Some(true) => aside * MIDDLE * half,
            Some(false) => BEHIND + turn * (core::f64::consts::TAU - 2.0 * BEHIND),
            None => turn * core::f64::consts::TAU,
        };
        let attitude = Attitude { heading: wrap_angle(bearing + off), ..Attitude::default() };
        Self { start: Pose { attitude, ..start }, focus, off, ..place }
    }

    /// A place with these targets, of which none is in focus.
    fn at(start: Pose, targets: Vec<ObjectId>, loaded: &LoadedScene) -> Self {
        let standing = |id: &ObjectId| loaded.cast.of_object(*id).is_none();
        let mut lasting: Vec<ObjectId> = targets.iter().copied().filter(standing).collect();
        if lasting.is_empty() {
            lasting.clone_from(&targets);
        }
        Self { start, targets, lasting, focus: None, off: 0.0 }
    }

    /// Position after take-off.
    fn aloft(&self, task: &Task) -> EnuPosition {
        let up = self.start.position.up + Model::of(task.craft).craft.take_off_height;
        EnuPosition { up, ..self.start.position }
    }

    /// The view there.
    fn snapshot(&self, task: &Task, loaded: &LoadedScene) -> WorldSnapshot {
        loaded.initial_snapshot(Pose { position: self.aloft(task), ..self.start })
    }

    /// The view there with the target centred.
    fn turned_to_focus(&self, task: &Task, loaded: &LoadedScene) -> WorldSnapshot {
        let heading = self.start.attitude.heading - self.off;
        let turned =
            Pose { position: self.aloft(task), attitude: Attitude { heading: wrap_angle(heading), ..self.start.attitude } };
        loaded.initial_snapshot(turned)
    }

    /// Whether it is on open ground, with room for take-off.
    fn is_free(&self, task: &Task, loaded: &LoadedScene) -> bool {
        let ground = self.start.position;
        let Some(below) = loaded.collider.ground_below(EnuPosition { up: ground.up + 0.1, ..ground }) else { return false };
        let object = loaded.scene.object(below.object);
        let is_ground = object.is_some_and(|object| matches!(object.tags.kind.as_str(), "ground" | "floor"));
        // A craft drifts during take-off by the error of its sensors.
        let radius = Model::of(task.craft).craft.radius;
        let room = radius + ROOM_M;
        let (low, aloft) = (EnuPosition { up: ground.up + room + 0.05, ..ground }, self.aloft(task));
        let snapshot = self.snapshot(task, loaded);
        let clear = |id| loaded.distance_to(id, &snapshot.actors, aloft).is_none_or(|away| away > 8.0 * radius);
        is_ground && loaded.collider.sweep(low, aloft, room).is_none() && loaded.cast.objects().all(clear)
    }

    /// Whether range and obstacles are as required.
    fn is_right(&self, task: &Task, loaded: &LoadedScene) -> bool {
        let Some(focus) = self.focus.and_then(|id| loaded.scene.object(id)) else { return task.start_targets().is_empty() };
        let snapshot = self.snapshot(task, loaded);
        // A craft cannot descend below its take-off height, for instance from a hill to an object at its foot.
        if focus.bounds.min.up < self.start.position.up - FOOT_M {
            return false;
        }
        let [least, most] = task.start.range;
        if !nearest(loaded, &self.lasting, &snapshot).is_some_and(|(_, range)| (least..=most).contains(&range)) {
            return false;
        }
        let (from, to) = (self.aloft(task), centre(&focus.bounds));
        let past = task.start.past.as_ref().is_none_or(|(selectors, near)| {
            let things = select_all(selectors, loaded, from);
            things
                .iter()
                .filter_map(|id| loaded.scene.object(*id))
                .any(|thing| distance_from_path(from, to, centre(&thing.bounds)) <= *near)
        });
        let radius = Model::of(task.craft).craft.radius;
        let is_met = |radius| loaded.collider.sweep(from, to, radius).is_some_and(|met| !self.is_target(loaded, met.object));
        past && match task.start.blocked {
            None => true,
            Some(true) => is_met(radius),
            Some(false) => self.targets.iter().all(|target| self.is_open(task, loaded, *target)),
        }
    }

    /// Whether the straight path to a target is free, unless the target is farther away than any start may be. Walking
    /// actors are ignored.
    fn is_open(&self, task: &Task, loaded: &LoadedScene, target: ObjectId) -> bool {
        let (snapshot, from) = (self.snapshot(task, loaded), self.aloft(task));
        let away = loaded.distance_to(target, &snapshot.actors, from).unwrap_or(f64::INFINITY);
        let Some(object) = loaded.scene.object(target) else { return true };
        if away > task.start.range[1] {
            return true;
        }
        let bounds = loaded.bounds(object, &snapshot.actors);
        let to = centre(&bounds);
        let room = Model::of(task.craft).craft.radius + ROOM_M;
        // The path ends at the success radius.
        let end =
            |at: EnuPosition| loaded.distance_to(target, &snapshot.actors, at).is_some_and(|left| left <= task.set.radius());
        let met = loaded.collider.sweep(from, to, room);
        met.is_none_or(|met| self.is_target(loaded, met.object) || end(met.centre))
    }

    /// Whether an object is a target or contains a target opening.
    fn is_target(&self, loaded: &LoadedScene, id: ObjectId) -> bool {
        let of = |target: &ObjectId| loaded.scene.object(*target).and_then(|object| object.tags.opening_of);
        self.targets.iter().any(|target| *target == id || of(target) == Some(id))
    }
}

/// Horizontal distance of a position from the segment between two others, metres.
fn distance_from_path(from: EnuPosition, to: EnuPosition, at: EnuPosition) -> f64 {
    let (direction, away) = ([to.east - from.east, to.north - from.north], [at.east - from.east, at.north - from.north]);
    let length = libm::hypot(direction[0], direction[1]).max(1e-9);
    let along = (away[0] * direction[0] + away[1] * direction[1]) / length;
    if !(0.0..=length).contains(&along) {
        return f64::INFINITY;
    }
    ((away[0] * direction[1] - away[1] * direction[0]) / length).abs()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_stands_beside_the_path_is_at_its_distance() {
        let at = |east, north| EnuPosition { east, north, up: 0.0 };
        assert_eq!(distance_from_path(at(0.0, 0.0), at(10.0, 0.0), at(4.0, -3.0)), 3.0);
        assert_eq!(distance_from_path(at(0.0, 0.0), at(10.0, 0.0), at(11.0, 0.0)), f64::INFINITY);
    }
}

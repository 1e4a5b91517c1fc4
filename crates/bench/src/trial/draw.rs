//! From a task and a seed to a scene, its light, and a start: the same for every method.

use std::sync::Arc;

use spf_core::geometry::{Attitude, EnuPosition, Pose, wrap_angle};
use spf_core::rng::Draw;
use spf_flight::sim::{LoadedScene, SceneLoadError, WorldSnapshot};
use spf_scene::geometry::ObjectId;
use spf_sim::model::Model;
use spf_sim::wind::Wind;
use thiserror::Error;

use crate::fnv;
use crate::judge::{Sight, nearest};
use crate::task::{Selector, Task, View, centre, select_all};

/// Variants that are drawn before a task is given up in its scene.
const VARIANTS: u64 = 40;
/// Places that are drawn in one variant.
const PLACES: u64 = 3000;
/// Places at most at which it is looked what is in view.
const LOOKS: u32 = 40;
/// The start is at most so much higher than the target's foot, metres.
const FOOT_M: f64 = 2.0;
/// Ground is looked for from so far below a scene's upper bound, which indoors is the ceiling, metres.
const CEILING_M: f64 = 0.05;
/// Beside the craft's body where it takes off, and on a way that is not blocked, metres.
const ROOM_M: f64 = 0.3;
/// Within this fraction of the half field of view the target lies from the middle, where it is to be in view.
const MIDDLE: f64 = 0.7;
/// Beyond this it is behind, radians.
const BEHIND: f64 = 1.6;

/// Why a trial could not be drawn.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum DrawError {
    /// The scene cannot be flown in.
    #[error("the scene `{scene}` of the task `{task}` cannot be flown in")]
    Scene {
        /// The scene.
        scene: String,
        /// The task.
        task: String,
        /// Why.
        #[source]
        source: Box<SceneLoadError>,
    },
    /// No place fits.
    #[error("no start was found for the task `{task}` with seed {seed}: ask for less under `start`")]
    NoStart {
        /// The task.
        task: String,
        /// The seed.
        seed: u64,
    },
}

/// Where and how a trial begins.
#[derive(Clone)]
pub struct Drawn {
    /// The scene, laid out and lit.
    pub loaded: Arc<LoadedScene>,
    /// Its name, with the variant's number.
    pub scene: String,
    /// The wind that blows there.
    pub wind: Wind,
    /// The start, on the ground.
    pub start: Pose,
    /// Whether a target is clearly visible from above the start; none where it is not looked at.
    pub in_view: Option<bool>,
    /// The target that the start was drawn for.
    pub focus: Option<ObjectId>,
    /// Metres from above the start to the nearest target.
    pub range: Option<f64>,
}

/// Draws a trial.
///
/// # Errors
/// [`DrawError`] when the scene cannot be flown in, or nothing fits.
pub fn draw(task: &Task, seed: u64) -> Result<Drawn, DrawError> {
    // A task's own number in draws.
    let word = fnv(task.id.as_bytes());
    let in_view = match task.start.view {
        View::Always => Some(true),
        View::Never => Some(false),
        // Every second seed; which of two begins differs from task to task.
        View::Half => Some((seed ^ Draw::new(0, "bench view", &[word]).below(2) as u64).is_multiple_of(2)),
        View::Any => None,
    };
    for attempt in 0..if task.variants { VARIANTS } else { 1 } {
        let number = (Draw::new(seed, "bench variant", &[word, attempt]).uniform() * 1e9) as u64;
        let scene = if task.variants { format!("{}@{number}", task.scene) } else { task.scene.clone() };
        let loaded = LoadedScene::load_with(&scene, &task.conditions);
        let loaded = Arc::new(loaded.map_err(|source| DrawError::Scene {
            scene: scene.clone(),
            task: task.id.clone(),
            source: Box::new(source),
        })?);
        let draw = Draw::new(seed, "bench start", &[word, attempt]);
        let found = if task.start.own { own_start(task, &loaded) } else { start(task, &loaded, in_view, draw) };
        if let Some(drawn) = found {
            return Ok(Drawn { scene, wind: wind(task, seed, word), ..drawn });
        }
    }
    Err(DrawError::NoStart { task: task.id.clone(), seed })
}

/// The wind of a trial: within the task's speeds, from anywhere.
fn wind(task: &Task, seed: u64, word: u64) -> Wind {
    let Some(winds) = task.wind else { return Wind::default() };
    let mut draw = Draw::new(seed, "bench wind", &[word]);
    let [least, most] = winds.speed;
    let speed = least + (most - least) * draw.uniform();
    let (sin, cos) = libm::sincos(draw.uniform() * core::f64::consts::TAU);
    Wind { east: speed * sin, north: speed * cos, gust: winds.gust, gust_time: winds.gust_time }
}

/// The scene's own start; none where the scene lacks a target.
fn own_start(task: &Task, loaded: &Arc<LoadedScene>) -> Option<Drawn> {
    let place = Place::at(loaded.scene.start, select_all(task.start_targets(), loaded, loaded.scene.start.position), loaded);
    let snapshot = place.snapshot(task, loaded);
    let near = nearest(loaded, &place.lasting, &snapshot);
    (!place.targets.is_empty() || task.start_targets().is_empty()).then(|| Drawn {
        loaded: loaded.clone(),
        scene: String::new(),
        wind: Wind::default(),
        start: place.start,
        in_view: None,
        focus: near.map(|(id, _)| id),
        range: near.map(|(_, range)| range),
    })
}

/// A start in a scene; none when none is found.
fn start(task: &Task, loaded: &Arc<LoadedScene>, in_view: Option<bool>, mut draw: Draw) -> Option<Drawn> {
    let mut sight = Sight::of(task.craft);
    let mut looks = 0;
    let has = |selectors: &[Selector]| selectors.is_empty() || !select_all(selectors, loaded, EnuPosition::default()).is_empty();
    if !(task.goals.iter().all(|goal| has(&goal.targets)) && has(&task.start.of)) {
        return None;
    }
    for _ in 0..PLACES {
        let place = Place::draw(task, loaded, in_view, &mut draw);
        if !place.is_free(task, loaded) || !place.is_right(task, loaded) {
            continue;
        }
        let snapshot = place.snapshot(task, loaded);
        let found = |in_view| Drawn {
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
            // Not a pixel of it now; and yet it can be found by turning.
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

/// A place that may be a start.
struct Place {
    start: Pose,
    targets: Vec<ObjectId>,
    /// Those of them that stay where they are; all, where none does. A car that drives off is no reason to start here.
    lasting: Vec<ObjectId>,
    focus: Option<ObjectId>,
    /// How far the heading lies from the bearing of the target, radians.
    off: f64,
}

impl Place {
    fn draw(task: &Task, loaded: &LoadedScene, in_view: Option<bool>, draw: &mut Draw) -> Self {
        let bounds = loaded.scene.bounds;
        let mut within = |[from, to]: [f64; 2]| from + (to - from) * draw.uniform();
        let east = within(task.start.east.unwrap_or([bounds.min.east, bounds.max.east]));
        let north = within(task.start.north.unwrap_or([bounds.min.north, bounds.max.north]));
        let above = EnuPosition { east, north, up: bounds.max.up - CEILING_M };
        let (aside, turn) = (draw.uniform() * 2.0 - 1.0, draw.uniform());
        let up = loaded.collider.ground_below(above).map_or(0.0, |ground| ground.up);
        let at = EnuPosition { east, north, up };
        let start = Pose { position: at, attitude: Attitude::default() };
        let place = Self::at(start, select_all(task.start_targets(), loaded, at), loaded);
        let focus = place.lasting.get(draw.below(place.lasting.len())).copied();
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

    /// Where the craft is after take-off.
    fn aloft(&self, task: &Task) -> EnuPosition {
        let up = self.start.position.up + Model::of(task.craft).craft.take_off_height;
        EnuPosition { up, ..self.start.position }
    }

    /// What it sees there.
    fn snapshot(&self, task: &Task, loaded: &LoadedScene) -> WorldSnapshot {
        loaded.beginning(Pose { position: self.aloft(task), ..self.start })
    }

    /// What it sees there with the target in the middle of the image.
    fn turned_to_focus(&self, task: &Task, loaded: &LoadedScene) -> WorldSnapshot {
        let heading = self.start.attitude.heading - self.off;
        let turned =
            Pose { position: self.aloft(task), attitude: Attitude { heading: wrap_angle(heading), ..self.start.attitude } };
        loaded.beginning(turned)
    }

    /// Open ground that nothing covers, and room to take off and to stay.
    fn is_free(&self, task: &Task, loaded: &LoadedScene) -> bool {
        let ground = self.start.position;
        let Some(below) = loaded.collider.ground_below(EnuPosition { up: ground.up + 0.1, ..ground }) else { return false };
        let object = loaded.scene.object(below.object);
        let is_ground = object.is_some_and(|object| matches!(object.tags.kind.as_str(), "ground" | "floor"));
        // A craft that takes off wanders by what its senses err.
        let radius = Model::of(task.craft).craft.radius;
        let room = radius + ROOM_M;
        let (low, aloft) = (EnuPosition { up: ground.up + room + 0.05, ..ground }, self.aloft(task));
        let snapshot = self.snapshot(task, loaded);
        let clear = |id| loaded.distance_to(id, &snapshot.actors, aloft).is_none_or(|away| away > 8.0 * radius);
        is_ground && loaded.collider.sweep(low, aloft, room).is_none() && loaded.cast.objects().all(clear)
    }

    /// Range, and what is to stand on the way.
    fn is_right(&self, task: &Task, loaded: &LoadedScene) -> bool {
        let Some(focus) = self.focus.and_then(|id| loaded.scene.object(id)) else { return task.start_targets().is_empty() };
        let snapshot = self.snapshot(task, loaded);
        // A craft does not sink below where it took off: not from a hill to what lies at its foot.
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
            things.iter().filter_map(|id| loaded.scene.object(*id)).any(|thing| off_way(from, to, centre(&thing.bounds)) <= *near)
        });
        let radius = Model::of(task.craft).craft.radius;
        let is_met = |radius| loaded.collider.sweep(from, to, radius).is_some_and(|met| !self.is_target(loaded, met.object));
        past && match task.start.blocked {
            None => true,
            Some(true) => is_met(radius),
            Some(false) => self.targets.iter().all(|target| self.is_open(task, loaded, *target)),
        }
    }

    /// Whether the craft finds room on the straight way to a target, unless that is farther than any start may be. What
    /// walks is not looked at.
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
        // The way ends where the judge would say that it is near enough.
        let end =
            |at: EnuPosition| loaded.distance_to(target, &snapshot.actors, at).is_some_and(|left| left <= task.set.radius());
        let met = loaded.collider.sweep(from, to, room);
        met.is_none_or(|met| self.is_target(loaded, met.object) || end(met.centre))
    }

    /// Whether an object is a target or what one of them leads through.
    fn is_target(&self, loaded: &LoadedScene, id: ObjectId) -> bool {
        let of = |target: &ObjectId| loaded.scene.object(*target).and_then(|object| object.tags.opening_of);
        self.targets.iter().any(|target| *target == id || of(target) == Some(id))
    }
}

/// How far a place lies from the straight way between two others, on the map and between its ends; metres.
fn off_way(from: EnuPosition, to: EnuPosition, at: EnuPosition) -> f64 {
    let (way, away) = ([to.east - from.east, to.north - from.north], [at.east - from.east, at.north - from.north]);
    let length = libm::hypot(way[0], way[1]).max(1e-9);
    let along = (away[0] * way[0] + away[1] * way[1]) / length;
    if !(0.0..=length).contains(&along) {
        return f64::INFINITY;
    }
    ((away[0] * way[1] - away[1] * way[0]) / length).abs()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_stands_beside_the_way_is_so_far_off_it() {
        let at = |east, north| EnuPosition { east, north, up: 0.0 };
        assert_eq!(off_way(at(0.0, 0.0), at(10.0, 0.0), at(4.0, -3.0)), 3.0);
        assert_eq!(off_way(at(0.0, 0.0), at(10.0, 0.0), at(11.0, 0.0)), f64::INFINITY);
    }
}

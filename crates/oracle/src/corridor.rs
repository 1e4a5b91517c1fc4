//! Boxes: the nearest objects in obstacle mode, the target's own, and the nearest point clear of objects that are to be passed
//! (`docs/explanation/oracle.md`).

use spf_core::query::{ImageBox, ImagePoint};
use spf_core::rng::RandomStream;

use super::Oracle;
use super::extent::Obstacle;
use super::percept::Percept;
use super::sight::PerceivedObject;

/// Maximum number of boxes reported, besides a spurious one.
const MOST_BOXES: usize = 8;
/// Standard deviation of each side of the target's box, as a fraction of the box.
const BOX_SD: f64 = 0.03;

/// Where the path ends.
pub(super) struct Way<'a> {
    /// Its length, metres.
    pub(super) range: f64,
    /// Key of the target object.
    pub(super) target: Option<&'a str>,
    /// Whether it leads through an opening of the target.
    pub(super) through: bool,
}

/// A noticed obstacle.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Found {
    /// Its box.
    pub(super) area: ImageBox,
    /// Range of its nearest surface, metres.
    pub(super) range: f64,
    /// Its name.
    pub(super) name: String,
}

impl Found {
    fn of(obstacle: &Obstacle) -> Self {
        Self { area: obstacle.area, range: obstacle.nearest, name: obstacle.name.clone() }
    }
}

/// The nearest obstacles that are nearer than the end of the way, at most [`MOST_BOXES`], in an image sent at `size`. The error file
/// gives the fraction that is missed, and the rate of spurious boxes. Drawn by frame, like the rest of the percept.
pub(super) fn boxes(oracle: &Oracle, percept: &Percept, size: Option<(u32, u32)>, way: &Way<'_>) -> Vec<Found> {
    let errors = &oracle.errors.boxes;
    let noticed = percept.noticed_obstacles(&oracle.errors, size);
    let in_the_way = noticed.filter(|(obstacle, thing)| obstacle.nearest < listed_to(thing, way));
    let mut nearer: Vec<&Obstacle> =
        in_the_way.map(|(obstacle, _)| obstacle).filter(|obstacle| obstacle.box_luck >= errors.missed).collect();
    nearer.sort_by(|a, b| a.nearest.total_cmp(&b.nearest));
    let mut out: Vec<Found> = nearer.into_iter().take(MOST_BOXES).map(Found::of).collect();
    let mut luck = RandomStream::new(oracle.seed, "oracle spurious box", &[percept.frame.0]);
    if luck.chance(errors.spurious) {
        let (u, v) = (luck.uniform(), luck.uniform());
        let (half_width, half_height) = (0.02 + 0.08 * luck.uniform(), 0.02 + 0.08 * luck.uniform());
        out.push(Found {
            area: ImageBox {
                left: (u - half_width).max(0.0),
                top: (v - half_height).max(0.0),
                right: (u + half_width).min(1.0),
                bottom: (v + half_height).min(1.0),
            },
            range: way.range.min(1e3) * (0.2 + 0.8 * luck.uniform()),
            name: "object".to_owned(),
        });
    }
    out
}

/// The box of the target: that of its mask, each side off by a normal error, in the image. A perfect oracle errs in no side.
pub(super) fn target_box(oracle: &Oracle, percept: &Percept, seen: &[&PerceivedObject], key: &str) -> Option<ImageBox> {
    let thing = seen.iter().find(|thing| thing.tags.key == key)?;
    let ImageBox { left, top, right, bottom } = thing.bounds;
    let sd = if oracle.errors.range.log_sd > 0.0 { BOX_SD } else { 0.0 };
    let mut luck = RandomStream::new(oracle.seed, "oracle target box", &[percept.frame.0, u64::from(thing.id)]);
    let mut off = |side: f64, size: f64| (side + sd * size * luck.normal()).clamp(0.0, 1.0);
    let (left, right) = (off(left, right - left), off(right, right - left));
    let (top, bottom) = (off(top, bottom - top), off(bottom, bottom - top));
    Some(ImageBox { left: left.min(right), top: top.min(bottom), right: left.max(right), bottom: top.max(bottom) })
}

/// Distance up to which what belongs to an object is listed, metres. The target is not in its own way, except for who flies through
/// it: around an opening it is about as far away as the opening.
fn listed_to(thing: &PerceivedObject, way: &Way<'_>) -> f64 {
    match (way.target == Some(thing.tags.key.as_str()), way.through) {
        (true, true) => FRAME * way.range,
        (true, false) => 0.0,
        (false, _) => way.range,
    }
}

/// How much farther than the point in an opening its frame may be, or may seem.
const FRAME: f64 = 1.5;

/// Half the width and height of the corridor at a range, as fractions of the image.
fn margin(oracle: &Oracle, percept: &Percept, range: f64) -> (f64, f64) {
    let camera = &percept.camera;
    let at = oracle.errors.boxes.corridor_m / range.max(0.1);
    (at * camera.fx / f64::from(camera.width), at * camera.fy / f64::from(camera.height))
}

/// The point nearest to `point` that is clear of all boxes and their margins; `None` if there is none.
pub(super) fn free(oracle: &Oracle, percept: &Percept, point: ImagePoint, found: &[Found]) -> Option<ImagePoint> {
    let walls: Vec<ImageBox> = found
        .iter()
        .map(|b| {
            let (du, dv) = margin(oracle, percept, b.range);
            ImageBox { left: b.area.left - du, top: b.area.top - dv, right: b.area.right + du, bottom: b.area.bottom + dv }
        })
        .collect();
    let free = |u: f64, v: f64| {
        (0.0..=1.0).contains(&u)
            && (0.0..=1.0).contains(&v)
            && walls.iter().all(|b| u <= b.left || u >= b.right || v <= b.top || v >= b.bottom)
    };
    if free(point.u, point.v) {
        return Some(point);
    }
    // Below the horizon is the ground, which no box represents.
    let lowest = point.v.max(percept.level);
    let free = |u: f64, v: f64| v <= lowest && free(u, v);
    // In the nearest free point, each coordinate is either unchanged or on the edge of a box.
    let across: Vec<f64> = core::iter::once(point.u).chain(walls.iter().flat_map(|b| [b.left, b.right])).collect();
    let down: Vec<f64> = core::iter::once(point.v).chain(walls.iter().flat_map(|b| [b.top, b.bottom])).collect();
    let aspect = f64::from(percept.camera.height) / f64::from(percept.camera.width);
    let mut best: Option<(f64, ImagePoint)> = None;
    for &u in &across {
        for &v in &down {
            let away = (u - point.u).powi(2) + (aspect * (v - point.v)).powi(2);
            if best.is_none_or(|(least, _)| away < least) && free(u, v) {
                best = Some((away, ImagePoint { u, v }));
            }
        }
    }
    best.map(|(_, place)| place)
}

//! Obstacle mode: the objects in the corridor, and the nearest point clear of the reported boxes
//! (`docs/explanation/oracle.md`).

use spf_core::detection::parse_detections;
use spf_core::query::{ImageBox, ImagePoint};
use spf_core::rng::RandomStream;

use super::Oracle;
use super::percept::{PerceivedObject, Percept};

/// The planned path.
pub(super) struct Way<'a> {
    /// Its end in the image.
    pub(super) point: ImagePoint,
    /// Its length, metres.
    pub(super) range: f64,
    /// Key of the target object.
    pub(super) target: Option<&'a str>,
    /// The box and range of the opening that it leads through, if any.
    pub(super) opening: Option<(ImageBox, f64)>,
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
    fn of(thing: &PerceivedObject) -> Self {
        Self { area: thing.bounds, range: thing.nearest, name: thing.tags.words() }
    }
}

/// Boxes nearer than the target that intersect the corridor. The error file gives the fraction that is missed, and the
/// rate of spurious boxes. Sampled by frame, like the rest of the percept.
pub(super) fn boxes(oracle: &Oracle, percept: &Percept, seen: &[&PerceivedObject], way: &Way<'_>) -> Vec<Found> {
    let errors = &oracle.errors.boxes;
    let mut out: Vec<Found> = seen
        .iter()
        .filter(|thing| thing.box_luck >= errors.missed && is_in_way(oracle, percept, thing, way))
        .map(|thing| Found::of(thing))
        .collect();
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

/// The listed boxes that match a visible object nearer than the target and in the corridor.
pub(super) fn listed(
    oracle: &Oracle,
    percept: &Percept,
    seen: &[&PerceivedObject],
    way: &Way<'_>,
    lines: &[String],
) -> Vec<Found> {
    // An invalid list counts as empty.
    let detections = parse_detections(&lines.join("\n")).unwrap_or_default();
    let is_listed = |thing: &PerceivedObject| detections.iter().any(|detection| detection.area.iou(&thing.bounds) >= SAME_THING);
    let in_way = |thing: &&&PerceivedObject| is_listed(thing) && is_in_way(oracle, percept, thing, way);
    seen.iter().filter(in_way).map(|thing| Found::of(thing)).collect()
}

/// Minimum intersection over union of two boxes for the same object, as in detector benchmarks.
const SAME_THING: f64 = 0.5;

/// Whether an object is nearer than the end of the path and intersects it.
fn is_in_way(oracle: &Oracle, percept: &Percept, thing: &PerceivedObject, way: &Way<'_>) -> bool {
    let tags = &thing.tags;
    let own = way.target.is_some_and(|key| key == tags.key || tags.opening_of.as_deref() == Some(key));
    !tags.opening
        && !tags.is_surface()
        && !own
        && !frames(thing, way)
        && thing.nearest < way.range
        && meets(oracle, percept, way.point, thing.bounds, thing.nearest)
}

/// Whether an object surrounds the opening: a hill around a tunnel entrance does not block the path into it.
fn frames(thing: &PerceivedObject, way: &Way<'_>) -> bool {
    way.opening.is_some_and(|(hole, range)| {
        let b = thing.bounds;
        let about = b.left <= hole.left && b.top <= hole.top && b.right >= hole.right;
        about && thing.range >= 0.7 * range
    })
}

/// Half the width and height of the corridor at a range, as fractions of the image.
fn margin(oracle: &Oracle, percept: &Percept, range: f64) -> (f64, f64) {
    let camera = &percept.camera;
    let at = oracle.errors.boxes.corridor_m / range.max(0.1);
    (at * camera.fx / f64::from(camera.width), at * camera.fy / f64::from(camera.height))
}

/// Whether the corridor to `point` passes within its half width of the box. Seen from the camera, a straight path is a
/// single point; the corridor around it is a disc that shrinks with range, here a rectangle.
fn meets(oracle: &Oracle, percept: &Percept, point: ImagePoint, area: ImageBox, range: f64) -> bool {
    let (du, dv) = margin(oracle, percept, range);
    point.u > area.left - du && point.u < area.right + du && point.v > area.top - dv && point.v < area.bottom + dv
}

/// The clear point nearest to `point`, and the obstacles on the path to it and to the points rejected during the
/// search: an object beside one path may block the next. Returns `point` itself if the image has no clear point.
pub(super) fn around(
    oracle: &Oracle,
    percept: &Percept,
    point: ImagePoint,
    in_way: impl Fn(ImagePoint) -> Vec<Found>,
) -> (ImagePoint, Vec<Found>) {
    let (mut place, mut found) = (point, Vec::new());
    for _ in 0..PLACES {
        let known = found.len();
        for another in in_way(place) {
            if !found.contains(&another) {
                found.push(another);
            }
        }
        if found.len() == known {
            break;
        }
        place = clear(oracle, percept, point, &found);
    }
    (place, found)
}

/// Maximum number of points tried: each adds an obstacle.
const PLACES: usize = 16;

/// The point nearest to `point` that is clear of all boxes and their margins; `point` itself if there is none.
pub(super) fn clear(oracle: &Oracle, percept: &Percept, point: ImagePoint, found: &[Found]) -> ImagePoint {
    free(oracle, percept, point, found).unwrap_or(point)
}

/// The same, but `None` if there is no such point.
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

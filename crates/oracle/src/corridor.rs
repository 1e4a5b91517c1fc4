//! Obstacle mode: which objects stand in the way, and the nearest point clear of the boxes reported
//! (`docs/explanation/oracle.md`).

use spf_core::detection::parse_detections;
use spf_core::query::{ImageBox, ImagePoint};
use spf_core::rng::Draw;

use super::Oracle;
use super::percept::{Percept, Thing};

/// The way to be flown.
pub(super) struct Way<'a> {
    /// Where it leads in the image.
    pub(super) point: ImagePoint,
    /// How far, metres.
    pub(super) range: f64,
    /// Key of the object it leads to.
    pub(super) target: Option<&'a str>,
    /// Where the opening stands that it leads through, if it does.
    pub(super) opening: Option<(ImageBox, f64)>,
}

/// An obstacle as noticed.
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
    fn of(thing: &Thing) -> Self {
        Self { area: thing.bounds, range: thing.nearest, name: thing.tags.words() }
    }
}

/// Boxes nearer than the target that meet the corridor: the error file's share is missed, and now and then one is around
/// nothing. Drawn by frame, like the rest of the percept.
pub(super) fn boxes(oracle: &Oracle, percept: &Percept, seen: &[&Thing], way: &Way<'_>) -> Vec<Found> {
    let errors = &oracle.errors.boxes;
    let mut out: Vec<Found> = seen
        .iter()
        .filter(|thing| thing.box_luck >= errors.missed && is_in_way(oracle, percept, thing, way))
        .map(|thing| Found::of(thing))
        .collect();
    let mut luck = Draw::new(oracle.seed, "oracle spurious box", &[percept.frame.0]);
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

/// Of the boxes that a detector listed, those around something that is seen there, nearer than the target, and in the way.
pub(super) fn listed(oracle: &Oracle, percept: &Percept, seen: &[&Thing], way: &Way<'_>, lines: &[String]) -> Vec<Found> {
    // A list that is none says nothing.
    let detections = parse_detections(&lines.join("\n")).unwrap_or_default();
    let is_listed = |thing: &Thing| detections.iter().any(|detection| detection.area.iou(&thing.bounds) >= SAME_THING);
    let in_way = |thing: &&&Thing| is_listed(thing) && is_in_way(oracle, percept, thing, way);
    seen.iter().filter(in_way).map(|thing| Found::of(thing)).collect()
}

/// Intersection over union of two boxes from which on they are about the same thing, as detectors are judged.
const SAME_THING: f64 = 0.5;

/// Whether a thing stands nearer than what the way leads to, and meets it.
fn is_in_way(oracle: &Oracle, percept: &Percept, thing: &Thing, way: &Way<'_>) -> bool {
    let tags = &thing.tags;
    let own = way.target.is_some_and(|key| key == tags.key || tags.opening_of.as_deref() == Some(key));
    !tags.opening
        && !tags.is_surface()
        && !own
        && !frames(thing, way)
        && thing.nearest < way.range
        && meets(oracle, percept, way.point, thing.bounds, thing.nearest)
}

/// Whether a thing is what the opening is in: a hill about a tunnel's mouth is not in the way into it.
fn frames(thing: &Thing, way: &Way<'_>) -> bool {
    way.opening.is_some_and(|(hole, range)| {
        let b = thing.bounds;
        let about = b.left <= hole.left && b.top <= hole.top && b.right >= hole.right;
        about && thing.range >= 0.7 * range
    })
}

/// Half the corridor's width and height at a range, as fractions of the image.
fn margin(oracle: &Oracle, percept: &Percept, range: f64) -> (f64, f64) {
    let camera = &percept.camera;
    let at = oracle.errors.boxes.corridor_m / range.max(0.1);
    (at * camera.fx / f64::from(camera.width), at * camera.fy / f64::from(camera.height))
}

/// Whether the corridor to `point` passes within its half width of the box. Seen from the camera the straight way to a point
/// is that point; a tube around it is a disc that shrinks with range, here a rectangle.
fn meets(oracle: &Oracle, percept: &Percept, point: ImagePoint, area: ImageBox, range: f64) -> bool {
    let (du, dv) = margin(oracle, percept, range);
    point.u > area.left - du && point.u < area.right + du && point.v > area.top - dv && point.v < area.bottom + dv
}

/// The place nearest to `point` to which the way is clear, and what stands in the way to it and to the places passed over on the
/// looking for it: what is beside the way to one place is in the way to the next. Where the image has no clear place it is
/// `point` itself.
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

/// Places tried: each but the last brings in a thing more.
const PLACES: usize = 16;

/// The place nearest to `point` that is clear of all boxes and their margins; `point` itself when the image has none.
pub(super) fn clear(oracle: &Oracle, percept: &Percept, point: ImagePoint, found: &[Found]) -> ImagePoint {
    free(oracle, percept, point, found).unwrap_or(point)
}

/// The same, or nothing when the image has no such place.
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
    // Below the horizon lies the ground, which no box stands for.
    let lowest = point.v.max(percept.level);
    let free = |u: f64, v: f64| v <= lowest && free(u, v);
    // The nearest free place has each coordinate either unchanged or on some wall's edge.
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

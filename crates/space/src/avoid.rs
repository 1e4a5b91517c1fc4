//! Obstacle mode: the corridor of a planned step against the obstacles that replies list (paper §3.1;
//! `docs/reference/reply.md`).
//!
//! The paper relies on the model to choose a point clear of the boxes it reports. Models do not always do so, so the
//! geometry is checked here. What counts is what may come within the clearance of the path up to where the craft would rest without
//! another answer. A box with its depth label is treated as a solid that starts at the near edge of the
//! label's range interval (for the lowest label, anywhere before it) and is as deep as it is wide; a box that an image edge cuts off
//! extends beyond that edge. It stands where the view that showed it saw it: what has left the image counts as well. Where
//! path and solid come closer than the clearance, the point is shifted to the nearest free direction; failing that, the
//! step is shortened; failing that, the craft holds and queries again. The area outside
//! the frame is unknown, so the craft first turns towards a path that runs along the frame's edge
//! ([`leads_along_edge`]).

use core::f64::consts::PI;

use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use spf_core::camera::Camera;
use spf_core::geometry::BodyDisplacement;
use spf_core::lift::{CameraDisplacement, Lifting, lift, lower, range_of_label, unproject};
use spf_core::query::{ImageBox, ImagePoint};
use spf_core::reply::ObstacleBox;

use crate::viewpoint::{Obstacle, Viewpoint};

mod corridor;
mod people;
mod solid;
mod vertical;
mod walking;

use solid::Solid;

pub use corridor::Corridor;
pub use people::{is_grown_up, is_person};
pub use vertical::is_clear_vertically;
pub use walking::{AHEAD_OF_FRAME, Motion, Walk, Walkers};

/// Added to the body's radius, metres: at 10 m, 2 % of the width of a 90° image, the box error of a good model.
pub const BODY_MARGIN: f64 = 0.25;
/// Added to that around a person, who may step aside, metres.
pub const PERSON_MARGIN: f64 = 0.3;
/// A detour keeps this far away where the image has room for it, metres: boxes are loose, and an obstacle is passed only once.
pub const DETOUR_CLEARANCE: f64 = 0.8;
/// A direction is not lower than another if it ends less than this below it, metres.
const LEVEL: f64 = 0.02;
/// Maximum angle by which a point is shifted from the planned direction, degrees.
pub const MAX_SHIFT_DEG: u32 = 60;
/// Up to this angle, degrees, a way to the side comes before any over or under: a craft that climbs over each thing comes ever higher.
const ASIDE_DEG: u32 = 35;
/// Shortest step worth flying, metres: the paper's `d_min`.
pub const MIN_STEP: f64 = 0.1;

/// Width of the strip along the image edges, as a fraction of its size, into which no point is shifted, since the area
/// beyond the edge is unknown.
const EDGE: f64 = 0.02;
/// Minimum lateral distance per metre forward for a path to count as leading along an edge: 14°.
const ASIDE: f64 = 0.25;
/// Number of the first of them that lead to a side, at most a sixteenth of a circle up or down.
const LEVEL_WAYS: usize = 6;
/// Directions tried on each ring around the planned one, half a circle's worth.
const HALF_RING: u32 = 8;
/// Part to the side below which a direction counts as straight up or down, which is on either side.
const STRAIGHT_UP: f64 = 1e-9;
/// Number of increments in which a step is shortened.
const SHORTENINGS: u32 = 40;

/// Shape of the path along which a displacement is flown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PathShape {
    /// All at once, in a straight line (blended motion).
    #[default]
    Straight,
    /// Along the heading first and then up or down (sequential motion, the paper's queue).
    LevelThenClimb,
}

/// A side of the planned direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Side {
    /// Left of it.
    Left,
    /// Right of it.
    Right,
}

/// The side on which an obstacle is being passed, so that one answer does not undo what the last one began.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PassingSide {
    /// The side.
    pub side: Side,
    /// Whether no other side may be tried: it has been changed once already.
    pub strict: bool,
}

/// A step as planned from one frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlannedStep<'a> {
    /// From where and when the frame was taken.
    pub view: &'a Viewpoint,
    /// How camera axes are converted to body axes.
    pub lifting: Lifting,
    /// Shape of the path.
    pub shape: PathShape,
    /// The waypoint.
    pub point: ImagePoint,
    /// Distance along the optical axis, metres (the paper's `d_adj`).
    pub step: f64,
    /// Whether a detour may lead lower than both the planned direction and the horizon. Such a detour leads under a box that
    /// reaches across the image, such as a wall's, where no free space is, but the floor.
    pub dives: bool,
}

/// What the obstacles make of a planned step.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", tag = "avoidance")]
pub enum Avoidance {
    /// The path is free.
    Clear,
    /// Fly to this point instead, with the same step.
    Shifted {
        /// The nearest free direction.
        point: ImagePoint,
    },
    /// Fly towards the same point, but with a shorter step.
    Shortened {
        /// Metres along the optical axis, less than planned.
        step: f64,
    },
    /// Hold and query again.
    Hold,
}

/// Checks `plan` against `obstacles`, and returns what they make of it, with the index of the blocking one, the first if there are
/// several; `None` if there is none, or the step itself is invalid: a point outside the image, or a length that is not positive.
/// `clearance` is the distance to keep free around the path, metres: the body's radius
/// plus [`BODY_MARGIN`]; from persons it is [`PERSON_MARGIN`] more. A box of the plan's own view is the target, and not an obstacle,
/// if its name equals `target` (ignoring case) and it contains the planned point; of several trees, only the one pointed at is the
/// target.
///
/// Alternatives are tried by growing angle from the planned direction in steps of one degree; at equal angles sideways
/// comes before up, up before down, and right before left. With `passing` those on its side come first, whatever their angle,
/// so that a detour goes on where it began. Those that keep
/// [`DETOUR_CLEARANCE`] come first, and those lower than both the planned direction and the horizon last, if at all. The result
/// depends only on the arguments.
#[must_use]
pub fn avoid(
    plan: &PlannedStep<'_>,
    clearance: f64,
    obstacles: &[Obstacle],
    target: Option<&str>,
    passing: Option<PassingSide>,
) -> (Avoidance, Option<usize>) {
    let Some(path) = plan.path(plan.point, plan.step) else { return (Avoidance::Hold, None) };
    let mut solids = solids(plan.view, clearance, obstacles, (plan.point, target));
    let Some(by) = solids.iter().find(|solid| solid.blocks(&path)).map(|solid| solid.index) else {
        return (Avoidance::Clear, None);
    };
    let free = |solids: &[Solid], point: ImagePoint, step: f64| {
        plan.path(point, step).is_some_and(|path| !solids.iter().any(|solid| solid.blocks(&path)))
    };
    // Below the horizon is the ground, which no box represents.
    let lowest = plan.climb(plan.point).min(0.0) - LEVEL;
    let is_level = |point: ImagePoint| plan.climb(point) >= lowest;
    let try_side = |solids: &[Solid], roomy: &[Solid], side: Option<Side>| {
        let fits = |point: ImagePoint| free(solids, point, plan.step);
        nearest_free(plan, side, |point| is_level(point) && free(roomy, point, plan.step))
            .or_else(|| nearest_free(plan, side, |point| is_level(point) && fits(point)))
            .or_else(|| nearest_free(plan, side, fits).filter(|_| plan.dives))
    };
    // Right beside an obstacle there is no such room, and looking for it would lead far aside.
    let narrow = solids.clone();
    solids.iter_mut().for_each(|solid| solid.widen(DETOUR_CLEARANCE));
    let shifted = match passing {
        None => try_side(&narrow, &solids, None),
        Some(PassingSide { side, strict: true }) => try_side(&narrow, &solids, Some(side)),
        Some(PassingSide { side, strict: false }) => {
            try_side(&narrow, &solids, Some(side)).or_else(|| try_side(&narrow, &solids, None))
        }
    };
    if let Some(point) = shifted {
        return (Avoidance::Shifted { point }, Some(by));
    }
    let shortened = (1..SHORTENINGS).rev().map(|part| plan.step * f64::from(part) / f64::from(SHORTENINGS));
    let shorter = shortened.take_while(|&step| step >= MIN_STEP).find(|&step| free(&narrow, plan.point, step));
    (shorter.map_or(Avoidance::Hold, |step| Avoidance::Shortened { step }), Some(by))
}

/// The obstacles as seen from a view, without those of its own boxes that are the target, pointed at.
fn solids(view: &Viewpoint, clearance: f64, obstacles: &[Obstacle], (point, target): (ImagePoint, Option<&str>)) -> Vec<Solid> {
    let counts = |obstacle: &Obstacle| obstacle.from.pose != view.pose || !is_target(&obstacle.listed, point, target);
    let counted = obstacles.iter().enumerate().filter(|(_, obstacle)| counts(obstacle));
    counted.map(|(index, obstacle)| Solid::new(view, obstacle, index, clearance)).collect()
}

/// The side of the planned point on which another one lies; `None` if it lies above or below it.
#[must_use]
pub fn side_of(plan: &PlannedStep<'_>, point: ImagePoint) -> Option<Side> {
    let (from, to) = (plan.view.camera.ray(plan.point), plan.view.camera.ray(point));
    let (across, up) = (to.right - from.right, to.up - from.up);
    // Less than a quarter of it across is a path over or under.
    (across.abs() > 0.25 * up.abs()).then_some(if across < 0.0 { Side::Left } else { Side::Right })
}

/// Whether the path to `point`, flown for `step` metres along the optical axis, ends closer than `clearance` metres to
/// the region outside the frame without leaving it: it runs along the left or right edge, past what the camera has not
/// seen.
#[must_use]
pub fn leads_along_edge(plan: &PlannedStep<'_>, point: ImagePoint, step: f64, clearance: f64) -> bool {
    let (ray, camera) = (plan.view.camera.ray(point), plan.view.camera);
    if ray.right.abs() < ASIDE {
        return false;
    }
    let edge = camera.ray(ImagePoint { u: if ray.right < 0.0 { 0.0 } else { 1.0 }, v: point.v }).right;
    // Distance of the end point from the vertical plane through the lens and the image edge.
    step * (edge - ray.right).abs() / libm::sqrt(1.0 + edge * edge) < clearance
}

/// Whether a climb of `climb` metres on the spot, negative for a descent, from where a view is taken stays `clearance` metres away from
/// an obstacle.
#[must_use]
pub fn is_free(view: &Viewpoint, obstacle: &Obstacle, climb: f64, clearance: f64) -> bool {
    let up = BodyDisplacement { up: climb, ..BodyDisplacement::default() };
    let end = axes(lower(up, &view.camera, view.pose.attitude, Lifting::Levelled));
    !Solid::new(view, obstacle, 0, clearance).blocks(&Path { corner: end, end })
}

/// Distance at which a box's solid begins, metres: the near edge of its label's range interval.
fn near_edge(obstacle: &ObstacleBox) -> f64 {
    range_of_label(f64::from(obstacle.depth) - 0.5)
}

fn is_target(obstacle: &ObstacleBox, point: ImagePoint, target: Option<&str>) -> bool {
    let ImageBox { left, top, right, bottom } = obstacle.area;
    let holds_point = (left..=right).contains(&point.u) && (top..=bottom).contains(&point.v);
    holds_point && target.is_some_and(|name| same_name(name, &obstacle.name))
}

/// Whether two names of objects are the same.
#[must_use]
pub fn same_name(one: &str, other: &str) -> bool {
    one.trim().to_lowercase() == other.trim().to_lowercase()
}

/// A path in camera axes: from the lens to `corner`, then to `end`; both are equal for a straight path.
#[derive(Clone, Copy, Debug)]
struct Path {
    corner: DVec3,
    end: DVec3,
}

impl PlannedStep<'_> {
    /// Metres gained, negative if lost, by a step to this point.
    fn climb(&self, point: ImagePoint) -> f64 {
        unproject(&self.view.camera, point, self.step)
            .map_or(0.0, |straight| lift(straight, &self.view.camera, self.view.pose.attitude, self.lifting).up)
    }

    fn path(&self, point: ImagePoint, step: f64) -> Option<Path> {
        let straight = unproject(&self.view.camera, point, step).ok()?;
        let end = axes(straight);
        if self.shape == PathShape::Straight {
            return Some(Path { corner: end, end });
        }
        let body = lift(straight, &self.view.camera, self.view.pose.attitude, self.lifting);
        let level = BodyDisplacement { up: 0.0, ..body };
        Some(Path { corner: axes(lower(level, &self.view.camera, self.view.pose.attitude, self.lifting)), end })
    }
}

fn axes(displacement: CameraDisplacement) -> DVec3 {
    DVec3::new(displacement.right, displacement.forward, displacement.up)
}

/// The direction of an image point in camera axes, of unit length.
fn direction(camera: &Camera, point: ImagePoint) -> DVec3 {
    let ray = camera.ray(point);
    DVec3::new(ray.right, 1.0, ray.up).normalize()
}

/// The first point inside the image that is `free`, on rings of growing angle around the planned direction, or on one side
/// of it.
fn nearest_free(plan: &PlannedStep<'_>, side: Option<Side>, free: impl Fn(ImagePoint) -> bool) -> Option<ImagePoint> {
    let ahead = direction(&plan.view.camera, plan.point);
    // The axes across it: to the right, and up.
    let right = DVec3::new(ahead.y, -ahead.x, 0.0).normalize();
    let up = right.cross(ahead);
    let inside = EDGE..=1.0 - EDGE;
    let aside = (1..=ASIDE_DEG).flat_map(|ring| around().take(LEVEL_WAYS).map(move |way| (ring, way)));
    let rest = (1..=MAX_SHIFT_DEG).flat_map(|ring| {
        let tried = if ring <= ASIDE_DEG { LEVEL_WAYS } else { 0 };
        around().skip(tried).map(move |way| (ring, way))
    });
    for (ring, (aside, tip)) in aside.chain(rest) {
        let wrong = match side {
            None => false,
            Some(Side::Left) => aside > STRAIGHT_UP,
            Some(Side::Right) => aside < -STRAIGHT_UP,
        };
        if wrong {
            continue;
        }
        let (sin, cos) = sin_cos(f64::from(ring).to_radians());
        let toward = ahead * cos + (right * aside + up * tip) * sin;
        let Some(point) = plan.view.camera.project(toward.x, toward.y, toward.z) else { continue };
        if inside.contains(&point.u) && inside.contains(&point.v) && free(point) {
            return Some(point);
        }
    }
    None
}

/// Directions around a circle as fractions to the right and up: sideways first, then upwards before downwards, right before left.
fn around() -> impl Iterator<Item = (f64, f64)> {
    (0..=HALF_RING / 2).flat_map(|i| {
        let (tip, side) = sin_cos(f64::from(i) * PI / f64::from(HALF_RING));
        let both = [(side, tip), (-side, tip), (side, -tip), (-side, -tip)];
        // On the axes two of the four are the same.
        let kept: &[usize] = if i == 0 {
            &[0, 1]
        } else if i == HALF_RING / 2 {
            &[0, 2]
        } else {
            &[0, 1, 2, 3]
        };
        kept.iter().map(move |&k| both[k])
    })
}

fn sin_cos(angle: f64) -> (f64, f64) {
    (libm::sin(angle), libm::cos(angle))
}

#[cfg(test)]
mod tests;

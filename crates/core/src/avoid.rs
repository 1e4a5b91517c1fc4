//! Obstacle mode: the corridor of a planned step against the obstacles of the same reply (paper §3.1;
//! `docs/explanation/method.md`).
//!
//! The paper leaves it to the model to point clear of the boxes that it reports. Models do not always, so the geometry is
//! checked: a box and its depth label are taken for a solid that begins at the near edge of the label's interval of range
//! (what has the least label may begin anywhere before that) and reaches without end behind it, for nobody has seen its far
//! side. The body sweeps a tube around its path. Where tube and solid come nearer than the clearance, the point is shifted to
//! the nearest free direction, else the step is shortened, else the craft is to hold and ask again. An obstacle is never left
//! out of account. What lies beside the picture is in no reply: a way along its edge is turned to first
//! ([`leads_along_edge`]).

use core::f64::consts::PI;

use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::camera::Camera;
use crate::geometry::{Attitude, BodyDisplacement};
use crate::lift::{CameraDisplacement, Lifting, lift, lower, range_of_label, unproject};
use crate::query::{ImageBox, ImagePoint};
use crate::reply::ObstacleBox;

/// Added to the body's radius, metres: at 10 m, 2 % of the width of a 90° picture, as far as a good model's box is off.
pub const BODY_MARGIN: f64 = 0.25;
/// Farthest from the planned direction that a point is shifted, degrees.
pub const MAX_SHIFT_DEG: u32 = 60;
/// Shortest step that is worth flying, metres: the paper's `d_min`.
pub const MIN_STEP: f64 = 0.1;

/// Width of the strip along the picture's edges into which no point is shifted, as a share of its size: beside it nothing is
/// known.
const EDGE: f64 = 0.02;
/// A box thinner than this share of the picture is taken to be this thick.
const MIN_BOX: f64 = 0.002;
/// Metres aside for each metre ahead from which on a way can be said to lead along an edge: 14°.
const ASIDE: f64 = 0.25;
/// Directions tried on each ring around the planned one, half a circle's worth.
const HALF_RING: u32 = 8;
/// Parts in which a step is shortened.
const SHORTENINGS: u32 = 40;

/// The way on which a displacement is flown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PathShape {
    /// All at once, in a straight line (blended motion).
    #[default]
    Straight,
    /// Along the heading first and then up or down (sequential motion, the paper's queue).
    LevelThenClimb,
}

/// A step as planned from one frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlannedStep<'a> {
    /// The camera of the frame.
    pub camera: &'a Camera,
    /// The craft's attitude at the frame's capture.
    pub attitude: Attitude,
    /// How camera axes become body axes.
    pub lifting: Lifting,
    /// The way on which the displacement is flown.
    pub shape: PathShape,
    /// The waypoint.
    pub point: ImagePoint,
    /// Distance along the optical axis, metres (the paper's `d_adj`).
    pub step: f64,
}

/// What becomes of a planned step. `by` is the index of the box that was in the way, the first one if several are.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", tag = "avoidance")]
pub enum Avoidance {
    /// Nothing is in the way.
    Clear,
    /// Fly to this point instead, with the same step.
    Shifted {
        /// The nearest free direction.
        point: ImagePoint,
        /// Which box.
        by: usize,
    },
    /// Fly to the same point, but only so far.
    Shortened {
        /// Metres along the optical axis, shorter than planned.
        step: f64,
        /// Which box.
        by: usize,
    },
    /// Stay, and ask again. `by` is absent if the step itself is none: a point off the picture, or no positive length.
    Hold {
        /// Which box.
        by: Option<usize>,
    },
}

/// Checks `plan` against `boxes`. `clearance` is what must stay free around the path, metres: the body's radius plus
/// [`BODY_MARGIN`]. A box counts as the target, and not as an obstacle, if it has the name of `target` (in any case) and the
/// planned point lies in it; one of several trees is not the tree that is pointed at.
///
/// The search is by angle from the planned direction, degree by degree; at equal angles sideways comes before up, up before
/// down, and right before left. It depends on nothing but its arguments.
#[must_use]
pub fn avoid(plan: &PlannedStep<'_>, clearance: f64, boxes: &[ObstacleBox], target: Option<&str>) -> Avoidance {
    let Some(path) = plan.path(plan.point, plan.step) else { return Avoidance::Hold { by: None } };
    let solids: Vec<Solid> = boxes
        .iter()
        .enumerate()
        .filter(|(_, obstacle)| !is_target(obstacle, plan.point, target))
        .map(|(index, obstacle)| Solid::new(plan.camera, obstacle, index, clearance))
        .collect();
    let Some(by) = solids.iter().find(|solid| solid.blocks(&path)).map(|solid| solid.index) else { return Avoidance::Clear };
    let free =
        |point: ImagePoint, step: f64| plan.path(point, step).is_some_and(|path| !solids.iter().any(|solid| solid.blocks(&path)));
    if let Some(point) = nearest_free(plan, |point| free(point, plan.step)) {
        return Avoidance::Shifted { point, by };
    }
    let shortened = (1..SHORTENINGS).rev().map(|part| plan.step * f64::from(part) / f64::from(SHORTENINGS));
    match shortened.take_while(|&step| step >= MIN_STEP).find(|&step| free(plan.point, step)) {
        Some(step) => Avoidance::Shortened { step, by },
        None => Avoidance::Hold { by: Some(by) },
    }
}

/// Whether the way to a point, flown for `step` metres along the optical axis, ends nearer than `clearance` to what lies beside the
/// picture, though not before it: it leads along the left or the right edge, past what nobody has seen.
#[must_use]
pub fn leads_along_edge(plan: &PlannedStep<'_>, point: ImagePoint, step: f64, clearance: f64) -> bool {
    let (ray, camera) = (plan.camera.ray(point), plan.camera);
    if ray.right.abs() < ASIDE {
        return false;
    }
    let edge = camera.ray(ImagePoint { u: if ray.right < 0.0 { 0.0 } else { 1.0 }, v: point.v }).right;
    // The end's distance from the upright plane through the lens and the edge.
    step * (edge - ray.right).abs() / libm::sqrt(1.0 + edge * edge) < clearance
}

fn is_target(obstacle: &ObstacleBox, point: ImagePoint, target: Option<&str>) -> bool {
    let ImageBox { left, top, right, bottom } = obstacle.area;
    let holds_point = (left..=right).contains(&point.u) && (top..=bottom).contains(&point.v);
    holds_point && target.is_some_and(|name| name.trim().to_lowercase() == obstacle.name.trim().to_lowercase())
}

/// A path in camera axes: from the lens to `corner`, and from there to `end`, which is the same if there is no corner.
struct Path {
    corner: DVec3,
    end: DVec3,
}

impl PlannedStep<'_> {
    fn path(&self, point: ImagePoint, step: f64) -> Option<Path> {
        let straight = unproject(self.camera, point, step).ok()?;
        let end = axes(straight);
        if self.shape == PathShape::Straight {
            return Some(Path { corner: end, end });
        }
        let body = lift(straight, self.camera, self.attitude, self.lifting);
        let level = BodyDisplacement { up: 0.0, ..body };
        Some(Path { corner: axes(lower(level, self.camera, self.attitude, self.lifting)), end })
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

/// What a box and its label may hold: everything seen through the box and farther than the label's near edge.
struct Solid {
    index: usize,
    /// Directions of the corners, in turn around the box.
    corners: [DVec3; 4],
    /// Inward unit normals of the planes through the lens and the side from each corner to the next. A lens that distorts
    /// bends the sides; that is left to the margin.
    normals: [DVec3; 4],
    /// Range at which it begins, metres.
    near: f64,
    clearance: f64,
    /// The least label is said of anything nearer too: no way leads towards such a thing, however short.
    is_here: bool,
}

impl Solid {
    fn new(camera: &Camera, obstacle: &ObstacleBox, index: usize, clearance: f64) -> Self {
        let wide = |low: f64, high: f64| {
            let (middle, half) = (0.5 * (low + high), (0.5 * (high - low)).max(0.5 * MIN_BOX));
            (middle - half, middle + half)
        };
        let ((left, right), (top, bottom)) =
            (wide(obstacle.area.left, obstacle.area.right), wide(obstacle.area.top, obstacle.area.bottom));
        let corners =
            [(left, top), (left, bottom), (right, bottom), (right, top)].map(|(u, v)| direction(camera, ImagePoint { u, v }));
        let middle: DVec3 = corners.iter().sum();
        let normals = [0, 1, 2, 3].map(|i: usize| {
            let normal = corners[i].cross(corners[(i + 1) % 4]).normalize();
            if normal.dot(middle) < 0.0 { -normal } else { normal }
        });
        let near = range_of_label(f64::from(obstacle.depth) - 0.5);
        // A wide craft may already be nearer to a thing than its clearance; it must not come nearer still, but may leave.
        let clearance = clearance.min(0.95 * near);
        Self { index, corners, normals, near, clearance, is_here: obstacle.depth <= 1 }
    }

    /// Cosine and sine of the angle between a unit vector and the nearest direction of the box.
    fn angle(&self, toward: DVec3) -> (f64, f64) {
        if self.normals.iter().all(|normal| normal.dot(toward) >= 0.0) {
            return (1.0, 0.0);
        }
        let mut best = (-1.0, 0.0);
        let mut offer = |cos: f64, sin: f64| {
            if cos > best.0 {
                best = (cos, sin);
            }
        };
        for i in 0..4 {
            let (from, to, normal) = (self.corners[i], self.corners[(i + 1) % 4], self.normals[i]);
            offer(from.dot(toward), from.cross(toward).length());
            // The foot of the perpendicular on the side's plane, if it lies on the side itself.
            let foot = toward - normal * normal.dot(toward);
            let length = foot.length();
            if length > 0.0 && from.cross(foot).dot(from.cross(to)) >= 0.0 && to.cross(foot).dot(to.cross(from)) >= 0.0 {
                offer(length, normal.dot(toward).abs());
            }
        }
        best
    }

    /// How near a point comes to the solid, metres.
    fn distance(&self, point: DVec3) -> f64 {
        let range = point.length();
        let (cos, sin) = if range > 0.0 { self.angle(point / range) } else { (1.0, 0.0) };
        // Beside the solid the nearest of it lies at the foot on the nearest direction, before it at its near edge.
        if range * cos >= self.near { range * sin } else { to_near_edge(range, self.near, cos) }
    }

    /// Whether a way leads from the lens into the box.
    fn is_towards(&self, end: DVec3) -> bool {
        let length = end.length();
        length > 0.0 && self.angle(end / length).1 == 0.0
    }

    /// How near a straight way from the lens comes to the solid, metres.
    fn distance_of_leg(&self, end: DVec3) -> f64 {
        let length = end.length();
        let (cos, sin) = if length > 0.0 { self.angle(end / length) } else { (1.0, 0.0) };
        // The way comes nearest to the solid's rim where it passes the rim's foot; beyond that it only draws away or enters.
        let foot = self.near * cos;
        if foot <= 0.0 {
            self.near
        } else if length >= foot {
            self.near * sin
        } else {
            to_near_edge(length, self.near, cos)
        }
    }

    fn blocks(&self, path: &Path) -> bool {
        if self.distance_of_leg(path.corner) < self.clearance
            || (self.is_here && (self.is_towards(path.corner) || self.is_towards(path.end)))
        {
            return true;
        }
        let climb = path.end - path.corner;
        let height = climb.length();
        if height == 0.0 {
            return false;
        }
        // Distance changes by no more than the way between two samples, so half of that added to the clearance is safe.
        let parts = libm::ceil(height / (0.5 * self.clearance)).clamp(1.0, 128.0);
        let slack = 0.5 * height / parts;
        (0..=parts as u32).any(|i| self.distance(path.corner + climb * (f64::from(i) / parts)) < self.clearance + slack)
    }
}

/// Distance between a point at `range` and one at `near` whose directions differ by the angle with cosine `cos`.
fn to_near_edge(range: f64, near: f64, cos: f64) -> f64 {
    libm::sqrt((range * range + near * near - 2.0 * range * near * cos).max(0.0))
}

/// The first point, on rings of growing angle around the planned direction, that is `free` and inside the picture.
fn nearest_free(plan: &PlannedStep<'_>, free: impl Fn(ImagePoint) -> bool) -> Option<ImagePoint> {
    let ahead = direction(plan.camera, plan.point);
    // The axes across it: to the right, and up.
    let right = DVec3::new(ahead.y, -ahead.x, 0.0).normalize();
    let up = right.cross(ahead);
    let inside = EDGE..=1.0 - EDGE;
    for ring in 1..=MAX_SHIFT_DEG {
        let (sin, cos) = sin_cos(f64::from(ring).to_radians());
        for (side, tip) in around() {
            let toward = ahead * cos + (right * side + up * tip) * sin;
            let Some(point) = plan.camera.project(toward.x, toward.y, toward.z) else { continue };
            if inside.contains(&point.u) && inside.contains(&point.v) && free(point) {
                return Some(point);
            }
        }
    }
    None
}

/// Directions around a circle as shares to the right and up: sideways first, then upwards before downwards, right before left.
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

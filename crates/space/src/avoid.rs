//! Obstacle mode: the corridor of a planned step against the obstacles of the same reply (paper §3.1;
//! `docs/reference/reply.md`).
//!
//! The paper relies on the model to choose a point clear of the boxes it reports. Models do not always do so, so the
//! geometry is checked here. A box with its depth label is treated as a solid that starts at the near edge of the
//! label's range interval (for the lowest label, anywhere before it) and extends without end, because its far side is
//! unseen; a box that an image edge cuts off extends beyond that edge. The body sweeps a tube along its path. Where
//! tube and solid come closer than the clearance, the point is shifted to the nearest free direction; failing that, the
//! step is shortened; failing that, the craft holds and queries again. Obstacles are never ignored. The area outside
//! the frame is unknown, so the craft first turns towards a path that runs along the frame's edge
//! ([`leads_along_edge`]).

use core::f64::consts::PI;

use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use spf_core::camera::Camera;
use spf_core::geometry::{Attitude, BodyDisplacement};
use spf_core::lift::{CameraDisplacement, Lifting, lift, lower, range_of_label, unproject};
use spf_core::query::{ImageBox, ImagePoint};
use spf_core::reply::ObstacleBox;

mod memory;
mod people;
mod vertical;
mod walking;

pub use memory::ObstacleMemory;
pub use people::{is_grown_up, is_person};
pub use vertical::is_clear_vertically;
pub use walking::{AHEAD_OF_FRAME, Motion, Walk, Walkers};

/// Added to the body's radius, metres: at 10 m, 2 % of the width of a 90° image, the box error of a good model.
pub const BODY_MARGIN: f64 = 0.25;
/// Added to that around a person, who may step aside, metres.
pub const PERSON_MARGIN: f64 = 0.5;
/// A detour keeps this far away where the image has room for it, metres: boxes are loose, and an obstacle is passed only once.
pub const DETOUR_CLEARANCE: f64 = 0.8;
/// A direction is not lower than another if it ends less than this below it, metres.
const LEVEL: f64 = 0.02;
/// No detour leads towards a person who is nearer than this, metres.
const PERSON_SIGHT: f64 = 10.0;
/// Maximum angle by which a point is shifted from the planned direction, degrees.
pub const MAX_SHIFT_DEG: u32 = 60;
/// Shortest step worth flying, metres: the paper's `d_min`.
pub const MIN_STEP: f64 = 0.1;

/// Width of the strip along the image edges, as a fraction of its size, into which no point is shifted, since the area
/// beyond the edge is unknown.
const EDGE: f64 = 0.02;
/// A box thinner than this fraction of the image is taken to be this thick.
const MIN_BOX: f64 = 0.002;
/// Tangent of the angle from the optical axis up to which an object that is cut off extends: 79°.
const BEYOND: f64 = 5.0;
/// Minimum lateral distance per metre forward for a path to count as leading along an edge: 14°.
const ASIDE: f64 = 0.25;
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
    /// The camera of the frame.
    pub camera: &'a Camera,
    /// The craft's attitude at the frame's capture.
    pub attitude: Attitude,
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

/// The verdict on a planned step. `by` is the index of the blocking box, the first if there are several.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", tag = "avoidance")]
pub enum Avoidance {
    /// The path is free.
    Clear,
    /// Fly to this point instead, with the same step.
    Shifted {
        /// The nearest free direction.
        point: ImagePoint,
        /// Index of the blocking box.
        by: usize,
    },
    /// Fly towards the same point, but with a shorter step.
    Shortened {
        /// Metres along the optical axis, less than planned.
        step: f64,
        /// Index of the blocking box.
        by: usize,
    },
    /// Hold and query again. `by` is `None` if the step itself is invalid: a point outside the image, or a length that
    /// is not positive.
    Hold {
        /// Index of the blocking box.
        by: Option<usize>,
    },
}

/// Checks `plan` against `boxes`. `clearance` is the distance to keep free around the path, metres: the body's radius
/// plus [`BODY_MARGIN`]; from persons it is [`PERSON_MARGIN`] more. A box is the target, and not an obstacle, if its name
/// equals `target` (ignoring case) and it contains the planned point; of several trees, only the one pointed at is the
/// target.
///
/// Alternatives are tried by growing angle from the planned direction in steps of one degree; at equal angles sideways
/// comes before up, up before down, and right before left. With `passing` those on its side come first, whatever their angle,
/// so that a detour goes on where it began. None leads towards a person who is near. Those that keep
/// [`DETOUR_CLEARANCE`] come first, and those lower than both the planned direction and the horizon last, if at all. The result
/// depends only on the arguments.
#[must_use]
pub fn avoid(
    plan: &PlannedStep<'_>,
    clearance: f64,
    boxes: &[ObstacleBox],
    target: Option<&str>,
    passing: Option<PassingSide>,
) -> Avoidance {
    let Some(path) = plan.path(plan.point, plan.step) else { return Avoidance::Hold { by: None } };
    let solids_within = |clearance: f64| -> Vec<Solid> {
        let obstacles = boxes.iter().enumerate().filter(|(_, obstacle)| !is_target(obstacle, plan.point, target));
        obstacles.map(|(index, obstacle)| Solid::new(plan.camera, obstacle, index, clearance)).collect()
    };
    let solids = solids_within(clearance);
    let Some(by) = solids.iter().find(|solid| solid.blocks(&path)).map(|solid| solid.index) else { return Avoidance::Clear };
    let free =
        |point: ImagePoint, step: f64| plan.path(point, step).is_some_and(|path| !solids.iter().any(|solid| solid.blocks(&path)));
    let allowed = |point: ImagePoint| {
        let toward = direction(plan.camera, point);
        !solids.iter().any(|solid| solid.is_person && solid.near < PERSON_SIGHT && solid.is_passed_closely(toward))
    };
    // Below the horizon is the ground, which no box represents.
    let lowest = plan.climb(plan.point).min(0.0) - LEVEL;
    // Right beside an obstacle there is no such room, and looking for it would lead far aside.
    let mut roomy = solids_within(clearance);
    for solid in &mut roomy {
        solid.clearance = solid.clearance.max(DETOUR_CLEARANCE.min(0.5 * solid.near));
    }
    let has_room =
        |point: ImagePoint| plan.path(point, plan.step).is_some_and(|path| !roomy.iter().any(|solid| solid.blocks(&path)));
    let try_side = |side: Option<Side>| {
        let fits = |point: ImagePoint| free(point, plan.step) && allowed(point);
        let level = |point: ImagePoint| plan.climb(point) >= lowest && fits(point);
        nearest_free(plan, side, |point| level(point) && has_room(point))
            .or_else(|| nearest_free(plan, side, level))
            .or_else(|| nearest_free(plan, side, fits).filter(|_| plan.dives))
    };
    let shifted = || match passing {
        None => try_side(None),
        Some(PassingSide { side, strict: true }) => try_side(Some(side)),
        Some(PassingSide { side, strict: false }) => try_side(Some(side)).or_else(|| try_side(None)),
    };
    if let Some(point) = shifted() {
        return Avoidance::Shifted { point, by };
    }
    let shortened = (1..SHORTENINGS).rev().map(|part| plan.step * f64::from(part) / f64::from(SHORTENINGS));
    match shortened.take_while(|&step| step >= MIN_STEP).find(|&step| free(plan.point, step)) {
        Some(step) => Avoidance::Shortened { step, by },
        None => Avoidance::Hold { by: Some(by) },
    }
}

/// The side of the planned point on which another one lies; `None` if it lies above or below it.
#[must_use]
pub fn side_of(plan: &PlannedStep<'_>, point: ImagePoint) -> Option<Side> {
    let (from, to) = (plan.camera.ray(plan.point), plan.camera.ray(point));
    let (across, up) = (to.right - from.right, to.up - from.up);
    // Less than a quarter of it across is a path over or under.
    (across.abs() > 0.25 * up.abs()).then_some(if across < 0.0 { Side::Left } else { Side::Right })
}

/// Whether the path to `point`, flown for `step` metres along the optical axis, ends closer than `clearance` metres to
/// the region outside the frame without leaving it: it runs along the left or right edge, past what the camera has not
/// seen.
#[must_use]
pub fn leads_along_edge(plan: &PlannedStep<'_>, point: ImagePoint, step: f64, clearance: f64) -> bool {
    let (ray, camera) = (plan.camera.ray(point), plan.camera);
    if ray.right.abs() < ASIDE {
        return false;
    }
    let edge = camera.ray(ImagePoint { u: if ray.right < 0.0 { 0.0 } else { 1.0 }, v: point.v }).right;
    // Distance of the end point from the vertical plane through the lens and the image edge.
    step * (edge - ray.right).abs() / libm::sqrt(1.0 + edge * edge) < clearance
}

/// Whether the straight path between two points, relative to where a view was taken with this attitude, stays `clearance` metres
/// away from the view's boxes.
#[must_use]
pub fn is_free(camera: &Camera, attitude: Attitude, boxes: &[ObstacleBox], way: [BodyDisplacement; 2], clearance: f64) -> bool {
    let [from, to] = way.map(|point| axes(lower(point, camera, attitude, Lifting::Levelled)));
    let parts = libm::ceil(from.distance(to) / (0.5 * clearance)).clamp(1.0, 128.0);
    // Where the craft is now it already is.
    let points = (1..=parts as u32).map(|i| from + (to - from) * (f64::from(i) / parts));
    let solids: Vec<Solid> =
        boxes.iter().enumerate().map(|(index, obstacle)| Solid::new(camera, obstacle, index, clearance)).collect();
    points.into_iter().all(|point| solids.iter().all(|solid| solid.distance(point) >= solid.clearance))
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
struct Path {
    corner: DVec3,
    end: DVec3,
}

impl PlannedStep<'_> {
    /// Metres gained, negative if lost, by a step to this point.
    fn climb(&self, point: ImagePoint) -> f64 {
        unproject(self.camera, point, self.step)
            .map_or(0.0, |straight| lift(straight, self.camera, self.attitude, self.lifting).up)
    }

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

/// The volume that a box and its label may occupy: everything seen through the box beyond the label's near edge.
struct Solid {
    index: usize,
    /// Directions of the corners, in order around the box.
    corners: [DVec3; 4],
    /// Inward unit normals of the planes through the lens and each side, from one corner to the next. Lens distortion
    /// bends the sides; the margin absorbs that.
    normals: [DVec3; 4],
    /// Range at which it begins, metres.
    near: f64,
    clearance: f64,
    /// The lowest label also covers anything closer, so no path may lead towards such a box, however short.
    is_here: bool,
    is_person: bool,
}

impl Solid {
    fn new(camera: &Camera, obstacle: &ObstacleBox, index: usize, clearance: f64) -> Self {
        let wide = |low: f64, high: f64| {
            let (middle, half) = (0.5 * (low + high), (0.5 * (high - low)).max(0.5 * MIN_BOX));
            (middle - half, middle + half)
        };
        let ((left, right), (top, bottom)) =
            (wide(obstacle.area.left, obstacle.area.right), wide(obstacle.area.top, obstacle.area.bottom));
        let corners = [(left, top), (left, bottom), (right, bottom), (right, top)].map(|(u, v)| {
            let mut ray = camera.ray(ImagePoint { u, v });
            if u < ImageBox::CUT {
                ray.right = ray.right.min(-BEYOND);
            } else if u > 1.0 - ImageBox::CUT {
                ray.right = ray.right.max(BEYOND);
            }
            if v < ImageBox::CUT {
                ray.up = ray.up.max(BEYOND);
            } else if v > 1.0 - ImageBox::CUT {
                ray.up = ray.up.min(-BEYOND);
            }
            DVec3::new(ray.right, 1.0, ray.up).normalize()
        });
        let middle: DVec3 = corners.iter().sum();
        let normals = [0, 1, 2, 3].map(|i: usize| {
            let normal = corners[i].cross(corners[(i + 1) % 4]).normalize();
            if normal.dot(middle) < 0.0 { -normal } else { normal }
        });
        let near = near_edge(obstacle);
        let is_person = is_person(&obstacle.name);
        let clearance = clearance + if is_person { PERSON_MARGIN } else { 0.0 };
        // A wide craft may already be closer than its clearance; it may leave but must not come closer.
        let clearance = clearance.min(0.95 * near);
        Self { index, corners, normals, near, clearance, is_here: obstacle.depth <= 1, is_person }
    }

    /// Whether a path in this direction, however long, passes closer than the clearance.
    fn is_passed_closely(&self, toward: DVec3) -> bool {
        let (cos, sin) = self.angle(toward);
        cos > 0.0 && self.near * sin < self.clearance
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

    /// Distance of a point from the solid, metres.
    fn distance(&self, point: DVec3) -> f64 {
        let range = point.length();
        let (cos, sin) = if range > 0.0 { self.angle(point / range) } else { (1.0, 0.0) };
        // Beside the solid, the nearest point is the foot on the nearest direction; in front of it, the near edge.
        if range * cos >= self.near { range * sin } else { to_near_edge(range, self.near, cos) }
    }

    /// Whether a straight path from the lens, flown on, would come closer than the clearance. Where the range is that of the
    /// lowest label only the direction is known: of many short steps past such a box each ends before it.
    fn is_towards(&self, end: DVec3) -> bool {
        let length = end.length();
        let (cos, sin) = if length > 0.0 { self.angle(end / length) } else { return false };
        cos > 0.0 && self.near * sin < self.clearance
    }

    /// Minimum distance of a straight path from the lens to the solid, metres.
    fn distance_of_leg(&self, end: DVec3) -> f64 {
        let length = end.length();
        let (cos, sin) = if length > 0.0 { self.angle(end / length) } else { (1.0, 0.0) };
        // The path is closest to the solid's rim at the foot of its perpendicular; beyond it, it only recedes or
        // enters.
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
        // Distance changes by at most the length between two samples, so half of that added to the clearance is safe.
        let parts = libm::ceil(height / (0.5 * self.clearance)).clamp(1.0, 128.0);
        let slack = 0.5 * height / parts;
        (0..=parts as u32).any(|i| self.distance(path.corner + climb * (f64::from(i) / parts)) < self.clearance + slack)
    }
}

/// Distance between a point at `range` and one at `near` whose directions differ by the angle with cosine `cos`.
fn to_near_edge(range: f64, near: f64, cos: f64) -> f64 {
    libm::sqrt((range * range + near * near - 2.0 * range * near * cos).max(0.0))
}

/// The first point inside the image that is `free`, on rings of growing angle around the planned direction, or on one side
/// of it.
fn nearest_free(plan: &PlannedStep<'_>, side: Option<Side>, free: impl Fn(ImagePoint) -> bool) -> Option<ImagePoint> {
    let ahead = direction(plan.camera, plan.point);
    // The axes across it: to the right, and up.
    let right = DVec3::new(ahead.y, -ahead.x, 0.0).normalize();
    let up = right.cross(ahead);
    let inside = EDGE..=1.0 - EDGE;
    for ring in 1..=MAX_SHIFT_DEG {
        let (sin, cos) = sin_cos(f64::from(ring).to_radians());
        for (aside, tip) in around() {
            let wrong = match side {
                None => false,
                Some(Side::Left) => aside > STRAIGHT_UP,
                Some(Side::Right) => aside < -STRAIGHT_UP,
            };
            if wrong {
                continue;
            }
            let toward = ahead * cos + (right * aside + up * tip) * sin;
            let Some(point) = plan.camera.project(toward.x, toward.y, toward.z) else { continue };
            if inside.contains(&point.u) && inside.contains(&point.v) && free(point) {
                return Some(point);
            }
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

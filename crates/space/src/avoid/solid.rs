//! [`Solid`]: the volume that a box and its label may occupy.

use glam::{DMat3, DVec3};

use super::{PERSON_MARGIN, Path, axes, is_person};
use crate::viewpoint::{Obstacle, Viewpoint};
use spf_core::lift::{CameraDisplacement, Lifting, lift, lower};
use spf_core::query::{ImageBox, ImagePoint};

/// A box thinner than this fraction of the image is taken to be this thick.
const MIN_BOX: f64 = 0.002;
/// Tangent of the angle from the optical axis up to which an object that is cut off extends: 79°.
const BEYOND: f64 = 5.0;
/// Beside something of the lowest label that is not somebody, this much of the clearance is given up, metres: it stands somewhere in
/// that label, seldom at its near end, and with a narrow image all of it would leave no direction at all.
const SPARED: f64 = 0.15;
/// Step with which a path is followed where it grazes the distance to keep, metres.
const GRAZE: f64 = 0.02;

/// The volume that a box and its label may occupy, in the camera axes of the view that showed it: what is seen through the box from
/// the label's near edge on, to the depth of a thing as wide as it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Solid {
    pub(super) index: usize,
    /// Directions of the corners, in order around the box.
    corners: [DVec3; 4],
    /// Inward unit normals of the planes through the lens and each side, from one corner to the next. Lens distortion
    /// bends the sides; the margin absorbs that.
    normals: [DVec3; 4],
    /// Ranges at which it begins and ends, metres.
    near: f64,
    far: f64,
    pub(super) clearance: f64,
    /// From the camera axes of the plan into its own, if it is of another view.
    moved: Option<(DMat3, DVec3)>,
    /// The lowest label also covers anything closer, so no path may lead towards such a box, however short.
    is_here: bool,
    is_person: bool,
}

impl Solid {
    /// The solid of an obstacle for a plan made from `view`; `clearance`: the distance to keep from it, metres.
    pub(super) fn new(view: &Viewpoint, obstacle: &Obstacle, index: usize, clearance: f64) -> Self {
        let Obstacle { from: Viewpoint { camera, .. }, listed } = obstacle;
        let wide = |low: f64, high: f64| {
            let (middle, half) = (0.5 * (low + high), (0.5 * (high - low)).max(0.5 * MIN_BOX));
            (middle - half, middle + half)
        };
        let ((left, right), (top, bottom)) =
            (wide(listed.area.left, listed.area.right), wide(listed.area.top, listed.area.bottom));
        // Later images have shown what is beyond the edges of an earlier one.
        let is_own = obstacle.from.pose == view.pose;
        let corners = [(left, top), (left, bottom), (right, bottom), (right, top)].map(|(u, v)| {
            let mut ray = camera.ray(ImagePoint { u, v });
            if !is_own {
                return DVec3::new(ray.right, 1.0, ray.up).normalize();
            }
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
        let is_person = is_person(&listed.name);
        let (near, far) = obstacle.extent();
        let moved = (!is_own).then(|| into_axes_of(view, &obstacle.from));
        let clearance = clearance + if is_person { PERSON_MARGIN } else { 0.0 };
        let is_here = listed.depth <= 1 && moved.is_none();
        let mut solid = Self { index, corners, normals, near, far, clearance, moved, is_here, is_person };
        // A wide craft may already be closer than its clearance; it may leave but must not come closer.
        solid.clearance = clearance.min(0.95 * solid.distance(solid.own(DVec3::ZERO)));
        solid
    }

    /// Keeps more room, metres, as far as there is that much before it.
    pub(super) fn widen(&mut self, clearance: f64) {
        let here = self.distance(self.own(DVec3::ZERO));
        self.clearance = self.clearance.max(clearance.min(0.5 * here));
    }

    /// A place of the plan in its own axes.
    fn own(&self, point: DVec3) -> DVec3 {
        self.moved.map_or(point, |(turn, to)| turn * point + to)
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

    /// Distance of a point, in its own axes, from the solid, metres.
    pub(super) fn distance(&self, point: DVec3) -> f64 {
        let range = point.length();
        let (cos, _) = if range > 0.0 { self.angle(point / range) } else { (1.0, 0.0) };
        // The nearest point lies in the nearest direction: at the foot of the perpendicular, or at one of the ends.
        to_range(range, (range * cos).clamp(self.near, self.far), cos)
    }

    /// Whether a straight path from the lens, flown on, would come closer than the clearance. Where the range is that of the
    /// lowest label only the direction is known: of many short steps past such a box each ends before it.
    fn is_towards(&self, end: DVec3) -> bool {
        let length = end.length();
        let (cos, sin) = if length > 0.0 { self.angle(end / length) } else { return false };
        let clearance = if self.is_person { self.clearance } else { self.clearance - SPARED };
        cos > 0.0 && self.near * sin < clearance
    }

    /// Whether a straight path, in its own axes, comes closer than the clearance. The distance changes by no more than what is flown.
    fn meets(&self, from: DVec3, to: DVec3) -> bool {
        let length = from.distance(to);
        let mut flown = 0.0;
        loop {
            let part = if length > 0.0 { (flown / length).min(1.0) } else { 1.0 };
            let distance = self.distance(from + (to - from) * part);
            if distance < self.clearance {
                return true;
            }
            if part >= 1.0 {
                return false;
            }
            flown += (distance - self.clearance).max(GRAZE);
        }
    }

    /// Whether a path comes closer than the clearance.
    pub(super) fn blocks(&self, path: &Path) -> bool {
        let (corner, end) = (self.own(path.corner), self.own(path.end));
        self.meets(self.own(DVec3::ZERO), corner)
            || (self.is_here && (self.is_towards(corner) || self.is_towards(end)))
            || (corner != end && self.meets(corner, end))
    }
}

/// The rotation and the translation from the camera axes of one view into those of another.
fn into_axes_of(view: &Viewpoint, other: &Viewpoint) -> (DMat3, DVec3) {
    let to = |right: f64, forward: f64, up: f64| {
        let level = lift(CameraDisplacement { right, forward, up }, &view.camera, view.pose.attitude, Lifting::Levelled);
        let place = view.pose.position.displaced(level, view.pose.attitude.heading);
        let ahead = other.pose.position.displacement_to(place, other.pose.attitude.heading);
        axes(lower(ahead, &other.camera, other.pose.attitude, Lifting::Levelled))
    };
    let origin = to(0.0, 0.0, 0.0);
    let turn = DMat3::from_cols(to(1.0, 0.0, 0.0) - origin, to(0.0, 1.0, 0.0) - origin, to(0.0, 0.0, 1.0) - origin);
    (turn, origin)
}

/// Distance between a point at `range` and one at `other` whose directions differ by the angle with cosine `cos`.
fn to_range(range: f64, other: f64, cos: f64) -> f64 {
    libm::sqrt((range * range + other * other - 2.0 * range * other * cos).max(0.0))
}

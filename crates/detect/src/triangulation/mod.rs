//! Triangulation: where the static things are that a moving camera sees, from points followed through its frames and from the
//! motion that telemetry gives (`docs/guide/obstacles.md`, "A depth network").
//!
//! For each point, the rays of the last 3 s are kept in the world, from the positions at which they were seen. The place that is
//! nearest to all of them is the point's (linear least squares, weighted by distance; Hartley and Sturm 1997, "Triangulation"). Only
//! the translation comes from telemetry. A heading error of 1° is as much as the parallax of something 10 m away after 0.2 m, so the
//! rotation of each frame is corrected from all its points together (`rotation`).
//!
//! The standard deviation of the range contains the error of the rays, of which a track of many images has no more than a few
//! independent ones; that of the corrected rotation; and that of the distance flown. A point counts only if the standard deviation of
//! the logarithm of its range is small enough, and if its rays meet: those of a moving thing do so only if it moves along them.

mod rotation;

use std::collections::{BTreeMap, VecDeque};

use glam::{DMat3, DVec3};
use spf_core::camera::Camera;
use spf_core::depth::CameraAxes;
use spf_core::geometry::{EnuPosition, Pose};
use spf_core::query::ImagePoint;
use spf_core::time::{Duration, Time};

use self::rotation::{Correction, Errors};

/// How long rays are kept.
const KEPT: Duration = Duration::from_secs(3);
/// Rays kept of a point, and points at most: those of [`KEPT`] at 10 Hz with room, and more than any report has.
const RAYS: usize = 40;
const POINTS: usize = 256;
/// After a longer gap between two reports the points are others.
const GAP: Duration = Duration::from_secs(1);
/// Error of a followed corner, standard deviation in pixels of an image 480 wide.
const RAY_ERROR: f64 = 0.35;
const IMAGE_WIDTH: f64 = 480.0;
/// Number of independent rays that a long track is worth: the errors of followed corners add up from frame to frame.
const INDEPENDENT: f64 = 6.0;
/// Part of the velocity's error that stays the same while a point is seen.
const DRIFT: f64 = 0.25;
/// Fewest rays of a point that counts.
const FEWEST: usize = 5;
/// Least angle between the first and the last ray, radians: 1.1°. Less is no more than the errors of rays and rotation.
const PARALLAX: f64 = 0.02;
/// The largest standard deviation of the logarithm of the range of a point that counts.
pub const SURE: f64 = 0.25;
/// Mean squared residual of the rays, in their variances, above which a point is no static one, and above which its rays are dropped.
const STATIC: f64 = 1.0;
const MOVING: f64 = 9.0;
/// Ranges between which points count, metres: nearer ones are rain on the lens, farther ones are of no use to a map of 20 m.
const RANGES: core::ops::RangeInclusive<f64> = 0.3..=14.0;

/// Errors of a motion estimate over a few seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionError {
    /// Error of a distance, as a fraction of it.
    pub relative: f64,
    /// Error of the velocity, m/s in any direction, which stays the same for seconds.
    pub velocity: f64,
    /// Error of a displacement besides, metres.
    pub least: f64,
}

impl MotionError {
    /// Of a craft with a position source, whose filtered velocity is good to a few hundredths of a metre per second.
    pub const POSITION: Self = Self { relative: 0.02, velocity: 0.01, least: 0.01 };
    /// Of a craft that reports velocity in whole decimetres per second: the rounding alone makes 0.03 m/s.
    pub const DEAD_RECKONED: Self = Self { relative: 0.03, velocity: 0.04, least: 0.01 };

    /// The standard deviation of a displacement across any direction, metres, besides the error of its length.
    fn across(self, time: Duration) -> f64 {
        libm::hypot(self.least, self.velocity * time.as_secs_f64())
    }

    /// The standard deviation of a displacement, metres.
    fn of(self, distance: f64, time: Duration) -> f64 {
        libm::hypot(self.relative * distance, self.across(time))
    }
}

/// Where the points that are followed are in a frame.
#[derive(Clone, Debug, PartialEq)]
pub struct PointReport {
    /// When that frame was captured.
    pub captured: Time,
    /// Their numbers, which they keep from frame to frame, and their places; those that the frame does not show are left out.
    pub points: Vec<(u32, ImagePoint)>,
}

/// A static point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StaticPoint {
    /// Its number.
    pub id: u32,
    /// Its place according to the motion estimate.
    pub place: EnuPosition,
    /// Distance from the camera, metres.
    pub range: f64,
    /// Standard deviation of the range's natural logarithm.
    pub log_sd: f64,
}

/// East, north and up as a vector.
fn vector(EnuPosition { east, north, up }: EnuPosition) -> DVec3 {
    DVec3::new(east, north, up)
}

fn position(DVec3 { x: east, y: north, z: up }: DVec3) -> EnuPosition {
    EnuPosition { east, north, up }
}

/// The direction of a vector; `None` for one without.
fn unit(a: DVec3) -> Option<DVec3> {
    let length = a.length();
    (length > 1e-9 && length.is_finite()).then(|| a / length)
}

/// The solution of a system whose matrix is symmetric and not negative, and the inverse. `None` if it is singular.
fn solve(matrix: DMat3, right: DVec3) -> Option<(DVec3, DMat3)> {
    let size = matrix.x_axis.x.max(matrix.y_axis.y).max(matrix.z_axis.z);
    // Also false for what is no number.
    let regular = matrix.determinant() > 1e-12 * size * size * size;
    let inverse = regular.then(|| matrix.inverse())?;
    Some((inverse * right, inverse))
}

/// A ray that a point was seen along.
#[derive(Clone, Copy, Debug)]
struct RaySeen {
    at: Time,
    /// East, north, up.
    from: DVec3,
    /// Unit vector, with the rotation corrected.
    along: DVec3,
}

/// A point that is followed.
#[derive(Clone, Debug, Default)]
struct Track {
    seen: VecDeque<RaySeen>,
    /// The inverse of its range from where it was first seen, 1/metres, and the standard deviation, whether or not it is sure.
    inverse: Option<(f64, f64)>,
}

/// Keeps the rays of all points, and triangulates them. See the [module](self).
#[derive(Clone, Debug)]
pub struct Triangulation {
    tracks: BTreeMap<u32, Track>,
    error: MotionError,
    last: Option<Time>,
    correction: Correction,
    points: Vec<StaticPoint>,
}

impl Triangulation {
    /// Without points yet.
    #[must_use]
    pub fn new(error: MotionError) -> Self {
        Self { tracks: BTreeMap::new(), error, last: None, correction: Correction::default(), points: Vec::new() }
    }

    /// Forgets everything, for instance because the position source has jumped.
    pub fn clear(&mut self) {
        *self = Self::new(self.error);
    }

    /// Sets the errors of the motion estimate.
    pub fn set_error(&mut self, error: MotionError) {
        self.error = error;
    }

    /// The static points that the last frame showed.
    #[must_use]
    pub fn points(&self) -> &[StaticPoint] {
        &self.points
    }

    /// The number of points of which rays are kept.
    #[must_use]
    pub fn len(&self) -> usize {
        self.tracks.len()
    }

    /// Whether no rays are kept.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.tracks.is_empty()
    }

    /// The corrections of the last frame's rotation, and of the direction of flight relative to it, radians about the axes east,
    /// north and up.
    #[must_use]
    pub fn corrections(&self) -> ([f64; 3], [f64; 3]) {
        (self.correction.turned.to_array(), self.correction.aim.to_array())
    }

    /// Takes the points of a frame that `camera` took at `pose`, and gives the static ones. A frame that is not newer than the last
    /// one, and a pose that is not a number, are ignored.
    pub fn observe(&mut self, report: &PointReport, camera: &Camera, pose: Pose) -> &[StaticPoint] {
        self.points.clear();
        let (place, attitude) = (pose.position, pose.attitude);
        let numbers = [place.east, place.north, place.up, attitude.heading, attitude.pitch, attitude.roll];
        if self.last.is_some_and(|last| report.captured <= last) || !numbers.iter().all(|x| x.is_finite()) {
            return &self.points;
        }
        if self.last.is_some_and(|last| report.captured.since(last) > GAP) {
            self.clear();
        }
        self.last = Some(report.captured);
        let from = vector(place);
        let axes = CameraAxes::new(camera, Pose { position: EnuPosition::default(), attitude });
        let along = |at: ImagePoint| {
            let ray = camera.ray(at);
            unit(vector(axes.place(ray.right, 1.0, ray.up)))
        };
        let mut rays = BTreeMap::new();
        for (id, at) in report.points.iter().take(POINTS).filter(|(_, at)| at.is_in_image()) {
            if let Some(along) = along(*at) {
                // Of a repeated number, the first place counts.
                rays.entry(*id).or_insert(along);
            }
        }
        let error = ray_error(camera);
        let errors = Errors { ray: error, motion: self.error };
        let correction = rotation::correction(&self.tracks, &rays, (report.captured, from), self.correction, errors);
        // The rays have talked each other into it.
        if !correction.is_plausible() {
            self.clear();
            self.last = Some(report.captured);
            return &self.points;
        }
        self.correction = correction;
        let mut before = core::mem::take(&mut self.tracks);
        for (id, along) in rays {
            let Some(along) = unit(along + correction.turned.cross(along)) else { continue };
            let mut track = before.remove(&id).unwrap_or_default();
            track.add(RaySeen { at: report.captured, from, along });
            if let Some(point) = track.triangulate(id, error, &correction, self.error) {
                self.points.push(point);
            }
            self.tracks.insert(id, track);
        }
        &self.points
    }
}

/// The standard deviation of a ray's direction, radians.
fn ray_error(camera: &Camera) -> f64 {
    RAY_ERROR / (camera.fx * IMAGE_WIDTH / f64::from(camera.width.max(1))).max(1.0)
}

impl Track {
    fn add(&mut self, seen: RaySeen) {
        self.seen.push_back(seen);
        while self.seen.len() > RAYS || self.seen.front().is_some_and(|first| seen.at.since(first.at) > KEPT) {
            self.seen.pop_front();
        }
    }

    /// The point, if it is known well enough and its rays meet.
    fn triangulate(&mut self, id: u32, ray_error: f64, correction: &Correction, motion: MotionError) -> Option<StaticPoint> {
        self.inverse = None;
        let (first, last) = (*self.seen.front()?, *self.seen.back()?);
        if self.seen.len() < FEWEST || first.along.cross(last.along).length() < PARALLAX {
            return None;
        }
        // Relative to the last place, in the axes of the rays.
        let from = |seen: &RaySeen| correction.displacement(seen.from - last.from);
        let mut place = None;
        let mut inverse = DMat3::ZERO;
        // Twice, because the weights depend on the distances.
        for _ in 0..2 {
            let (mut matrix, mut right) = (DMat3::ZERO, DVec3::ZERO);
            for seen in &self.seen {
                let distance = place.map_or(1.0, |place: DVec3| (place - from(seen)).length().max(0.1));
                let [x, y, z] = seen.along.to_array().map(|x| x * seen.along);
                let across = (DMat3::IDENTITY - DMat3::from_cols(x, y, z)) * (1.0 / (distance * distance));
                matrix += across;
                right += across * from(seen);
            }
            let (next, of) = solve(matrix, right)?;
            (place, inverse) = (Some(next), of);
        }
        let place = place?;
        let (range, away_first) = (place.length(), place - from(&first));
        let along = unit(place)?;
        if along.dot(last.along) <= 0.0 || away_first.dot(first.along) <= 0.0 {
            return None;
        }
        // How far the camera has moved across the line of sight, and how well that is known.
        let across = self.seen.iter().map(|seen| from(seen).cross(along).length()).fold(0.0, f64::max).max(1e-6);
        let flown = self.seen.iter().map(|seen| from(seen).length()).fold(0.0, f64::max);
        let spread = along.dot(inverse * along);
        let rays = ray_error * ray_error * spread * (self.seen.len() as f64 / INDEPENDENT).max(1.0) / (range * range);
        let drifted = DRIFT * motion.velocity * last.at.since(first.at).as_secs_f64();
        let moved = libm::hypot(motion.relative, (libm::hypot(motion.least, drifted) + correction.aim_sd * flown) / across);
        let turned = correction.turned_sd * range / across;
        let log_sd = libm::sqrt(rays + moved * moved + turned * turned);
        let inverse = 1.0 / away_first.length().max(0.1);
        self.inverse = Some((inverse, log_sd * inverse));
        // Rays that miss: besides their own error, that of the places they were seen from.
        let mut misses = 0.0;
        for seen in &self.seen {
            let to = place - from(seen);
            let (distance, miss) = (to.length().max(0.1), seen.along.cross(to).length());
            let moved = libm::hypot(motion.least, correction.aim_sd * from(seen).length());
            let variance = ray_error * ray_error * distance * distance + moved * moved;
            misses += miss * miss / variance;
        }
        let misses = misses / (2 * self.seen.len() - 3) as f64;
        if misses > MOVING {
            self.seen.drain(..self.seen.len() - 1);
            self.inverse = None;
            return None;
        }
        let sure = log_sd < SURE && misses < STATIC && RANGES.contains(&range);
        let place = position(last.from + correction.direction(place));
        sure.then_some(StaticPoint { id, place, range, log_sd })
    }
}

#[cfg(test)]
mod tests;

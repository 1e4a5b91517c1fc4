//! The brake: limits the speed near known obstacles, whatever planner, pilot or VLM request.
//!
//! It uses points in the world: those of the newest depth grid, and the occupied cells of the obstacle map. Along a
//! direction, the speed is limited so that the craft comes to rest the margin before the nearest point in the corridor
//! of the body. In directions that no working sensor shows (sideways, backwards, or with a dead, frozen or late sensor)
//! it is also limited to the blind speed. A direction in the field of view without a return does not count as blind:
//! open space gives none, and neither does glass. But where the ground should give a return in a part of the image and
//! gives none, that part has failed, and what it would show is blind.

use std::collections::BTreeMap;

use super::brake_limits::BrakeLimits;
use super::reach::Braking;
use spf_core::camera::Camera;
use spf_core::depth::{CameraAxes, DepthGrid};
use spf_core::geometry::{EnuPosition, EnuVelocity, Pose};
use spf_core::lift::CameraDisplacement;
use spf_core::ranges::{MOST_RAYS, RangeScan};
use spf_core::time::{Duration, Time, duration_from_secs};

/// Added to the body's radius on either side of the path, metres.
pub(super) const BESIDE: f64 = 0.1;
/// Number of consecutive grids with equal values from which the sensor counts as frozen: noise never repeats.
const FROZEN: u32 = 3;
/// A grid in which a smaller fraction of pixels has a value comes from a dead or covered sensor.
const LEAST_VALID: f64 = 0.02;
/// A return of the ground is due up to this depth, metres: within the range of common sensors.
const DUE: f64 = 8.0;
/// Parts of the image, side by side, that can fail on their own.
const STRIPS: usize = 8;
/// A grid is reduced to the nearest point of each block of this many pixels a side.
const BLOCK: usize = 4;
/// Points farther than this from the craft do not matter, metres: no craft of ours needs as much to stop.
const SIGHT: f64 = 12.0;
/// A motion estimate older than this is not used, s.
const FRESH: f64 = 0.5;
/// What a sensor around the craft has measured counts for this long: over a slow link it comes twice a second.
const RANGED: Duration = Duration::from_secs(1);
/// Maximum number of sensors around the craft.
const SENSORS: usize = 32;

/// The known obstacles and motion.
#[derive(Clone, Debug, Default)]
pub(super) struct Brake {
    depth: Option<NewestGrid>,
    /// Values of the newest grid, and the number of consecutive grids with these values.
    repeated: (Vec<u16>, u32),
    /// Whether the sensor gave values when it was last due to; and the same of each strip.
    proved: bool,
    strips: [bool; STRIPS],
    remembered: Vec<EnuPosition>,
    /// The places that the sensors around the craft have hit last, with the time of measurement, by sensor.
    ranges: BTreeMap<u32, (Time, Vec<EnuPosition>)>,
    /// Position and heading according to the motion estimate that depth and map are based on.
    motion: Option<(Time, EnuPosition, f64)>,
}

/// The newest usable grid.
#[derive(Clone, Debug)]
struct NewestGrid {
    captured: Time,
    counter: u64,
    camera: Camera,
    axes: CameraAxes,
    points: Vec<EnuPosition>,
    /// The strips that work.
    strips: [bool; STRIPS],
}

/// A motion to be bounded.
pub(super) struct Motion {
    /// Where the craft is now, and its velocity.
    pub(super) at: EnuPosition,
    pub(super) own: EnuVelocity,
    /// Where the setpoint takes effect.
    pub(super) from: EnuPosition,
    /// Heading there, radians.
    pub(super) heading: f64,
    pub(super) velocity: EnuVelocity,
    /// Directions between now and the end of the setpoint's validity: turns about the vertical, clockwise, radians.
    pub(super) turns: [f64; 3],
    pub(super) radius: f64,
    pub(super) braking: Braking,
    /// The same from now on, if the next setpoint holds.
    pub(super) stopping: Braking,
}

impl Brake {
    /// Adds a depth grid, measured at `pose`, `height` metres above the ground. Returns whether it is a measurement of a working
    /// sensor.
    ///
    /// A grid without values comes from the open sky if the ground is too far below to be in range, and from a dead sensor if it is
    /// not: a sensor that worked when it could show so is trusted above that height.
    pub(super) fn depth(&mut self, now: Time, grid: &DepthGrid, pose: Pose, height: f64) -> bool {
        if grid.check().is_err() || self.depth.as_ref().is_some_and(|seen| grid.captured <= seen.captured) {
            return false;
        }
        if self.depth.as_ref().is_some_and(|seen| grid.counter == seen.counter) {
            return false; // The same measurement again.
        }
        let (values, times) = &mut self.repeated;
        if *values == grid.cm {
            *times += 1;
        } else {
            values.clone_from(&grid.cm);
            *times = 1;
        }
        let (empty, nothing) = (grid.valid_fraction() < LEAST_VALID, grid.cm.iter().all(|&cm| cm == 0));
        let open_sky = empty && self.proved && !is_due(grid, pose, height);
        // Nothing is always the same.
        let frozen = *times >= FROZEN && !(nothing && open_sky);
        if frozen || (empty && !open_sky) {
            (self.depth, self.proved, self.strips) = (None, false, [false; STRIPS]);
            return false;
        }
        self.proved |= !empty;
        let valid = valid_in_strips(grid);
        for (index, works) in self.strips.iter_mut().enumerate() {
            if valid[index] >= LEAST_VALID {
                *works = true;
            } else if is_due_at(grid, pose, height, (index as f64 + 0.5) / STRIPS as f64, LOW) {
                *works = false;
            }
        }
        let axes = CameraAxes::new(&grid.camera, pose);
        let across = (grid.camera.width as usize).div_ceil(BLOCK);
        let down = (grid.camera.height as usize).div_ceil(BLOCK);
        let mut nearest = vec![None; across * down];
        let width = grid.camera.width as usize;
        for (index, at) in grid.points() {
            let block = &mut nearest[(index / width / BLOCK) * across + (index % width) / BLOCK];
            if block.is_none_or(|near: CameraDisplacement| at.forward < near.forward) {
                *block = Some(at);
            }
        }
        let points = nearest.into_iter().flatten().map(|at| axes.place(at.right, at.forward, at.up)).collect();
        let (captured, strips) = (grid.captured.min(now), self.strips);
        self.depth = Some(NewestGrid { captured, counter: grid.counter, camera: grid.camera, axes, points, strips });
        true
    }

    /// Replaces the remembered obstacles by these places near the craft.
    pub(super) fn remember(&mut self, places: impl Iterator<Item = EnuPosition>) {
        self.remembered.clear();
        self.remembered.extend(places.filter(|p| [p.east, p.north, p.up].iter().all(|x| x.is_finite())));
    }

    /// Takes a scan of a sensor around the craft, measured at `pose`: it replaces the one before of the same sensor.
    pub(super) fn ranges(&mut self, now: Time, scan: &RangeScan, pose: Pose) {
        self.ranges.retain(|_, (captured, _)| now.since(*captured) <= RANGED);
        let older = self.ranges.get(&scan.sensor).is_some_and(|(captured, _)| *captured > scan.captured);
        if older || (self.ranges.len() >= SENSORS && !self.ranges.contains_key(&scan.sensor)) {
            return;
        }
        let rays = scan.rays.iter().take(MOST_RAYS).filter(|ray| ray.is_valid());
        let places = rays.flat_map(|ray| ray.hits(pose)).filter(|place| place.distance(pose.position) <= SIGHT).collect();
        self.ranges.insert(scan.sensor, (scan.captured.min(now), places));
    }

    /// The places that count at `now` besides those of the newest grid.
    fn known(&self, now: Time) -> impl Iterator<Item = &EnuPosition> {
        let ranged = self.ranges.values().filter(move |(captured, _)| now.since(*captured) <= RANGED);
        let ranged = ranged.flat_map(|(_, places)| places);
        self.remembered.iter().chain(ranged)
    }

    /// Takes the position according to the motion estimate that depth and map are based on, and the heading.
    pub(super) fn motion(&mut self, now: Time, at: EnuPosition, heading: f64) {
        let finite = [at.east, at.north, at.up, heading].iter().all(|x| x.is_finite());
        self.motion = finite.then_some((now, at, heading));
    }

    /// Position and heading at `now` according to the motion estimate, for a craft that moves at `velocity`; `None` if
    /// the estimate is more than half a second old.
    pub(super) fn place(&self, now: Time, velocity: EnuVelocity, ahead: f64) -> Option<(EnuPosition, f64)> {
        let (told, at, heading) = self.motion.filter(|(told, ..)| now.since(*told) <= duration_from_secs(FRESH))?;
        let t = now.since(told).as_secs_f64() + ahead;
        let moved =
            EnuPosition { east: at.east + velocity.east * t, north: at.north + velocity.north * t, up: at.up + velocity.up * t };
        Some((moved, heading))
    }

    /// Length of a straight path that is allowed, metres, and whether it is outside the view of every working sensor.
    pub(super) fn way(&self, now: Time, limits: &BrakeLimits, motion: &Motion) -> (f64, bool) {
        if motion.velocity.speed() <= 0.0 {
            return (f64::INFINITY, false);
        }
        let seen = self.seen(now, limits);
        let along = direction(motion.velocity, 0.0);
        let points = seen.iter().flat_map(|seen| &seen.points).chain(self.known(now));
        let room = nearest(points, motion, along) - motion.radius - limits.margin;
        (room.max(0.0), !seen.is_some_and(|seen| shows(seen, motion, along)))
    }

    /// The newest grid, if the sensor works.
    fn seen(&self, now: Time, limits: &BrakeLimits) -> Option<&NewestGrid> {
        self.depth.as_ref().filter(|seen| now.since(seen.captured) < duration_from_secs(limits.max_depth_age))
    }

    /// The fraction of a motion that is allowed, 0..=1.
    pub(super) fn allowed(&self, now: Time, limits: &BrakeLimits, motion: &Motion) -> f64 {
        let speed = motion.velocity.speed();
        if speed <= 0.0 {
            return 1.0;
        }
        let seen = self.seen(now, limits);
        let mut most = speed;
        for along in motion.turns.map(|turn| direction(motion.velocity, turn)) {
            let points = seen.iter().flat_map(|seen| &seen.points).chain(self.known(now));
            let room = nearest(points, motion, along) - motion.radius - limits.margin;
            most = most.min(motion.braking.speed_within(room));
            if !seen.is_some_and(|seen| shows(seen, motion, along)) {
                most = most.min(limits.blind_speed.unwrap_or(f64::INFINITY));
            }
        }
        (most / speed).clamp(0.0, 1.0)
    }
}

/// Where in the image, from its top, the ground is looked for.
const LOW: f64 = 0.95;

/// Whether level ground `height` metres below would be in range somewhere in the image.
fn is_due(grid: &DepthGrid, pose: Pose, height: f64) -> bool {
    let corners = [(0.05, 0.05), (0.95, 0.05), (0.05, LOW), (0.5, LOW), (0.95, LOW)];
    corners.into_iter().any(|(u, v)| is_due_at(grid, pose, height, u, v))
}

/// Whether level ground `height` metres below would be in range at this place of the image.
fn is_due_at(grid: &DepthGrid, pose: Pose, height: f64, u: f64, v: f64) -> bool {
    let axes = CameraAxes::new(&grid.camera, Pose { position: EnuPosition::default(), ..pose });
    let ray = grid.camera.ray(spf_core::query::ImagePoint { u, v });
    let down = -axes.place(ray.right, 1.0, ray.up).up;
    down > 0.0 && height <= DUE * down
}

/// The fraction of the pixels with a value in each strip.
fn valid_in_strips(grid: &DepthGrid) -> [f64; STRIPS] {
    let width = grid.camera.width.max(1) as usize;
    let mut counts = [(0_u32, 0_u32); STRIPS];
    for row in grid.cm.chunks(width) {
        for (column, &cm) in row.iter().enumerate() {
            let (valid, all) = &mut counts[column * STRIPS / width];
            *valid += u32::from(cm > 0);
            *all += 1;
        }
    }
    counts.map(|(valid, all)| f64::from(valid) / f64::from(all.max(1)))
}

/// Unit vector of a velocity, turned clockwise.
pub(super) fn direction(velocity: EnuVelocity, turn: f64) -> [f64; 3] {
    let (sin, cos, speed) = (libm::sin(turn), libm::cos(turn), velocity.speed());
    [
        (velocity.east * cos + velocity.north * sin) / speed,
        (velocity.north * cos - velocity.east * sin) / speed,
        velocity.up / speed,
    ]
}

/// Distance along a direction of the nearest point in the body's corridor; infinite without one. What lies behind the craft's
/// middle, as seen in that direction, is left behind.
fn nearest<'a>(points: impl Iterator<Item = &'a EnuPosition>, motion: &Motion, along: [f64; 3]) -> f64 {
    let beside = motion.radius + BESIDE;
    let distance = |p: &EnuPosition| {
        let away = [p.east - motion.from.east, p.north - motion.from.north, p.up - motion.from.up];
        let ahead = away[0] * along[0] + away[1] * along[1] + away[2] * along[2];
        let squared = away[0] * away[0] + away[1] * away[1] + away[2] * away[2] - ahead * ahead;
        (ahead > 0.0 && ahead < SIGHT && squared < beside * beside).then_some(ahead)
    };
    points.filter_map(distance).fold(f64::INFINITY, f64::min)
}

/// Whether a grid's field of view covers the path: the place 2 m along it, with strips that work across the body's corridor there.
fn shows(seen: &NewestGrid, motion: &Motion, along: [f64; 3]) -> bool {
    let ahead = 2.0;
    let place = EnuPosition {
        east: motion.from.east + ahead * along[0],
        north: motion.from.north + ahead * along[1],
        up: motion.from.up + ahead * along[2],
    };
    if !seen.axes.shows(&seen.camera, place) {
        return false;
    }
    let CameraDisplacement { right, forward, up } = seen.axes.look(place);
    let beside = motion.radius + BESIDE;
    // An edge outside the image has no strip: the outermost one stands for it.
    let strip = |right: f64| {
        let u = seen.camera.project(right, forward, up).map_or(0.5, |point| point.u);
        ((u * STRIPS as f64).max(0.0) as usize).min(STRIPS - 1)
    };
    seen.strips[strip(right - beside)..=strip(right + beside)].iter().all(|works| *works)
}

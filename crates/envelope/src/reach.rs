//! How far a setpoint carries the craft before it can be stopped, and how much of it the limits allow.
//!
//! A setpoint cleared now moves the craft after the dead time and holds until its validity ends; only the zero that
//! follows, again after the dead time, brakes it: `reach(v) = v·(validity + dead time + lag) + v²/2a`, measured from
//! the position at which the setpoint takes effect. A velocity that would reach beyond a limit loses its outward
//! component (the craft slides along the limit); if that is not enough it is scaled down, at worst to zero, but never
//! reversed.

use super::cause::Cause;
use super::limits::Limits;
use crate::geofence::{Geofence, MapPoint};
use spf_core::command::Setpoint;
use spf_core::craft::Craft;
use spf_core::geometry::{BodyDisplacement, EnuPosition, EnuVelocity, Spread};

/// Points closer to an edge than this are on it, m.
const ON_EDGE: f64 = 1.0e-6;
/// Cosine of the angle to the direction back inside below which a ray may first lead away from the geofence: cos 45°.
const STRAIGHT_BACK: f64 = core::f64::consts::FRAC_1_SQRT_2;
/// Longest time between two setpoints, s.
const TICK: f64 = 0.2;
/// Limited speeds below this are set to zero, m/s.
const CREEP: f64 = 1.0e-6;

/// Motion towards one limit: delay before braking, and deceleration.
#[derive(Clone, Copy, Debug)]
pub(super) struct Braking {
    /// Validity, dead time and lag, s.
    delay: f64,
    /// Deceleration, m/s².
    acceleration: f64,
}

impl Braking {
    pub(super) fn new(limits: &Limits, craft: &Craft, acceleration: f64) -> Self {
        Self { delay: limits.setpoint_validity + craft.dead_time + craft.lag, acceleration: acceleration.max(0.01) }
    }

    /// The same for a craft that is told to hold within a tick.
    pub(super) fn stopping(craft: &Craft, acceleration: f64) -> Self {
        Self { delay: TICK + craft.dead_time + craft.lag, acceleration: acceleration.max(0.01) }
    }

    /// Distance that `speed` carries the craft, m.
    pub(super) fn reach(self, speed: f64) -> f64 {
        speed * self.delay + speed * speed / (2.0 * self.acceleration)
    }

    /// Maximum speed whose reach is at most `room` metres; zero without room.
    pub(super) fn speed_within(self, room: f64) -> f64 {
        if room == f64::INFINITY {
            return room;
        }
        if room > 0.0 {
            // v·T + v²/2a = d, solved without the cancellation of −T + √(T² + 2d/a).
            2.0 * room / (self.delay + libm::sqrt(self.delay * self.delay + 2.0 * room / self.acceleration))
        } else {
            0.0
        }
    }
}

/// The predicted state of the craft when a setpoint cleared now takes effect.
#[derive(Clone, Copy, Debug)]
pub(super) struct Situation {
    /// Position; `up` is the height above the take-off point.
    pub(super) at: EnuPosition,
    /// The take-off point.
    pub(super) home: EnuPosition,
    /// Clockwise from north.
    pub(super) heading: f64,
    /// Bound of the position error, which adds to the margin of every limit.
    pub(super) spread: Spread,
}

/// A horizontal limit as seen from one position along one direction.
struct Wall {
    /// Metres along the direction.
    distance: f64,
    /// Outward unit normal of the limit.
    out: MapPoint,
    /// Which limit.
    cause: Cause,
}

/// Reduces `setpoint` to the limits; also returns the first limit that applied. Speeds are already within their own
/// limits.
pub(super) fn confine(limits: &Limits, craft: &Craft, is: &Situation, setpoint: Setpoint) -> (Setpoint, Option<Cause>) {
    let (up, altitudes, mut cause) = confine_climb(limits, craft, is, setpoint.up);
    let mut limited = Setpoint { up, ..setpoint };
    let requested = map_velocity(setpoint, is.heading);
    if requested == (0.0, 0.0) {
        return (limited, cause);
    }
    let plane = Plane::new(limits, craft, is, altitudes, libm::hypot(requested.0, requested.1));
    let (mut v, mut changed) = plane.only_back(requested);
    // A corner has two sides, and a circle may meet a straight edge; whatever four corrections do not resolve is
    // scaled.
    for _ in 0..4 {
        let before = v;
        for wall in plane.walls(v).into_iter().flatten() {
            let slid = plane.slide(v, &wall);
            changed = changed.or((slid != v).then_some(wall.cause));
            v = slid;
        }
        if v == before {
            break;
        }
    }
    if dot(v, requested) <= 0.0 {
        v = (0.0, 0.0);
    }
    // The setpoint is in the body frame: while it holds, a turning craft sweeps all directions between first and last.
    let turned = setpoint.yaw_rate * (limits.setpoint_validity + craft.dead_time);
    let directions: &[f64] = if turned == 0.0 { &[0.0] } else { &[0.0, 0.5, 1.0] };
    let speed = libm::hypot(v.0, v.1);
    let mut allowed = speed;
    for part in directions {
        for wall in plane.walls(rotate(v, part * turned)).into_iter().flatten() {
            let within = plane.braking.speed_within(wall.distance - plane.margin + 0.5 * limits.margin);
            if within < allowed {
                allowed = within;
                changed = changed.or(Some(wall.cause));
            }
        }
    }
    if changed.is_some() {
        cause = cause.or(changed);
        let fraction = if allowed > CREEP { allowed / speed } else { 0.0 };
        v = (v.0 * fraction, v.1 * fraction);
        let (sin, cos) = (libm::sin(is.heading), libm::cos(is.heading));
        limited.right = v.0 * cos - v.1 * sin;
        limited.forward = v.0 * sin + v.1 * cos;
    }
    (limited, cause)
}

/// Relative error of the distance flown by a craft that measures it itself, as a fraction.
pub(super) const DISTANCE_ERROR: f64 = 0.1;
/// Cosine between a path and a limit's normal below which the path counts as parallel to the limit.
const ALONG: f64 = 0.05;

/// Shortens a straight path, given in the body frame, so that it stays inside the limits by the margin. Returns nothing
/// if it starts outside a limit.
pub(super) fn confine_path(
    limits: &Limits,
    craft: &Craft,
    is: &Situation,
    way: BodyDisplacement,
) -> (BodyDisplacement, Option<Cause>) {
    let height = is.at.up;
    let between = |floor: f64, ceiling: f64| {
        way.up.clamp(
            (floor + is.spread.vertical - height).min(0.0),
            ((ceiling - limits.margin - is.spread.vertical - height) / (1.0 + DISTANCE_ERROR)).max(0.0),
        )
    };
    let mut up = between(limits.min_altitude, limits.max_altitude);
    let mut cause = (up != way.up).then(|| vertical_limit(way.up));
    if let Some(fence) = &limits.geofence {
        let (floor, ceiling) = fence.band(is.at);
        let fenced = between(floor.max(limits.min_altitude), ceiling.min(limits.max_altitude));
        if fenced != up {
            (up, cause) = (fenced, cause.or(Some(Cause::GeofenceLimit)));
        }
    }
    let level = way.horizontal_length();
    let altitudes = (height.min(height + up) + limits.margin, height.max(height + up));
    let mut plane = Plane::new(limits, craft, is, altitudes, 0.0);
    plane.reach = level * (1.0 + DISTANCE_ERROR) + plane.margin / ALONG;
    let v = map_velocity(Setpoint { right: way.right, forward: way.forward, ..Setpoint::HOLD }, is.heading);
    if let (_, Some(outside)) = plane.only_back(v) {
        return (BodyDisplacement::default(), Some(outside));
    }
    let mut fraction = 1.0;
    for wall in plane.walls(v).into_iter().flatten() {
        let across = (dot(v, wall.out) / level).max(ALONG);
        let room = (wall.distance - plane.margin / across) / (1.0 + DISTANCE_ERROR);
        if room < fraction * level {
            fraction = (room / level).max(0.0);
            cause = cause.or(Some(wall.cause));
        }
    }
    (BodyDisplacement { right: way.right * fraction, forward: way.forward * fraction, up }, cause)
}

/// The limit that applies to a vertical motion.
fn vertical_limit(up: f64) -> Cause {
    if up < 0.0 { Cause::FloorLimit } else { Cause::AltitudeLimit }
}

/// The climb rate between floor and ceiling, the altitudes it may sweep, and the limit that applied.
fn confine_climb(limits: &Limits, craft: &Craft, is: &Situation, up: f64) -> (f64, (f64, f64), Option<Cause>) {
    let braking = Braking::new(limits, craft, craft.climb_acceleration);
    let height = is.at.up;
    let between = |floor: f64, ceiling: f64| {
        up.clamp(
            -braking.speed_within(height - floor - is.spread.vertical),
            braking.speed_within(ceiling - limits.margin - is.spread.vertical - height),
        )
    };
    let mut limited = between(limits.min_altitude, limits.max_altitude);
    let mut cause = (limited != up).then(|| vertical_limit(up));
    if let Some(fence) = &limits.geofence {
        let (floor, ceiling) = fence.band(is.at);
        let fenced = between(floor.max(limits.min_altitude), ceiling.min(limits.max_altitude));
        if fenced != limited {
            cause = cause.or(Some(Cause::GeofenceLimit));
            limited = fenced;
        }
    }
    let swept = height + limited.signum() * braking.reach(limited.abs());
    // A craft holding at its floor may be below it by the height error; that must not stop it from moving on.
    (limited, (height.min(swept) + limits.margin, height.max(swept)), cause)
}

/// The horizontal limits around one position.
struct Plane<'a> {
    at: MapPoint,
    home: MapPoint,
    max_distance: f64,
    margin: f64,
    fence: Option<&'a Geofence>,
    /// Altitudes that the craft may sweep.
    altitudes: (f64, f64),
    /// From outside the geofence: unit vector and distance back to it.
    back: Option<(MapPoint, f64)>,
    /// True if no polygon is open at the altitudes.
    closed: bool,
    braking: Braking,
    /// Distance up to which a geofence matters, m.
    reach: f64,
}

impl<'a> Plane<'a> {
    fn new(limits: &'a Limits, craft: &Craft, is: &Situation, altitudes: (f64, f64), speed: f64) -> Self {
        let braking = Braking::new(limits, craft, craft.acceleration);
        let at = (is.at.east, is.at.north);
        let mut plane = Self {
            at,
            home: (is.home.east, is.home.north),
            max_distance: limits.max_distance,
            margin: limits.margin + is.spread.horizontal,
            fence: limits.geofence.as_ref(),
            altitudes,
            back: None,
            closed: false,
            braking,
            reach: braking.reach(speed) + limits.margin + is.spread.horizontal,
        };
        if let Some(fence) = plane.fence.filter(|fence| !fence.allows(at, altitudes)) {
            match fence.nearest_inside(at, altitudes) {
                None => plane.closed = true,
                Some(to) => {
                    let (dx, dy) = (to.0 - at.0, to.1 - at.1);
                    let distance = libm::hypot(dx, dy);
                    // On the edge itself there is no direction back inside; the ray determines which side is free.
                    plane.back = (distance > ON_EDGE).then(|| ((dx / distance, dy / distance), distance));
                }
            }
        }
        plane
    }

    /// From outside a limit, the component that leads back inside; from inside, all of `v`.
    fn only_back(&self, v: MapPoint) -> (MapPoint, Option<Cause>) {
        let along = |v: MapPoint, unit: MapPoint| {
            let part = dot(v, unit).max(0.0);
            (unit.0 * part, unit.1 * part)
        };
        let (mut is, mut cause) = (v, None);
        let (x, y) = (self.at.0 - self.home.0, self.at.1 - self.home.1);
        let r = libm::hypot(x, y);
        if r > self.max_distance {
            (is, cause) = (along(is, (-x / r, -y / r)), Some(Cause::DistanceLimit));
        }
        if self.closed {
            (is, cause) = ((0.0, 0.0), Some(Cause::GeofenceLimit));
        } else if let Some((unit, _)) = self.back {
            (is, cause) = (along(is, unit), Some(Cause::GeofenceLimit));
        }
        (is, cause)
    }

    fn walls(&self, v: MapPoint) -> [Option<Wall>; 2] {
        let speed = libm::hypot(v.0, v.1);
        if speed == 0.0 {
            return [None, None];
        }
        let along = (v.0 / speed, v.1 / speed);
        [self.distance_wall(along), self.fence_wall(along)]
    }

    /// Where the ray leaves the circle around the take-off point. From outside, a ray leading back in is free up to the
    /// far side; every other is blocked.
    fn distance_wall(&self, along: MapPoint) -> Option<Wall> {
        if self.max_distance == f64::INFINITY {
            return None;
        }
        let from = (self.at.0 - self.home.0, self.at.1 - self.home.1);
        let radial = dot(from, along);
        let inside = self.max_distance * self.max_distance - dot(from, from);
        // t² + 2·radial·t − inside = 0; the far root is where the ray leaves the circle.
        let discriminant = radial * radial + inside;
        let distance = if inside < 0.0 && (radial >= 0.0 || discriminant <= 0.0) {
            0.0
        } else {
            (libm::sqrt(discriminant.max(0.0)) - radial).max(0.0)
        };
        let exit = (from.0 + along.0 * distance, from.1 + along.1 * distance);
        let r = libm::hypot(exit.0, exit.1);
        let out = if r > 0.0 { (exit.0 / r, exit.1 / r) } else { along };
        Some(Wall { distance, out, cause: Cause::DistanceLimit })
    }

    fn fence_wall(&self, along: MapPoint) -> Option<Wall> {
        let fence = self.fence?;
        let cause = Cause::GeofenceLimit;
        let Some((unit, gap)) = self.back else {
            let exit = fence.exit(self.at, along, self.altitudes, self.reach)?;
            return Some(Wall { distance: exit.distance, out: exit.out, cause });
        };
        // Turning while coming back: at least half of it must still lead back.
        let back = dot(along, unit);
        if back < 0.5 {
            return Some(Wall { distance: 0.0, out: along, cause });
        }
        // A ray nearly straight back enters the fence and may leave it on another side.
        let within = gap / back + 2.0 * ON_EDGE;
        let entry = (self.at.0 + along.0 * within, self.at.1 + along.1 * within);
        if back > STRAIGHT_BACK && fence.allows(entry, self.altitudes) {
            let exit = fence.exit(entry, along, self.altitudes, self.reach)?;
            return Some(Wall { distance: within + exit.distance, out: exit.out, cause });
        }
        // Any other ray may miss it: up to here it is at least no farther from the nearest edge point.
        Some(Wall { distance: 2.0 * gap * back, out: along, cause })
    }

    /// `v` with its outward component reduced so that it can stop the margin before the wall.
    fn slide(&self, v: MapPoint, wall: &Wall) -> MapPoint {
        let speed = libm::hypot(v.0, v.1);
        let outwards = dot(v, wall.out);
        if speed == 0.0 || outwards <= 0.0 {
            return v;
        }
        let across = wall.distance * outwards / speed;
        let excess = outwards - self.braking.speed_within(across - self.margin);
        if excess > 0.0 { (v.0 - excess * wall.out.0, v.1 - excess * wall.out.1) } else { v }
    }
}

fn dot(a: MapPoint, b: MapPoint) -> f64 {
    a.0 * b.0 + a.1 * b.1
}

/// The horizontal part of a setpoint as east and north.
pub(super) fn map_velocity(setpoint: Setpoint, heading: f64) -> (f64, f64) {
    let (sin, cos) = (libm::sin(heading), libm::cos(heading));
    (setpoint.right * cos + setpoint.forward * sin, setpoint.forward * cos - setpoint.right * sin)
}

/// The setpoint in the world frame.
pub(super) fn world_velocity(setpoint: Setpoint, heading: f64) -> EnuVelocity {
    let (east, north) = map_velocity(setpoint, heading);
    EnuVelocity { east, north, up: setpoint.up }
}

/// `v` turned clockwise.
fn rotate(v: (f64, f64), angle: f64) -> (f64, f64) {
    let (sin, cos) = (libm::sin(angle), libm::cos(angle));
    (v.0 * cos + v.1 * sin, v.1 * cos - v.0 * sin)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn standstill_is_dead_time_plus_v_over_a_or_longer() {
        // Quad at 3 m/s: 0.1 + 3/4 = 0.85 s by the acceleration limit; the lag's tail below 1.2 m/s takes 0.3·ln 12 =
        // 0.745 s instead of 0.3 s: 0.1 + 0.45 + 0.745 = 1.295 s.
        assert!((Craft::quad().standstill_time(3.0) - 1.295).abs() < 1e-3);
        // Tello at 1 m/s: 0.35 + (1 − 0.31)/1.55 + 0.2·ln 3.1 = 0.35 + 0.445 + 0.226 = 1.021 s.
        assert!((Craft::tello().standstill_time(1.0) - 1.021).abs() < 1e-3);
        assert_eq!(Craft::quad().standstill_time(0.0), 0.1);
        assert!(Craft::quad().standstill_time(0.05) >= 0.1);
    }

    #[test]
    fn speed_within_inverts_the_reach() {
        let braking = Braking { delay: 0.9, acceleration: 4.0 };
        // 3·0.9 + 9/8 = 3.825 m.
        assert!((braking.speed_within(3.825) - 3.0).abs() < 1e-12);
        assert_eq!((braking.speed_within(0.0), braking.speed_within(-1.0)), (0.0, 0.0));
        assert_eq!(braking.speed_within(f64::INFINITY), f64::INFINITY);
    }
}

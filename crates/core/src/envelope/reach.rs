//! How far a setpoint carries the craft before it can be stopped, and how much of it the limits leave.
//!
//! A setpoint that is cleared now moves the craft after the dead time, holds until its validity ends, and only the zero that
//! follows, again after the dead time, brakes it: `reach(v) = v·(validity + dead time + lag) + v²/2a`, counted from where the
//! craft will be when the setpoint takes effect. What would reach beyond a limit loses the part of it that points out
//! (it slides along the limit), and what still would is scaled down, to zero at worst: never reversed.

use super::cause::Cause;
use super::limits::Limits;
use crate::command::Setpoint;
use crate::craft::Craft;
use crate::geometry::{EnuPosition, EnuVelocity};

/// Speed below which a craft counts as standing still, m/s (the pilot's own figure for the next frame).
const STANDSTILL: f64 = 0.1;

impl Craft {
    /// From the zero setpoint to standstill (below 0.1 m/s) at `speed` m/s, s: the dead time plus v/a, and where the
    /// first-order lag takes longer over its last part than the acceleration limit would, that time (DESIGN.md section 4,
    /// "Safety").
    #[must_use]
    pub fn standstill_time(&self, speed: f64) -> f64 {
        let (speed, a) = (speed.abs(), self.acceleration.max(0.01));
        // The craft slows by min(a, v/lag): at the limit down to a·lag, exponentially from there.
        let knee = (a * self.lag).min(speed);
        let tail = if knee > STANDSTILL { self.lag * libm::log(knee / STANDSTILL) } else { 0.0 };
        self.dead_time + (speed / a).max((speed - knee) / a + tail)
    }
}

/// Motion towards one limit: how long it goes on unbraked, and how hard it brakes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Braking {
    /// Validity, dead time and lag, s.
    delay: f64,
    /// Deceleration, m/s².
    acceleration: f64,
}

impl Braking {
    fn new(limits: &Limits, craft: &Craft, acceleration: f64) -> Self {
        Self { delay: limits.setpoint_validity + craft.dead_time + craft.lag, acceleration: acceleration.max(0.01) }
    }

    /// The greatest speed whose reach is no longer than `room` metres; zero without room.
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

/// Where the craft will be when a setpoint that is cleared now takes effect.
#[derive(Clone, Copy, Debug)]
pub(super) struct Situation {
    /// On the map, and `up` as height above the take-off point.
    pub(super) at: EnuPosition,
    /// The take-off point.
    pub(super) home: EnuPosition,
    /// Clockwise from north.
    pub(super) heading: f64,
}

/// A limit on the map seen from one place along one direction.
struct Wall {
    /// Metres along the direction.
    distance: f64,
    /// Unit vector across the limit, pointing out.
    out: (f64, f64),
}

/// What `confine` leaves of `setpoint`, with the first limit that took something. Speeds are already within their limits.
pub(super) fn confine(limits: &Limits, craft: &Craft, is: &Situation, setpoint: Setpoint) -> (Setpoint, Option<Cause>) {
    let mut cause = None;
    let mut limited = setpoint;

    let vertical = Braking::new(limits, craft, craft.climb_acceleration);
    let (floor, ceiling) = (limits.min_altitude, limits.max_altitude - limits.margin);
    let up = setpoint.up.clamp(-vertical.speed_within(is.at.up - floor), vertical.speed_within(ceiling - is.at.up));
    if up != setpoint.up {
        limited.up = up;
        cause = Some(Cause::AltitudeLimit);
    }

    let asked = map_velocity(setpoint, is.heading);
    if asked == (0.0, 0.0) {
        return (limited, cause);
    }
    let braking = Braking::new(limits, craft, craft.acceleration);
    let mut v = asked;
    // A corner has two sides and a round limit may meet a straight one; what four corrections do not settle is scaled.
    for _ in 0..4 {
        let before = v;
        if let Some(wall) = distance_wall(limits, is, v) {
            v = slide(v, &wall, braking, limits.margin);
            if v != before {
                cause = cause.or(Some(Cause::DistanceLimit));
            }
        }
        if v == before {
            break;
        }
    }
    if v.0 * asked.0 + v.1 * asked.1 <= 0.0 {
        v = (0.0, 0.0);
    }
    // The setpoint is in the body frame: while it holds, a turning craft flies every direction between the first and last.
    let turned = setpoint.yaw_rate * (limits.setpoint_validity + craft.dead_time);
    let mut share = 1.0_f64;
    let speed = libm::hypot(v.0, v.1);
    for part in if turned == 0.0 { &[0.0][..] } else { &[0.0, 0.5, 1.0][..] } {
        if speed == 0.0 {
            break;
        }
        let along = rotate(v, part * turned);
        if let Some(wall) = distance_wall(limits, is, along) {
            let allowed = braking.speed_within(wall.distance - 0.5 * limits.margin);
            if allowed < speed * share {
                share = allowed / speed;
                cause = cause.or(Some(Cause::DistanceLimit));
            }
        }
    }
    v = (v.0 * share, v.1 * share);
    if v != asked {
        let (sin, cos) = (libm::sin(is.heading), libm::cos(is.heading));
        limited.right = v.0 * cos - v.1 * sin;
        limited.forward = v.0 * sin + v.1 * cos;
    }
    (limited, cause)
}

/// The horizontal part of a setpoint as east and north.
pub(super) fn map_velocity(setpoint: Setpoint, heading: f64) -> (f64, f64) {
    let (sin, cos) = (libm::sin(heading), libm::cos(heading));
    (setpoint.right * cos + setpoint.forward * sin, setpoint.forward * cos - setpoint.right * sin)
}

/// The setpoint in the world.
pub(super) fn world_velocity(setpoint: Setpoint, heading: f64) -> EnuVelocity {
    let (east, north) = map_velocity(setpoint, heading);
    EnuVelocity { east, north, up: setpoint.up }
}

/// `v` turned clockwise.
fn rotate(v: (f64, f64), angle: f64) -> (f64, f64) {
    let (sin, cos) = (libm::sin(angle), libm::cos(angle));
    (v.0 * cos + v.1 * sin, v.1 * cos - v.0 * sin)
}

/// `v` with the part that points out of the wall no faster than can be stopped `margin` before it.
fn slide(v: (f64, f64), wall: &Wall, braking: Braking, margin: f64) -> (f64, f64) {
    let speed = libm::hypot(v.0, v.1);
    let outwards = v.0 * wall.out.0 + v.1 * wall.out.1;
    if speed == 0.0 || outwards <= 0.0 {
        return v;
    }
    let across = wall.distance * outwards / speed;
    let excess = outwards - braking.speed_within(across - margin);
    if excess > 0.0 { (v.0 - excess * wall.out.0, v.1 - excess * wall.out.1) } else { v }
}

/// The distance limit along `v`: where the ray leaves the circle about the take-off point. From outside, a way back in counts
/// as free and every other as blocked.
fn distance_wall(limits: &Limits, is: &Situation, v: (f64, f64)) -> Option<Wall> {
    let speed = libm::hypot(v.0, v.1);
    if limits.max_distance == f64::INFINITY || speed == 0.0 {
        return None;
    }
    let (x, y) = (is.at.east - is.home.east, is.at.north - is.home.north);
    let r = libm::hypot(x, y);
    let (dx, dy) = (v.0 / speed, v.1 / speed);
    let radial = x * dx + y * dy;
    let inside = limits.max_distance * limits.max_distance - r * r;
    // t² + 2·radial·t − inside = 0; the far root is where the ray leaves the circle.
    let discriminant = radial * radial + inside;
    if inside < 0.0 && (radial >= 0.0 || discriminant <= 0.0) {
        let r = r.max(f64::MIN_POSITIVE);
        return Some(Wall { distance: 0.0, out: (x / r, y / r) });
    }
    let distance = libm::sqrt(discriminant.max(0.0)) - radial;
    // Near the middle the nearest part of the circle says little about the way out; the exit point always does.
    let (ex, ey) = (x + dx * distance, y + dy * distance);
    let e = libm::hypot(ex, ey).max(f64::MIN_POSITIVE);
    Some(Wall { distance, out: (ex / e, ey / e) })
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

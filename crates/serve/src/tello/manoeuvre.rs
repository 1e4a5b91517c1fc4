//! Autonomous flight of a move, a turn or a curve: towards the next point of a path, ending at rest.
//!
//! The craft's dead time would make a simple controller oscillate, so this one controls the predicted rest position
//! after all pending commands have taken effect.

use std::collections::VecDeque;

use spf_core::command::Setpoint;
use spf_core::geometry::{BodyDisplacement, EnuPosition, EnuVelocity, wrap_angle};
use spf_core::time::{Duration, Time, duration_from_secs};
use spf_sim::craft::SimCraft;

use super::command::Offset;

/// Control interval.
pub(super) const CONTROL: Duration = Duration::from_millis(20);
const CONTROL_SECONDS: f64 = 0.02;
/// Deceleration used for planning, m/s²: below the craft's limit.
const BRAKE: f64 = 0.8;
/// Speed per metre of remaining distance, 1/s.
const GAIN: f64 = 3.0;
/// Arrival thresholds: distance, metres, and speed, m/s.
const NEAR: f64 = 0.03;
const SLOW: f64 = 0.08;
/// The same for turns, radians and rad/s.
const NEAR_TURN: f64 = 0.02;
const SLOW_TURN: f64 = 0.1;
/// Distance at which a point on the path counts as passed, metres.
const PASSED: f64 = 0.15;
/// Distance between points of a curve, metres.
const CURVE_STEP: f64 = 0.1;

/// Commands that have not taken effect yet.
#[derive(Clone, Debug, Default)]
pub(super) struct PendingSetpoints(VecDeque<(Time, EnuVelocity, f64)>);

impl PendingSetpoints {
    fn push(&mut self, now: Time, velocity: EnuVelocity, yaw_rate: f64) {
        self.0.push_back((now, velocity, yaw_rate));
    }

    /// Displacement and turn still to come from them.
    fn still_coming(&mut self, now: Time, dead_time: Duration) -> (EnuVelocity, f64) {
        while self.0.front().is_some_and(|(at, ..)| *at + dead_time <= now) {
            self.0.pop_front();
        }
        self.0.iter().fold((EnuVelocity::default(), 0.0), |(sum, turn), (_, v, rate)| {
            let sum = EnuVelocity {
                east: sum.east + v.east * CONTROL_SECONDS,
                north: sum.north + v.north * CONTROL_SECONDS,
                up: sum.up + v.up * CONTROL_SECONDS,
            };
            (sum, turn + rate * CONTROL_SECONDS)
        })
    }
}

/// The remaining path.
#[derive(Clone, Debug)]
enum PathKind {
    /// Through points, stopping at the last one.
    Through { points: VecDeque<EnuPosition>, speed: f64 },
    /// Turn on the spot, radians clockwise remaining.
    Turn { left: f64, rate: f64, heading: f64 },
}

/// A manoeuvre in progress.
#[derive(Clone, Debug)]
pub(super) struct Manoeuvre {
    way: PathKind,
    pending: PendingSetpoints,
    give_up: Time,
}

/// The next action.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Step {
    Fly(Setpoint),
    Done,
    GivenUp,
}

impl Manoeuvre {
    /// Flies from the craft's position to the last of `points` (at least one), at most at this speed.
    pub(super) fn through(now: Time, craft: &SimCraft, points: VecDeque<EnuPosition>, speed: f64, patience: f64) -> Self {
        let mut from = craft.dynamics().pose().position;
        let mut way = 0.0;
        for point in &points {
            way += from.distance(*point);
            from = *point;
        }
        let give_up = now + duration_from_secs(way / speed.max(0.01) + patience);
        Self { way: PathKind::Through { points, speed }, pending: PendingSetpoints::default(), give_up }
    }

    /// A turn, radians clockwise.
    pub(super) fn turn(now: Time, craft: &SimCraft, angle: f64, rate: f64, patience: f64) -> Self {
        let heading = craft.dynamics().pose().attitude.heading;
        let give_up = now + duration_from_secs(angle.abs() / rate + patience);
        Self { way: PathKind::Turn { left: angle, rate, heading }, pending: PendingSetpoints::default(), give_up }
    }

    /// The next correction; call every [`CONTROL`].
    pub(super) fn step(&mut self, now: Time, craft: &SimCraft) -> Step {
        if now >= self.give_up {
            return Step::GivenUp;
        }
        let figures = craft.dynamics().model().craft;
        let (to_come, turn_to_come) = self.pending.still_coming(now, duration_from_secs(figures.dead_time));
        let pose = craft.dynamics().pose();
        let heading = pose.attitude.heading;
        let setpoint = match &mut self.way {
            PathKind::Turn { left, rate, heading: before } => {
                *left -= wrap_angle(heading - *before);
                *before = heading;
                let turning = craft.dynamics().yaw_rate();
                let rest = *left - stopping(turning, figures.yaw_acceleration, figures.lag) - turn_to_come;
                if rest.abs() < NEAR_TURN && turning.abs() < SLOW_TURN {
                    return Step::Done;
                }
                Setpoint { yaw_rate: (GAIN * rest).clamp(-*rate, *rate), ..Setpoint::HOLD }
            }
            PathKind::Through { points, speed } => {
                let velocity = craft.dynamics().velocity();
                let stop = |v| stopping(v, figures.acceleration, figures.lag);
                let rest_at = EnuPosition {
                    east: pose.position.east + stop(velocity.east) + to_come.east,
                    north: pose.position.north + stop(velocity.north) + to_come.north,
                    up: pose.position.up + stop(velocity.up) + to_come.up,
                };
                while points.len() > 1 && points.front().is_some_and(|point| rest_at.distance(*point) < PASSED) {
                    points.pop_front();
                }
                let Some(target) = points.front() else { return Step::Done };
                let missing = rest_at.displacement_to(*target, heading);
                let length = missing.length();
                if points.len() == 1 && length < NEAR && velocity.speed() < SLOW {
                    return Step::Done;
                }
                let wanted =
                    if points.len() > 1 { *speed } else { speed.min(GAIN * length).min(libm::sqrt(2.0 * BRAKE * length)) };
                towards(missing, wanted / length.max(1e-9))
            }
        };
        let (sin, cos) = (libm::sin(heading), libm::cos(heading));
        let velocity = EnuVelocity {
            east: setpoint.right * cos + setpoint.forward * sin,
            north: setpoint.forward * cos - setpoint.right * sin,
            up: setpoint.up,
        };
        self.pending.push(now, velocity, setpoint.yaw_rate);
        Step::Fly(setpoint)
    }
}

fn towards(missing: BodyDisplacement, fraction: f64) -> Setpoint {
    Setpoint { right: missing.right * fraction, forward: missing.forward * fraction, up: missing.up * fraction, yaw_rate: 0.0 }
}

/// Distance to standstill after zero takes effect: at the acceleration limit, then exponentially.
fn stopping(velocity: f64, limit: f64, lag: f64) -> f64 {
    let (speed, bends) = (velocity.abs(), limit * lag);
    let way = if speed <= bends { speed * lag } else { 0.5 * (speed * speed - bends * bends) / limit + bends * lag };
    way.copysign(velocity)
}

/// The position at an offset in the craft's axes, with its current heading.
pub(super) fn place(craft: &SimCraft, offset: Offset, fraction: f64) -> EnuPosition {
    let pose = craft.dynamics().pose();
    let metres = |cm: i32| f64::from(cm) * 0.01 * fraction;
    let displacement = BodyDisplacement { forward: metres(offset.x), right: -metres(offset.y), up: metres(offset.z) };
    pose.position.displaced(displacement, pose.attitude.heading)
}

/// Offsets along the arc from the origin through `via` to `to`; `None` if they are collinear or the radius is not
/// within 0.5 and 10 m.
pub(super) fn arc(via: Offset, to: Offset) -> Option<Vec<Offset>> {
    let vector = |offset: Offset| glam::DVec3::new(f64::from(offset.x), f64::from(offset.y), f64::from(offset.z)) * 0.01;
    let (b, c) = (vector(via), vector(to));
    let normal = b.cross(c);
    let area = normal.length_squared();
    if area < 1e-6 {
        return None;
    }
    // Centre of the circle through the origin, b and c.
    let centre = (normal.cross(b) * c.length_squared() + c.cross(normal) * b.length_squared()) / (2.0 * area);
    let radius = centre.length();
    if !(0.5..=10.0).contains(&radius) {
        return None;
    }
    let (ahead, axis) = (-centre / radius, normal / libm::sqrt(area));
    let aside = axis.cross(ahead);
    let angle = |point: glam::DVec3| {
        let from_centre = point - centre;
        let angle = libm::atan2(from_centre.dot(aside), from_centre.dot(ahead));
        if angle < 0.0 { angle + core::f64::consts::TAU } else { angle }
    };
    let whole = angle(c);
    let steps = libm::ceil(whole * radius / CURVE_STEP).max(2.0) as usize;
    let offset = |step: usize| {
        let at = whole * step as f64 / steps as f64;
        let point = centre + (ahead * libm::cos(at) + aside * libm::sin(at)) * radius;
        let cm = |metres: f64| libm::round(metres * 100.0) as i32;
        Offset { x: cm(point.x), y: cm(point.y), z: cm(point.z) }
    };
    Some((1..=steps).map(offset).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_arc_passes_its_points_at_its_radius() {
        // A half circle of radius 1 m to the left: through (1, 1) to (0, 2).
        let points = arc(Offset { x: 100, y: 100, z: 0 }, Offset { x: 0, y: 200, z: 0 }).unwrap();
        let last = points[points.len() - 1];
        assert!((last.x).abs() <= 1 && (last.y - 200).abs() <= 1);
        assert!(points.iter().any(|point| (point.x - 100).abs() < 8 && (point.y - 100).abs() < 8), "{points:?}");
        for point in points {
            let radius = (f64::from(point.x).powi(2) + f64::from(point.y - 100).powi(2)).sqrt();
            assert!((radius - 100.0).abs() < 2.0, "{point:?}");
        }
        assert_eq!(arc(Offset { x: 100, y: 0, z: 0 }, Offset { x: 200, y: 0, z: 0 }), None, "on a line");
        assert_eq!(arc(Offset { x: 20, y: 20, z: 0 }, Offset { x: 0, y: 40, z: 0 }), None, "too tight");
    }
}

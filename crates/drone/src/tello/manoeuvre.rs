//! `go`, `cw`, `ccw`: moves that the drone ends by itself, and `stop`, which ends one early (SDK 2.0).

use spf_core::command::{Manoeuvre, Setpoint};
use spf_core::time::{Duration, Time};

use super::conversation::Order;

/// The drone refuses a move within this time after an `rc` command (`error Not joystick`).
const STICKS_REST: Duration = Duration::from_millis(500);
/// A move not sent within this time after it was cleared is dropped.
const STALE: Duration = Duration::from_millis(2500);
/// Minimum duration of a move.
const EARLIEST: Duration = Duration::from_millis(300);
/// Response timeout: the drone aborts a move after 15 s or more of its own.
const ANSWERED: Duration = Duration::from_secs(22);
/// Number of times `stop` is sent until it is answered, and their interval.
const STOPS: u32 = 5;
const STOP_AGAIN: Duration = Duration::from_millis(250);

/// Stage of a move.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stage {
    /// Waiting until the sticks have rested.
    Resting,
    /// Queued or sent.
    Submitted,
    /// `stop` was sent.
    Stopping,
}

/// A move in progress.
#[derive(Clone, Debug)]
pub(super) struct Move {
    pub(super) text: String,
    pub(super) stage: Stage,
    pub(super) cleared: Time,
    /// When it must have ended.
    pub(super) valid_until: Time,
    /// Its velocity as a setpoint.
    pub(super) velocity: Setpoint,
}

impl Move {
    /// Creates a move; `None` if it is too small for the drone: within 20 cm on every axis, or under a degree.
    pub(super) fn new(manoeuvre: Manoeuvre, now: Time, valid_until: Time, turn_rate: f64) -> Option<Self> {
        let text = words(manoeuvre)?;
        Some(Self { text, stage: Stage::Resting, cleared: now, valid_until, velocity: manoeuvre.velocity(turn_rate) })
    }

    /// When it may be sent.
    pub(super) fn due(&self) -> Time {
        self.cleared + STICKS_REST
    }

    /// Whether it has waited too long to be sent.
    pub(super) fn is_stale(&self, now: Time) -> bool {
        now.since(self.cleared) > STALE
    }

    pub(super) fn order(&self) -> Order {
        Order::motion(&self.text, EARLIEST, ANSWERED)
    }
}

pub(super) const STOP: &str = "stop";

pub(super) fn stop() -> Order {
    Order { repeats: STOPS - 1, timeout: STOP_AGAIN, ..Order::quick(STOP) }
}

/// The SDK command: whole degrees; centimetres forward, left and up.
fn words(manoeuvre: Manoeuvre) -> Option<String> {
    match manoeuvre {
        Manoeuvre::Turn { angle } => {
            let degrees = libm::round(angle.to_degrees().abs()).min(360.0) as i32;
            let verb = if angle > 0.0 { "cw" } else { "ccw" };
            (degrees >= 1).then(|| format!("{verb} {degrees}"))
        }
        Manoeuvre::Go { displacement, speed } => {
            let most = 100.0 * Manoeuvre::MAX_DISPLACEMENT;
            let cm = |metres: f64| libm::round(100.0 * metres).clamp(-most, most) as i32;
            let (x, y, z) = (cm(displacement.forward), cm(-displacement.right), cm(displacement.up));
            let least = cm(Manoeuvre::MIN_DISPLACEMENT);
            let large_enough = [x, y, z].iter().any(|part| part.abs() >= least);
            // Rounded down, so that it is no faster than cleared.
            let speed = libm::floor(100.0 * speed + 1e-6).clamp(10.0, 100.0) as i32;
            large_enough.then(|| format!("go {x} {y} {z} {speed}"))
        }
    }
}

#[cfg(test)]
mod tests {
    use spf_core::geometry::BodyDisplacement;

    use super::*;

    #[test]
    fn hand_worked_words() {
        let go =
            |right, forward, up, speed| words(Manoeuvre::Go { displacement: BodyDisplacement { right, forward, up }, speed });
        // Forward, left, up.
        assert_eq!(go(0.3, 1.5, -0.25, 0.8).as_deref(), Some("go 150 -30 -25 80"));
        assert_eq!(go(0.0, 9.0, 0.0, 3.0).as_deref(), Some("go 500 0 0 100"));
        assert_eq!(go(0.0, 0.2, 0.0, 0.01).as_deref(), Some("go 20 0 0 10"));
        assert_eq!(go(0.19, 0.19, -0.19, 1.0), None);
        let turn = |degrees: f64| words(Manoeuvre::Turn { angle: degrees.to_radians() });
        assert_eq!(turn(-89.6).as_deref(), Some("ccw 90"));
        assert_eq!(turn(12.0).as_deref(), Some("cw 12"));
        assert_eq!(turn(0.4), None);
        assert_eq!(go(f64::NAN, 0.1, 0.0, 1.0), None);
    }
}

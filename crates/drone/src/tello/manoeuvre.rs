//! `go`, `cw`, `ccw`: moves that the drone ends by itself, and `stop`, which ends one early (SDK 2.0).

use spf_core::command::{Manoeuvre, Setpoint};
use spf_core::time::{Duration, Time};

use super::conversation::Order;

/// The drone refuses a move as long as sticks were told a moment ago (`error Not joystick`).
const STICKS_REST: Duration = Duration::from_millis(500);
/// A move that was not said by then after it was cleared is no longer wanted.
const STALE: Duration = Duration::from_millis(2500);
/// No move is over sooner.
const EARLIEST: Duration = Duration::from_millis(300);
/// The drone gives a move up after 15 s and more by its own clock.
const ANSWERED: Duration = Duration::from_secs(22);
/// `stop` is said so often, this far apart, until it is answered.
const STOPS: u32 = 5;
const STOP_AGAIN: Duration = Duration::from_millis(250);

/// Where a move is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stage {
    /// Until the sticks have rested.
    Resting,
    /// Among what is to be said.
    Submitted,
    /// `stop` was said.
    Stopping,
}

/// A move under way.
#[derive(Clone, Debug)]
pub(super) struct Move {
    pub(super) text: String,
    pub(super) stage: Stage,
    pub(super) cleared: Time,
    /// When it has to have ended.
    pub(super) valid_until: Time,
    /// What its velocity is, as a setpoint.
    pub(super) velocity: Setpoint,
}

impl Move {
    /// None of one that the drone could not be told, within 20 cm on every axis or under a degree.
    pub(super) fn new(manoeuvre: Manoeuvre, now: Time, valid_until: Time, turn_rate: f64) -> Option<Self> {
        let text = words(manoeuvre)?;
        Some(Self { text, stage: Stage::Resting, cleared: now, valid_until, velocity: manoeuvre.velocity(turn_rate) })
    }

    /// When it may be said.
    pub(super) fn due(&self) -> Time {
        self.cleared + STICKS_REST
    }

    /// Whether it waited too long to be said.
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

/// The SDK's words: whole degrees, and centimetres ahead, to the left and up.
fn words(manoeuvre: Manoeuvre) -> Option<String> {
    match manoeuvre {
        Manoeuvre::Turn { angle } => {
            let degrees = libm::round(angle.to_degrees().abs()).min(360.0) as i32;
            let verb = if angle > 0.0 { "cw" } else { "ccw" };
            (degrees >= 1).then(|| format!("{verb} {degrees}"))
        }
        Manoeuvre::Go { displacement, speed } => {
            let most = 100.0 * Manoeuvre::MOST_WAY;
            let cm = |metres: f64| libm::round(100.0 * metres).clamp(-most, most) as i32;
            let (x, y, z) = (cm(displacement.forward), cm(-displacement.right), cm(displacement.up));
            let least = cm(Manoeuvre::LEAST_WAY);
            let told = [x, y, z].iter().any(|part| part.abs() >= least);
            // Rounded down: no faster than was cleared, where that can be told.
            let speed = libm::floor(100.0 * speed + 1e-6).clamp(10.0, 100.0) as i32;
            told.then(|| format!("go {x} {y} {z} {speed}"))
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
        // Ahead, to the left, up.
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

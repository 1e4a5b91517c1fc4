//! `rc` commands: stick positions, and when to send them.
//!
//! A Tello holds the last stick positions until it gets new ones, so a zero must not get lost: it is sent three times.
//! In flight something is sent at least every [`PERIOD`], which also prevents the drone's own landing after 15 s
//! without a command.

use spf_core::command::Setpoint;
use spf_core::time::{Duration, Time};

/// Maximum interval between two `rc` commands.
pub const PERIOD: Duration = Duration::from_millis(80);
/// Minimum interval between two `rc` commands.
const LEAST: Duration = Duration::from_millis(20);
/// Interval between the copies of a zero.
const COPIES: Duration = Duration::from_millis(30);
/// Number of copies of a zero before it is only repeated every [`PERIOD`].
const ZEROS: u32 = 3;

/// Velocities at full stick. SI units and radians.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Calibration {
    /// Horizontal speed, m/s.
    pub speed: f64,
    /// Climb rate, m/s.
    pub climb: f64,
    /// Descent rate, m/s.
    pub sink: f64,
    /// Yaw rate, rad/s.
    pub yaw_rate: f64,
}

impl Default for Calibration {
    /// The common interpretation that `rc` is in cm/s, with the yaw rate found by most measurements; the vendor
    /// publishes none.
    fn default() -> Self {
        Self { speed: 1.0, climb: 1.0, sink: 0.8, yaw_rate: 95.0_f64.to_radians() }
    }
}

impl Calibration {
    /// Stick positions for a setpoint: right, forward, up, clockwise, each -100 to 100.
    #[must_use]
    pub fn sticks(&self, setpoint: Setpoint) -> [i8; 4] {
        let vertical = if setpoint.up > 0.0 { self.climb } else { self.sink };
        let fraction = |value: f64, full: f64| {
            let fraction = 100.0 * value / full;
            // NaN must not become full stick.
            if fraction.is_finite() { libm::round(fraction.clamp(-100.0, 100.0)) as i8 } else { 0 }
        };
        [
            fraction(setpoint.right, self.speed),
            fraction(setpoint.forward, self.speed),
            fraction(setpoint.up, vertical),
            fraction(setpoint.yaw_rate, self.yaw_rate),
        ]
    }
}

/// The stick positions over time. Sans-IO.
#[derive(Clone, Debug, Default)]
pub struct Sticks {
    wanted: Option<([i8; 4], Time)>,
    last_sent: Option<([i8; 4], Time)>,
    zeros: u32,
}

impl Sticks {
    /// Holds these positions from `now` until `valid_until`; then zero.
    pub fn set(&mut self, sticks: [i8; 4], valid_until: Time) {
        self.wanted = Some((sticks, valid_until));
    }

    /// Holds zero from `now` on and sends all repetitions of it again, even if zero was sent already.
    pub fn zero(&mut self, now: Time) {
        self.set([0; 4], now);
        self.zeros = 0;
    }

    /// Stops sending.
    pub fn release(&mut self) {
        *self = Self::default();
    }

    fn due(&self, now: Time) -> Option<([i8; 4], Time)> {
        let (sticks, valid_until) = self.wanted?;
        let sticks = if now < valid_until { sticks } else { [0; 4] };
        let Some((last_sent, at)) = self.last_sent else { return Some((sticks, now)) };
        let after = if last_sent != sticks {
            LEAST
        } else if sticks == [0; 4] && self.zeros < ZEROS {
            COPIES
        } else {
            PERIOD
        };
        Some((sticks, at + after))
    }

    /// The next command to send, if due.
    pub fn poll(&mut self, now: Time) -> Option<String> {
        let (sticks, _) = self.due(now).filter(|(_, at)| *at <= now)?;
        self.zeros = if sticks == [0; 4] { self.zeros + 1 } else { 0 };
        self.last_sent = Some((sticks, now));
        let [right, forward, up, clockwise] = sticks;
        Some(format!("rc {right} {forward} {up} {clockwise}"))
    }

    /// When the next command is due.
    #[must_use]
    pub fn next_at(&self, now: Time) -> Option<Time> {
        let (_, at) = self.due(now)?;
        let expires = self.wanted.map(|(_, until)| until).filter(|until| *until > now);
        Some(expires.map_or(at, |until| at.min(until)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sent_between(sticks: &mut Sticks, from: u64, to: u64) -> Vec<(u64, String)> {
        (from..to).filter_map(|ms| Some((ms, sticks.poll(Time::from_millis(ms))?))).collect()
    }

    #[test]
    fn hand_worked_stick_positions() {
        let calibration = Calibration::default();
        let setpoint = Setpoint { right: -0.25, forward: 0.5, up: -0.4, yaw_rate: 19.0_f64.to_radians() };
        assert_eq!(calibration.sticks(setpoint), [-25, 50, -50, 20]);
        let wild = Setpoint { right: f64::NAN, forward: 9.0, up: f64::INFINITY, yaw_rate: -99.0 };
        assert_eq!(calibration.sticks(wild), [0, 100, 0, -100]);
    }

    #[test]
    fn a_motion_is_repeated_and_its_end_is_a_zero_three_times() {
        let mut sticks = Sticks::default();
        sticks.set([0, 50, 0, 0], Time::from_millis(500));
        let all = sent_between(&mut sticks, 0, 1000);
        let moving: Vec<u64> = all.iter().filter(|(_, text)| text == "rc 0 50 0 0").map(|(ms, _)| *ms).collect();
        assert_eq!(moving, [0, 80, 160, 240, 320, 400, 480]);
        let zeros: Vec<u64> = all.iter().filter(|(_, text)| text == "rc 0 0 0 0").map(|(ms, _)| *ms).collect();
        assert_eq!(zeros[..4], [500, 530, 560, 640], "at the end of its validity, though nobody said so");
    }

    #[test]
    fn a_new_setpoint_goes_out_within_20_ms() {
        let mut sticks = Sticks::default();
        sticks.set([0, 50, 0, 0], Time::MAX);
        assert_eq!(sent_between(&mut sticks, 0, 5).len(), 1);
        sticks.set([0; 4], Time::MAX);
        assert_eq!(sent_between(&mut sticks, 5, 25)[0].0, 20);
    }
}

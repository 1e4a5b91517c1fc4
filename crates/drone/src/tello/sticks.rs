//! `rc`: what the sticks are told, and how often.
//!
//! A Tello holds what it was told last until it is told something else, so a zero must not get lost: it is sent three times, and
//! while it flies something is sent at least every [`PERIOD`], which also keeps its own landing after 15 s away.

use spf_core::command::Setpoint;
use spf_core::time::{Duration, Time};

/// Between two `rc` at most.
pub const PERIOD: Duration = Duration::from_millis(80);
/// Between two `rc` at least.
const LEAST: Duration = Duration::from_millis(20);
/// Between the copies of a zero.
const COPIES: Duration = Duration::from_millis(30);
/// How often a zero is sent before it is only repeated every [`PERIOD`].
const ZEROS: u32 = 3;

/// What full stick does. SI units and radians.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Calibration {
    /// On the map.
    pub speed: f64,
    /// Upwards.
    pub climb: f64,
    /// Downwards.
    pub sink: f64,
    /// Round.
    pub yaw_rate: f64,
}

impl Default for Calibration {
    /// Clients' common reading that `rc` is in cm/s, and the yaw rate that most timings give; no measurement of the vendor's exists.
    fn default() -> Self {
        Self { speed: 1.0, climb: 1.0, sink: 0.8, yaw_rate: 95.0_f64.to_radians() }
    }
}

impl Calibration {
    /// Stick positions for a setpoint: right, forward, up, clockwise, each -100 to 100.
    #[must_use]
    pub fn sticks(&self, setpoint: Setpoint) -> [i8; 4] {
        let vertical = if setpoint.up > 0.0 { self.climb } else { self.sink };
        let share = |value: f64, full: f64| {
            let share = 100.0 * value / full;
            // What is not a number must not become full stick.
            if share.is_finite() { libm::round(share.clamp(-100.0, 100.0)) as i8 } else { 0 }
        };
        [
            share(setpoint.right, self.speed),
            share(setpoint.forward, self.speed),
            share(setpoint.up, vertical),
            share(setpoint.yaw_rate, self.yaw_rate),
        ]
    }
}

/// What the sticks are to be, over time. Sans-IO.
#[derive(Clone, Debug, Default)]
pub struct Sticks {
    wanted: Option<([i8; 4], Time)>,
    said: Option<([i8; 4], Time)>,
    zeros: u32,
}

impl Sticks {
    /// Holds these from `now` on, until `valid_until`; then zero.
    pub fn set(&mut self, sticks: [i8; 4], valid_until: Time) {
        self.wanted = Some((sticks, valid_until));
    }

    /// Nothing is said any more.
    pub fn release(&mut self) {
        *self = Self::default();
    }

    fn due(&self, now: Time) -> Option<([i8; 4], Time)> {
        let (sticks, valid_until) = self.wanted?;
        let sticks = if now < valid_until { sticks } else { [0; 4] };
        let Some((said, at)) = self.said else { return Some((sticks, now)) };
        let after = if said != sticks {
            LEAST
        } else if sticks == [0; 4] && self.zeros < ZEROS {
            COPIES
        } else {
            PERIOD
        };
        Some((sticks, at + after))
    }

    /// What to say now.
    pub fn poll(&mut self, now: Time) -> Option<String> {
        let (sticks, _) = self.due(now).filter(|(_, at)| *at <= now)?;
        self.zeros = if sticks == [0; 4] { self.zeros + 1 } else { 0 };
        self.said = Some((sticks, now));
        let [right, forward, up, clockwise] = sticks;
        Some(format!("rc {right} {forward} {up} {clockwise}"))
    }

    /// When there is something to say.
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

    fn said(sticks: &mut Sticks, from: u64, to: u64) -> Vec<(u64, String)> {
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
        let all = said(&mut sticks, 0, 1000);
        let moving: Vec<u64> = all.iter().filter(|(_, text)| text == "rc 0 50 0 0").map(|(ms, _)| *ms).collect();
        assert_eq!(moving, [0, 80, 160, 240, 320, 400, 480]);
        let zeros: Vec<u64> = all.iter().filter(|(_, text)| text == "rc 0 0 0 0").map(|(ms, _)| *ms).collect();
        assert_eq!(zeros[..4], [500, 530, 560, 640], "at the end of its validity, though nobody said so");
    }

    #[test]
    fn a_new_setpoint_goes_out_within_20_ms() {
        let mut sticks = Sticks::default();
        sticks.set([0, 50, 0, 0], Time::MAX);
        assert_eq!(said(&mut sticks, 0, 5).len(), 1);
        sticks.set([0; 4], Time::MAX);
        assert_eq!(said(&mut sticks, 5, 25)[0].0, 20);
    }
}

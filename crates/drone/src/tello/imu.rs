//! Whether the drone's inertial measurement, or its visual odometry, is invalid.
//!
//! A Tello has no value for this in its state. It reports an error in its answers to moves (`error No valid imu`), and
//! by a state line without attitude. An `rc` command has no answer. A drone flown by `rc` that is told to move, and whose
//! state says that it stands still, either does not know its motion or is held by something; its position can then not be
//! reckoned, and no limit on it holds.

use spf_core::time::Duration;

use super::state::State;

/// Refusals of a drone that does not know its motion, in lower case.
const REFUSALS: [&str; 3] = ["error no valid imu", "error imu", "imu error"];
/// State lines in a row without attitude: one may be damaged.
const LINES: u32 = 3;

/// Speed that counts as told to move, m/s: three times the resolution of the reported speed.
const TOLD: f64 = 0.3;
/// After this long of such motion with a reported speed of zero, it is invalid.
const MOTIONLESS: Duration = Duration::from_secs(3);

/// Of a longer gap between two lines only this much counts.
const SPACING: Duration = Duration::from_millis(150);

/// Evidence about the inertial measurement from answers and state lines.
#[derive(Clone, Debug, Default)]
pub(super) struct Imu {
    refused: bool,
    /// Newest state lines without pitch or roll.
    missing: u32,
    /// How long it has been told to move since a speed other than zero was reported.
    motionless: Duration,
}

impl Imu {
    /// Takes a refusal into account. Returns true if it is an error of the inertial measurement.
    pub(super) fn refused(&mut self, answer: &str) -> bool {
        let lower = answer.trim().to_ascii_lowercase();
        let is_error = REFUSALS.iter().any(|refusal| lower.starts_with(refusal));
        self.refused |= is_error;
        is_error
    }

    /// Takes a state line into account that arrived this long after the one before; `told` is the horizontal speed that the
    /// drone should have by the commands to it, m/s.
    pub(super) fn observe(&mut self, state: &State, passed: Duration, told: f64) {
        match state.speed {
            Some([0, 0, _]) if told >= TOLD => self.motionless += passed.min(SPACING),
            Some([0, 0, _]) | None => {}
            Some(_) => self.motionless = Duration::ZERO,
        }
        let missing = state.pitch.is_none() || state.roll.is_none();
        self.missing = if missing { self.missing.saturating_add(1) } else { 0 };
    }

    /// Whether it is invalid. A refusal counts until the drone is on the ground again: a craft that has lost its
    /// position is landed, whatever it reports later.
    pub(super) fn has_error(&self) -> bool {
        self.refused || self.missing >= LINES || self.motionless >= MOTIONLESS
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn refusals_for_the_imu_are_distinguished_from_others() {
        for answer in ["error No valid imu", "Error No Valid IMU\r\n", "error IMU"] {
            assert!(Imu::default().refused(answer), "{answer}");
        }
        for answer in ["error", "error Motor stop", "error Not joystick", "out of range", "ok"] {
            assert!(!Imu::default().refused(answer), "{answer}");
        }
    }

    #[test]
    fn one_damaged_line_is_no_error_and_three_are() {
        let (mut imu, level) = (Imu::default(), State { pitch: Some(1), roll: Some(0), ..State::default() });
        for state in [State::default(), State::default(), level, State::default(), State::default()] {
            imu.observe(&state, SPACING, 0.0);
            assert!(!imu.has_error());
        }
        imu.observe(&State::default(), SPACING, 0.0);
        assert!(imu.has_error());
        imu.observe(&level, SPACING, 0.0);
        assert!(!imu.has_error());
    }

    #[test]
    fn told_to_move_and_no_speed_for_three_seconds_is_an_error_and_slow_or_measured_motion_is_none() {
        let line = |speed| State { pitch: Some(1), roll: Some(0), speed: Some(speed), ..State::default() };
        let mut imu = Imu::default();
        let feed = |imu: &mut Imu, count, speed, told| {
            (0..count).for_each(|_| imu.observe(&line(speed), Duration::from_millis(100), told));
            imu.has_error()
        };
        assert!(!feed(&mut imu, 100, [0, 0, 0], 0.2), "slow");
        assert!(!feed(&mut imu, 100, [0, -3, 0], 0.4), "measured");
        assert!(!feed(&mut imu, 29, [0, 0, 0], 0.4));
        assert!(!feed(&mut imu, 100, [0, 0, 0], 0.0), "it holds in between");
        assert!(feed(&mut imu, 1, [0, 0, 0], 0.4));
        // A gap counts no more than a line.
        let mut imu = Imu::default();
        imu.observe(&line([0, 0, 0]), Duration::from_secs(9), 0.4);
        assert!(!imu.has_error());
    }
}

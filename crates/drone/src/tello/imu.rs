//! Whether the drone's inertial measurement, or its visual odometry, is invalid.
//!
//! A Tello has no value for this in its state. It reports an error in its answers to moves (`error No valid imu`), and
//! by a state line without attitude. An `rc` command has no answer: an error that shows only in the answers stays
//! unknown while the drone is flown by `rc` alone.

use super::state::State;

/// Refusals of a drone that does not know its motion, in lower case.
const REFUSALS: [&str; 3] = ["error no valid imu", "error imu", "imu error"];
/// State lines in a row without attitude: one may be damaged.
const LINES: u32 = 3;

/// Evidence about the inertial measurement from answers and state lines.
#[derive(Clone, Debug, Default)]
pub(super) struct Imu {
    refused: bool,
    /// Newest state lines without pitch or roll.
    missing: u32,
}

impl Imu {
    /// Takes a refusal into account. Returns true if it is an error of the inertial measurement.
    pub(super) fn refused(&mut self, answer: &str) -> bool {
        let lower = answer.trim().to_ascii_lowercase();
        let is_error = REFUSALS.iter().any(|refusal| lower.starts_with(refusal));
        self.refused |= is_error;
        is_error
    }

    /// Takes a state line into account.
    pub(super) fn observe(&mut self, state: &State) {
        let missing = state.pitch.is_none() || state.roll.is_none();
        self.missing = if missing { self.missing.saturating_add(1) } else { 0 };
    }

    /// Whether it is invalid. A refusal counts until the drone is on the ground again: a craft that has lost its
    /// position is landed, whatever it reports later.
    pub(super) fn has_error(&self) -> bool {
        self.refused || self.missing >= LINES
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
            imu.observe(&state);
            assert!(!imu.has_error());
        }
        imu.observe(&State::default());
        assert!(imu.has_error());
        imu.observe(&level);
        assert!(!imu.has_error());
    }
}

//! Whether the drone's inertial measurement, or its visual odometry, is invalid.
//!
//! A Tello has no value for this in its state. It reports an error in its answers to moves (`error No valid imu`), and
//! by a state line without attitude. An `rc` command has no answer. A drone flown by `rc` that is told to move, and whose
//! state says that it stands still, either does not know its motion or is held by something; its position can then not be
//! reckoned, and no limit on it holds. One that is told to stand, and whose state says that it flies on, drifts, or does not
//! get its commands.

use spf_core::time::Duration;

use super::state::State;

/// Refusals of a drone that does not know its motion, in lower case.
const REFUSALS: [&str; 3] = ["error no valid imu", "error imu", "imu error"];
/// State lines in a row without attitude: one may be damaged.
const LINES: u32 = 3;

/// Speed from which on it counts as told to move, m/s. The speeds of a Tello are whole dm/s, and it flies at about 0.8 of
/// the commanded speed (`rc` 15 moved one by 1.17 m in 10 s), so that here it reports 1 even if it rounds down.
const TOLD: f64 = 0.2;
/// After so many metres of such motion, during which every line reported a speed of zero, it is invalid. At the Tello's
/// 0.6 m/s these are 33 lines, at 0.2 m/s 100. A real Tello in flight cannot report as many zeros unless it is held by
/// something or does not see the floor: in a recorded `forward 100` the first speed other than zero came 0.4 s after the
/// command. It starts over with the first such speed.
const UNSEEN: f64 = 2.0;

/// Below this speed it is told to stand, m/s.
const TOLD_TO_STAND: f64 = 0.05;
/// Reported speed that is more than the drift of a Tello that hovers, dm/s.
const ADRIFT: f64 = 3.0;
/// After this long of such speeds, while told to stand, it does not hold its position. A Tello comes to rest from 1 m/s in
/// 1 to 2 s, of which the modelled response covers 1.25 s.
const ADRIFT_FOR: Duration = Duration::from_secs(3);

/// Of a longer gap between two lines only this much counts.
const SPACING: Duration = Duration::from_millis(150);

/// What commands and reported speeds show together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MotionFault {
    /// Told to fly, it reports no speed.
    Unseen,
    /// Told to stand, it reports that it flies on.
    Adrift,
}

/// Evidence about the inertial measurement from answers and state lines.
#[derive(Clone, Debug, Default)]
pub(super) struct Imu {
    refused: bool,
    /// Newest state lines without pitch or roll.
    missing: u32,
    /// How far it has been told to move since a speed other than zero was reported, m.
    unseen: f64,
    /// How long it has reported a speed while it was told to stand.
    adrift: Duration,
    /// The first fault found, until [`Imu::take_found`].
    found: Option<MotionFault>,
    /// Whether a fault was found: it counts until the drone is on the ground.
    is_faulty: bool,
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
    /// drone should have by the commands to it, m/s; `None` while it is not flown by them.
    pub(super) fn observe(&mut self, state: &State, passed: Duration, told: Option<f64>) {
        match state.speed {
            Some([0, 0, _]) => {
                let told = told.filter(|told| *told >= TOLD).unwrap_or(0.0);
                self.unseen += told * passed.min(SPACING).as_secs_f64();
            }
            None => {}
            Some(_) => self.unseen = 0.0,
        }
        match state.speed {
            Some([x, y, _]) if told.is_some_and(|told| told < TOLD_TO_STAND) && libm::hypot(x.into(), y.into()) >= ADRIFT => {
                self.adrift += passed.min(SPACING);
            }
            Some(_) => self.adrift = Duration::ZERO,
            None => {}
        }
        let unseen = (self.unseen >= UNSEEN).then_some(MotionFault::Unseen);
        let fault = unseen.or((self.adrift >= ADRIFT_FOR).then_some(MotionFault::Adrift));
        if fault.is_some() && !std::mem::replace(&mut self.is_faulty, true) {
            self.found = fault;
        }
        let missing = state.pitch.is_none() || state.roll.is_none();
        self.missing = if missing { self.missing.saturating_add(1) } else { 0 };
    }

    /// The fault of its motion that was found since the last call, for the user.
    pub(super) fn take_found(&mut self) -> Option<MotionFault> {
        self.found.take()
    }

    /// Whether it is invalid. A refusal counts until the drone is on the ground again: a craft that has lost its
    /// position is landed, whatever it reports later.
    pub(super) fn has_error(&self) -> bool {
        self.refused || self.missing >= LINES || self.is_faulty
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
            imu.observe(&state, SPACING, None);
            assert!(!imu.has_error());
        }
        imu.observe(&State::default(), SPACING, None);
        assert!(imu.has_error());
        imu.observe(&level, SPACING, None);
        assert!(!imu.has_error());
    }

    #[test]
    fn told_to_move_by_two_metres_and_no_speed_is_an_error_and_slow_or_measured_motion_is_none() {
        let line = |speed| State { pitch: Some(1), roll: Some(0), speed: Some(speed), ..State::default() };
        let feed = |imu: &mut Imu, count, speed, told| {
            (0..count).for_each(|_| imu.observe(&line(speed), Duration::from_millis(100), Some(told)));
            imu.has_error()
        };
        let mut imu = Imu::default();
        assert!(!feed(&mut imu, 300, [0, 0, 0], 0.19), "slow");
        assert!(!feed(&mut imu, 100, [0, -3, 0], 0.4), "measured");
        assert!(!feed(&mut imu, 49, [0, 0, 0], 0.4));
        assert!(!feed(&mut imu, 100, [0, 0, 0], 0.0), "it holds in between");
        assert!(feed(&mut imu, 2, [0, 0, 0], 0.4));
        // A gap counts no more than a line.
        let mut imu = Imu::default();
        imu.observe(&line([0, 0, 0]), Duration::from_secs(90), Some(0.4));
        assert!(!imu.has_error());
    }

    /// A Tello that flies at three quarters of the commanded speed, as measured, reports whole dm/s rounded down, and needs
    /// 0.4 s for its first motion and half a second to reach its speed, as recorded.
    #[test]
    fn a_tello_that_rounds_its_speeds_down_is_believed_in_any_flight() {
        let line = |speed| State { pitch: Some(1), roll: Some(0), speed: Some([speed, 0, 0]), ..State::default() };
        for told in [0.2, 0.25, 0.3, 0.45, 0.6, 1.0] {
            for pulse in [3_u32, 6, 10, 20, 100] {
                let (mut imu, mut speed, mut modelled) = (Imu::default(), 0.0, 0.0);
                for n in 0..3000_u32 {
                    // Starts and stops, each for `pulse` lines.
                    let moves = n >= 3 && (n - 3) / pulse % 2 == 0;
                    let effective = n >= 4 && (n - 4) / pulse % 2 == 0;
                    let change: f64 = (if effective { 0.75 * told } else { 0.0 }) - speed;
                    speed += change.clamp(-0.12, 0.12);
                    // The driver's model, whose dead time is shorter.
                    modelled += (if moves { told } else { 0.0 } - modelled) * 0.28;
                    imu.observe(&line((10.0 * speed) as i32), Duration::from_millis(100), Some(modelled));
                    assert!(!imu.has_error(), "told {told} m/s, starts and stops after {pulse} lines");
                }
            }
        }
    }

    #[test]
    fn told_to_stand_and_flying_on_for_three_seconds_is_an_error_and_drift_is_none() {
        let line = |speed| State { pitch: Some(1), roll: Some(0), speed: Some(speed), ..State::default() };
        let feed = |imu: &mut Imu, count, speed, told| {
            (0..count).for_each(|_| imu.observe(&line(speed), Duration::from_millis(100), told));
            imu.has_error()
        };
        let mut imu = Imu::default();
        assert!(!feed(&mut imu, 300, [2, -2, 0], Some(0.0)), "drift");
        assert!(!feed(&mut imu, 300, [5, 0, 0], Some(0.5)), "told to");
        assert!(!feed(&mut imu, 300, [5, 0, 0], None), "by itself");
        assert!(!feed(&mut imu, 29, [4, 0, 0], Some(0.0)));
        assert!(!feed(&mut imu, 1, [1, 0, 0], Some(0.0)), "it came to rest");
        assert!(!feed(&mut imu, 29, [4, 0, 0], Some(0.0)));
        assert!(feed(&mut imu, 1, [0, -4, 0], Some(0.0)));
        assert_eq!((imu.take_found(), imu.take_found()), (Some(MotionFault::Adrift), None));
    }
}

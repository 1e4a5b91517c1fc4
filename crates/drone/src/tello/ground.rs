//! Whether the drone stands on the ground with its motors off.
//!
//! No single value shows this: the motor time also stops while lines are lost or late, and the height is relative to
//! the take-off point. Time counts only as far as lines arrived at their usual interval, so that neither a gap nor the
//! burst of late lines after it looks like motors that have stopped.

use spf_core::time::{Duration, Time};

use super::state::State;

/// Lines arrive every 0.1 s; of a longer gap only this much counts.
const SPACING: Duration = Duration::from_millis(150);
/// The motor time advances every second: after this long without a change the motors are off.
const STILL: Duration = Duration::from_millis(1800);
/// The same, if the drone seems to be above the ground (on a table, with no echo).
const STILL_HIGH: Duration = Duration::from_secs(6);
/// The same, for a firmware that reports no motor time.
const LOW_AND_AT_REST: Duration = Duration::from_secs(4);
/// Distance sensor and height on the ground, centimetres; the height has steps of 10.
const ECHO_LOW: i32 = 20;
const HEIGHT_LOW: i32 = 10;
/// The same, for one that says itself that its motors are off.
const LOW_AND_SAID: Duration = Duration::from_millis(300);
/// A line repeated without any change for this long is stale. A real drone's line always changes: its accelerometer has
/// noise.
const REPEATED: Duration = Duration::from_secs(1);

/// Above this the drone is in the air, or in a hand, centimetres.
pub(super) const ABOVE_GROUND: i32 = 25;

/// Where a drone is, as far as its state tells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// In the air: above the ground, with its motors turning.
    Airborne,
    /// Its motors turn, and nothing says that it is above the ground: it takes off or lands, or cools its motors.
    MotorsOn,
    /// Its motors are off: on the ground, or in a hand.
    Grounded,
    /// Its state does not tell: the values that would cannot be read, do not arrive, or were watched too briefly.
    Unknown,
}

/// The evidence of the state lines received so far.
#[derive(Clone, Debug, Default)]
pub(super) struct Ground {
    /// Arrival of the last line.
    heard: Option<Time>,
    /// Motor time as last reported.
    motor_time: Option<u32>,
    /// How long the motor time has not changed, counted over received lines.
    still: Duration,
    /// How long height and vertical speed were those of a drone on the ground, counted over received lines.
    low: Duration,
    /// The last line.
    newest: State,
    /// Whether the motor time has ever advanced since [`Ground::forget`].
    advanced: bool,
}

impl Ground {
    /// Takes a state line into account.
    pub(super) fn observe(&mut self, now: Time, state: &State) {
        let passed = self.heard.replace(now).map_or(Duration::ZERO, |before| now.since(before).min(SPACING));
        if state.motor_time == self.motor_time {
            self.still += passed;
        } else {
            // One that could not be read has not advanced.
            self.advanced |= self.motor_time.is_some() && state.motor_time.is_some();
            self.motor_time = state.motor_time;
            self.still = Duration::ZERO;
        }
        self.newest = *state;
        if is_low(state) && state.speed.is_none_or(|[.., down]| down.abs() <= 1) {
            self.low += passed;
        } else {
            self.low = Duration::ZERO;
        }
    }

    /// Starts over: earlier lines carry no information about a motion that begins now.
    pub(super) fn forget(&mut self) {
        (self.still, self.low, self.advanced) = (Duration::ZERO, Duration::ZERO, false);
    }

    /// Whether the motors are off, by motor time and height.
    pub(super) fn is_reached(&self) -> bool {
        match self.motor_time {
            Some(_) if is_low(&self.newest) => self.still >= STILL,
            Some(_) => self.still >= STILL_HIGH,
            None => self.low >= LOW_AND_AT_REST,
        }
    }

    /// Where the drone is. Nothing is taken for a sign of the ground that a drone in the air could show as well.
    pub(super) fn place(&self) -> Place {
        let height = self.newest.height.is_some_and(|cm| cm >= ABOVE_GROUND);
        if self.advanced {
            return if height || self.newest.tof.is_some_and(|cm| cm >= ABOVE_GROUND) {
                Place::Airborne
            } else {
                Place::MotorsOn
            };
        }
        match self.motor_time {
            _ if self.is_reached() => Place::Grounded,
            // Without a motor time the height above the take-off point decides: it is zero while the motors are off.
            None if height && !is_low(&self.newest) => Place::Airborne,
            _ => Place::Unknown,
        }
    }

    /// Whether the last lines were those of a drone on the ground, as far as height and vertical speed go. A single line may be
    /// late, or forged.
    pub(super) fn looks_low(&self) -> bool {
        self.low >= LOW_AND_SAID
    }

    /// Whether the motors turned since [`Ground::forget`].
    pub(super) fn motors_turned(&self) -> bool {
        self.advanced
    }
}

/// Height of a drone on the ground. The distance sensor decides if it has an echo: a drone may land on something higher
/// or lower than its take-off point.
fn is_low(state: &State) -> bool {
    match (state.tof, state.height) {
        (Some(echo), _) => echo <= ECHO_LOW,
        (None, Some(height)) => height <= HEIGHT_LOW,
        (None, None) => false,
    }
}

/// Detects a line that is repeated unchanged.
#[derive(Clone, Debug, Default)]
pub(super) struct Repeats {
    line: Vec<u8>,
    since: Time,
}

impl Repeats {
    /// Whether this line has been repeated for too long to be fresh.
    pub(super) fn is_stale(&mut self, now: Time, line: &[u8]) -> bool {
        if self.line != line {
            self.line.clear();
            self.line.extend_from_slice(line);
            self.since = now;
        }
        now.since(self.since) >= REPEATED
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(motor_time: Option<u32>, tof: Option<i32>, height: i32, down: i32) -> State {
        State { motor_time, tof, height: Some(height), speed: Some([0, 0, down]), ..State::default() }
    }

    /// Feeds lines every 0.1 s from `from` for `count`.
    fn feed(ground: &mut Ground, from: u64, count: u64, state: impl Fn(u64) -> State) {
        (0..count).for_each(|n| ground.observe(Time::from_millis(from + 100 * n), &state(from + 100 * n)));
    }

    #[test]
    fn motors_off_count_over_received_lines_only() {
        let mut ground = Ground::default();
        feed(&mut ground, 0, 20, |ms| line(Some(ms as u32 / 1000), Some(80), 80, 0));
        // A gap of 5 s, then everything at once: still the same motor time.
        for _ in 0..50 {
            ground.observe(Time::from_millis(7000), &line(Some(1), Some(80), 80, 0));
        }
        assert!(!ground.is_reached());
        feed(&mut ground, 7000, 20, |ms| line(Some(ms as u32 / 1000), Some(10), 0, 0));
        assert!(!ground.is_reached(), "the motor time goes on");
        feed(&mut ground, 9000, 21, |_| line(Some(9), Some(10), 0, 0));
        assert!(ground.is_reached());
    }

    #[test]
    fn in_the_air_motor_time_alone_needs_longer() {
        let mut ground = Ground::default();
        feed(&mut ground, 0, 50, |_| line(Some(7), Some(80), 80, 0));
        assert!(!ground.is_reached());
        // On a table, whose top gives no echo.
        feed(&mut ground, 5000, 12, |_| line(Some(7), None, 70, 0));
        assert!(ground.is_reached());
    }

    #[test]
    fn without_motor_time_it_must_be_low_and_at_rest() {
        let mut ground = Ground::default();
        feed(&mut ground, 0, 30, |_| line(None, Some(15), 10, -3));
        assert!(!ground.is_reached(), "it still sinks");
        feed(&mut ground, 3000, 39, |_| line(None, Some(10), 0, 0));
        assert!(!ground.is_reached());
        feed(&mut ground, 6900, 5, |_| line(None, Some(10), 0, 0));
        assert!(ground.is_reached());
    }

    #[test]
    fn a_drone_is_said_to_be_somewhere_only_by_a_sign_of_it() {
        let place = |count, state: fn(u64) -> State| {
            let mut ground = Ground::default();
            feed(&mut ground, 0, count, state);
            ground.place()
        };
        let unread = State { pitch: Some(0), ..State::default() };
        for (expected, count, state) in [
            // Neither heights nor a motor time can be read.
            (Place::Unknown, 80, (|_| State { pitch: Some(0), ..State::default() }) as fn(u64) -> State),
            (Place::Unknown, 1, |_| line(Some(3), Some(10), 0, 0)),
            (Place::Grounded, 20, |_| line(Some(3), Some(10), 0, 0)),
            // In a hand, or on a table: the motors are off.
            (Place::Grounded, 62, |_| line(Some(3), Some(80), 0, 0)),
            (Place::Grounded, 62, |_| State { motor_time: Some(3), ..State::default() }),
            (Place::Airborne, 12, |ms| line(Some(ms as u32 / 1000), Some(80), 80, 0)),
            (Place::Airborne, 12, |ms| State { motor_time: Some(ms as u32 / 1000), height: Some(80), ..State::default() }),
            (Place::MotorsOn, 12, |ms| line(Some(ms as u32 / 1000), Some(10), 0, 0)),
            (Place::MotorsOn, 12, |ms| State { motor_time: Some(ms as u32 / 1000), ..State::default() }),
            // Without a motor time: the height above the take-off point is zero while the motors are off.
            (Place::Airborne, 1, |_| line(None, None, 80, 0)),
            (Place::Unknown, 80, |_| line(None, Some(80), 0, 0)),
            (Place::Grounded, 45, |_| line(None, Some(10), 0, 0)),
        ] {
            assert_eq!(place(count, state), expected, "{count} lines, the last {:?}", state(100 * (count - 1)));
        }
        // A motor time that cannot be read is no motor that turned.
        let mut ground = Ground::default();
        feed(&mut ground, 0, 3, |_| line(Some(3), Some(80), 80, 0));
        ground.observe(Time::from_millis(300), &unread);
        assert!(!ground.motors_turned() && ground.place() != Place::Airborne);
    }

    #[test]
    fn a_line_that_never_changes_is_stale_after_a_second() {
        let mut repeats = Repeats::default();
        assert!(!repeats.is_stale(Time::ZERO, b"h:0;agz:-1000"));
        assert!(!repeats.is_stale(Time::from_millis(900), b"h:0;agz:-1000"));
        assert!(repeats.is_stale(Time::from_millis(1000), b"h:0;agz:-1000"));
        assert!(!repeats.is_stale(Time::from_millis(1100), b"h:0;agz:-1001"));
    }
}

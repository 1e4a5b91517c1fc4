//! What the keys of a game do, measured in its picture: rates, dead time, and lag.
//!
//! Each key is held until the craft flies steadily, and what it does then is its rate. A turn follows from the motion of all points and
//! the field of view ([`turning`](super::turning)). A way has no scale in a picture; its scale is the height above flat ground, which
//! must be known ([`over_ground`]). What a picture shows of the first motion after the key is the dead time, less that of the picture
//! itself ([`mod@response`]). Each key is measured twice, and only a rate that both runs confirm is one: what is in view of the second is
//! another part of the ground.

mod lab;
pub mod over_ground;
pub mod response;
mod watch;

use spf_screen::profile::{Axis, Change, Key, Profile, Yaw};
use spf_screen::{Hidden, ScreenError};

use super::motion::{LEAST_PULSES, PULSES_PER_PICTURE};
use super::settings::ScreenSettings;
use lab::{Bounds, Lab, Leg, Press};
use response::{Response, median, response};
use watch::Quantity;

/// Part of the time for which a key is down if the motion of a held one cannot be followed.
const PART: f64 = 0.35;
/// Pixels by which the mouse is moved at a time, fifty times a second: the first, and those if too little or too much is seen of it.
const PIXELS: [i16; 3] = [2, 20, 1];
/// Least turn by the mouse, radians: less is told badly.
const LEAST_TURN: f64 = 0.1;
/// Part of the height to which a descent may lead.
const FLOOR: f64 = 0.6;
/// Rates in both directions that differ by less are one, as a fraction.
const ALIKE: f64 = 0.05;
/// How long pictures are counted in a turn, and in the turn back, seconds.
const COUNTED: f64 = 1.0;
/// Two measurements of one rate differ by at most this factor. Those of the mouse are made at different speeds: a turn that is too fast
/// for the pictures to follow may look like a slow one.
const AGREEING: f64 = 1.2;

/// What has to be known.
#[derive(Clone, Copy, Debug)]
pub struct Known {
    /// Height of the camera above flat ground after the take-off, metres.
    pub height: f64,
    /// Free way from the start in each direction, metres.
    pub room: f64,
}

/// One key, measured twice.
#[derive(Clone, Debug, PartialEq)]
pub struct Measured {
    /// What it does: `yaw`, `forward`, `right` or `up`.
    pub axis: &'static str,
    /// The key, or `mouse`.
    pub key: String,
    /// What the profile said: °/s, ° per pixel of the mouse, or m/s.
    pub before: f64,
    /// What the two runs measured, in the same unit; `None` if the picture did not tell, or the craft did not move.
    pub runs: [Option<f64>; 2],
    /// Whether the craft flew steadily: otherwise it is faster than that.
    pub is_steady: bool,
}

impl Measured {
    /// What both runs have confirmed: their mean.
    #[must_use]
    pub fn rate(&self) -> Option<f64> {
        let [Some(one), Some(two)] = self.runs else { return None };
        (1.0 / AGREEING..=AGREEING).contains(&(one / two)).then_some(0.5 * (one + two))
    }
}

/// What was found.
#[derive(Clone, Debug, Default)]
pub struct Found {
    /// A line for each key.
    pub rows: Vec<Measured>,
    /// Time from a key to the first motion, seconds.
    pub dead_time: Option<f64>,
    /// Time constant of the velocity, seconds.
    pub lag: Option<f64>,
    /// New pictures of the game per second in motion; `None` if no turn was measured.
    pub pictures_per_s: Option<f64>,
    /// Pulses per second that the game notices, if the profile's are more.
    pub pulses: Option<f64>,
    /// What is to be changed in the profile.
    pub changes: Vec<(&'static str, Change)>,
}

/// Why nothing could be measured.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CalibrateError {
    /// The display or the keyboard, or the focus was lost: the keys were released.
    #[error(transparent)]
    Screen(#[from] ScreenError),
    /// The window cannot be seen.
    #[error(transparent)]
    Hidden(#[from] Hidden),
    /// A profile with sticks.
    #[error("the calibration presses keys, and this profile is flown by the sticks of a gamepad")]
    Sticks,
    /// Somebody wants it to end.
    #[error("interrupted")]
    Interrupted,
}

/// Presses each key of a profile, and measures what it does. `stop` is asked often; `say` is told what is done.
///
/// # Errors
/// [`CalibrateError`]. All keys are released, and the keys of the landing were pressed, if they could be.
pub fn calibrate(
    profile: &Profile,
    settings: &ScreenSettings,
    known: Known,
    stop: &dyn Fn() -> bool,
    say: &mut dyn FnMut(&str),
) -> Result<Found, CalibrateError> {
    if profile.has_sticks() {
        return Err(CalibrateError::Sticks);
    }
    let lab = Lab::open(profile, settings, stop)?;
    let mut bench = Bench { lab, profile, known, found: Found::default(), dead_times: Vec::new(), lags: Vec::new(), say };
    let measured = bench.measure();
    let focus_is_lost = matches!(measured, Err(CalibrateError::Screen(ScreenError::NoFocus)));
    if !profile.landing.steps.is_empty() && !focus_is_lost {
        (bench.say)("landing");
        let landed = bench.lab.steps(&profile.landing.steps, true);
        measured.and(landed)?;
    } else {
        measured?;
    }
    Ok(bench.found)
}

struct Bench<'a> {
    lab: Lab<'a>,
    profile: &'a Profile,
    known: Known,
    found: Found,
    dead_times: Vec<f64>,
    lags: Vec<f64>,
    say: &'a mut dyn FnMut(&str),
}

impl Bench<'_> {
    fn measure(&mut self) -> Result<(), CalibrateError> {
        let Profile { controls, take_off, reset, camera, .. } = self.profile;
        let steps: Vec<_> = reset.steps.iter().chain(&take_off.steps).collect();
        if !steps.is_empty() {
            (self.say)("taking off");
            self.lab.steps(steps, false)?;
        }
        match &controls.yaw {
            Yaw::Keys(keys) => self.yaw(keys.plus, keys.minus, keys.rate_deg_s)?,
            Yaw::Stick(_) => return Err(CalibrateError::Sticks),
            Yaw::Mouse(mouse) => self.mouse(mouse.mouse_deg)?,
        }
        let mut height = self.known.height;
        let names = ("forward", "controls.forward.rate_m_s", "controls.forward.minus_rate_m_s");
        self.axis(&controls.forward, names, Quantity::Forward, &mut height)?;
        if let Some(right) = &controls.right {
            let names = ("right", "controls.right.rate_m_s", "controls.right.minus_rate_m_s");
            self.axis(right, names, Quantity::Right, &mut height)?;
        }
        // Last, for the height is the scale, and less certain after a climb.
        self.axis(&controls.up, ("up", "controls.up.rate_m_s", "controls.up.minus_rate_m_s"), Quantity::Up, &mut height)?;
        self.found.dead_time =
            median(std::mem::take(&mut self.dead_times)).map(|dead_time| (dead_time - camera.latency_s).clamp(0.0, 2.0));
        self.found.lag = median(std::mem::take(&mut self.lags)).map(|lag| lag.clamp(0.01, 5.0));
        let noticed = self.found.pictures_per_s.map(|pictures| (PULSES_PER_PICTURE * pictures).floor().max(LEAST_PULSES));
        self.found.pulses = noticed.filter(|pulses| *pulses < controls.pulse_hz);
        let [dead_time, lag, pulses] = [self.found.dead_time, self.found.lag, self.found.pulses];
        for (key, value) in [("controls.dead_time_s", dead_time), ("controls.lag_s", lag), ("controls.pulse_hz", pulses)] {
            self.found.changes.extend(value.map(|value| (key, Change::Number(value))));
        }
        Ok(())
    }

    /// Presses a key; slowly, if the motion of a held one cannot be followed. After a press of which the picture did not tell enough, the opposite
    /// key brings the craft back. `rate` is what the profile says, m/s; 0 for a turn.
    fn press(
        &mut self,
        (key, opposite): (Key, Key),
        quantity: Quantity,
        (height, rate): (f64, f64),
        hold: Option<f64>,
    ) -> Result<(Leg, Option<Response>), CalibrateError> {
        let bounds = Bounds { room: self.known.room, rate, floor: FLOOR * self.known.height, hold };
        let leg = self.lab.leg(Press::Key(key, 1.0), quantity, height, bounds)?;
        if let Some(response) = told(&leg) {
            // A craft that gains speed backwards may see no ground at first.
            if leg.watch.is_seen(leg.down, leg.steady) {
                self.dead_times.push(response.dead_time);
                if quantity != Quantity::Turn {
                    self.lags.push(response.lag);
                }
            }
            return Ok((leg, Some(response)));
        }
        (self.say)(&format!("back by {opposite:?}: the picture did not tell"));
        self.lab.back(opposite, leg.up - leg.down)?;
        if !leg.watch.has_changed() {
            // Slower it would not show anything either.
            return Ok((leg, None));
        }
        (self.say)(&format!("{key:?} again, in pulses"));
        let leg = self.lab.leg(Press::Key(key, PART), quantity, height, bounds)?;
        let response = told(&leg).filter(|_| leg.is_steady).map(|response| Response { rate: response.rate / PART, ..response });
        if response.is_none() {
            self.lab.back(opposite, PART * (leg.up - leg.down))?;
        }
        Ok((leg, response))
    }

    fn yaw(&mut self, plus: Key, minus: Key, before: f64) -> Result<(), CalibrateError> {
        let mut height = self.known.height;
        let rows = self.both("yaw", (plus, minus), Quantity::Turn, &mut height, (0.0, [before; 2]))?;
        let rates: Vec<f64> = rows.into_iter().flatten().filter(|rate| (5.0..=360.0).contains(rate)).collect();
        if !rates.is_empty() {
            self.count(Press::Key(plus, 1.0), Press::Key(minus, 1.0))?;
        }
        let change = median(rates).map(|rate| ("controls.yaw.rate_deg_s", Change::Number(rate)));
        self.found.changes.extend(change);
        Ok(())
    }

    /// Presses the two keys of an axis, one after the other, and both again; what each has done by both runs. `profile`: the speed by the
    /// profile that bounds a way, m/s, 0 for a turn, and what the profile says of the two keys.
    fn both(
        &mut self,
        name: &'static str,
        (plus, minus): (Key, Key),
        quantity: Quantity,
        height: &mut f64,
        (bound, before): (f64, [f64; 2]),
    ) -> Result<[Option<f64>; 2], CalibrateError> {
        let mut rows = [(plus, before[0]), (minus, before[1])].map(|(key, before)| Measured {
            axis: name,
            key: key.to_string(),
            before,
            runs: [None; 2],
            is_steady: true,
        });
        let mut hold = None;
        for run in 0..2 {
            for (row, (key, opposite, sign)) in rows.iter_mut().zip([(plus, minus, 1.0), (minus, plus, -1.0)]) {
                (self.say)(&format!("{name} by {key:?}, run {} of 2", run + 1));
                let (leg, response) = self.press((key, opposite), quantity, (*height, bound), hold)?;
                hold = response.is_some().then_some(leg.up - leg.down);
                if response.is_some() {
                    // Otherwise it was brought back.
                    *height = leg.watch.height();
                }
                let is_turn = quantity == Quantity::Turn;
                row.runs[run] = response.map(|response| sign * if is_turn { response.rate.to_degrees() } else { response.rate });
                row.is_steady &= leg.is_steady;
                trace(row, &leg);
            }
            // One that was not seen cannot be confirmed, and the other would not be flown back.
            if rows.iter().any(|row| row.runs[run].is_none()) {
                break;
            }
        }
        let rates = rows.each_ref().map(Measured::rate);
        self.found.rows.extend(rows);
        Ok(rates)
    }

    fn mouse(&mut self, before: f64) -> Result<(), CalibrateError> {
        let bounds = Bounds { room: self.known.room, rate: 0.0, floor: 0.0, hold: None };
        let mut row = Measured { axis: "yaw", key: "mouse".to_owned(), before, runs: [None; 2], is_steady: true };
        for pixels in PIXELS {
            (self.say)(&format!("turning by the mouse, {pixels} pixels at a time"));
            let leg = self.lab.leg(Press::Mouse(pixels), Quantity::Turn, self.known.height, bounds)?;
            let response = told(&leg);
            let is_enough = leg.watch.total().abs() >= LEAST_TURN;
            if let Some(response) = response.filter(|_| is_enough) {
                // And back, at another speed for as long a way.
                let other = if pixels > 1 { pixels / 2 } else { 2 };
                let longer = f64::from(pixels) / f64::from(other);
                let hold = Bounds { hold: Some((leg.up - leg.down) * longer), ..bounds };
                let back = self.lab.leg(Press::Mouse(-other), Quantity::Turn, self.known.height, hold)?;
                let per_pixel = |leg: &Leg| leg.watch.total().to_degrees() / leg.pixels as f64;
                row.runs = [Some(per_pixel(&leg)), Some(per_pixel(&back))];
                if row.rate().is_some() {
                    self.dead_times.push(response.dead_time);
                    self.count(Press::Mouse(other), Press::Mouse(-other))?;
                }
            }
            row.is_steady = leg.is_steady;
            trace(&row, &leg);
            if row.rate().is_some() {
                break;
            }
        }
        let each = row.rate().filter(|each| (0.001..=10.0).contains(&each.abs()));
        self.found.rows.push(row);
        self.found.changes.extend(each.map(|each| ("controls.yaw.mouse_deg", Change::Number(each))));
        Ok(())
    }

    /// Counts the game's pictures in a turn, and in the turn back.
    fn count(&mut self, press: Press, back: Press) -> Result<(), CalibrateError> {
        (self.say)("counting the game's pictures");
        let pictures = self.lab.pictures_per_s(press, back, COUNTED)?;
        self.found.pictures_per_s = (pictures > 0.0).then_some(pictures);
        Ok(())
    }

    /// The two keys of an axis. `height` is that of the camera, before and after.
    fn axis(
        &mut self,
        axis: &Axis,
        (name, plus, minus): (&'static str, &'static str, &'static str),
        quantity: Quantity,
        height: &mut f64,
    ) -> Result<(), CalibrateError> {
        let Some((plus_key, minus_key)) = axis.keys() else { return Err(CalibrateError::Sticks) };
        // The faster key bounds the way.
        let before = [axis.rate(1.0), axis.rate(-1.0)];
        let rates = self.both(name, (plus_key, minus_key), quantity, height, (before[0].max(before[1]), before))?;
        let rates = rates.map(|rate| rate.filter(|rate| (0.1..=50.0).contains(rate)));
        let number = |rate: f64| Change::Number(rate);
        match rates {
            [Some(one), Some(other)] if (one - other).abs() <= ALIKE * one && axis.minus_rate_m_s.is_none() => {
                self.found.changes.push((plus, number(0.5 * (one + other))));
            }
            [one, other] => {
                // Without a rate of its own, one that was not confirmed is that of the other key.
                self.found.changes.extend(one.map(|rate| (plus, number(rate))));
                self.found.changes.extend(other.map(|rate| (minus, number(rate))));
            }
        }
        Ok(())
    }
}

/// For those who look for the cause of a wrong rate.
fn trace(row: &Measured, leg: &Leg) {
    tracing::debug!(axis = row.axis, key = row.key, runs = ?row.runs, down = leg.down, steady = leg.steady, up = leg.up, samples = ?leg.watch.samples(), "measured");
}

/// What a press did, if the picture told.
fn told(leg: &Leg) -> Option<Response> {
    let samples = leg.watch.samples();
    response(samples, leg.down, leg.steady, leg.up)
        .filter(|response| leg.watch.is_seen(leg.steady, leg.up) && response.rate != 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::screen::motion::tests::padded;

    #[test]
    fn a_rate_is_what_both_runs_confirm() {
        let row = |one, two| Measured { axis: "up", key: "r".to_owned(), before: 1.5, runs: [one, two], is_steady: true }.rate();
        assert_eq!((row(Some(1.4), Some(1.6)), row(Some(-1.4), Some(-1.6))), (Some(1.5), Some(-1.5)));
        // 60 % off, the other way, at rest, unseen once.
        for runs in [(Some(1.5), Some(2.4)), (Some(1.5), Some(-1.5)), (Some(1.5), Some(0.0)), (Some(1.5), None), (None, None)] {
            assert_eq!(row(runs.0, runs.1), None, "{runs:?}");
        }
    }

    #[test]
    fn sticks_are_refused_before_a_display_is_opened() {
        let settings = ScreenSettings { display: Some(":none".to_owned()) };
        let known = Known { height: 3.0, room: 10.0 };
        let measured = |profile: &Profile| calibrate(profile, &settings, known, &|| false, &mut |_| {}).unwrap_err();
        assert!(matches!(measured(&padded()), CalibrateError::Sticks));
        assert!(matches!(measured(&Profile::shipped("luanti").unwrap()), CalibrateError::Screen(_)));
    }
}

//! What the keys of a game do, measured in its picture: rates, dead time, and lag.
//!
//! Each key is held until the craft flies steadily, and what it does then is its rate. A turn follows from the motion of all points and
//! the field of view ([`turning`](super::turning)). A way has no scale in a picture; its scale is the height above flat ground, which
//! must be known ([`over_ground`]). What a picture shows of the first motion after the key is the dead time, less that of the picture
//! itself ([`mod@response`]).

mod lab;
pub mod over_ground;
pub mod response;
mod watch;

use spf_screen::profile::{Axis, Change, Key, Profile, Yaw};
use spf_screen::{Hidden, ScreenError};

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
/// Most pulses per new picture of the game: a game that looks at its keys once a picture does not notice shorter ones.
const PULSES: f64 = 0.67;
/// How long pictures are counted in a turn, and in the turn back, seconds.
const COUNTED: f64 = 1.0;
/// Two measurements of the mouse, at different speeds, differ by at most this factor: a turn that is too fast for the pictures to follow
/// may look like a slow one.
const AGREEING: f64 = 1.25;
/// Fewest pulses per second of a profile.
const LEAST_PULSES: f64 = 5.0;

/// What has to be known.
#[derive(Clone, Copy, Debug)]
pub struct Known {
    /// Height of the camera above flat ground after the take-off, metres.
    pub height: f64,
    /// Free way from the start in each direction, metres.
    pub room: f64,
}

/// One key, measured.
#[derive(Clone, Debug, PartialEq)]
pub struct Measured {
    /// What it does: `yaw`, `forward`, `right` or `up`.
    pub axis: &'static str,
    /// The key, or `mouse`.
    pub key: String,
    /// What the profile said: °/s, ° per pixel of the mouse, or m/s.
    pub before: f64,
    /// What was measured, in the same unit; `None` if the picture did not tell, or the craft did not move.
    pub now: Option<f64>,
    /// Whether the craft flew steadily: otherwise it is faster than that.
    pub is_steady: bool,
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
        let noticed = self.found.pictures_per_s.map(|pictures| (PULSES * pictures).floor().max(LEAST_PULSES));
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
        let (mut rates, mut hold) = (Vec::new(), None);
        for (key, opposite, sign) in [(plus, minus, 1.0), (minus, plus, -1.0)] {
            (self.say)(&format!("turning by {key:?}"));
            let (leg, response) = self.press((key, opposite), Quantity::Turn, (self.known.height, 0.0), hold)?;
            hold = response.is_some().then_some(leg.up - leg.down);
            let now = response.map(|response| sign * response.rate.to_degrees());
            rates.extend(now.filter(|rate| (5.0..=360.0).contains(rate)));
            self.note("yaw", key.to_string(), before, now, &leg);
        }
        if !rates.is_empty() {
            self.count(Press::Key(plus, 1.0), Press::Key(minus, 1.0))?;
        }
        let change = median(rates).map(|rate| ("controls.yaw.rate_deg_s", Change::Number(rate)));
        self.found.changes.extend(change);
        Ok(())
    }

    fn mouse(&mut self, before: f64) -> Result<(), CalibrateError> {
        let bounds = Bounds { room: self.known.room, rate: 0.0, floor: 0.0, hold: None };
        let mut each = None;
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
                let (one, two) = (per_pixel(&leg), per_pixel(&back));
                if (1.0 / AGREEING..=AGREEING).contains(&(one / two)) {
                    self.dead_times.push(response.dead_time);
                    each = Some(0.5 * (one + two));
                    self.count(Press::Mouse(other), Press::Mouse(-other))?;
                }
            }
            let is_last = Some(&pixels) == PIXELS.last();
            if each.is_some() || is_last {
                self.note("yaw", "mouse".to_owned(), before, each, &leg);
                break;
            }
        }
        let each = each.filter(|each| (0.001..=10.0).contains(&each.abs()));
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
        let (mut rates, mut hold) = ([None; 2], None);
        for (rate, (key, opposite, sign)) in rates.iter_mut().zip([(plus_key, minus_key, 1.0), (minus_key, plus_key, -1.0)]) {
            (self.say)(&format!("flying {name} by {key:?}"));
            let (leg, response) = self.press((key, opposite), quantity, (*height, axis.rate(sign)), hold)?;
            hold = response.is_some().then_some(leg.up - leg.down);
            let now = response.map(|response| sign * response.rate);
            *rate = now.filter(|rate| (0.1..=50.0).contains(rate));
            if response.is_some() {
                // Otherwise it was brought back.
                *height = leg.watch.height();
            }
            self.note(name, key.to_string(), axis.rate(sign), now, &leg);
        }
        let number = |rate: f64| Change::Number(rate);
        match rates {
            [Some(one), Some(other)] if (one - other).abs() <= ALIKE * one && axis.minus_rate_m_s.is_none() => {
                self.found.changes.push((plus, number(0.5 * (one + other))));
            }
            [one, other] => {
                // Without a rate of its own, one that was not seen is that of the other key.
                self.found.changes.extend(one.map(|rate| (plus, number(rate))));
                self.found.changes.extend(other.map(|rate| (minus, number(rate))));
            }
        }
        Ok(())
    }

    fn note(&mut self, axis: &'static str, key: String, before: f64, now: Option<f64>, leg: &Leg) {
        tracing::debug!(axis, key, ?now, down = leg.down, steady = leg.steady, up = leg.up, samples = ?leg.watch.samples(), "measured");
        self.found.rows.push(Measured { axis, key, before, now, is_steady: leg.is_steady });
    }
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
    fn sticks_are_refused_before_a_display_is_opened() {
        let settings = ScreenSettings { display: Some(":none".to_owned()) };
        let known = Known { height: 3.0, room: 10.0 };
        let measured = |profile: &Profile| calibrate(profile, &settings, known, &|| false, &mut |_| {}).unwrap_err();
        assert!(matches!(measured(&padded()), CalibrateError::Sticks));
        assert!(matches!(measured(&Profile::shipped("luanti").unwrap()), CalibrateError::Screen(_)));
    }
}

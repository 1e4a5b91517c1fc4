//! From a velocity setpoint to what is done with the controls: fractions of full deflection, by pulses of a key, pixels of the mouse, or
//! the position of a stick.

use spf_core::command::Setpoint;
use spf_core::time::{Duration, Time};
use spf_screen::duty::Pulses;
use spf_screen::gamepad::Positions;
use spf_screen::profile::{Axis, Controls, Key, Yaw};

/// Most pulses of a key per picture that a game draws: a game that looks at its keys once a picture does not notice shorter ones.
pub(super) const PULSES_PER_PICTURE: f64 = 0.67;
/// Fewest pulses per second.
pub(super) const LEAST_PULSES: f64 = 5.0;
/// Interval between two motions of the mouse.
const MOUSE_PERIOD: Duration = Duration::from_millis(20);
/// Most pixels of one motion.
const MOST_PIXELS: f64 = 100.0;

/// What is wanted of keyboard, mouse and gamepad at an instant.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Wanted {
    /// Keys that are to be down; all others are up.
    pub(super) keys: Vec<Key>,
    /// Pixels by which the mouse is to be moved to the right.
    pub(super) mouse: i16,
    /// Where the sticks are to be.
    pub(super) sticks: Positions,
    /// The velocity for which all this is: with keys, that of the keys that are down.
    pub(super) motion: Setpoint,
}

/// The controls of the four axes.
#[derive(Debug)]
pub(super) struct Motion {
    controls: Controls,
    /// Right, forward, up, yaw.
    pulses: [Pulses; 4],
    sticks: Positions,
    /// What the controls can do of the wanted velocity.
    able: Setpoint,
    /// Yaw rate of the mouse, rad/s.
    turn_rate: f64,
    /// Pixels not moved yet.
    pixels: f64,
    mouse_at: Time,
}

impl Motion {
    pub(super) fn new(controls: &Controls) -> Self {
        let pulses = core::array::from_fn(|_| Pulses::new(controls.pulse_hz));
        let controls = controls.clone();
        let able = Setpoint::HOLD;
        Self { controls, pulses, sticks: Positions::default(), able, turn_rate: 0.0, pixels: 0.0, mouse_at: Time::ZERO }
    }

    /// Notes how many pictures per second the game draws, if fewer than are looked at: there are no shorter pulses, and never more than
    /// the profile says.
    pub(super) fn draws(&mut self, pictures_per_s: Option<f64>) {
        let most = pictures_per_s.map_or(f64::INFINITY, |pictures| (PULSES_PER_PICTURE * pictures).max(LEAST_PULSES));
        self.pulses.iter_mut().for_each(|pulses| pulses.set_rate(self.controls.pulse_hz.min(most)));
    }

    /// Sets the velocity.
    pub(super) fn set(&mut self, now: Time, wanted: Setpoint) {
        let Controls { forward, right, up, yaw, .. } = &self.controls;
        let fraction = |axis: Option<&Axis>, speed: f64| axis.map_or(0.0, |axis| of_full(speed, axis.rate(speed)));
        let full_turn = yaw.rate_deg_s().to_radians();
        let fractions = [
            fraction(right.as_ref(), wanted.right),
            fraction(Some(forward), wanted.forward),
            fraction(Some(up), wanted.up),
            of_full(wanted.yaw_rate, full_turn),
        ];
        let is_mouse = matches!(yaw, Yaw::Mouse(_));
        self.turn_rate = if is_mouse { fractions[3] * full_turn } else { 0.0 };
        if self.turn_rate == 0.0 {
            self.pixels = 0.0;
        }
        let stick = |axis: &Axis| axis.stick;
        let sticks = [right.as_ref().and_then(stick), stick(forward), stick(up), yaw.stick()];
        let curve = self.controls.curve();
        self.sticks = Positions::default();
        for (number, (pulses, (fraction, stick))) in self.pulses.iter_mut().zip(fractions.into_iter().zip(sticks)).enumerate() {
            if let Some(stick) = stick {
                self.sticks.push(stick, curve.deflection(fraction));
            }
            pulses.set(now, if stick.is_some() || (number == 3 && is_mouse) { 0.0 } else { fraction });
        }
        let speed = |axis: Option<&Axis>, fraction: f64| axis.map_or(0.0, |axis| fraction * axis.rate(fraction));
        self.able = Setpoint {
            right: speed(right.as_ref(), fractions[0]),
            forward: speed(Some(forward), fractions[1]),
            up: speed(Some(up), fractions[2]),
            yaw_rate: fractions[3] * full_turn,
        };
    }

    /// What is wanted now.
    pub(super) fn poll(&mut self, now: Time) -> Wanted {
        let Controls { forward, right, up, yaw, .. } = &self.controls;
        let pairs = [right.as_ref().and_then(Axis::keys), forward.keys(), up.keys(), yaw.keys()];
        let turn = yaw.rate_deg_s().to_radians();
        let full = |level: f64| [right.as_ref().map_or(0.0, |axis| axis.rate(level)), forward.rate(level), up.rate(level), turn];
        let Setpoint { right: aside, forward: ahead, up: climb, yaw_rate } = self.able;
        let mut motion = [aside, ahead, climb, yaw_rate];
        let mut keys = Vec::new();
        for (number, (pulses, pair)) in self.pulses.iter_mut().zip(pairs).enumerate() {
            let level = pulses.level(now);
            let Some((plus, minus)) = pair else { continue };
            motion[number] = f64::from(level) * full(f64::from(level))[number];
            match level {
                1 => keys.push(plus),
                -1 => keys.push(minus),
                _ => {}
            }
        }
        let [right, forward, up, yaw_rate] = motion;
        let motion = Setpoint { right, forward, up, yaw_rate };
        Wanted { keys, mouse: self.mouse(now), sticks: self.sticks, motion }
    }

    fn mouse(&mut self, now: Time) -> i16 {
        let passed = now.since(self.mouse_at);
        let Yaw::Mouse(mouse) = &self.controls.yaw else { return 0 };
        if passed < MOUSE_PERIOD {
            return 0;
        }
        self.mouse_at = now;
        // After a pause only what one period is worth.
        let seconds = passed.min(2 * MOUSE_PERIOD).as_secs_f64();
        self.pixels += (self.turn_rate * seconds).to_degrees() / mouse.mouse_deg;
        let whole = self.pixels.round().clamp(-MOST_PIXELS, MOST_PIXELS);
        self.pixels = (self.pixels - whole).clamp(-MOST_PIXELS, MOST_PIXELS);
        whole as i16
    }
}

/// A rate as a fraction of that at full deflection; what is no number is zero.
fn of_full(rate: f64, full: f64) -> f64 {
    let fraction = rate / full;
    if fraction.is_finite() { fraction.clamp(-1.0, 1.0) } else { 0.0 }
}

/// The greatest fraction of full deflection in a setpoint.
pub(super) fn deflection(controls: &Controls, setpoint: Setpoint) -> f64 {
    let Controls { forward, right, up, yaw, .. } = controls;
    let fraction = |axis: &Axis, speed: f64| of_full(speed, axis.rate(speed)).abs();
    let sides = right.as_ref().map_or(0.0, |axis| fraction(axis, setpoint.right));
    let turn = of_full(setpoint.yaw_rate, yaw.rate_deg_s().to_radians()).abs();
    [sides, fraction(forward, setpoint.forward), fraction(up, setpoint.up), turn].into_iter().fold(0.0, f64::max)
}

#[cfg(test)]
pub(super) mod tests {
    use proptest::prelude::*;
    use spf_screen::profile::Profile;

    use super::*;

    #[test]
    fn hand_worked_pulses_and_pixels() {
        // 4 m/s at full deflection, ten pulses per second; 0.2264° a pixel.
        let profile = Profile::shipped("luanti").unwrap();
        let mut motion = Motion::new(&profile.controls);
        let wanted = Setpoint { forward: 2.0, right: -8.0, up: 0.0, yaw_rate: 30.0_f64.to_radians() };
        motion.set(Time::ZERO, wanted);
        let (mut ahead, mut aside, mut pixels) = (0, 0, 0);
        let mut way = Setpoint::HOLD;
        for ms in (5..=2000).step_by(5) {
            let Wanted { keys, mouse, sticks, motion: done } = motion.poll(Time::from_millis(ms));
            // Of a key that is down, the whole of its speed; of the mouse, what is wanted.
            assert!((done.forward == 4.0) == keys.contains(&Key::named("w").unwrap()) && done.right == -4.0 && done.up == 0.0);
            assert!((done.yaw_rate - wanted.yaw_rate).abs() < 1e-9);
            way.forward += 0.005 * done.forward;
            ahead += i32::from(keys.contains(&Key::named("w").unwrap()));
            aside += i32::from(keys.contains(&Key::named("a").unwrap()));
            pixels += i32::from(mouse);
            assert!(keys.len() <= 2 && mouse <= 6 && sticks.are_centred());
        }
        // 60° in 2 s are 265 pixels, of which the last period is open.
        assert!((way.forward - 4.0).abs() < 0.41, "{way:?}");
        assert!((180..=220).contains(&ahead) && aside == 400 && (258..=265).contains(&pixels), "{ahead} {aside} {pixels}");
        motion.set(Time::from_millis(2001), Setpoint::HOLD);
        assert_eq!(motion.poll(Time::from_millis(2025)), Wanted::default());
    }

    /// The shipped profile `spf-window`, flown by sticks but for the climb.
    pub(in crate::screen) fn padded() -> Profile {
        let text = Profile::text("spf-window").unwrap();
        let text = text
            .replace("plus = \"w\"\nminus = \"s\"", "stick = \"-right_y\"")
            .replace("plus = \"d\"\nminus = \"a\"", "stick = \"right_x\"")
            .replace("plus = \"e\"\nminus = \"q\"", "stick = \"left_x\"");
        Profile::parse(&(text + "\n[controls.gamepad]\ndead_zone = 0.2\nexponent = 2.0\n")).unwrap()
    }

    #[test]
    fn hand_worked_sticks() {
        let mut motion = Motion::new(&padded().controls);
        // Full rates are 4 m/s, 1.5 m/s and 95 °/s.
        motion.set(Time::ZERO, Setpoint { forward: 1.0, right: -9.0, up: 1.5, yaw_rate: 0.0 });
        let Wanted { keys, mouse, sticks, motion: done } = motion.poll(Time::from_millis(5));
        assert_eq!((done.forward, done.right, done.up, done.yaw_rate), (1.0, -4.0, 1.5, 0.0));
        // A quarter of the speed by a square: 0.2 + 0.8 · 0.5 of 32767, pushed away.
        assert_eq!((keys, mouse, sticks.values()), (vec![Key::named("r").unwrap()], 0, [0, 0, -32767, -19660]));
        motion.set(Time::from_millis(9), Setpoint::HOLD);
        assert_eq!(motion.poll(Time::from_millis(9)), Wanted::default());
    }

    proptest! {
        #[test]
        fn sticks_give_the_wanted_part_of_the_full_rate(
            right in any::<f64>(), forward in -6.0..6.0_f64, yaw_rate in -2.0..2.0_f64, ms in 0_u64..5000
        ) {
            let profile = padded();
            let mut motion = Motion::new(&profile.controls);
            motion.set(Time::ZERO, Setpoint { right, forward, up: 0.0, yaw_rate });
            let Wanted { keys, mouse, sticks, motion: done } = motion.poll(Time::from_millis(ms));
            prop_assert!(keys.is_empty() && mouse == 0);
            let [turn, _, aside, back] = sticks.values();
            let rate = |value: i16| profile.controls.curve().rate(f64::from(value) / 32767.0);
            prop_assert!((-4.0 * rate(back) - done.forward).abs() < 1e-3 && (4.0 * rate(aside) - done.right).abs() < 1e-3);
            prop_assert!((rate(turn) * 95.0_f64.to_radians() - done.yaw_rate).abs() < 1e-3);
        }

        #[test]
        fn no_setpoint_presses_opposite_keys_or_exceeds_full_deflection(
            right in any::<f64>(), forward in any::<f64>(), up in any::<f64>(), yaw_rate in any::<f64>(), name in 0..3_usize, ms in 0_u64..5000
        ) {
            let profile = Profile::shipped(Profile::names()[name]).unwrap();
            let mut motion = Motion::new(&profile.controls);
            motion.set(Time::ZERO, Setpoint { right, forward, up, yaw_rate });
            let done = motion.poll(Time::from_millis(ms)).motion;
            prop_assert!(done.is_finite() && deflection(&profile.controls, done) <= 1.0 + 1e-9);
            let Wanted { keys, .. } = motion.poll(Time::from_millis(ms));
            let pressed = |axis: &Axis| axis.keys().is_some_and(|(plus, minus)| keys.contains(&plus) && keys.contains(&minus));
            prop_assert!(!pressed(&profile.controls.forward) && !pressed(&profile.controls.up) && keys.len() <= 4);
        }
    }
}

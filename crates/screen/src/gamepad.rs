//! A gamepad of our own: its sticks, and how far one is pushed for a rate.
//!
//! A stick is analogue: a rate below the full one is a smaller deflection, and needs no pulses.

use std::fmt;

use serde::{Deserialize, Serialize};

/// Names of the axes, in the order of [`Positions`].
const NAMES: [&str; 4] = ["left_x", "left_y", "right_x", "right_y"];
/// Full deflection, as gamepads report it.
const FULL: f64 = 32767.0;

/// An axis of a stick and the direction in which it is pushed for a positive rate. Without a sign that is to the right, or towards the
/// player (as the kernel counts: `ABS_X`, `ABS_Y`, `ABS_RX`, `ABS_RY`); `-left_y` is the left stick, pushed away.
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Stick {
    /// Which of the four axes.
    axis: u8,
    is_inverted: bool,
}

/// The name is not that of a stick.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("expected `left_x`, `left_y`, `right_x` or `right_y`, with a minus in front for the other direction, found `{0}`")]
pub struct StickError(String);

impl Stick {
    /// The stick of this name.
    ///
    /// # Errors
    /// [`StickError`] if there is none.
    pub fn named(name: &str) -> Result<Self, StickError> {
        let plain = name.strip_prefix('-');
        let axis = NAMES.iter().position(|known| *known == plain.unwrap_or(name));
        let axis = axis.ok_or_else(|| StickError(name.chars().filter(|letter| !letter.is_control()).take(40).collect()))?;
        Ok(Self { axis: axis as u8, is_inverted: plain.is_some() })
    }

    /// The name of its axis, without the direction.
    #[must_use]
    pub fn axis(self) -> &'static str {
        NAMES.get(usize::from(self.axis)).copied().unwrap_or_default()
    }
}

impl fmt::Display for Stick {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}{}", if self.is_inverted { "-" } else { "" }, self.axis())
    }
}

impl fmt::Debug for Stick {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "`{self}`")
    }
}

impl TryFrom<String> for Stick {
    type Error = StickError;

    fn try_from(name: String) -> Result<Self, StickError> {
        Self::named(&name)
    }
}

impl From<Stick> for String {
    fn from(stick: Stick) -> Self {
        stick.to_string()
    }
}

/// What a program makes of a stick: the rate is `((d − dead_zone) / (1 − dead_zone))^exponent` of the full one for a deflection `d`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Curve {
    /// Deflection up to which nothing happens, as a fraction of the full one.
    pub dead_zone: f64,
    /// 1: the rate is in proportion to the deflection; more: it is finer around the centre.
    pub exponent: f64,
}

impl Default for Curve {
    fn default() -> Self {
        Self { dead_zone: 0.0, exponent: 1.0 }
    }
}

impl Curve {
    /// The deflection (−1 to 1) for a rate as a fraction of that at full deflection. What is no number is the centre.
    #[must_use]
    pub fn deflection(&self, fraction: f64) -> f64 {
        let fraction = fraction.clamp(-1.0, 1.0);
        let deflection = self.dead_zone + (1.0 - self.dead_zone) * fraction.abs().powf(1.0 / self.exponent);
        if fraction == 0.0 || !deflection.is_finite() { 0.0 } else { deflection.clamp(0.0, 1.0) * fraction.signum() }
    }

    /// The rate that a program makes of a deflection, as a fraction of the full one.
    #[must_use]
    pub fn rate(&self, deflection: f64) -> f64 {
        let beyond = ((deflection.abs() - self.dead_zone) / (1.0 - self.dead_zone)).clamp(0.0, 1.0);
        beyond.powf(self.exponent) * deflection.signum()
    }
}

/// Where the sticks are: left x and y, right x and y. The default is the centre.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Positions([i16; 4]);

impl Positions {
    /// Pushes a stick by a deflection of −1 to 1; what is no number is the centre.
    pub fn push(&mut self, stick: Stick, deflection: f64) {
        let signed = if stick.is_inverted { -deflection } else { deflection };
        if let Some(position) = self.0.get_mut(usize::from(stick.axis)) {
            // No number becomes 0.
            *position = (signed.clamp(-1.0, 1.0) * FULL).round() as i16;
        }
    }

    /// The values, as a gamepad reports them.
    #[must_use]
    pub fn values(&self) -> [i16; 4] {
        self.0
    }

    /// Whether all sticks are in the centre.
    #[must_use]
    pub fn are_centred(&self) -> bool {
        self.0 == [0; 4]
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn hand_worked_positions() {
        let mut positions = Positions::default();
        positions.push(Stick::named("-right_y").unwrap(), 0.5);
        positions.push(Stick::named("left_x").unwrap(), -1.0);
        // 0.5 · 32767 = 16383.5.
        assert_eq!(positions.values(), [-32767, 0, 0, -16384]);
        positions.push(Stick::named("right_y").unwrap(), f64::NAN);
        positions.push(Stick::named("left_x").unwrap(), 0.0);
        assert!(positions.are_centred());
        // A quarter of the rate by a square is half of the way beyond the dead zone: 0.2 + 0.8 · 0.5.
        let curve = Curve { dead_zone: 0.2, exponent: 2.0 };
        assert!((curve.deflection(-0.25) + 0.6).abs() < 1e-12 && curve.deflection(0.0) == 0.0 && curve.deflection(9.0) == 1.0);
    }

    #[test]
    fn names_of_sticks_and_back() {
        for name in ["left_x", "-left_y", "right_x", "-right_y"] {
            assert_eq!(Stick::named(name).unwrap().to_string(), name);
        }
        for name in ["", "-", "--left_x", "left", "LEFT_X", "-left_x ", "+left_x"] {
            assert!(Stick::named(name).is_err(), "{name}");
        }
    }

    proptest! {
        #[test]
        fn a_program_makes_the_wanted_rate_of_the_position(
            fraction in -1.0_f64..=1.0, dead_zone in 0.0..0.5_f64, exponent in 1.0..4.0_f64, name in "-?(left|right)_[xy]"
        ) {
            let curve = Curve { dead_zone, exponent };
            let stick = Stick::named(&name).unwrap();
            let mut positions = Positions::default();
            positions.push(stick, curve.deflection(fraction));
            let sum = f64::from(positions.values().iter().map(|value| i32::from(*value)).sum::<i32>());
            let pushed = if name.starts_with('-') { -sum } else { sum } / FULL;
            // A position is rounded, which counts most next to the centre.
            prop_assert!((curve.rate(pushed) - fraction).abs() < 2e-4, "{} for {fraction}", curve.rate(pushed));
            prop_assert!(pushed == 0.0 || pushed.signum() == fraction.signum());
        }

        #[test]
        fn any_rate_is_a_position_and_zero_is_the_centre(rate in any::<f64>(), dead_zone in 0.0..=0.5_f64, exponent in 1.0..=4.0_f64) {
            let curve = Curve { dead_zone, exponent };
            prop_assert!((-1.0..=1.0).contains(&curve.deflection(rate)));
            prop_assert_eq!(curve.deflection(0.0 * rate), 0.0);
        }

        #[test]
        fn any_text_is_a_stick_of_that_name_or_none(name in ".{0,12}") {
            if let Ok(stick) = Stick::named(&name) {
                prop_assert_eq!(stick.to_string(), name);
            }
        }
    }
}

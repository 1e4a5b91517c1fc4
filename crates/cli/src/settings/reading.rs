//! Parsers for the text of settings.

use std::error::Error;
use std::fmt::Display;
use std::str::FromStr;

use spf_core::craft::CraftKind;
use spf_core::geometry::Pose;
use spf_core::query::DepthAs;
use spf_core::step::StepRule;
use spf_drone::driver::{Driver, Target};
use spf_drone::mavlink::settings::GimbalUse;
use spf_drone::registry::{DRIVERS, alternatives, forms, named};
use spf_drone::tello::TelloMotion;
use spf_flight::policy::PolicyKind;
use spf_flight::pose::parse_pose;
use spf_motion::executor::Motion;
use spf_pilot::{AtEnd, Preset, QueryTiming};
use spf_scene::{Lighting, Weather};
use spf_sim::depth_sensor::{DepthFault, DepthSensor};

use crate::error::nearest;

/// Parses the text of a setting.
pub(crate) trait Reading<T>: Sync {
    /// The value of a non-empty text.
    ///
    /// # Errors
    /// [`Refusal`] for an invalid text.
    fn read(&self, text: &str) -> Result<T, Refusal>;

    /// The accepted words; empty if others are accepted too.
    fn words(&self) -> Vec<&'static str> {
        Vec::new()
    }

    /// The accepted values, in words.
    fn values(&self) -> String {
        alternatives(&self.words())
    }

    /// The accepted numbers, in words; `None` if it is not a number, or if any is accepted.
    #[cfg(test)]
    fn range(&self) -> Option<String> {
        None
    }
}

/// Why a text is rejected.
#[derive(Debug)]
pub(crate) struct Refusal {
    /// What was expected, as in "expected …".
    pub(super) expected: String,
    /// A likely intended value.
    pub(super) near: Option<&'static str>,
    /// The parser's error.
    pub(super) cause: Option<Box<dyn Error>>,
}

impl Refusal {
    fn of(expected: impl Into<String>) -> Self {
        Self { expected: expected.into(), near: None, cause: None }
    }
}

/// Any text: a name or a path, which is checked where it is used.
pub(super) struct Text;

impl Reading<String> for Text {
    fn read(&self, text: &str) -> Result<String, Refusal> {
        Ok(text.to_owned())
    }
}

/// A number from the first to the second, both included.
pub(super) struct Number(pub(super) f64, pub(super) f64);

impl Reading<f64> for Number {
    fn read(&self, text: &str) -> Result<f64, Refusal> {
        // A NaN is in no range.
        within(text, &self.0, &self.1).ok_or_else(|| Refusal::of(format!("a number from {} to {}", self.0, self.1)))
    }

    #[cfg(test)]
    fn range(&self) -> Option<String> {
        Some(format!("{} to {}", self.0, self.1))
    }
}

/// A whole number from the first to the second, both included.
pub(super) struct Count<T>(pub(super) T, pub(super) T);

impl<T: FromStr + PartialOrd + Display + Sync> Reading<T> for Count<T> {
    fn read(&self, text: &str) -> Result<T, Refusal> {
        within(text, &self.0, &self.1).ok_or_else(|| Refusal::of(format!("a whole number from {} to {}", self.0, self.1)))
    }

    #[cfg(test)]
    fn range(&self) -> Option<String> {
        Some(format!("{} to {}", self.0, self.1))
    }
}

fn within<T: FromStr + PartialOrd>(text: &str, low: &T, high: &T) -> Option<T> {
    text.parse().ok().filter(|value| (low..=high).contains(&value))
}

/// A value for the type's own parser, whose errors give no reason; with a description.
pub(super) struct Parsed(pub(super) &'static str);

impl<T: FromStr> Reading<T> for Parsed {
    fn read(&self, text: &str) -> Result<T, Refusal> {
        text.parse().map_err(|_| Refusal::of(self.0))
    }
}

/// A value for the type's own parser, whose errors give the reason; with a description.
pub(super) struct Explained(pub(super) &'static str);

impl<T: FromStr<Err: Error + 'static>> Reading<T> for Explained {
    fn read(&self, text: &str) -> Result<T, Refusal> {
        text.parse().map_err(|error| Refusal { cause: Some(Box::new(error)), ..Refusal::of(self.0) })
    }
}

/// Values for the type's own parser, joined by commas; with a description.
pub(super) struct Joined(pub(super) &'static str);

impl<T: FromStr<Err: Error + 'static>> Reading<Vec<T>> for Joined {
    fn read(&self, text: &str) -> Result<Vec<T>, Refusal> {
        let values = text.split(',').map(|part| part.trim().parse()).collect::<Result<_, T::Err>>();
        values.map_err(|error| Refusal { cause: Some(Box::new(error)), ..Refusal::of(self.0) })
    }
}

/// One of the names of a type's values.
pub(super) struct Word;

impl<T: Words> Reading<T> for Word {
    fn read(&self, text: &str) -> Result<T, Refusal> {
        let words = T::words();
        words.iter().find(|(word, _)| *word == text).map(|(_, value)| *value).ok_or_else(|| {
            let known: Vec<&'static str> = words.iter().map(|(word, _)| *word).collect();
            // A word of two letters is one letter away from its opposite.
            let near = if text.len() > 2 { nearest(text, known.iter().copied()) } else { None };
            Refusal { near, ..Refusal::of(alternatives(&known)) }
        })
    }

    fn words(&self) -> Vec<&'static str> {
        T::words().into_iter().map(|(word, _)| word).collect()
    }
}

/// A type whose values all have a name.
pub(crate) trait Words: Copy {
    /// All of them.
    fn words() -> Vec<(&'static str, Self)>;
}

impl Words for bool {
    fn words() -> Vec<(&'static str, Self)> {
        vec![("true", true), ("false", false)]
    }
}

/// A part that is on, off, or on where its sensor is there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Switch(Option<bool>);

impl Switch {
    /// Whether the part is on; `auto` is what it is if nobody says.
    pub(crate) fn or(self, auto: bool) -> bool {
        self.0.unwrap_or(auto)
    }

    /// What somebody says; `None` for `auto`.
    pub(crate) fn chosen(self) -> Option<bool> {
        self.0
    }
}

impl Words for Switch {
    fn words() -> Vec<(&'static str, Self)> {
        vec![("auto", Self(None)), ("on", Self(Some(true))), ("off", Self(Some(false)))]
    }
}

/// The simulated depth sensor, if there is one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct DepthSense(pub(crate) Option<DepthSensor>);

impl Words for DepthSense {
    fn words() -> Vec<(&'static str, Self)> {
        let with = |fault| Self(Some(DepthSensor { fault }));
        let [frozen, half, scale] = [DepthFault::Frozen, DepthFault::HalfBlack, DepthFault::Scale].map(|fault| with(Some(fault)));
        vec![("off", Self(None)), ("on", with(None)), ("frozen", frozen), ("half", half), ("scale", scale)]
    }
}

impl Words for Lighting {
    fn words() -> Vec<(&'static str, Self)> {
        Self::ALL.map(|light| (light.name(), light)).to_vec()
    }
}

impl Words for Weather {
    fn words() -> Vec<(&'static str, Self)> {
        Self::ALL.map(|weather| (weather.name(), weather)).to_vec()
    }
}

impl Words for CraftKind {
    fn words() -> Vec<(&'static str, Self)> {
        vec![("quad", Self::Quad), ("tello", Self::Tello)]
    }
}

impl Words for Preset {
    fn words() -> Vec<(&'static str, Self)> {
        vec![("default", Self::Default), ("paper", Self::Paper)]
    }
}

impl Words for DepthAs {
    fn words() -> Vec<(&'static str, Self)> {
        vec![("labels", Self::Labels), ("metres", Self::Metres)]
    }
}

impl Words for Motion {
    /// Values that can be set: manoeuvres are set by [`TelloMotion`].
    fn words() -> Vec<(&'static str, Self)> {
        vec![("sequential", Self::Sequential), ("blended", Self::Blended)]
    }
}

impl Words for QueryTiming {
    fn words() -> Vec<(&'static str, Self)> {
        vec![("stop", Self::Stop), ("continuous", Self::Continuous)]
    }
}

/// Pitch of a gimbal, or that the camera is not on it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct GimbalPitch(pub(crate) GimbalUse);

impl FromStr for GimbalPitch {
    type Err = ();

    fn from_str(text: &str) -> Result<Self, ()> {
        if text == "off" {
            return Ok(Self(GimbalUse::Off));
        }
        let pitch: f64 = text.parse().map_err(|_| ())?;
        if (-90.0..=45.0).contains(&pitch) { Ok(Self(GimbalUse::At(-pitch.to_radians()))) } else { Err(()) }
    }
}

/// Width and height of a network's input, pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct NetworkSize(pub(crate) usize, pub(crate) usize);

impl FromStr for NetworkSize {
    type Err = ();

    fn from_str(text: &str) -> Result<Self, ()> {
        let (width, height) = text.split_once(['x', 'X']).ok_or(())?;
        let side = |text: &str| text.parse().ok().filter(|side| (14..=4096).contains(side)).ok_or(());
        Ok(Self(side(width)?, side(height)?))
    }
}

impl Words for AtEnd {
    fn words() -> Vec<(&'static str, Self)> {
        vec![("land", Self::Land), ("hover", Self::Hover), ("rtl", Self::Return)]
    }
}

impl Words for TelloMotion {
    fn words() -> Vec<(&'static str, Self)> {
        vec![("rc", Self::Rc), ("go", Self::Go)]
    }
}

/// The policy: a row of the table of methods.
pub(super) struct Policy;

impl Words for PolicyKind {
    fn words() -> Vec<(&'static str, Self)> {
        Self::all().into_iter().map(|kind| (kind.name(), kind)).collect()
    }
}

impl Reading<PolicyKind> for Policy {
    fn read(&self, text: &str) -> Result<PolicyKind, Refusal> {
        Word.read(text)
    }

    fn words(&self) -> Vec<&'static str> {
        Reading::<PolicyKind>::words(&Word)
    }

    /// The names, grouped by kind.
    fn values(&self) -> String {
        let all = PolicyKind::all();
        let kinds = all.chunk_by(|one, next| one.words() == next.words()).map(|kind| {
            let names: Vec<&str> = kind.iter().map(|policy| policy.name()).collect();
            format!("{} ({})", names.join(", "), kind[0].words())
        });
        kinds.collect::<Vec<_>>().join("; ")
    }
}

/// The drone to fly.
pub(crate) enum DroneName {
    /// The simulator's.
    Sim,
    /// One of a driver's.
    Real(&'static Driver, Box<dyn Target>),
}

/// `sim`, or a name that one of the drivers accepts.
pub(super) struct Drone;

impl Reading<DroneName> for Drone {
    fn read(&self, text: &str) -> Result<DroneName, Refusal> {
        if text == "sim" {
            return Ok(DroneName::Sim);
        }
        named(text).map(|(driver, target)| DroneName::Real(driver, target)).map_err(|_| Refusal {
            near: nearest(text, ["sim"].into_iter().chain(DRIVERS.iter().map(|driver| driver.scheme))),
            ..Refusal::of(alternatives(&[&["sim"], forms().as_slice()].concat()))
        })
    }

    /// The forms of names, from the registry of the drivers, with what they are.
    fn values(&self) -> String {
        let real: String = DRIVERS.iter().map(|driver| format!("; {} ({})", driver.form, driver.about)).collect();
        format!("sim (simulated){real}")
    }
}

/// Where a flight starts.
pub(super) struct Start;

impl Reading<Pose> for Start {
    fn read(&self, text: &str) -> Result<Pose, Refusal> {
        parse_pose(text).map_err(Refusal::of)
    }
}

/// How long a step is: the adaptive rule, with the paper's constants or others, or metres.
pub(super) struct Step;

impl Reading<StepRule> for Step {
    fn read(&self, text: &str) -> Result<StepRule, Refusal> {
        let refused = || {
            Refusal::of(
                "adaptive, adaptive:s=METRES,L=LABELS,p=EXPONENT,min=METRES (each optional; s 0.1 to 50, L 1 to 100, p 0 to 5, min \
                 0.01 to s) or fixed:METRES (0.05 to 50)",
            )
        };
        match text.split_once(':') {
            None if text == "adaptive" => Ok(StepRule::default()),
            Some(("fixed", metres)) => within(metres, &0.05, &50.0).map(StepRule::Fixed).ok_or_else(refused),
            Some(("adaptive", constants)) => adaptive(constants).ok_or_else(refused),
            _ => Err(refused()),
        }
    }
}

/// The adaptive rule with the constants in `s=…,L=…,p=…,min=…`; those that are not given are the paper's.
fn adaptive(constants: &str) -> Option<StepRule> {
    let StepRule::Adaptive { mut scale, mut labels, mut min, mut exponent } = StepRule::PAPER else { return None };
    let mut given = Vec::new();
    for constant in constants.split(',') {
        let (name, value) = constant.split_once('=')?;
        match name {
            "s" => scale = within(value, &0.1, &50.0)?,
            "L" => labels = within(value, &1, &100)?,
            "p" => exponent = within(value, &0.0, &5.0)?,
            "min" => min = within(value, &0.01, &50.0)?,
            _ => return None,
        }
        if given.contains(&name) {
            return None;
        }
        given.push(name);
    }
    (min <= scale).then_some(StepRule::Adaptive { scale, labels, min, exponent })
}

//! Named lights and weathers, and the lamps that shine under them.

use core::ops::Range;

use glam::Vec3;
use serde::{Deserialize, Serialize};
use toml::Spanned;

use super::error::SceneError;
use super::file::{RawLamp, RawLight, RawScene, Source};
use super::surface::Colour;
use crate::geometry::{Lamp, Light};
use crate::mesh::Bulb;

/// Most lamps that shine in a scene: each costs a millisecond when the scene is prepared.
const MAX_LAMPS: usize = 500;

/// Azimuth of the sun where the file names none, degrees clockwise from north.
const AZIMUTH_DEG: f64 = 222.0;

/// A named light: where the sun stands and what the sky gives.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Lighting {
    /// The sun, high.
    #[default]
    Day,
    /// A closed layer of clouds by day: light without shadows.
    Overcast,
    /// The sun at the horizon; lamps are lit.
    Dusk,
    /// Moonlight; lamps are lit.
    Night,
}

impl Lighting {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Day, Self::Overcast, Self::Dusk, Self::Night];

    /// Its name in scene files and on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Day => "day",
            Self::Overcast => "overcast",
            Self::Dusk => "dusk",
            Self::Night => "night",
        }
    }

    /// The light of that name.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|light| light.name() == name)
    }

    /// Whether lamps are lit.
    const fn lit(self) -> bool {
        matches!(self, Self::Dusk | Self::Night)
    }

    /// Elevation of sun or moon, degrees, and the light in clear weather but for the sun's place.
    fn clear(self) -> (f64, Light) {
        let light = Light::default();
        match self {
            Self::Day => (46.0, light),
            Self::Overcast => {
                let sun = Vec3::new(0.10, 0.10, 0.10);
                let (sky_ambient, ground_ambient) = (Vec3::new(0.66, 0.69, 0.73), Vec3::new(0.27, 0.27, 0.26));
                let (zenith, horizon) = (Vec3::new(0.50, 0.53, 0.57), Vec3::new(0.70, 0.72, 0.74));
                (60.0, Light { sun, sky_ambient, ground_ambient, zenith, horizon, haze: 0.002, clouds: 1.0, ..light })
            }
            Self::Dusk => {
                let sun = Vec3::new(0.62, 0.27, 0.10);
                let (sky_ambient, ground_ambient) = (Vec3::new(0.088, 0.098, 0.155), Vec3::new(0.058, 0.050, 0.055));
                let (zenith, horizon) = (Vec3::new(0.036, 0.065, 0.18), Vec3::new(0.28, 0.19, 0.20));
                (4.0, Light { sun, sky_ambient, ground_ambient, zenith, horizon, haze: 0.002, clouds: 0.45, ..light })
            }
            Self::Night => {
                let sun = Vec3::new(0.020, 0.026, 0.040);
                let (sky_ambient, ground_ambient) = (Vec3::new(0.011, 0.014, 0.025), Vec3::new(0.007, 0.007, 0.009));
                let (zenith, horizon) = (Vec3::new(0.002, 0.004, 0.011), Vec3::new(0.016, 0.019, 0.030));
                (38.0, Light { sun, sky_ambient, ground_ambient, zenith, horizon, haze: 0.002, clouds: 0.4, ..light })
            }
        }
    }
}

/// A named weather.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Weather {
    /// What the light has by itself.
    #[default]
    Clear,
    /// Dry haze: a few hundred metres of sight.
    Haze,
    /// Rain under clouds: grey, little sight, falling drops.
    Rain,
}

impl Weather {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Clear, Self::Haze, Self::Rain];

    /// Its name in scene files and on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Clear => "clear",
            Self::Haze => "haze",
            Self::Rain => "rain",
        }
    }

    /// The weather of that name.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|weather| weather.name() == name)
    }

    /// The light that is left of a clear one.
    fn over(self, light: Light) -> Light {
        let grey = |c: Vec3, share: f32, gain: f32| c.lerp(Vec3::splat(c.dot(Vec3::new(0.21, 0.72, 0.07))), share) * gain;
        match self {
            Self::Clear => light,
            Self::Haze => Light {
                sun: light.sun * 0.6,
                sky_ambient: grey(light.sky_ambient, 0.4, 1.15),
                zenith: light.zenith.lerp(grey(light.horizon, 0.3, 1.0), 0.55),
                horizon: grey(light.horizon, 0.35, 1.0),
                haze: 0.007,
                clouds: light.clouds * 0.6,
                ..light
            },
            Self::Rain => Light {
                sun: grey(light.sun, 0.7, 0.06),
                // Clouds spread a part of the sun's light.
                sky_ambient: grey(light.sky_ambient + light.sun * 0.12, 0.7, 1.0),
                ground_ambient: grey(light.ground_ambient, 0.6, 0.9),
                zenith: grey(light.zenith.lerp(light.horizon, 0.4), 0.8, 0.6),
                horizon: grey(light.horizon, 0.8, 0.55),
                haze: 0.009,
                clouds: 1.0,
                rain: 1.0,
                ..light
            },
        }
    }
}

/// Light and weather asked for; what is not is the scene's own.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Conditions {
    /// The light. Another than the file's own puts aside the keys of its `[light]` but for the sun's azimuth and the haze.
    pub lighting: Option<Lighting>,
    /// The weather. Another than the file's own puts aside its haze.
    pub weather: Option<Weather>,
}

/// The light of a scene while it is put together.
pub(crate) struct Shining {
    pub(crate) lighting: Lighting,
    pub(crate) weather: Weather,
    pub(crate) light: Light,
}

impl Shining {
    /// The light of the file under these conditions, with the lamps that belong to no object.
    pub(super) fn new(raw: &RawScene, conditions: &Conditions, source: &Source<'_>) -> Result<Self, SceneError> {
        let mut shining = Self::of(&raw.light, conditions, source)?;
        for lamp in &raw.lamps {
            let bulb = bulb(lamp, source)?;
            shining.add(&bulb, |p| p, 1.0, &lamp.span(), source)?;
        }
        Ok(shining)
    }

    /// The light alone.
    pub(super) fn of(raw: &RawLight, conditions: &Conditions, source: &Source<'_>) -> Result<Self, SceneError> {
        let own = (raw.time.unwrap_or_default(), raw.weather.unwrap_or_default());
        let (lighting, weather) = (conditions.lighting.unwrap_or(own.0), conditions.weather.unwrap_or(own.1));
        Ok(Self { lighting, weather, light: light(raw, lighting, weather, own, source)? })
    }

    /// Whether lamps are lit.
    pub(super) const fn lit(&self) -> bool {
        self.lighting.lit()
    }

    /// Whether the ground is wet.
    pub(super) const fn wet(&self) -> bool {
        matches!(self.weather, Weather::Rain)
    }

    /// Adds a lamp if it shines now; `to_world` moves a point of its frame, `scale` its lengths.
    pub(super) fn add(
        &mut self,
        bulb: &Bulb,
        to_world: impl Fn(Vec3) -> Vec3,
        scale: f32,
        at: &Range<usize>,
        source: &Source<'_>,
    ) -> Result<(), SceneError> {
        if !(bulb.always || self.lit()) {
            return Ok(());
        }
        if self.light.lamps.len() >= MAX_LAMPS {
            let hint = "lamps that light nothing near where one flies can be materials with `emission_lit` alone";
            return Err(source.error(at, format!("more than {MAX_LAMPS} lamps shine"), Some(hint.to_owned())));
        }
        let Lamp { position, colour, reach } = bulb.lamp;
        // As bright at the scaled distances.
        self.light.lamps.push(Lamp { position: to_world(position), colour: colour * (scale * scale), reach: reach * scale });
        Ok(())
    }
}

fn bulb(lamp: &Spanned<RawLamp>, source: &Source<'_>) -> Result<Bulb, SceneError> {
    let raw = lamp.get_ref();
    let wrong = |message: String| Err(source.error(&lamp.span(), message, None));
    if raw.position.iter().any(|v| v.is_nan() || v.abs() > 2000.0) {
        return wrong("a lamp must hang within 2000 m of the origin".to_owned());
    }
    if !(0.0..=10_000.0).contains(&raw.strength) {
        return wrong(format!("`strength` must be from 0 to 10000, not `{}`", raw.strength));
    }
    if !(0.5..=60.0).contains(&raw.reach_m) {
        return wrong(format!("`reach_m` must be from 0.5 to 60 metres, not `{}`", raw.reach_m));
    }
    let [x, y, z] = raw.position.map(|v| v as f32);
    let lamp = Lamp { position: Vec3::new(x, y, z), colour: raw.colour.0 * raw.strength as f32, reach: raw.reach_m as f32 };
    Ok(Bulb { lamp, always: raw.always })
}

/// The named light under the named weather, and over it the file's keys, as far as `own` light and weather are in force.
fn light(
    raw: &RawLight,
    lighting: Lighting,
    weather: Weather,
    own: (Lighting, Weather),
    source: &Source<'_>,
) -> Result<Light, SceneError> {
    let number = |value: &Option<Spanned<f64>>, key: &str, low: f64, high: f64| match value {
        Some(v) if !(low..=high).contains(v.get_ref()) => {
            Err(source.error(&v.span(), format!("`{key}` must be from {low} to {high}, not `{}`", v.get_ref()), None))
        }
        v => Ok(v.as_ref().map(|v| *v.get_ref())),
    };
    // Every key is checked, also those that are put aside.
    let azimuth = number(&raw.sun_azimuth_deg, "sun_azimuth_deg", -360.0, 360.0)?.unwrap_or(AZIMUTH_DEG).to_radians();
    let elevation = number(&raw.sun_elevation_deg, "sun_elevation_deg", 1.0, 90.0)?;
    let strength = number(&raw.sun_strength, "sun_strength", 0.0, 10.0)?;
    let haze = number(&raw.haze_per_m, "haze_per_m", 0.0, 1.0)?;
    let exposure = number(&raw.exposure, "exposure", 0.01, 100.0)?;
    let (named_elevation, clear) = lighting.clear();
    let mut light = weather.over(clear);
    if let Some(haze) = haze.filter(|_| weather == own.1) {
        light.haze = haze as f32;
    }
    light.dark_places = raw.dark_places || lighting.lit();
    let kept = lighting == own.0;
    let elevation = elevation.filter(|_| kept).unwrap_or(named_elevation).to_radians();
    let (ce, se) = (libm::cos(elevation), libm::sin(elevation));
    light.to_sun = Vec3::new((ce * libm::sin(azimuth)) as f32, (ce * libm::cos(azimuth)) as f32, se as f32).normalize();
    if kept && weather == own.1 {
        let colour = |target: &mut Vec3, c: Option<Colour>| *target = c.map_or(*target, |c| c.0);
        colour(&mut light.sun, raw.sun);
        colour(&mut light.sky_ambient, raw.sky_ambient);
        colour(&mut light.ground_ambient, raw.ground_ambient);
        colour(&mut light.zenith, raw.zenith);
        colour(&mut light.horizon, raw.horizon);
        light.sun *= strength.unwrap_or(1.0) as f32;
        light.exposure = exposure.map(|e| e as f32);
    }
    Ok(light)
}

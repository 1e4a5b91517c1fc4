//! Named lights and weathers, and their combination.

use glam::Vec3;
use serde::{Deserialize, Serialize};

use crate::geometry::Light;

/// A named light: position of the sun, and sky.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Lighting {
    /// Clear sky with a high sun.
    #[default]
    Day,
    /// Full cloud cover by day: no shadows.
    Overcast,
    /// The sun at the horizon; lamps are lit.
    Dusk,
    /// Moonlight; lamps are lit.
    Night,
}

impl Lighting {
    /// All lights.
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

    /// The light with this name; `None` if unknown.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|light| light.name() == name)
    }

    /// Whether lamps are lit.
    pub(crate) const fn lit(self) -> bool {
        matches!(self, Self::Dusk | Self::Night)
    }

    /// Elevation of sun or moon, degrees, and the light in clear weather apart from the sun's position.
    pub(crate) fn clear(self) -> (f64, Light) {
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
    /// No change to the light.
    #[default]
    Clear,
    /// Dry haze: visibility of a few hundred metres.
    Haze,
    /// Rain: overcast and grey, low visibility, falling drops.
    Rain,
}

impl Weather {
    /// All weathers.
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

    /// The weather with this name; `None` if unknown.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|weather| weather.name() == name)
    }

    /// A clear-sky light as changed by the weather.
    pub(crate) fn over(self, light: Light) -> Light {
        let grey = |c: Vec3, fraction: f32, gain: f32| c.lerp(Vec3::splat(c.dot(Vec3::new(0.21, 0.72, 0.07))), fraction) * gain;
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
                // Clouds scatter a part of the sunlight.
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

/// Requested light and weather; `None` for the scene's own.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SceneLook {
    /// The light. If it differs from the file's, the keys of its `[light]` are ignored, except for the sun's azimuth
    /// and the haze.
    pub lighting: Option<Lighting>,
    /// The weather. If it differs from the file's, its haze is ignored.
    pub weather: Option<Weather>,
}

/// The light of a scene during loading.
pub(crate) struct Shining {
    pub(crate) lighting: Lighting,
    pub(crate) weather: Weather,
    pub(crate) light: Light,
}

impl Shining {
    /// Whether lamps are lit.
    pub(crate) const fn lit(&self) -> bool {
        self.lighting.lit()
    }

    /// Whether the ground is wet.
    pub(crate) const fn wet(&self) -> bool {
        matches!(self.weather, Weather::Rain)
    }
}

//! The scene file as parsed, before validation.

pub(super) mod vary;

use std::collections::BTreeMap;

use serde::Deserialize;
use spf_core::craft::CraftKind;
use toml::Spanned;

use self::vary::RawVary;
use super::surface::{Colour, RawMaterial};
use crate::actors::PathEnd;
use crate::light::{Lighting, Weather};

/// The whole file.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawScene {
    /// Checked first, see [`super::source::Source::read`].
    #[serde(rename = "format")]
    _format: u32,
    pub(super) name: Spanned<String>,
    pub(super) description: Option<Spanned<String>>,
    pub(super) craft: CraftKind,
    pub(super) start: Spanned<String>,
    pub(super) preview: Option<Spanned<String>>,
    pub(super) success_radius_m: Spanned<f64>,
    pub(super) near_m: Spanned<f64>,
    pub(super) max_altitude_m: Option<Spanned<f64>>,
    pub(super) bounds: Spanned<RawBounds>,
    #[serde(default)]
    pub(super) light: RawLight,
    #[serde(default)]
    pub(super) lamps: Vec<Spanned<RawLamp>>,
    #[serde(default)]
    pub(super) materials: BTreeMap<String, Spanned<RawMaterial>>,
    #[serde(default)]
    pub(super) templates: BTreeMap<String, Spanned<RawObject>>,
    pub(super) objects: Vec<Spanned<RawObject>>,
    pub(super) vary: Option<RawVary>,
}

/// Flyable region, metres.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawBounds {
    pub(super) east: [f64; 2],
    pub(super) north: [f64; 2],
    pub(super) up: [f64; 2],
}

/// Light as written; defaults are those of `time` and `weather`, whose own default is a clear day.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawLight {
    pub(super) time: Option<Lighting>,
    pub(super) weather: Option<Weather>,
    pub(super) exposure: Option<Spanned<f64>>,
    #[serde(default)]
    pub(super) dark_places: bool,
    pub(super) sun_azimuth_deg: Option<Spanned<f64>>,
    pub(super) sun_elevation_deg: Option<Spanned<f64>>,
    pub(super) sun_strength: Option<Spanned<f64>>,
    pub(super) haze_per_m: Option<Spanned<f64>>,
    pub(super) sun: Option<Colour>,
    pub(super) sky_ambient: Option<Colour>,
    pub(super) ground_ambient: Option<Colour>,
    pub(super) zenith: Option<Colour>,
    pub(super) horizon: Option<Colour>,
}

/// A lamp that does not belong to an object.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawLamp {
    pub(super) position: [f64; 3],
    pub(super) colour: Colour,
    pub(super) strength: f64,
    pub(super) reach_m: f64,
    #[serde(default)]
    pub(super) always: bool,
}

/// An object or a template: all keys optional, checked after merging.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawObject {
    pub(super) id: Option<String>,
    pub(super) like: Option<Spanned<String>>,
    pub(super) mesh: Option<Spanned<toml::Table>>,
    #[serde(default)]
    pub(super) materials: BTreeMap<String, Spanned<String>>,
    pub(super) position: Option<Spanned<Vec<f64>>>,
    pub(super) heading_deg: Option<Spanned<f64>>,
    pub(super) scale: Option<Spanned<f64>>,
    pub(super) places: Option<Spanned<Vec<Vec<f64>>>>,
    pub(super) repeat: Option<Spanned<RawRepeat>>,
    pub(super) walk: Option<Spanned<RawMotion>>,
    pub(super) drive: Option<Spanned<RawMotion>>,
    pub(super) opening_of: Option<Spanned<String>>,
    pub(super) looks_like: Option<Spanned<String>>,
    pub(super) main_part: Option<Spanned<String>>,
    pub(super) names: Option<Vec<String>>,
    pub(super) synonyms: Option<Vec<String>>,
    pub(super) qualities: Option<Vec<String>>,
    pub(super) colour: Option<String>,
    pub(super) kind: Option<String>,
    #[serde(rename = "use")]
    pub(super) uses: Option<Vec<String>>,
    pub(super) group: Option<String>,
    pub(super) number: Option<u32>,
}

/// A row of identical objects.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawRepeat {
    pub(super) count: u32,
    /// Offset from one to the next, metres east and north.
    pub(super) step: [f64; 2],
}

/// A `walk` or a `drive` as written.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawMotion {
    pub(super) path: Spanned<Vec<Vec<f64>>>,
    pub(super) speed_m_s: Spanned<f64>,
    #[serde(rename = "loop")]
    pub(super) round: Option<Spanned<PathEnd>>,
    pub(super) wait_s: Option<Spanned<f64>>,
    pub(super) start: Option<Spanned<f64>>,
    pub(super) turn_radius_m: Option<Spanned<f64>>,
    pub(super) aside_m: Option<Spanned<f64>>,
}

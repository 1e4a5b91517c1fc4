//! The `vary` tables as parsed: what may change between variants.

use std::collections::BTreeMap;

use serde::Deserialize;
use toml::Spanned;

use crate::light::{Lighting, Weather};

/// The `vary` tables as written.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::file) struct RawVary {
    #[serde(default)]
    pub(in crate::file) shuffle: Vec<RawShuffle>,
    #[serde(default)]
    pub(in crate::file) jitter: Vec<RawJitter>,
    #[serde(default)]
    pub(in crate::file) repaint: Vec<RawRepaint>,
    #[serde(default)]
    pub(in crate::file) depart: Vec<RawDepart>,
    #[serde(default)]
    pub(in crate::file) add: Vec<Spanned<RawAdd>>,
    #[serde(default)]
    pub(in crate::file) light: RawVaryLight,
}

/// Objects that exchange places.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::file) struct RawShuffle {
    pub(in crate::file) objects: Spanned<Vec<String>>,
}

/// Objects that are moved a little.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::file) struct RawJitter {
    pub(in crate::file) objects: Spanned<Vec<String>>,
    pub(in crate::file) distance_m: Spanned<f64>,
    pub(in crate::file) turn_deg: Option<Spanned<f64>>,
    /// Whether they move as one, turning about the first.
    #[serde(default)]
    pub(in crate::file) together: bool,
}

/// Objects that are repainted: colour word and material change together.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::file) struct RawRepaint {
    pub(in crate::file) objects: Spanned<Vec<String>>,
    pub(in crate::file) slot: String,
    pub(in crate::file) colours: Spanned<BTreeMap<String, Spanned<String>>>,
}

/// Actors that start at other points of their paths.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::file) struct RawDepart {
    pub(in crate::file) objects: Spanned<Vec<String>>,
}

/// Objects that are added at some of the places.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::file) struct RawAdd {
    pub(in crate::file) id: String,
    pub(in crate::file) like: Spanned<String>,
    pub(in crate::file) mesh: Option<Spanned<toml::Table>>,
    pub(in crate::file) count: Spanned<[u32; 2]>,
    pub(in crate::file) places: Spanned<Vec<Vec<f64>>>,
    pub(in crate::file) slot: Option<String>,
    #[serde(default)]
    pub(in crate::file) colours: BTreeMap<String, Spanned<String>>,
}

/// Light and weather to choose from.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::file) struct RawVaryLight {
    #[serde(default)]
    pub(in crate::file) times: Vec<Lighting>,
    #[serde(default)]
    pub(in crate::file) weathers: Vec<Weather>,
    pub(in crate::file) sun_azimuth_deg: Option<Spanned<[f64; 2]>>,
    pub(in crate::file) sun_elevation_deg: Option<Spanned<[f64; 2]>>,
}

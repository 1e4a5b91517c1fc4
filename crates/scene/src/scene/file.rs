//! The scene file as written: its keys, and where in the text each thing stands.

use std::collections::BTreeMap;
use std::ops::Range;

use serde::Deserialize;
use serde::de::DeserializeOwned;
use toml::Spanned;

use super::error::{SceneError, hint_from};
use super::light::{Lighting, Weather};
use super::motion::RawMotion;
use super::surface::{Colour, RawMaterial};
use super::variant::RawVary;
use spf_core::craft::CraftKind;

/// Longest scene file that is read, bytes.
pub(super) const MAX_BYTES: usize = 4 << 20;

/// The version of the format that is read.
const FORMAT: u32 = 1;

/// The text of a scene file with its name, for errors.
pub(super) struct Source<'a> {
    text: &'a str,
    file: &'a str,
}

impl<'a> Source<'a> {
    pub(super) const fn new(text: &'a str, file: &'a str) -> Self {
        Self { text, file }
    }

    /// The file's name.
    pub(super) const fn name(&self) -> &'a str {
        self.file
    }

    /// An error at the start of a span.
    pub(super) fn error(&self, at: &Range<usize>, message: impl Into<String>, hint: Option<String>) -> SceneError {
        let before = self.text.as_bytes().get(..at.start.min(self.text.len())).unwrap_or_default();
        let line = 1 + before.iter().filter(|&&b| b == b'\n').count();
        SceneError::Invalid { file: self.file.to_owned(), line, message: message.into(), hint }
    }

    /// An error of the TOML reader, whose span is in the text.
    pub(super) fn toml_error(&self, error: &toml::de::Error) -> SceneError {
        let message = first_line(error.message());
        self.error(&error.span().unwrap_or(0..0), message.clone(), hint_from(&message))
    }
}

/// The first line of a parser's message, in the house's manner.
pub(super) fn first_line(message: &str) -> String {
    message.lines().next().unwrap_or_default().to_owned()
}

/// The whole file.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawScene {
    /// Looked at before all else, see [`read`].
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

/// Flying room, metres.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawBounds {
    pub(super) east: [f64; 2],
    pub(super) north: [f64; 2],
    pub(super) up: [f64; 2],
}

/// Light as written; what is left out is that of `time` and `weather`, and those are a clear day.
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

/// A lamp that belongs to no object.
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

/// A row of equal objects.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawRepeat {
    pub(super) count: u32,
    /// From one to the next, metres east and north.
    pub(super) step: [f64; 2],
}

/// Reads the text into its keys, those of a scene or of a scene that names a model, and checks the format version first.
pub(super) fn read<T: DeserializeOwned>(source: &Source<'_>) -> Result<T, SceneError> {
    if source.text.len() > MAX_BYTES {
        return Err(SceneError::too_large(source.file));
    }
    // The version is looked at before the keys, so that a newer file is not blamed for keys that this program does not know.
    let format = toml::from_str::<Version>(source.text).map_err(|e| source.toml_error(&e))?.format;
    if *format.get_ref() != FORMAT {
        let message = format!("scene format `{}` is not known, this program reads format {FORMAT}", format.get_ref());
        return Err(source.error(&format.span(), message, Some("update the program, or write `format = 1`".to_owned())));
    }
    toml::from_str(source.text).map_err(|e| source.toml_error(&e))
}

#[derive(Deserialize)]
struct Version {
    format: Spanned<u32>,
}

//! A scene file for a model: `[gltf] file = "harbour.glb"`, with the usual keys for what the model lacks.

use serde::Deserialize;
use serde::de::IgnoredAny;
use spf_core::craft::CraftKind;
use toml::Spanned;

use super::raw::{RawBounds, RawLight};
use super::source::Source;
use super::{build, shine};
use crate::error::SceneError;
use crate::gltf::{self, ModelOverrides, UpAxis};
use crate::light::SceneLook;
use crate::world::Scene;

/// The whole file.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawWrapper {
    /// Checked earlier, see [`Source::read`].
    #[serde(rename = "format")]
    _format: u32,
    name: Option<Spanned<String>>,
    description: Option<Spanned<String>>,
    craft: Option<CraftKind>,
    start: Option<Spanned<String>>,
    preview: Option<Spanned<String>>,
    success_radius_m: Option<Spanned<f64>>,
    near_m: Option<Spanned<f64>>,
    bounds: Option<Spanned<RawBounds>>,
    #[serde(default)]
    light: RawLight,
    gltf: RawModel,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawModel {
    /// Path from the scene file's folder.
    file: Spanned<String>,
    scale: Option<Spanned<f64>>,
    up: Option<UpAxis>,
}

#[derive(Deserialize)]
struct Probe {
    gltf: Option<IgnoredAny>,
}

/// Whether a text is a scene file that names a model.
pub(super) fn names_a_model(text: &str) -> bool {
    toml::from_str::<Probe>(text).is_ok_and(|probe| probe.gltf.is_some())
}

/// Loads the model that the text names.
pub(super) fn load(source: &Source<'_>, conditions: &SceneLook) -> Result<Scene, SceneError> {
    let raw: RawWrapper = source.read()?;
    let at = raw.gltf.file.span();
    let Some(folder) = source.folder() else {
        return Err(source.error(&at, "a scene with `[gltf]` must be loaded from its path", None));
    };
    let name = raw.gltf.file.get_ref();
    if !gltf::is_model(name) {
        let hint = "for example `file = \"harbour.glb\"`, relative to this file's folder".to_owned();
        return Err(source.error(&at, format!("`{name}` does not end in `.glb` or `.gltf`"), Some(hint)));
    }
    let scale = match &raw.gltf.scale {
        Some(s) if !(1e-4..=1e4).contains(s.get_ref()) => {
            let message = format!("`scale` must be from 0.0001 to 10000, not `{}`", s.get_ref());
            return Err(source.error(&s.span(), message, None));
        }
        s => s.as_ref().map(|s| *s.get_ref()),
    };
    let bounds = raw.bounds.as_ref().map(|bounds| build::bounds(bounds, source)).transpose()?;
    let overrides = ModelOverrides {
        name: raw.name.as_ref().map(|name| build::checked_name(name, source)).transpose()?,
        description: build::description(raw.description.as_ref(), source)?,
        craft: raw.craft,
        start: raw.start.as_ref().map(|start| build::pose(start, "start", bounds.as_ref(), source)).transpose()?,
        preview: raw.preview.as_ref().map(|p| build::pose(p, "preview", None, source)).transpose()?,
        success_radius: raw.success_radius_m.as_ref().map(|r| build::radius(r, "success_radius_m", source)).transpose()?,
        near: raw.near_m.as_ref().map(|r| build::radius(r, "near_m", source)).transpose()?,
        bounds,
        scale,
        up: raw.gltf.up,
    };
    let shining = shine::light_alone(&raw.light, conditions, source)?;
    gltf::load(&folder.join(name).to_string_lossy(), &overrides, shining)
}

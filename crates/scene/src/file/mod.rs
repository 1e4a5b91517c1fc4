//! Scene files (`docs/reference/scene-format.md`): from text via validated entries to the scene.

mod build;
mod expand;
mod model;
mod motion;
mod raw;
mod shine;
mod source;
mod surface;
mod variant;
mod wrapper;

use std::path::Path;

use crate::error::SceneError;
use crate::light::{SceneLook, Shining};
use crate::world::Scene;

use self::raw::RawLight;
use self::source::Source;

/// The default light of a scene.
pub(crate) fn own_light(conditions: &SceneLook) -> Result<Shining, SceneError> {
    shine::light_alone(&RawLight::default(), conditions, &Source::new("", "", None))
}

/// Reads a scene from its text. `file` is its name in errors; `folder` is the file's folder, `None` if only the text is
/// known. With a seed, reads the variant with that seed.
pub(crate) fn parse(
    text: &str,
    file: &str,
    folder: Option<&Path>,
    conditions: &SceneLook,
    seed: Option<u64>,
) -> Result<Scene, SceneError> {
    let source = Source::new(text, file, folder);
    if wrapper::names_a_model(text) {
        if seed.is_some() {
            return Err(SceneError::no_variants(file, 1));
        }
        return wrapper::load(&source, conditions);
    }
    let mut raw = source.read()?;
    let mut expanded = expand::expand(&raw, &source)?;
    let Some(seed) = seed else { return build::build(&raw, expanded, conditions, &source) };
    let mut conditions = *conditions;
    variant::vary(&mut raw, &mut expanded, &mut conditions, seed, &source)?;
    let mut scene = build::build(&raw, expanded, &conditions, &source)?;
    scene.name = format!("{}@{seed}", scene.name);
    Ok(scene)
}

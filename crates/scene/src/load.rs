//! Loading scenes (`docs/reference/scene-format.md`).
//!
//! [`Scene::load`] reads a built-in scene by name or a file by path, validates it, and builds its meshes. Object ids
//! are assigned from 1 in file order, so the same file always gives the same ids.

use std::io::ErrorKind;
use std::path::Path;

use crate::error::SceneError;
use crate::file;
use crate::gltf::{self, ModelOverrides};
use crate::light::SceneLook;
use crate::limits::MAX_BYTES;
use crate::mesh::KINDS;
use crate::world::Scene;

/// The built-in scenes: name and text.
const BUILT_IN: &[(&str, &str)] = &[
    ("city", include_str!("../../../scenes/city.toml")),
    ("park", include_str!("../../../scenes/park.toml")),
    ("office", include_str!("../../../scenes/office.toml")),
    ("yard", include_str!("../../../scenes/yard.toml")),
];

/// Whether a name is the path of a file that can be read as a scene.
fn is_file(name: &str) -> bool {
    gltf::is_model(name) || name.ends_with(".toml")
}

/// Splits the seed of a variant off a scene's name: `city@17` is variant 17 of `city`. The part before the `@` must be
/// a scene's name, so that other paths may contain an `@`.
fn split(name: &str) -> Result<(&str, Option<u64>), SceneError> {
    let Some((scene, seed)) = name.rsplit_once('@') else { return Ok((name, None)) };
    let is_scene = BUILT_IN.iter().any(|(known, _)| *known == scene) || is_file(scene);
    if !is_scene {
        return Ok((name, None));
    }
    let digits = !seed.is_empty() && seed.bytes().all(|b| b.is_ascii_digit());
    match seed.parse() {
        Ok(number) if digits => Ok((scene, Some(number))),
        _ => Err(SceneError::bad_seed(scene, seed)),
    }
}

impl Scene {
    /// Loads a built-in scene by name (`city`, `park`), or a file by path: a scene file (`.toml`), or a glTF 2.0 model
    /// (`.glb` or `.gltf`, see `docs/guide/gltf.md`). A suffix of `@` and a number (`city@17`) selects the variant with
    /// that seed.
    ///
    /// # Errors
    /// [`SceneError::Unknown`] for an unknown name, [`SceneError::Read`] if the file cannot be read,
    /// [`SceneError::Invalid`] if it is not a valid scene, with the line and a hint where possible,
    /// [`SceneError::Model`] if a model cannot be used as a world.
    pub fn load(name_or_path: &str) -> Result<Self, SceneError> {
        Self::load_with(name_or_path, &SceneLook::default())
    }

    /// Loads a scene with different light and weather.
    ///
    /// # Errors
    /// Same as [`Scene::load`].
    pub fn load_with(name_or_path: &str, conditions: &SceneLook) -> Result<Self, SceneError> {
        Self::load_adding(name_or_path, conditions, "")
    }

    /// Loads a scene with further objects: `[[objects]]` tables of the scene format, whose ids follow those of the file. Errors
    /// count their lines as those of text appended to the file.
    ///
    /// # Errors
    /// Same as [`Scene::load`], and [`SceneError::Invalid`] for objects added to a glTF model.
    pub fn load_adding(name_or_path: &str, conditions: &SceneLook, objects: &str) -> Result<Self, SceneError> {
        let (name_or_path, seed) = split(name_or_path)?;
        let with = |text: &str| if objects.is_empty() { text.to_owned() } else { format!("{text}\n{objects}") };
        if let Some((name, text)) = BUILT_IN.iter().find(|(name, _)| *name == name_or_path) {
            return file::parse(&with(text), &format!("scenes/{name}.toml"), None, conditions, seed);
        }
        if gltf::is_model(name_or_path) {
            if !objects.is_empty() {
                return Err(SceneError::no_objects(name_or_path));
            }
            if seed.is_some() {
                return Err(SceneError::no_variants(name_or_path, 1));
            }
            return gltf::load(name_or_path, &ModelOverrides::default(), file::own_light(conditions)?);
        }
        if !is_file(name_or_path) {
            return Err(SceneError::unknown(name_or_path, &Self::built_in()));
        }
        let read = |source| SceneError::Read { path: name_or_path.to_owned(), source };
        let bytes = spf_input::read(Path::new(name_or_path), MAX_BYTES as u64).map_err(|error| match error.kind() {
            ErrorKind::FileTooLarge => SceneError::too_large(name_or_path),
            _ => read(error),
        })?;
        let text = String::from_utf8(bytes).map_err(|error| read(std::io::Error::new(ErrorKind::InvalidData, error)))?;
        let text = with(&text);
        file::parse(&text, name_or_path, Path::new(name_or_path).parent(), conditions, seed)
    }

    /// Parses a scene from text; `file` is its name in errors.
    ///
    /// # Errors
    /// [`SceneError::Invalid`] if it is not a valid scene.
    pub fn parse(text: &str, file: &str) -> Result<Self, SceneError> {
        file::parse(text, file, None, &SceneLook::default(), None)
    }

    /// Parses the variant with this seed of a scene from text; `file` is its name in errors.
    ///
    /// # Errors
    /// [`SceneError::Invalid`], also for a scene without `vary` tables.
    pub fn parse_variant(text: &str, file: &str, seed: u64) -> Result<Self, SceneError> {
        file::parse(text, file, None, &SceneLook::default(), Some(seed))
    }

    /// Parses the bytes of a self-contained `.glb` or `.gltf` file; `file` is its name in errors.
    ///
    /// # Errors
    /// [`SceneError::Model`] if it cannot be used as a world.
    pub fn parse_model(bytes: &[u8], file: &str) -> Result<Self, SceneError> {
        gltf::parse(bytes, file, None, &ModelOverrides::default(), file::own_light(&SceneLook::default())?)
    }

    /// Names of the built-in scenes.
    #[must_use]
    pub fn built_in() -> Vec<&'static str> {
        BUILT_IN.iter().map(|(name, _)| *name).collect()
    }

    /// All kinds of meshes available in scene files, in alphabetical order.
    #[must_use]
    pub fn mesh_kinds() -> Vec<&'static str> {
        KINDS.iter().map(|(name, _)| *name).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_seed_is_split_off_a_name() {
        let parts = |name| split(name).unwrap();
        assert_eq!(parts("city@17"), ("city", Some(17)));
        assert_eq!(parts("city"), ("city", None));
        assert_eq!(parts("a@b/yard.toml"), ("a@b/yard.toml", None));
        assert_eq!(parts("a@b/yard.toml@3"), ("a@b/yard.toml", Some(3)));
        assert_eq!(parts("me@home"), ("me@home", None));
        for bad in ["city@", "city@-1", "city@+1", "city@1.5", "city@x", "city@18446744073709551616", "my.toml@a"] {
            let error = split(bad).unwrap_err().to_string();
            assert!(error.contains("whole number") && error.contains(bad), "{error}");
        }
    }
}

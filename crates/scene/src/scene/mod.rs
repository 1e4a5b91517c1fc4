//! Scenes: data files that say what stands where and what people call it (DESIGN.md section 5; `docs/scene-format.md`).
//!
//! [`Scene::load`] reads a built-in scene by name or a user's file by path, checks it, and builds its meshes. Object ids count
//! from 1 in the order of the file, so the same file always gives the same ids.

mod build;
mod error;
mod expand;
mod file;
mod light;
mod motion;
mod surface;
mod variant;
mod wrapper;

use std::path::Path;

use glam::Vec3;
use serde::Serialize;
use serde_json::json;
use spf_core::geometry::{EnuPosition, Pose};

pub(crate) use self::build::{above, parse_pose};
pub use self::error::SceneError;
pub use self::error::hint_from;
pub(crate) use self::expand::{LONGEST as LONGEST_TAG, MAX_OBJECTS};
pub(crate) use self::light::Shining;
pub use self::light::{Conditions, Lighting, Weather};
use crate::actors::Actor;
use crate::geometry::{ObjectId, Part, SceneGeometry};
use crate::gltf::{self, Wishes};
use crate::mesh::KINDS;
use spf_core::craft::CraftKind;
use spf_core::tags::Tagged;

/// The scenes that come with the program: name and text.
const BUILT_IN: &[(&str, &str)] = &[
    ("city", include_str!("../../../../scenes/city.toml")),
    ("park", include_str!("../../../../scenes/park.toml")),
    ("office", include_str!("../../../../scenes/office.toml")),
    ("yard", include_str!("../../../../scenes/yard.toml")),
];

/// A loaded scene.
#[derive(Clone, Debug)]
pub struct Scene {
    /// Name, as in the file.
    pub name: String,
    /// What it shows, in one line for people; empty when the file says nothing.
    pub description: String,
    /// Range at which the oracle believes a goal reached, metres: 3.0 in scenes of the simulation set, 0.8 in the real-world set.
    pub near: f64,
    /// The judge's radius about the nearest surface of the goal, metres.
    pub success_radius: f64,
    /// The envelope's greatest height above take-off here, metres: a room's ceiling for whoever starts on its floor. None where
    /// the envelope's own will do. Not taken from `bounds`: a model's end at its roof, above which one may well fly.
    pub max_altitude: Option<f64>,
    /// The craft that flies here unless the user names another.
    pub default_craft: CraftKind,
    /// Where the craft stands before take-off.
    pub start: Pose,
    /// From where the scene is best shown in one picture.
    pub preview: Pose,
    /// Where flying makes sense; the ground may reach farther.
    pub bounds: Aabb,
    /// Everything that is seen, ids counting from 1.
    pub objects: Vec<Object>,
    /// The light in force.
    pub lighting: Lighting,
    /// The weather in force.
    pub weather: Weather,
    /// Meshes of what stands still, materials, light.
    pub geometry: SceneGeometry,
    /// What moves by itself, in the order of ids. Bounds and outlines of these objects are those of the beginning.
    pub actors: Vec<Actor>,
}

/// One thing of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Object {
    /// Its number in id pictures.
    pub id: ObjectId,
    /// Its name in the file, unique; repeated objects end in `_1`, `_2`, ….
    pub key: String,
    /// What people call it.
    pub tags: Tags,
    /// Kind of its mesh, one of [`Scene::mesh_kinds`], or `gltf` for one out of a model file.
    pub mesh: &'static str,
    /// Whether it is an opening, a surface that hides and touches nothing.
    pub opening: bool,
    /// Extent of its meshes.
    pub bounds: Aabb,
    /// Footprint polygons for drawings seen from above, metres east and north, counter-clockwise.
    pub outline: Vec<Vec<[f64; 2]>>,
}

/// What people call a thing and do with it. Lower case.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Tags {
    /// What it is, most fitting first; never empty.
    pub names: Vec<String>,
    /// Other words for it.
    pub synonyms: Vec<String>,
    /// Adjectives besides the colour.
    pub qualities: Vec<String>,
    /// Main colour in words.
    pub colour: Option<String>,
    /// Category: building, vehicle, tree, tower, ….
    pub kind: String,
    /// What people do with it, as verbs or phrases.
    pub uses: Vec<String>,
    /// Where it belongs: construction site, car park, ….
    pub group: Option<String>,
    /// Number written on it or known by.
    pub number: Option<u32>,
    /// For an opening: the object it leads through.
    pub opening_of: Option<ObjectId>,
}

/// An axis-parallel box in the world, metres.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Aabb {
    /// Western, southern, lower corner.
    pub min: EnuPosition,
    /// Eastern, northern, upper corner.
    pub max: EnuPosition,
}

impl Aabb {
    /// Whether a position lies inside or on the boundary.
    #[must_use]
    pub fn contains(&self, p: EnuPosition) -> bool {
        (self.min.east..=self.max.east).contains(&p.east)
            && (self.min.north..=self.max.north).contains(&p.north)
            && (self.min.up..=self.max.up).contains(&p.up)
    }

    /// The smallest box about some points; none for no points.
    pub(crate) fn around(points: impl Iterator<Item = Vec3>) -> Option<Self> {
        let (min, max) =
            points.fold(None, |sum: Option<(Vec3, Vec3)>, p| Some(sum.map_or((p, p), |(min, max)| (min.min(p), max.max(p)))))?;
        let corner = |v: Vec3| EnuPosition { east: f64::from(v.x), north: f64::from(v.y), up: f64::from(v.z) };
        Some(Self { min: corner(min), max: corner(max) })
    }
}

/// Whether a path is that of a model.
fn is_model(path: &str) -> bool {
    let end = Path::new(path).extension().unwrap_or_default();
    end.eq_ignore_ascii_case("glb") || end.eq_ignore_ascii_case("gltf")
}

/// Whether a name is the path of a file that a scene can be read from.
fn is_file(name: &str) -> bool {
    is_model(name) || name.ends_with(".toml")
}

/// The light of a scene that says nothing of it.
fn own_light(conditions: &Conditions) -> Result<Shining, SceneError> {
    Shining::of(&file::RawLight::default(), conditions, &file::Source::new("", ""))
}

impl Scene {
    /// Loads a built-in scene by name (`city`, `park`), or a file by its path: a scene file, which ends in `.toml`, or a glTF 2.0 model,
    /// which ends in `.glb` or `.gltf` (`docs/gltf.md`). With `@` and a number behind it (`city@17`), the variant of that seed.
    ///
    /// # Errors
    /// [`SceneError::Unknown`] for a name that no built-in scene has, [`SceneError::Read`] if the file cannot be read,
    /// [`SceneError::Invalid`] if it is no scene, with the line and a hint where there is one, [`SceneError::Model`] if a model
    /// cannot be made a world.
    pub fn load(name_or_path: &str) -> Result<Self, SceneError> {
        Self::load_with(name_or_path, &Conditions::default())
    }

    /// The same under other light and weather than the file's own.
    ///
    /// # Errors
    /// As [`Scene::load`].
    pub fn load_with(name_or_path: &str, conditions: &Conditions) -> Result<Self, SceneError> {
        let (name_or_path, seed) = variant::split(name_or_path)?;
        if let Some((name, text)) = BUILT_IN.iter().find(|(name, _)| *name == name_or_path) {
            return Self::parse_with(text, &format!("scenes/{name}.toml"), None, conditions, seed);
        }
        if is_model(name_or_path) {
            if seed.is_some() {
                return Err(SceneError::no_variants(name_or_path, 1));
            }
            return gltf::load(name_or_path, &Wishes::default(), own_light(conditions)?);
        }
        if !is_file(name_or_path) {
            return Err(SceneError::unknown(name_or_path, &Self::built_in()));
        }
        let read = |source| SceneError::Read { path: name_or_path.to_owned(), source };
        let length = std::fs::metadata(name_or_path).map_err(read)?.len();
        if length > file::MAX_BYTES as u64 {
            return Err(SceneError::too_large(name_or_path));
        }
        let text = std::fs::read_to_string(name_or_path).map_err(read)?;
        Self::parse_with(&text, name_or_path, Path::new(name_or_path).parent(), conditions, seed)
    }

    /// Reads a scene from its text; `file` names it in errors.
    ///
    /// # Errors
    /// [`SceneError::Invalid`].
    pub fn parse(text: &str, file: &str) -> Result<Self, SceneError> {
        Self::parse_with(text, file, None, &Conditions::default(), None)
    }

    /// The variant of a seed of a scene from its text; `file` names it in errors.
    ///
    /// # Errors
    /// [`SceneError::Invalid`], also for a scene without `vary` tables.
    pub fn parse_variant(text: &str, file: &str, seed: u64) -> Result<Self, SceneError> {
        Self::parse_with(text, file, None, &Conditions::default(), Some(seed))
    }

    /// Reads a scene from the bytes of a `.glb` or `.gltf` that names no other files; `file` names it in errors.
    ///
    /// # Errors
    /// [`SceneError::Model`].
    pub fn parse_model(bytes: &[u8], file: &str) -> Result<Self, SceneError> {
        gltf::parse(bytes, file, None, &Wishes::default(), own_light(&Conditions::default())?)
    }

    fn parse_with(
        text: &str,
        file: &str,
        folder: Option<&Path>,
        conditions: &Conditions,
        seed: Option<u64>,
    ) -> Result<Self, SceneError> {
        let source = file::Source::new(text, file);
        if wrapper::names_a_model(text) {
            if seed.is_some() {
                return Err(SceneError::no_variants(file, 1));
            }
            return wrapper::load(&source, folder, conditions);
        }
        let mut raw = file::read(&source)?;
        let mut expanded = expand::expand(&raw, &source)?;
        let Some(seed) = seed else { return build::build(&raw, expanded, conditions, &source) };
        let mut conditions = *conditions;
        variant::vary(&mut raw, &mut expanded, &mut conditions, seed, &source)?;
        let mut scene = build::build(&raw, expanded, &conditions, &source)?;
        scene.name = format!("{}@{seed}", scene.name);
        Ok(scene)
    }

    /// Names of the built-in scenes.
    #[must_use]
    pub fn built_in() -> Vec<&'static str> {
        BUILT_IN.iter().map(|(name, _)| *name).collect()
    }

    /// Every kind of mesh that a scene file can name, in alphabetical order.
    #[must_use]
    pub fn mesh_kinds() -> Vec<&'static str> {
        KINDS.iter().map(|(name, _)| *name).collect()
    }

    /// The object of an id; none for 0 (nothing) and ids beyond the list.
    #[must_use]
    pub fn object(&self, id: ObjectId) -> Option<&Object> {
        self.objects.get(usize::from(id).checked_sub(1)?)
    }

    /// The meshes of everything: what stands still in the world, what moves in its own frame and first posture.
    pub fn meshes(&self) -> impl Iterator<Item = &Part> {
        self.geometry.parts.iter().chain(self.actors.iter().filter_map(|actor| actor.postures.first()).flatten())
    }

    /// The object of a key.
    #[must_use]
    pub fn by_key(&self, key: &str) -> Option<&Object> {
        self.objects.iter().find(|o| o.key == key)
    }

    /// The tags of all objects as the oracle and the truth read them, in the order of their ids.
    #[must_use]
    pub fn tagged(&self) -> Vec<Tagged> {
        let tagged = |o: &Object| Tagged {
            id: o.id,
            key: o.key.clone(),
            names: o.tags.names.clone(),
            synonyms: o.tags.synonyms.clone(),
            colour: o.tags.colour.clone(),
            kind: o.tags.kind.clone(),
            qualities: o.tags.qualities.clone(),
            uses: o.tags.uses.clone(),
            opening: o.opening,
            opening_of: o.tags.opening_of.and_then(|id| self.object(id)).map(|of| of.key.clone()),
        };
        self.objects.iter().map(tagged).collect()
    }

    /// The legend of an id picture: `{"scene": …, "objects": [{"id": 1, "key": …, "opening": …, "tags": {…}, "bounds": {…}}]}`.
    #[must_use]
    pub fn legend_json(&self) -> serde_json::Value {
        let objects: Vec<_> = self
            .objects
            .iter()
            .map(|o| json!({ "id": o.id, "key": o.key, "opening": o.opening, "tags": o.tags, "bounds": o.bounds }))
            .collect();
        json!({ "scene": self.name, "objects": objects })
    }
}

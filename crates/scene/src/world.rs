//! A loaded world: objects, names, light.

use serde::Serialize;
use serde_json::json;
use spf_core::craft::CraftKind;
use spf_core::geometry::{EnuPosition, Pose};
use spf_core::sign::SignView;
use spf_core::tags::{PieceTag, Tagged};

use crate::actors::Actor;
use crate::bounds::Aabb;
use crate::geometry::{ObjectId, Part, SceneGeometry};
use crate::light::{Lighting, Weather};
use crate::sign::Sign;

/// A loaded scene.
#[derive(Clone, Debug)]
pub struct Scene {
    /// Name, as in the file.
    pub name: String,
    /// One-line description; empty if the file has none.
    pub description: String,
    /// Range at which the oracle considers a goal reached, metres: 3.0 in scenes of the simulation set, 0.8 in the
    /// real-world set.
    pub near: f64,
    /// The judge's success radius around the nearest surface of the goal, metres.
    pub success_radius: f64,
    /// Maximum altitude above take-off in this scene, metres, such as the ceiling of a room; `None` for the envelope's
    /// default. Not derived from `bounds`: those of a model end at its roof, above which flying is allowed.
    pub max_altitude: Option<f64>,
    /// The default craft model.
    pub default_craft: CraftKind,
    /// Start pose of the craft, before take-off.
    pub start: Pose,
    /// Camera pose for a preview image.
    pub preview: Pose,
    /// Extent of the flyable region; the ground may extend beyond it.
    pub bounds: Aabb,
    /// All visible objects, with ids from 1.
    pub objects: Vec<Object>,
    /// The named parts of objects, in order of the objects; see [`Part::pieces`].
    pub pieces: Vec<PieceTag>,
    /// The current light.
    pub lighting: Lighting,
    /// The current weather.
    pub weather: Weather,
    /// Meshes of static objects, materials, light.
    pub geometry: SceneGeometry,
    /// Actors, in order of ids. Bounds and outlines of these objects are the initial ones.
    pub actors: Vec<Actor>,
    /// What of its glTF files is not drawn, or may be in another unit: a sentence each, for whoever loaded it.
    pub warnings: Vec<String>,
}

/// An object of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Object {
    /// Its id in id images.
    pub id: ObjectId,
    /// Its name in the file, unique; repeated objects end in `_1`, `_2`, ….
    pub key: String,
    /// Its names, uses and other properties in words.
    pub tags: Tags,
    /// Kind of its mesh: one of [`Scene::mesh_kinds`], `model` for a model file placed as an object, or `gltf` for an object of
    /// a scene loaded from a glTF file.
    pub mesh: &'static str,
    /// Whether it is an opening: a surface that neither hides nor collides with anything.
    pub opening: bool,
    /// Extent of its meshes.
    pub bounds: Aabb,
    /// Footprint polygons for maps, metres east and north, counter-clockwise.
    pub outline: Vec<Vec<[f64; 2]>>,
    /// What is written on it.
    pub sign: Option<Sign>,
}

/// Names and properties of an object, as people describe it, in lower case.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Tags {
    /// Its names, the most specific first; never empty.
    pub names: Vec<String>,
    /// Synonyms.
    pub synonyms: Vec<String>,
    /// Adjectives besides the colour.
    pub qualities: Vec<String>,
    /// Main colour in words.
    pub colour: Option<String>,
    /// Category: building, vehicle, tree, tower, ….
    pub kind: String,
    /// What people do with it, as verbs or phrases.
    pub uses: Vec<String>,
    /// The group of objects to which it belongs: construction site, car park, ….
    pub group: Option<String>,
    /// Number written on it, or by which it is known.
    pub number: Option<u32>,
    /// For an opening: the object it leads through.
    pub opening_of: Option<ObjectId>,
    /// For a look-alike: the object that it seems to be.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub looks_like: Option<ObjectId>,
}

impl Scene {
    /// The object with this id; `None` for 0 (no object) and ids out of range.
    #[must_use]
    pub fn object(&self, id: ObjectId) -> Option<&Object> {
        self.objects.get(usize::from(id).checked_sub(1)?)
    }

    /// All meshes: those of static objects in the world frame, those of actors in their own frame and first posture.
    pub fn meshes(&self) -> impl Iterator<Item = &Part> {
        self.geometry.parts.iter().chain(self.actors.iter().filter_map(|actor| actor.postures.first()).flatten())
    }

    /// The signs that face an eye, by ascending id of their objects.
    #[must_use]
    pub fn signs_from(&self, eye: EnuPosition) -> Vec<SignView> {
        let view = |object: &Object| {
            let sign = object.sign.as_ref()?;
            Some(SignView {
                id: object.id,
                text: sign.text.clone(),
                arrow: sign.arrow,
                letter_m: sign.letter,
                area_m2: sign.area,
                facing: sign.facing(eye),
            })
        };
        self.objects.iter().filter_map(view).filter(|view| view.facing > 0.0).collect()
    }

    /// The object with this key.
    #[must_use]
    pub fn by_key(&self, key: &str) -> Option<&Object> {
        self.objects.iter().find(|o| o.key == key)
    }

    /// The tags of all objects, in order of ids, in the form that the oracle and the ground truth use.
    #[must_use]
    pub fn tagged(&self) -> Vec<Tagged> {
        let key = |id: Option<ObjectId>| id.and_then(|id| self.object(id)).map(|of| of.key.clone());
        let tagged = |o: &Object| Tagged {
            id: o.id,
            key: o.key.clone(),
            names: o.tags.names.clone(),
            synonyms: o.tags.synonyms.clone(),
            colour: o.tags.colour.clone(),
            kind: o.tags.kind.clone(),
            qualities: o.tags.qualities.clone(),
            uses: o.tags.uses.clone(),
            group: o.tags.group.clone(),
            stands_for_group: false,
            opening: o.opening,
            opening_of: key(o.tags.opening_of),
            looks_like: key(o.tags.looks_like),
        };
        let mut all: Vec<Tagged> = self.objects.iter().map(tagged).collect();
        Tagged::represent_groups(&mut all);
        all
    }

    /// The legend of an id image: `{"scene": …, "objects": [{"id": 1, "key": …, "opening": …, "tags": {…}, "bounds": {…}}]}`.
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

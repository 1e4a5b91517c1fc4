//! `mesh = { kind = "model", file = "chair.glb" }`: a glTF model as the mesh of an object.

use std::ops::Range;
use std::sync::Arc;

use serde::Deserialize;

use super::raw::RawObject;
use super::source::{Source, first_line};
use crate::error::{SceneError, hint_from};
use crate::geometry::{Material, Part, Pattern};
use crate::gltf::{self, Model, UpAxis};
use crate::mesh::{Generator, Sketch, Slots, Surface};
use crate::texture::Texture;

/// The kind of such a mesh.
pub(super) const KIND: &str = "model";

/// The slot name of its surfaces; its materials are its own.
const SLOT: &str = "model";

/// Maximum number of different models in a scene.
const MAX_MODELS: usize = 100;

/// Maximum memory for the images of all models, bytes: as much as those of one world.
const MAX_TEXTURE_BYTES: usize = 256 << 20;

/// The keys of such a mesh.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawModel {
    /// Path from the scene file's folder.
    file: String,
    /// The file's upward axis, unless given in the file.
    up: Option<UpAxis>,
}

/// The models of a scene, each loaded once.
#[derive(Debug, Default)]
pub(super) struct Models {
    list: Vec<(RawModel, Arc<Model>)>,
    /// Memory used by their images, bytes.
    images: usize,
    /// What of them is not drawn.
    pub(super) warnings: Vec<String>,
}

impl Models {
    /// The index of the model that an object's mesh names; loads it if necessary.
    pub(super) fn get(
        &mut self,
        object: &RawObject,
        keys: toml::Table,
        at: &Range<usize>,
        source: &Source<'_>,
    ) -> Result<usize, SceneError> {
        let raw: RawModel = keys.try_into().map_err(|e: toml::de::Error| {
            let message = first_line(e.message());
            let hint = hint_from(&message);
            source.error(at, format!("mesh `{KIND}`: {message}"), hint)
        })?;
        if let Some(moves) = object.walk.as_ref().or(object.drive.as_ref()) {
            return Err(source.error(&moves.span(), "a model cannot move", None));
        }
        if let Some((_, own)) = object.materials.first_key_value() {
            return Err(source.error(&own.span(), "a model has its own materials", Some("remove `materials`".to_owned())));
        }
        if let Some(number) = self.list.iter().position(|(known, _)| *known == raw) {
            return Ok(number);
        }
        let Some(folder) = source.folder() else {
            return Err(source.error(at, "a scene with a model must be loaded from its path", None));
        };
        if !gltf::is_model(&raw.file) {
            let hint = "for example `file = \"chair.glb\"`, relative to this file's folder".to_owned();
            return Err(source.error(at, format!("`{}` does not end in `.glb` or `.gltf`", raw.file), Some(hint)));
        }
        if self.list.len() >= MAX_MODELS {
            return Err(source.error(at, format!("a scene may have at most {MAX_MODELS} different models"), None));
        }
        let model = Model::load(folder, &raw.file, raw.up)
            .map_err(|problem| source.error(at, format!("the model `{}`: {}", raw.file, problem.message), problem.hint))?;
        self.images += model.textures.iter().map(Texture::bytes).sum::<usize>();
        if self.images > MAX_TEXTURE_BYTES {
            let message = format!("the textures of the models exceed {} MiB", MAX_TEXTURE_BYTES >> 20);
            return Err(source.error(at, message, Some("make them smaller".to_owned())));
        }
        self.warnings.extend(model.warnings.iter().map(|warning| format!("the model `{}`: {warning}", raw.file)));
        self.list.push((raw, Arc::new(model)));
        Ok(self.list.len() - 1)
    }

    /// The generator for the model with an index.
    pub(super) fn generator(&self, number: usize) -> Box<dyn Generator> {
        Box::new(Drawn(self.list[number].1.clone()))
    }

    /// Adds the materials and images of all models to those of the scene; returns the offset of each model's material
    /// indices, `None` if there are too many.
    pub(super) fn add_looks(&self, materials: &mut Vec<Material>, textures: &mut Vec<Texture>) -> Option<Vec<u16>> {
        let mut grown = Vec::with_capacity(self.list.len());
        for (_, model) in &self.list {
            let more = u16::try_from(textures.len()).ok()?;
            grown.push(u16::try_from(materials.len()).ok()?);
            // An invalid index stands for white.
            u16::try_from(textures.len() + model.textures.len()).ok().filter(|count| *count < u16::MAX)?;
            materials.extend(model.materials.iter().map(|material| match material.pattern {
                Pattern::Image { texture, mirror } if usize::from(texture) < model.textures.len() => {
                    Material { pattern: Pattern::Image { texture: texture + more, mirror }, ..material.clone() }
                }
                _ => material.clone(),
            }));
            textures.extend(model.textures.iter().cloned());
        }
        u16::try_from(materials.len()).ok().map(|_| grown)
    }

    /// The names of a model's parts.
    pub(super) fn pieces(&self, number: usize) -> &[String] {
        &self.list[number].1.pieces
    }

    /// The meshes of a model.
    pub(super) fn parts(&self, number: usize) -> &[Part] {
        &self.list[number].1.parts
    }
}

/// A model as a sketch: one surface per part, in order.
#[derive(Debug)]
struct Drawn(Arc<Model>);

impl Generator for Drawn {
    fn slots(&self) -> Slots {
        &[]
    }

    fn draw(&self, sketch: &mut Sketch, _seed: &str) {
        sketch.surfaces.extend(self.0.parts.iter().map(|part| Surface {
            slot: SLOT,
            role: part.role,
            vertices: part.vertices.clone(),
            triangles: part.triangles.clone(),
            runs: Vec::new(),
        }));
    }
}

//! A model as the mesh of one object, without tags, start and ground.

use std::path::Path;

use super::files::inside;
use super::{Problem, UpAxis, assemble, open};
use crate::geometry::{Material, Part, Role};
use crate::texture::Texture;
use crate::world::Object;

/// A model in the frame of the object whose mesh it is: x right, y forward (the file's −z), z up; metres.
#[derive(Debug)]
pub(crate) struct Model {
    /// Its meshes. The object id is set on placement; materials and textures are the model's own.
    pub(crate) parts: Vec<Part>,
    /// Its named parts, which are its nodes; empty if it is a single one.
    pub(crate) pieces: Vec<String>,
    /// Its materials.
    pub(crate) materials: Vec<Material>,
    /// Its material images.
    pub(crate) textures: Vec<Texture>,
    /// What of the file is not drawn.
    pub(crate) warnings: Vec<String>,
}

impl Model {
    /// Loads a `.glb` or `.gltf` with the files it names. `file` is a path relative to `folder`, in which it must lie.
    /// Openings of the model are omitted: an opening is an object of its own, to which instructions can refer.
    ///
    /// # Errors
    /// The error, worded so that it can follow the file's name.
    pub(crate) fn load(folder: &Path, file: &str, up: Option<UpAxis>) -> Result<Self, Problem> {
        let outside = || {
            Problem::new("it is not a file in the scene's folder")
                .hint("copy it next to the scene file and use a relative path, such as `models/chair.glb`")
        };
        let path = inside(folder, Path::new(file)).ok_or_else(outside)?;
        let bytes = open(&path)?.map_err(|e| Problem::new(format!("cannot read it: {e}")))?;
        let made = assemble(&bytes, path.parent(), None, up)?;
        let parts: Vec<Part> = made.assembly.parts.into_iter().filter(|part| part.role != Role::Opening).collect();
        if parts.is_empty() {
            return Err(Problem::new("it has no triangles"));
        }
        // Each of its objects is a part of what the model is in the scene.
        let mut parts = parts;
        let named = |object: &Object| object.tags.names.first().cloned().unwrap_or_default();
        let pieces: Vec<String> = made.assembly.objects.iter().map(named).collect();
        let several = pieces.len() > 1;
        parts
            .iter_mut()
            .for_each(|part| part.pieces = if several { vec![part.object; part.triangles.len()] } else { Vec::new() });
        let pieces = if several { pieces } else { Vec::new() };
        Ok(Self { parts, pieces, materials: made.assembly.materials, textures: made.assembly.textures, warnings: made.warnings })
    }
}

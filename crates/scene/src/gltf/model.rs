//! A model as the mesh of one object, without tags, start and ground.

use std::path::Path;

use super::files::inside;
use super::{Problem, UpAxis, assemble, open};
use crate::geometry::{Material, Part, Role};
use crate::texture::Texture;

/// A model in the frame of an object that it is the mesh of: x right, y forward (the file's −z), z up; metres.
#[derive(Debug)]
pub(crate) struct Model {
    /// Its meshes. The object id is set on placement; materials and textures are the model's own.
    pub(crate) parts: Vec<Part>,
    /// Its materials.
    pub(crate) materials: Vec<Material>,
    /// The images of its materials.
    pub(crate) textures: Vec<Texture>,
}

impl Model {
    /// Loads a `.glb` or `.gltf` with the files it names. `file` is a path from `folder`, in which it must lie. Openings of the
    /// model are left out: an opening is an object of its own, which one can speak of.
    ///
    /// # Errors
    /// What is wrong with the file, in words that want its name before them.
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
        Ok(Self { parts, materials: made.assembly.materials, textures: made.assembly.textures })
    }
}

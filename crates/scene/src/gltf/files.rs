//! Buffers and images of a file: embedded, in data URIs, or beside it in its folder.

use std::borrow::Cow;
use std::io::ErrorKind;
use std::path::{Component, Path, PathBuf};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use gltf::json::{Index, Root, buffer};
use percent_encoding::percent_decode_str;

use super::container::MAX_BYTES;
use super::problem::{Problem, missing};

/// The folder of a file's other files, and how much of them may still be read.
pub(super) struct Surroundings {
    folder: Option<PathBuf>,
    left: u64,
}

impl Surroundings {
    /// `folder` is that of the file; `None` if a file has none and may not name others.
    pub(super) fn new(folder: Option<&Path>) -> Self {
        Self { folder: folder.map(Path::to_owned), left: MAX_BYTES }
    }

    /// The bytes of a URI.
    pub(super) fn read(&mut self, uri: &str) -> Result<Vec<u8>, Problem> {
        let bytes = match uri.strip_prefix("data:") {
            Some(data) => self.embedded(data)?,
            None => self.beside(uri)?,
        };
        self.left = self.left.saturating_sub(bytes.len() as u64);
        Ok(bytes)
    }

    fn too_much() -> Problem {
        Problem::new(format!("its buffers and images exceed {} MiB", MAX_BYTES >> 20))
            .hint("reduce the textures and simplify the meshes")
    }

    fn embedded(&self, data: &str) -> Result<Vec<u8>, Problem> {
        let bad = || Problem::new("it contains a data URI that is not base64");
        let (kind, payload) = data.split_once(',').ok_or_else(bad)?;
        if !kind.ends_with(";base64") {
            return Err(bad());
        }
        if payload.len() as u64 / 4 * 3 > self.left {
            return Err(Self::too_much());
        }
        STANDARD.decode(payload).map_err(|_| bad())
    }

    fn beside(&self, uri: &str) -> Result<Vec<u8>, Problem> {
        let shown: String = uri.chars().take(120).collect();
        let path = self.path(uri, &shown)?;
        let unreadable = |e: std::io::Error| {
            Problem::new(format!("cannot read the referenced file `{shown}`: {e}")).hint(
                "keep the file and its resources \
                together",
            )
        };
        spf_input::read(&path, self.left).map_err(|error| match error.kind() {
            ErrorKind::FileTooLarge => Self::too_much(),
            ErrorKind::InvalidInput => Problem::new(format!("the referenced `{shown}` is not a file")),
            _ => unreadable(error),
        })
    }

    /// The path of a relative URI, inside the folder.
    fn path(&self, uri: &str, shown: &str) -> Result<PathBuf, Problem> {
        let outside = || {
            Problem::new(format!("the referenced `{shown}` is not a file in its folder"))
                .hint("copy it next to the scene and use a relative path, or save everything in one .glb")
        };
        let folder = self.folder.as_ref().ok_or_else(outside)?;
        let decoded = percent_decode_str(uri).decode_utf8().map_err(|_| outside())?;
        inside(folder, Path::new(decoded.as_ref())).ok_or_else(outside)
    }
}

/// The path of a file inside a folder; `None` if it lies elsewhere.
pub(super) fn inside(folder: &Path, relative: &Path) -> Option<PathBuf> {
    let written = relative.to_str()?;
    let inward = |part: Component<'_>| matches!(part, Component::Normal(_) | Component::CurDir);
    if written.is_empty() || written.contains([':', '\\', '\0']) || !relative.components().all(inward) {
        return None;
    }
    // The folder of a bare name is the working directory.
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let path = folder.join(relative);
    // Links may lead out of the folder.
    match (folder.canonicalize(), path.canonicalize()) {
        (Ok(folder), Ok(path)) if !path.starts_with(&folder) => None,
        _ => Some(path),
    }
}

/// All buffers of a file, with the lengths given there.
pub(super) struct Buffers<'a>(Vec<Cow<'a, [u8]>>);

impl<'a> Buffers<'a> {
    pub(super) fn load(root: &Root, blob: Option<Cow<'a, [u8]>>, around: &mut Surroundings) -> Result<Self, Problem> {
        let mut blob = blob;
        let mut buffers = Vec::new();
        for (i, buffer) in root.buffers.iter().enumerate() {
            let bytes = match &buffer.uri {
                Some(uri) => Cow::Owned(around.read(uri)?),
                None => blob.take().ok_or_else(|| Problem::new(format!("buffer {i} has no data")))?,
            };
            if (bytes.len() as u64) < buffer.byte_length.0 {
                let message = format!("buffer {i} is truncated: {} of {} bytes", bytes.len(), buffer.byte_length.0);
                return Err(Problem::new(message).hint("download or export the file again"));
            }
            buffers.push(bytes);
        }
        Ok(Self(buffers))
    }

    /// The bytes of a buffer view, and its stride if it has one.
    pub(super) fn view(&self, root: &Root, index: Index<buffer::View>) -> Result<(&[u8], Option<usize>), Problem> {
        let view = root.buffer_views.get(index.value()).ok_or_else(|| missing("buffer view", index.value()))?;
        let buffer = self.0.get(view.buffer.value()).ok_or_else(|| missing("buffer", view.buffer.value()))?;
        let start = view.byte_offset.unwrap_or_default().0;
        let range = usize::try_from(start).ok().zip(start.checked_add(view.byte_length.0).and_then(|e| usize::try_from(e).ok()));
        let bytes = range.and_then(|(start, end)| buffer.get(start..end));
        let bytes = bytes.ok_or_else(|| Problem::new(format!("buffer view {} exceeds its buffer", index.value())))?;
        Ok((bytes, view.byte_stride.map(|stride| stride.0)))
    }
}

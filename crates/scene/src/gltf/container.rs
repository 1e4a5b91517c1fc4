//! Reads a glTF file to validated JSON.

use std::borrow::Cow;

use gltf::json::validation::{Checked, Validate};
use gltf::json::{Path, Root, mesh::Semantic};
use serde::Deserialize;
use serde_json::json;

use super::problem::{Problem, short};

/// Maximum file size, and maximum size of all buffers of a file together, bytes.
pub(super) const MAX_BYTES: u64 = 256 << 20;
/// Maximum length of the JSON text, bytes, including embedded buffers and images.
const MAX_JSON_BYTES: usize = 128 << 20;
/// The extension by which a node places its mesh many times.
pub(super) const INSTANCING: &str = "EXT_mesh_gpu_instancing";
/// Maximum number of values in the JSON text, which also bounds the memory for them.
const MAX_JSON_VALUES: usize = 500_000;

/// The JSON of a file, and its binary chunk.
pub(super) struct Container<'a> {
    pub(super) root: Root,
    pub(super) blob: Option<Cow<'a, [u8]>>,
}

/// The keys that are checked first.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Head {
    asset: Version,
    #[serde(default)]
    extensions_required: Vec<String>,
}

#[derive(Deserialize)]
struct Version {
    version: String,
}

/// Reads a `.glb` or the JSON of a `.gltf`.
pub(super) fn read(bytes: &[u8]) -> Result<Container<'_>, Problem> {
    let (json, blob) = if bytes.starts_with(b"glTF") { split(bytes)? } else { (Cow::Borrowed(bytes), None) };
    let root = root(&json)?;
    Ok(Container { root, blob })
}

type Chunks<'a> = (Cow<'a, [u8]>, Option<Cow<'a, [u8]>>);

fn split(bytes: &[u8]) -> Result<Chunks<'_>, Problem> {
    // The reader subtracts the header's length from the claimed file length.
    let claimed = bytes.get(8..12).and_then(|b| b.try_into().ok()).map_or(0, u32::from_le_bytes);
    if claimed < 12 {
        return Err(Problem::new("the file is truncated in its header"));
    }
    let glb = gltf::Glb::from_slice(bytes).map_err(|e| {
        let cut = "the file is truncated or not glTF 2.0: download or export it again";
        Problem::new(format!("cannot read the binary container: {}", reason(&e))).hint(cut)
    })?;
    Ok((glb.json, glb.bin))
}

/// The message of a parser error.
fn reason(error: &gltf::Error) -> String {
    match error {
        gltf::Error::Binary(inner) => inner.to_string(),
        other => other.to_string(),
    }
}

fn root(text: &[u8]) -> Result<Root, Problem> {
    if text.len() > MAX_JSON_BYTES {
        let message = format!("its JSON exceeds {} MiB", MAX_JSON_BYTES >> 20);
        return Err(Problem::new(message).hint("save as .glb, or store buffers and images in separate files"));
    }
    // Each value except the first follows one of these characters, so this bounds the allocations of the reader.
    let values = text.iter().filter(|byte| matches!(byte, b'{' | b'[' | b',')).count();
    if values > MAX_JSON_VALUES {
        let message = format!("its JSON has more than {MAX_JSON_VALUES} values");
        return Err(Problem::new(message).hint("join meshes and export without animations"));
    }
    let broken = |e: serde_json::Error| Problem::new(format!("cannot parse its JSON: {e}"));
    let head: Head = serde_json::from_slice(text).map_err(|e| {
        broken(e).hint(
            "the file must be a .glb or .gltf file in glTF \
        2.0",
        )
    })?;
    if !head.asset.version.starts_with("2.") {
        let message = format!("unsupported glTF version {}", short(&head.asset.version));
        return Err(Problem::new(message).hint("export it as glTF 2.0"));
    }
    head.extensions_required.iter().try_for_each(|name| supported(name))?;
    let mut root: Root = serde_json::from_slice(text).map_err(broken)?;
    // Checked above against the actual use, not against the extensions known to the reader.
    root.extensions_required.clear();
    complete_positions(&mut root)?;
    validate(&root)?;
    Ok(root)
}

/// Rejects required extensions without which nothing, or something else, would be drawn. Of textures in other formats the
/// material's plain colour is drawn, with a warning (`images`).
fn supported(name: &str) -> Result<(), Problem> {
    let harmless = ["KHR_materials_", "KHR_lights_", "EXT_lights_", "KHR_texture_transform", "KHR_xmp"];
    let textures = ["KHR_texture_basisu", "EXT_texture_webp", "EXT_texture_avif", "MSFT_texture_dds"];
    if harmless.iter().any(|prefix| name.starts_with(prefix)) || textures.contains(&name) || name == INSTANCING {
        return Ok(());
    }
    let remedy = match name {
        "KHR_draco_mesh_compression" => "export without compression (Blender: untick Data > Compression)",
        "EXT_meshopt_compression" | "KHR_meshopt_compression" => "export without compression",
        "KHR_mesh_quantization" => "export without quantisation: coordinates as 32-bit floats",
        _ => "export without it",
    };
    Err(Problem::new(format!("unsupported extension `{}`", short(name))).hint(remedy))
}

/// The reader's own check demands the extent of positions, which nothing here uses, and follows their index without
/// checking it first.
fn complete_positions(root: &mut Root) -> Result<(), Problem> {
    let positions = Checked::Valid(Semantic::Positions);
    for (m, mesh) in root.meshes.iter().enumerate() {
        for primitive in &mesh.primitives {
            let Some(index) = primitive.attributes.get(&positions) else {
                return Err(Problem::new(format!("mesh {m} has no positions")));
            };
            let Some(accessor) = root.accessors.get_mut(index.value()) else {
                return Err(Problem::new(format!("the positions of mesh {m} are not in the file")));
            };
            accessor.min = Some(json!([0.0, 0.0, 0.0]));
            accessor.max = Some(json!([0.0, 0.0, 0.0]));
        }
    }
    Ok(())
}

fn validate(root: &Root) -> Result<(), Problem> {
    let mut first = None;
    root.validate(root, Path::new, &mut |path, error| {
        if first.is_none() {
            first = Some(format!("{}: {}", path(), error.to_string().to_lowercase()));
        }
    });
    match first {
        None => Ok(()),
        Some(found) => {
            Err(Problem::new(format!("invalid glTF 2.0: {found}"))
                .hint("export it again; the Khronos glTF Validator gives details"))
        }
    }
}

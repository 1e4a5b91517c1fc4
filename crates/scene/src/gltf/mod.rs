//! glTF 2.0 files as worlds (`docs/guide/gltf.md`): meshes for rendering and collisions, tags, and a start.
//!
//! Files are untrusted: every value is validated before use, and allocations are bounded by the limits of
//! [`container`], [`accessor`], [`mesh`] and [`images`].

mod accessor;
mod container;
mod files;
mod images;
mod material;
mod mesh;
mod model;
mod names;
mod normals;
mod objects;
mod problem;
mod size;
mod spec;
mod start;
mod walk;

use std::collections::BTreeSet;
use std::io::ErrorKind;
use std::path::Path;

use glam::Vec3;
use gltf::json::Root;
use serde::Deserialize;
use spf_core::geometry::{EnuPosition, Pose};

use self::accessor::Accessors;
use self::container::Container;
use self::files::{Buffers, Surroundings};
use self::images::Images;
use self::material::Looks;
use self::mesh::Meshes;
pub(crate) use self::model::Model;
use self::objects::Assembly;
pub(crate) use self::problem::Problem;
use self::spec::SceneSpec;
use self::walk::{Viewpoint, Walked};
use crate::bounds::Aabb;
use crate::collide::Collider;
use crate::error::SceneError;
use crate::geometry::SceneGeometry;
use crate::light::Shining;
use crate::pose;
use crate::world::Scene;
use spf_core::craft::CraftKind;

/// The file's upward axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum UpAxis {
    /// As defined by the format: x east, −z north.
    #[default]
    Y,
    /// As in many scans: x east, y north.
    Z,
}

/// Settings of a scene file for its model; they override the model's own extras.
#[derive(Clone, Debug, Default)]
pub(crate) struct ModelOverrides {
    pub(crate) name: Option<String>,
    pub(crate) craft: Option<CraftKind>,
    pub(crate) description: String,
    pub(crate) start: Option<Pose>,
    pub(crate) preview: Option<Pose>,
    pub(crate) success_radius: Option<f64>,
    pub(crate) near: Option<f64>,
    pub(crate) bounds: Option<Aabb>,
    pub(crate) scale: Option<f64>,
    pub(crate) up: Option<UpAxis>,
}

/// Worlds at least this wide or deep use the quad and the distances of a city; smaller ones use the Tello and those of
/// a room; metres.
const WIDE: f64 = 60.0;

/// Free height above the highest point, metres.
const HEADROOM: f64 = 20.0;

/// Whether a path has the extension of a model.
pub(crate) fn is_model(path: &str) -> bool {
    let end = Path::new(path).extension().unwrap_or_default();
    end.eq_ignore_ascii_case("glb") || end.eq_ignore_ascii_case("gltf")
}

/// Loads a `.glb` or `.gltf` with the files it names, which must lie in its folder.
pub(crate) fn load(path: &str, overrides: &ModelOverrides, shining: Shining) -> Result<Scene, SceneError> {
    let read = open(Path::new(path)).map_err(|problem| refused(path, problem))?;
    let bytes = read.map_err(|source| SceneError::Read { path: path.to_owned(), source })?;
    parse(&bytes, path, Path::new(path).parent(), overrides, shining)
}

/// The bytes of a file, up to the size limit.
fn open(path: &Path) -> Result<std::io::Result<Vec<u8>>, Problem> {
    match spf_input::read(path, container::MAX_BYTES) {
        Err(error) if error.kind() == ErrorKind::FileTooLarge => {
            let length = std::fs::metadata(path).map_or(0, |about| about.len() >> 20);
            let message = format!("the file has {length} MiB; at most {} MiB is supported", container::MAX_BYTES >> 20);
            Err(Problem::new(message).hint("reduce the textures and simplify the meshes"))
        }
        read => Ok(read),
    }
}

/// Reads a scene from the bytes of a file; `file` names it in errors and gives the scene its name. Other files are read
/// from `folder`, or rejected without one.
pub(crate) fn parse(
    bytes: &[u8],
    file: &str,
    folder: Option<&Path>,
    overrides: &ModelOverrides,
    shining: Shining,
) -> Result<Scene, SceneError> {
    import(bytes, file, folder, overrides, shining).map_err(|problem| refused(file, problem))
}

fn refused(file: &str, problem: Problem) -> SceneError {
    SceneError::Model { file: file.to_owned(), message: problem.message, hint: problem.hint }
}

fn import(
    bytes: &[u8],
    file: &str,
    folder: Option<&Path>,
    overrides: &ModelOverrides,
    shining: Shining,
) -> Result<Scene, Problem> {
    let Assembled { assembly, start, extras, scale, mut warnings } = assemble(bytes, folder, overrides.scale, overrides.up)?;
    warnings.extend(size::doubt(&assembly.objects, scale));
    let mut scene = world(assembly, start, &extras, overrides, file, shining)?;
    scene.warnings = warnings;
    Ok(scene)
}

/// Everything read from a file.
struct Assembled {
    assembly: Assembly,
    start: Option<Viewpoint>,
    extras: SceneSpec,
    /// The factor from the file's lengths to metres.
    scale: f64,
    /// What of the file is not drawn.
    warnings: Vec<String>,
}

/// Reads a file; the given scale and upward axis take precedence over its extras.
fn assemble(bytes: &[u8], folder: Option<&Path>, scale: Option<f64>, up: Option<UpAxis>) -> Result<Assembled, Problem> {
    let Container { root, blob } = container::read(bytes)?;
    let mut around = Surroundings::new(folder);
    let buffers = Buffers::load(&root, blob, &mut around)?;
    let scene = root.scene.map_or(0, |scene| scene.value());
    let extras = scene_spec(&root, scene)?;
    let scale = scale.or(extras.scale).unwrap_or(1.0);
    if !(1e-4..=1e4).contains(&scale) {
        return Err(Problem::new(format!("`scale` must be from 0.0001 to 10000, not `{scale}`")));
    }
    let accessors = Accessors { root: &root, buffers: &buffers };
    let walked = walk::walk(accessors, walk::axes(up.or(extras.up).unwrap_or_default(), scale), scene)?;
    let mut images = Images::load(&root, &materials(&root, &walked), &buffers, &mut around)?;
    let warnings = std::mem::take(&mut images.warnings);
    let looks = Looks::new(&root, images);
    let assembly = Assembly::build(&root, &walked, Meshes::new(accessors, scale), looks)?;
    Ok(Assembled { assembly, start: walked.start, extras, scale, warnings })
}

/// The extras of the scene.
fn scene_spec(root: &Root, scene: usize) -> Result<SceneSpec, Problem> {
    let extras = root.scenes.get(scene).map(|scene| spec::ours(&scene.extras)).transpose()?.flatten();
    extras.map_or(Ok(SceneSpec::default()), |own| spec::read(own, "the scene"))
}

/// The materials in use.
fn materials(root: &Root, walked: &Walked) -> BTreeSet<usize> {
    let meshes: BTreeSet<usize> = walked.placed.iter().map(|placed| placed.mesh).collect();
    let primitives = meshes.into_iter().filter_map(|mesh| root.meshes.get(mesh)).flat_map(|mesh| &mesh.primitives);
    primitives.filter_map(|primitive| primitive.material).map(|material| material.value()).collect()
}

/// Adds ground if there is none, and determines missing metadata.
fn world(
    assembly: Assembly,
    view: Option<Viewpoint>,
    extras: &SceneSpec,
    overrides: &ModelOverrides,
    file: &str,
    shining: Shining,
) -> Result<Scene, Problem> {
    let Assembly { mut objects, parts, pieces, materials, textures, skipped } = assembly;
    let corners = || parts.iter().flat_map(|part| part.vertices.iter().map(|v| v.position));
    let Some(mut extent) = Aabb::around(corners()) else {
        let cloud =
            if skipped > 0 { "points and lines are not rendered: convert them to a mesh" } else { "export its meshes too" };
        return Err(Problem::new("it has no triangles").hint(cloud));
    };
    let span = (extent.max.east - extent.min.east).max(extent.max.north - extent.min.north);
    let wide = span >= WIDE;
    let start = match (overrides.start, &extras.start) {
        (Some(pose), _) => Some(pose),
        (None, Some(text)) => Some(pose::parse_pose(text).ok_or_else(|| {
            Problem::new(format!("the extras of the scene: invalid pose `{text}`")).hint("use `east,north,up,heading_deg`")
        })?),
        (None, None) => None,
    };
    let mut geometry = SceneGeometry { parts, materials, textures, light: shining.light };
    let untouchable = |e: crate::collide::ColliderError| Problem::new(e.to_string());
    let mut collider = Collider::new(&geometry).map_err(untouchable)?;
    let mut room = [0.5 * (extent.max.east - extent.min.east), 0.5 * (extent.max.north - extent.min.north)];
    let grounded = start.is_some_and(|pose| start::ground(&collider, pose.position).is_some())
        || view.is_some_and(|view| start::below(&collider, &view).is_some())
        || objects.iter().any(|object| spf_core::tags::SURFACES.contains(&object.tags.kind.as_str()))
        || start::has_ground(&collider, &extent);
    let mut bounds = extent;
    if !grounded {
        let given = start.map(|pose| pose.position).or(view.map(|view| view.position));
        bounds = widened(&extent, given);
        // Slightly below the lowest point, so that no two faces are coplanar.
        let up = extent.min.up.min(given.map_or(f64::MAX, |at| at.up)) - 0.01;
        objects::lay_ground(&mut geometry, &mut objects, &bounds, up)?;
        extent.min.up = up;
        bounds.min.up = up;
        collider = Collider::new(&geometry).map_err(untouchable)?;
        let more = (8.0 + 0.25 * room[0].max(room[1])).min(0.6 * start::BEYOND);
        room = room.map(|half| half + more);
        let margin = start::BEYOND - 10.0;
        bounds = grown(&bounds, margin);
    }
    // Heights of the ground are rounded.
    bounds.min.up -= 0.01;
    bounds.max.up = extent.max.up + HEADROOM;
    let bounds = overrides.bounds.unwrap_or(bounds);
    let start = start
        .or_else(|| view.and_then(|view| start::below(&collider, &view)))
        .or_else(|| start::find(&collider, &extent, room))
        .or_else(|| start::below(&collider, &Viewpoint { position: above_middle(&extent), heading: 0.0 }))
        .ok_or_else(|| Problem::new("no start position found").hint("add an empty called `spf_start` above the ground"))?;
    if !bounds.contains(start.position) {
        let EnuPosition { east, north, up } = start.position;
        let message = format!("the start {east:.1},{north:.1},{up:.1} is outside `bounds`");
        return Err(Problem::new(message));
    }
    let craft = overrides.craft.or(extras.craft).unwrap_or(if wide { CraftKind::Quad } else { CraftKind::Tello });
    Ok(Scene {
        description: overrides.description.clone(),
        preview: overrides.preview.unwrap_or_else(|| pose::above(start, craft)),
        name: overrides.name.clone().or_else(|| extras.name.clone()).and_then(|name| shown(&name)).unwrap_or_else(|| stem(file)),
        near: radius("near_m", overrides.near.or(extras.near_m), if wide { 3.0 } else { 0.8 })?,
        success_radius: radius(
            "success_radius_m",
            overrides.success_radius.or(extras.success_radius_m),
            if wide { 5.0 } else { 1.0 },
        )?,
        max_altitude: None,
        default_craft: craft,
        start,
        bounds,
        objects,
        pieces,
        lighting: shining.lighting,
        weather: shining.weather,
        geometry,
        actors: Vec::new(),
        warnings: Vec::new(),
    })
}

fn radius(key: &str, value: Option<f64>, default: f64) -> Result<f64, Problem> {
    let value = value.unwrap_or(default);
    if (0.1..=50.0).contains(&value) {
        return Ok(value);
    }
    Err(Problem::new(format!("`{key}` must be from 0.1 to 50 metres, not `{value}`")))
}

/// The extent, enlarged to include a point.
fn widened(extent: &Aabb, point: Option<EnuPosition>) -> Aabb {
    let corners = [Some(extent.min), Some(extent.max), point].into_iter().flatten();
    let narrow = corners.map(|p| Vec3::new(p.east as f32, p.north as f32, p.up as f32));
    Aabb::around(narrow).unwrap_or(*extent)
}

fn grown(extent: &Aabb, margin: f64) -> Aabb {
    let (min, max) = (extent.min, extent.max);
    Aabb {
        min: EnuPosition { east: min.east - margin, north: min.north - margin, ..min },
        max: EnuPosition { east: max.east + margin, north: max.north + margin, ..max },
    }
}

fn above_middle(extent: &Aabb) -> EnuPosition {
    EnuPosition {
        east: 0.5 * (extent.min.east + extent.max.east),
        north: 0.5 * (extent.min.north + extent.max.north),
        up: extent.max.up,
    }
}

/// A scene name restricted to permitted characters.
fn shown(name: &str) -> Option<String> {
    let name: String = name.trim().chars().filter(|c| !c.is_control()).take(60).collect();
    (!name.is_empty()).then_some(name)
}

fn stem(file: &str) -> String {
    Path::new(file).file_stem().and_then(|stem| shown(&stem.to_string_lossy())).unwrap_or_else(|| "model".to_owned())
}

//! Traverses the nodes of a file: the transform of each mesh, and the object it belongs to.

use std::collections::{BTreeMap, BTreeSet};

use glam::{DMat4, DQuat, DVec3, Vec3};
use gltf::json::{Index, Root, scene::Node};
use serde::Deserialize;
use spf_core::geometry::EnuPosition;

use super::UpAxis;
use super::accessor::Accessors;
use super::container::INSTANCING;
use super::problem::{Problem, missing, short};
use super::spec::{self, NodeSpec};

/// Maximum number of nodes of a file, and of the places of their meshes.
const MAX_NODES: usize = 50_000;
/// Maximum depth of the node tree.
const MAX_DEPTH: usize = 200;

/// A placed mesh.
#[derive(Clone, Debug)]
pub(super) struct Placed {
    /// Index of the mesh.
    pub(super) mesh: usize,
    /// Index into [`Walked::owners`].
    pub(super) owner: usize,
    /// Name of its node, or of the mesh; may be empty.
    pub(super) name: String,
    pub(super) to_world: DMat4,
    pub(super) solid: bool,
}

/// A node that becomes an object.
#[derive(Clone, Debug)]
pub(super) struct Owner {
    /// Its name, or its mesh's; may be empty.
    pub(super) name: String,
    pub(super) spec: NodeSpec,
    /// The object above it, for openings.
    pub(super) above: Option<usize>,
}

impl Owner {
    pub(super) fn is_opening(&self) -> bool {
        self.spec.opening.is_some_and(|o| o.0)
    }
}

/// A start pose found among the nodes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Viewpoint {
    pub(super) position: EnuPosition,
    /// Radians clockwise from north.
    pub(super) heading: f64,
}

/// The contents of a file's scene.
#[derive(Debug, Default)]
pub(super) struct Walked {
    pub(super) placed: Vec<Placed>,
    pub(super) owners: Vec<Owner>,
    /// The node called `spf_start`, else the first camera.
    pub(super) start: Option<Viewpoint>,
}

/// From the file's axes to the world's: y up with −z north, or z up with y north.
pub(super) fn axes(up: UpAxis, scale: f64) -> DMat4 {
    let [x, y, z] = match up {
        UpAxis::Y => [DVec3::X, DVec3::Z, DVec3::NEG_Y],
        UpAxis::Z => [DVec3::X, DVec3::Y, DVec3::Z],
    };
    DMat4::from_cols((x * scale).extend(0.0), (y * scale).extend(0.0), (z * scale).extend(0.0), DVec3::ZERO.extend(1.0))
}

/// The contents of [`INSTANCING`]: accessors by `TRANSLATION`, `ROTATION`, `SCALE`, and names of the exporter's own.
#[derive(Deserialize)]
struct Instancing {
    #[serde(default)]
    attributes: BTreeMap<String, u32>,
}

struct Visit {
    node: usize,
    above: DMat4,
    /// The tagged node that owns untagged nodes.
    tagged: Option<usize>,
    /// The nearest object above, tagged or not.
    object: Option<usize>,
    solid: bool,
    depth: usize,
}

/// Traverses the file's scene.
pub(super) fn walk(accessors: Accessors<'_>, axes: DMat4, scene: usize) -> Result<Walked, Problem> {
    let root = accessors.root;
    let mut walk = Walk { root, accessors, out: Walked::default(), seen: BTreeSet::new(), camera: None };
    let tops: Vec<usize> = match root.scenes.get(scene) {
        Some(scene) => scene.nodes.iter().map(Index::value).collect(),
        None => tops(root),
    };
    let visit = |node| Visit { node, above: axes, tagged: None, object: None, solid: true, depth: 0 };
    // The last one is visited first, so that ids follow the file's order.
    let mut stack: Vec<Visit> = tops.into_iter().rev().map(visit).collect();
    while let Some(next) = stack.pop() {
        walk.visit(next, &mut stack)?;
    }
    walk.out.start = walk.out.start.or(walk.camera);
    Ok(walk.out)
}

/// Root nodes, which are shown for a file without scenes.
fn tops(root: &Root) -> Vec<usize> {
    let children: BTreeSet<usize> = root.nodes.iter().filter_map(|n| n.children.as_ref()).flatten().map(Index::value).collect();
    (0..root.nodes.len()).filter(|node| !children.contains(node)).collect()
}

struct Walk<'a> {
    root: &'a Root,
    accessors: Accessors<'a>,
    out: Walked,
    seen: BTreeSet<usize>,
    camera: Option<Viewpoint>,
}

impl Walk<'_> {
    fn visit(&mut self, visit: Visit, stack: &mut Vec<Visit>) -> Result<(), Problem> {
        let node = self.root.nodes.get(visit.node).ok_or_else(|| missing("node", visit.node))?;
        if !self.seen.insert(visit.node) {
            let message = format!("node {} is its own descendant or has two parents", visit.node);
            return Err(Problem::new(message).hint("nodes must form a tree; export the file again"));
        }
        if self.seen.len() > MAX_NODES || visit.depth > MAX_DEPTH {
            return Err(too_many());
        }
        let name = node.name.clone().unwrap_or_default();
        let spec = self.spec(node, &name, visit.node)?;
        if spec.as_ref().and_then(|s| s.ignore).is_some_and(|ignore| ignore.0) {
            return Ok(());
        }
        let to_world = visit.above * local(node);
        if is_start(&name) {
            self.out.start = self.out.start.or(viewpoint(to_world));
        } else if node.camera.is_some() {
            self.camera = self.camera.or(viewpoint(to_world));
        }
        let solid = visit.solid && spec.as_ref().and_then(|s| s.solid).is_none_or(|solid| solid.0);
        let (mut tagged, mut object) = (visit.tagged, visit.object);
        if let Some(spec) = spec {
            tagged = Some(self.own(self.name_of(node, name.clone()), spec, visit.object));
            object = tagged;
        }
        if let Some(mesh) = node.mesh {
            let mut first = None;
            for place in self.places(node, &format!("node {} `{}`", visit.node, short(&name)))? {
                if self.out.placed.len() >= MAX_NODES {
                    return Err(too_many());
                }
                let owner = match tagged {
                    Some(owner) => owner,
                    None => self.own(self.name_of(node, name.clone()), NodeSpec::default(), visit.object),
                };
                first = first.or(Some(owner));
                self.out.placed.push(Placed {
                    mesh: mesh.value(),
                    owner,
                    name: self.name_of(node, name.clone()),
                    to_world: to_world * place,
                    solid,
                });
            }
            object = first.or(object);
        }
        let below = node.children.iter().flatten().rev();
        let depth = visit.depth + 1;
        stack.extend(below.map(|child| Visit { node: child.value(), above: to_world, tagged, object, solid, depth }));
        Ok(())
    }

    /// Where a node's mesh is placed, relative to the node: once, or at each instance. `of` names it in errors.
    fn places(&self, node: &Node, of: &str) -> Result<Vec<DMat4>, Problem> {
        let Some(given) = node.extensions.as_ref().and_then(|all| all.others.get(INSTANCING)) else {
            return Ok(vec![DMat4::IDENTITY]);
        };
        let wrong = |why: String| {
            Problem::new(format!("the instances of {of} (`{INSTANCING}`): {why}")).hint("export each instance as a node")
        };
        let Instancing { attributes } = Instancing::deserialize(given).map_err(|error| wrong(error.to_string()))?;
        let counts = attributes.values().map(|index| self.accessors.count(Index::new(*index)));
        let counts: Vec<usize> = counts.collect::<Result<_, _>>()?;
        let Some(&count) = counts.first() else { return Err(wrong("they have no attributes".to_owned())) };
        if counts.iter().any(|other| *other != count) {
            return Err(wrong(format!("their attributes have {counts:?} values")));
        }
        // Counted before they are read.
        if self.out.placed.len() + count > MAX_NODES {
            return Err(too_many());
        }
        let of = |key: &str| attributes.get(key).map(|index| Index::new(*index));
        let moved = of("TRANSLATION").map(|i| self.accessors.vectors::<3>(i, 3, 0.0, false)).transpose()?;
        let turned = of("ROTATION").map(|i| self.accessors.vectors::<4>(i, 4, 0.0, true)).transpose()?;
        let scaled = of("SCALE").map(|i| self.accessors.vectors::<3>(i, 3, 0.0, false)).transpose()?;
        let get = |vectors: &Option<Vec<[f32; 3]>>, i: usize, or: f32| vectors.as_ref().map_or([or; 3], |all| all[i]);
        let place = |i| transform(get(&scaled, i, 1.0), turned.as_ref().map_or([0.0; 4], |all| all[i]), get(&moved, i, 0.0));
        Ok((0..count).map(place).collect())
    }

    fn own(&mut self, name: String, spec: NodeSpec, above: Option<usize>) -> usize {
        self.out.owners.push(Owner { name, spec, above });
        self.out.owners.len() - 1
    }

    fn name_of(&self, node: &Node, name: String) -> String {
        let of_mesh = || node.mesh.and_then(|m| self.root.meshes.get(m.value())).and_then(|m| m.name.clone());
        if name.is_empty() { of_mesh().unwrap_or_default() } else { name }
    }

    /// The extras of a node, which take precedence over those of its mesh.
    fn spec(&self, node: &Node, name: &str, index: usize) -> Result<Option<NodeSpec>, Problem> {
        let mesh = node.mesh.and_then(|m| self.root.meshes.get(m.value()));
        let below = mesh.map_or(Ok(None), |mesh| spec::ours(&mesh.extras))?;
        let own = spec::ours(&node.extras)?;
        let Some(mut all) = below.or_else(|| own.as_ref().map(|_| serde_json::Map::new())) else { return Ok(None) };
        all.extend(own.unwrap_or_default());
        spec::read(all, &format!("node {index} `{}`", short(name))).map(Some)
    }
}

/// Whether it is `spf_start`, in any spelling or numbering of exporters.
fn is_start(name: &str) -> bool {
    let name = name.to_ascii_lowercase();
    name.strip_prefix("spf_start").is_some_and(|rest| rest.bytes().all(|b| b == b'.' || b == b'_' || b.is_ascii_digit()))
}

/// Transform of a node relative to its parent.
fn local(node: &Node) -> DMat4 {
    if let Some(m) = node.matrix {
        return DMat4::from_cols_array(&m.map(f64::from));
    }
    transform(node.scale.unwrap_or([1.0; 3]), node.rotation.unwrap_or_default().0, node.translation.unwrap_or_default())
}

/// The transform that scales, then turns, then moves.
fn transform(scale: [f32; 3], [x, y, z, w]: [f32; 4], moved: [f32; 3]) -> DMat4 {
    let wide = |v: [f32; 3]| DVec3::from(v.map(f64::from));
    let turn = DQuat::from_xyzw(x.into(), y.into(), z.into(), w.into());
    // Exporters round; a quaternion of zero length means no rotation.
    let turn = if turn.length_squared() > 1e-12 { turn.normalize() } else { DQuat::IDENTITY };
    DMat4::from_scale_rotation_translation(wide(scale), turn, wide(moved))
}

fn too_many() -> Problem {
    Problem::new(format!("it has more than {MAX_NODES} nodes or instances, or a hierarchy deeper than {MAX_DEPTH}"))
        .hint("join meshes")
}

/// Position and direction of a node: along its own −z, as for cameras, which is forward of an empty of Blender.
fn viewpoint(to_world: DMat4) -> Option<Viewpoint> {
    let at = to_world.w_axis.truncate();
    let ahead = to_world.transform_vector3(DVec3::NEG_Z);
    // When looking straight down, the top of the image is forward.
    let level = |v: DVec3| (v.x * v.x + v.y * v.y > 1e-6 * v.length_squared()).then_some(v);
    let ahead = level(ahead).or_else(|| level(to_world.transform_vector3(DVec3::Y)));
    let heading = ahead.map_or(0.0, |v| libm::atan2(v.x, v.y));
    let usable = at.is_finite() && heading.is_finite();
    usable.then_some(Viewpoint { position: EnuPosition { east: at.x, north: at.y, up: at.z }, heading })
}

/// Transforms a point of the file to the world.
pub(super) fn point(to_world: &DMat4, p: [f32; 3]) -> Vec3 {
    to_world.transform_point3(DVec3::from(p.map(f64::from))).as_vec3()
}

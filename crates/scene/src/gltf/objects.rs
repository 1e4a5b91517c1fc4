//! Converts placed meshes to objects with ids, tags, bounds and footprints.

use std::collections::{BTreeMap, BTreeSet};

use glam::Vec3;
use gltf::json::Root;
use spf_core::tags::PieceTag;

use super::material::Looks;
use super::mesh::{Meshes, add_areas};
use super::names;
use super::problem::{Problem, missing, short};
use super::spec::{Words, tidy};
use super::start;
use super::walk::{Owner, Walked};
use crate::bounds::Aabb;
use crate::geometry::{Material, ObjectId, Part, Pattern, Role, SceneGeometry};
use crate::limits::{LONGEST_TAG, MAX_OBJECTS};
use crate::mesh::convex_hull;
use crate::texture::Texture;
use crate::world::{Object, Tags};

/// Mesh kind shown for the objects in lists.
const MESH_KIND: &str = "gltf";

/// All rendered and solid parts of a file.
#[derive(Debug)]
pub(super) struct Assembly {
    pub(super) objects: Vec<Object>,
    pub(super) parts: Vec<Part>,
    pub(super) pieces: Vec<PieceTag>,
    pub(super) materials: Vec<Material>,
    pub(super) textures: Vec<Texture>,
    /// Number of points and lines, which are not rendered.
    pub(super) skipped: usize,
}

/// The contents collected for an owner.
#[derive(Default)]
struct Gathered {
    parts: Vec<Part>,
    /// Names of its nodes with meshes: its named parts.
    pieces: Vec<String>,
    /// Area in square metres by colour word.
    areas: BTreeMap<&'static str, f32>,
}

impl Assembly {
    /// Places all meshes in the world.
    pub(super) fn build(root: &Root, walked: &Walked, mut meshes: Meshes<'_>, mut looks: Looks<'_>) -> Result<Self, Problem> {
        let mut gathered: Vec<Gathered> = walked.owners.iter().map(|_| Gathered::default()).collect();
        for placed in &walked.placed {
            let mesh = root.meshes.get(placed.mesh).ok_or_else(|| missing("mesh", placed.mesh))?;
            let owner = &walked.owners[placed.owner];
            let of = format!("mesh {} of `{}`", placed.mesh, short(&owner.name));
            gathered[placed.owner].pieces.push(names::words(&placed.name).join(" "));
            for primitive in &mesh.primitives {
                let look = looks.look(primitive.material.map(|m| m.value()), Meshes::is_coloured(primitive))?;
                let drawn = meshes.draw(primitive, placed, &look, &of)?;
                if drawn.triangles.is_empty() {
                    continue;
                }
                let gathered = &mut gathered[placed.owner];
                let mean = names::colour_word(look.mean);
                add_areas(&mut gathered.areas, &drawn, |corner| {
                    if look.by_corner { names::colour_word(look.mean * Looks::corner_colour(corner.uv)) } else { mean }
                });
                let role = match (placed.solid, look.invisible) {
                    _ if owner.is_opening() => Role::Opening,
                    (true, false) => Role::Solid,
                    (true, true) => Role::Glass,
                    (false, false) => Role::Visual,
                    (false, true) => continue,
                };
                let (vertices, triangles) = (drawn.vertices, drawn.triangles);
                // Objects are numbered once it is known which have triangles.
                let pieces = vec![gathered.pieces.len() as u16; triangles.len()];
                gathered.parts.push(Part { vertices, triangles, material: look.material, object: 0, pieces, role });
            }
        }
        let (materials, textures) = looks.into_parts();
        let (objects, parts, pieces) = (Vec::new(), Vec::new(), Vec::new());
        let mut assembly = Self { objects, parts, pieces, materials, textures, skipped: meshes.skipped };
        assembly.number(&walked.owners, gathered)?;
        Ok(assembly)
    }

    fn number(&mut self, owners: &[Owner], gathered: Vec<Gathered>) -> Result<(), Problem> {
        let (mut ids, mut next) = (Vec::with_capacity(owners.len()), 0);
        for gathered in &gathered {
            let drawn = !gathered.parts.is_empty();
            next += usize::from(drawn);
            ids.push(drawn.then_some(next as ObjectId));
        }
        if next >= MAX_OBJECTS {
            let message = format!("it has {next} objects; at most {} are supported", MAX_OBJECTS - 1);
            return Err(Problem::new(message).hint("join meshes that belong together, or group them under one tagged node"));
        }
        let (solids, mut keys) = (Solids::new(owners, &ids), BTreeSet::new());
        for (i, (owner, gathered)) in owners.iter().zip(gathered).enumerate() {
            let Some(id) = ids[i] else { continue };
            let key = names::unique_key(&owner.name, &mut keys);
            let mut tags = tags(owner, &gathered.areas)?;
            if owner.is_opening() {
                tags.opening_of = opening_of(owner, &solids)?;
            }
            let positions = || gathered.parts.iter().flat_map(|p| p.vertices.iter().map(|v| v.position));
            let Some(bounds) = Aabb::around(positions()) else { continue };
            let plan: Vec<[f64; 2]> = positions().map(|p| [f64::from(p.x), f64::from(p.y)]).collect();
            self.objects.push(Object {
                id,
                key,
                tags,
                mesh: MESH_KIND,
                opening: owner.is_opening(),
                bounds,
                outline: vec![convex_hull(&plan)],
                sign: None,
            });
            // Of a single node the object has the name. There are fewer nodes than numbers of parts.
            if gathered.pieces.len() > 1 {
                let first = self.pieces.len() as u16;
                let collide = gathered.parts.iter().filter(|part| matches!(part.role, Role::Solid | Role::Glass));
                let solid: BTreeSet<u16> = collide.flat_map(|part| part.pieces.iter().copied()).collect();
                self.pieces.extend(gathered.pieces.into_iter().zip(1..).map(|(name, number)| PieceTag {
                    object: id,
                    name: if name.is_empty() { "part".to_owned() } else { name },
                    main: false,
                    solid: solid.contains(&number),
                }));
                let numbered = |pieces: Vec<u16>| pieces.into_iter().map(|piece| first + piece).collect();
                self.parts.extend(gathered.parts.into_iter().map(|part| Part {
                    object: id,
                    pieces: numbered(part.pieces),
                    ..part
                }));
            } else {
                self.parts.extend(gathered.parts.into_iter().map(|part| Part { object: id, pieces: Vec::new(), ..part }));
            }
        }
        Ok(())
    }
}

/// The object that an opening leads through: the one it names, else the nearest one above it.
fn opening_of(opening: &Owner, solids: &Solids<'_>) -> Result<Option<ObjectId>, Problem> {
    let Some(name) = &opening.spec.opening_of else {
        let mut above = opening.above;
        while let Some(owner) = above {
            if let Some(id) = solids.ids[owner] {
                return Ok(Some(id));
            }
            above = solids.owners[owner].above;
        }
        return Ok(None);
    };
    let found = solids.by_name.get(&tidy(name)).ok_or_else(|| {
        let message =
            format!("the extras of node `{}`: unknown object `{}` in `spf_opening_of`", short(&opening.name), short(name));
        Problem::new(message).hint("use the name of the node that the opening belongs to")
    })?;
    Ok(Some(*found))
}

/// Candidates for `opening_of`.
struct Solids<'a> {
    owners: &'a [Owner],
    /// For each owner its object, unless that is an opening.
    ids: Vec<Option<ObjectId>>,
    /// The first one with a name counts.
    by_name: BTreeMap<String, ObjectId>,
}

impl<'a> Solids<'a> {
    fn new(owners: &'a [Owner], ids: &[Option<ObjectId>]) -> Self {
        let solid = |(owner, id): (&Owner, &Option<ObjectId>)| id.filter(|_| !owner.is_opening());
        let ids: Vec<Option<ObjectId>> = owners.iter().zip(ids).map(solid).collect();
        let mut by_name = BTreeMap::new();
        for (owner, id) in owners.iter().zip(&ids) {
            if let Some(id) = id {
                by_name.entry(tidy(&owner.name)).or_insert(*id);
            }
        }
        Self { owners, ids, by_name }
    }
}

/// The names of an object: from its metadata, otherwise from its node name and colour.
fn tags(owner: &Owner, areas: &BTreeMap<&'static str, f32>) -> Result<Tags, Problem> {
    let spec = &owner.spec;
    let mut words = names::words(&owner.name);
    if words.is_empty() {
        words.push("object".to_owned());
    }
    let list = |words: &Option<Words>| words.clone().unwrap_or_default().0;
    let given = list(&spec.names);
    let own_words = if given.is_empty() { words.clone() } else { given.iter().flat_map(|name| names::words(name)).collect() };
    let main = || areas.iter().max_by(|a, b| a.1.total_cmp(b.1)).map(|(word, _)| (*word).to_owned());
    let opening = owner.is_opening();
    let colour = spec.colour.as_deref().map(tidy).or_else(|| names::colour(&own_words)).or_else(|| main().filter(|_| !opening));
    let kind = spec.kind.as_deref().map(tidy).filter(|kind| !kind.is_empty());
    let tags = Tags {
        names: if given.is_empty() { names::names(&words) } else { given },
        synonyms: list(&spec.synonyms),
        qualities: list(&spec.qualities),
        colour: colour.filter(|colour| !colour.is_empty()),
        kind: kind.unwrap_or_else(|| if opening { "opening".to_owned() } else { names::kind(&words) }),
        uses: list(&spec.uses),
        group: spec.group.as_deref().map(tidy).filter(|group| !group.is_empty()),
        number: spec.number,
        opening_of: None,
        looks_like: None,
    };
    let lists = [&tags.names, &tags.synonyms, &tags.qualities, &tags.uses].into_iter().flatten();
    let all: Vec<&String> = lists.chain(&tags.colour).chain(&tags.group).chain([&tags.kind]).collect();
    if let Some(tag) = all.into_iter().find(|tag| tag.chars().count() > LONGEST_TAG) {
        let start: String = tag.chars().take(20).collect();
        let message = format!("the extras of node `{}`: the tag `{start}…` is too long", short(&owner.name));
        return Err(Problem::new(message).hint(format!("tags have at most {LONGEST_TAG} characters")));
    }
    Ok(tags)
}

/// Adds a meadow under a model that has no ground of its own.
pub(super) fn lay_ground(geometry: &mut SceneGeometry, objects: &mut Vec<Object>, extent: &Aabb, up: f64) -> Result<(), Problem> {
    let id = objects.len() as ObjectId + 1;
    let material = u16::try_from(geometry.materials.len()).map_err(|_| Problem::new("it has more than 65535 materials"))?;
    geometry.materials.push(Material {
        colour: Vec3::new(0.07, 0.14, 0.03),
        accent: Vec3::new(0.13, 0.17, 0.05),
        pattern: Pattern::Grass,
        two_sided: false,
        emission: Vec3::ZERO,
    });
    let part = start::laid(extent, up, material, id);
    let mut keys: BTreeSet<String> = objects.iter().map(|object| object.key.clone()).collect();
    let plan: Vec<[f64; 2]> = part.vertices.iter().map(|v| [f64::from(v.position.x), f64::from(v.position.y)]).collect();
    let Some(bounds) = Aabb::around(part.vertices.iter().map(|v| v.position)) else { return Ok(()) };
    let tags = Tags {
        names: vec!["ground".to_owned(), "meadow".to_owned()],
        colour: Some("green".to_owned()),
        kind: "ground".to_owned(),
        ..Tags::default()
    };
    let key = names::unique_key("ground", &mut keys);
    objects.push(Object { id, key, tags, mesh: MESH_KIND, opening: false, bounds, outline: vec![plan], sign: None });
    geometry.parts.push(part);
    Ok(())
}

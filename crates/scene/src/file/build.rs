//! Builds the scene from validated entries: meshes, materials, light, bounds, footprints.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use glam::{Vec2, Vec3};
use spf_core::geometry::{EnuPosition, Pose};
use spf_core::tags::PieceTag;
use toml::Spanned;

use super::expand::{Expanded, Placed};
use super::raw::{RawBounds, RawScene};
use super::shine;
use super::source::Source;
use super::surface::palette;
use crate::actors::{Actor, Course, Gait, Motion, first_clash};
use crate::bounds::Aabb;
use crate::error::{SceneError, nearest};
use crate::geometry::{Material, ObjectId, Part, Pattern, Role, SceneGeometry, Vertex};
use crate::light::SceneLook;
use crate::limits::MAX_TRIANGLES;
use crate::mesh::{Generator, Sketch, Surface, Writing, convex_hull};
use crate::pose::{above, parse_pose};
use crate::sign::Sign;
use crate::world::{Object, Scene};

/// Postures of one double step: about as many per second as a video has frames.
const GAIT: u32 = 12;

/// Maximum number of triangles of all postures of all walking people.
const MAX_GAIT_TRIANGLES: usize = 8 * MAX_TRIANGLES;

/// Maximum number of moving objects: each checks all others.
const MAX_ACTORS: usize = 200;

/// Materials by name, each stored once.
struct Materials<'a> {
    raw: &'a RawScene,
    /// Whether lamps shine and windows glow.
    lit: bool,
    /// Whether the ground is wet.
    wet: bool,
    list: Vec<Material>,
    index: BTreeMap<String, u16>,
}

impl Materials<'_> {
    fn get(&mut self, name: &str, at: &Range<usize>, source: &Source<'_>) -> Result<u16, SceneError> {
        if let Some(&index) = self.index.get(name) {
            return Ok(index);
        }
        let own = self.raw.materials.get(name).map(|m| (m.get_ref(), m.span()));
        let Some((material, span)) = own.or_else(|| palette().get(name).map(|m| (m, at.clone()))) else {
            let known = self.raw.materials.keys().chain(palette().keys()).map(String::as_str);
            let hint = nearest(name, known).map_or_else(
                || "define it under `[materials]`, or use one from the palette in docs/reference/scene-format.md".to_owned(),
                |n| format!("did you mean `{n}`?"),
            );
            return Err(source.error(at, format!("unknown material `{name}`"), Some(hint)));
        };
        let material =
            material.material(self.lit, self.wet).map_err(|e| source.error(&span, format!("material `{name}`: {e}"), None))?;
        let index =
            u16::try_from(self.list.len()).map_err(|_| source.error(at, "a scene may have at most 65535 materials", None))?;
        self.list.push(material);
        self.index.insert(name.to_owned(), index);
        Ok(index)
    }
}

/// Builds the scene.
pub(super) fn build(
    raw: &RawScene,
    expanded: Expanded,
    conditions: &SceneLook,
    source: &Source<'_>,
) -> Result<Scene, SceneError> {
    let mut shining = shine::shining(raw, conditions, source)?;
    let mut materials = Materials { raw, lit: shining.lit(), wet: shining.wet(), list: Vec::new(), index: BTreeMap::new() };
    // Every material is checked, even if nothing uses it.
    for (name, material) in &raw.materials {
        materials.get(name, &material.span(), source)?;
    }
    let ids: BTreeMap<&str, ObjectId> =
        expanded.placed.iter().enumerate().map(|(i, p)| (p.key.as_str(), i as ObjectId + 1)).collect();
    let mut textures = Vec::new();
    let Some(model_materials) = expanded.models.add_looks(&mut materials.list, &mut textures) else {
        return Err(source.error(&(0..0), "a scene may have at most 65535 materials and as many textures", None));
    };
    let (mut all, mut objects, mut actors) = (Vec::new(), Vec::new(), Actors::default());
    let mut pieces = Vec::new();
    let (mut triangles, mut gait_triangles) = (0, 0);
    for (i, placed) in expanded.placed.iter().enumerate() {
        let id = i as ObjectId + 1;
        let generator = &expanded.meshes[placed.mesh];
        let slots = slots(generator.slots(), placed, &mut materials, source)?;
        let cells = slots.iter().filter_map(|&(slot, index)| match materials.list[usize::from(index)].pattern {
            Pattern::Windows { cell, .. } => Some((slot, cell)),
            _ => None,
        });
        let mut sketch = Sketch::new(cells.collect());
        generator.draw(&mut sketch, &placed.key);
        triangles += sketch.triangle_count();
        if triangles > MAX_TRIANGLES {
            let message = format!("the scene exceeds {MAX_TRIANGLES} triangles at `{}`", placed.key);
            return Err(source.error(&placed.span, message, None));
        }
        let to_world = Frame::of(placed);
        // A moving lamp would need new shadows at every instant.
        for lamp in sketch.lamps.iter().filter(|_| placed.motion.is_none()) {
            shine::add(&mut shining, lamp, |p| to_world.point(p), to_world.scale, &placed.span, source)?;
        }
        let first = pieces.len() as u16;
        let own = match placed.model {
            Some(number) => model_parts(expanded.models.parts(number), (model_materials[number], first), &to_world, id),
            None => parts(&sketch, &slots, &to_world, id, first),
        };
        let named: Vec<(String, bool)> = match placed.model {
            Some(number) => expanded.models.pieces(number).iter().map(|name| (name.clone(), false)).collect(),
            None => sketch.pieces.iter().map(|piece| (piece.name.to_owned(), piece.main)).collect(),
        };
        let collide = own.iter().filter(|part| matches!(part.role, Role::Solid | Role::Glass));
        let solid: BTreeSet<u16> = collide.flat_map(|part| part.pieces.iter().copied()).collect();
        let is_solid = |place: usize| u16::try_from(usize::from(first) + place + 1).is_ok_and(|number| solid.contains(&number));
        let tag = |(place, (name, main))| PieceTag { object: id, name, main, solid: is_solid(place) };
        pieces.extend(named.into_iter().enumerate().map(tag));
        choose_main(placed, &mut pieces[usize::from(first)..], source)?;
        if pieces.len() > usize::from(u16::MAX) {
            let message = format!("the objects of the scene have more than {} named parts at `{}`", u16::MAX, placed.key);
            return Err(source.error(&placed.span, message, None));
        }
        let mut object = object(placed, id, &ids, &own, &sketch, &to_world, source)?;
        // The words on what moves are not read: their place would be another at every moment.
        object.sign = generator.writing().filter(|_| placed.motion.is_none()).map(|writing| to_world.sign(writing));
        match &placed.motion {
            Some(motion) => {
                let mut postures = vec![own];
                let gait = gait(generator.as_ref(), motion);
                gait_triangles += gait.iter().map(Sketch::triangle_count).sum::<usize>();
                if gait_triangles > MAX_GAIT_TRIANGLES {
                    let message = format!("the walking people exceed {MAX_GAIT_TRIANGLES} triangles");
                    return Err(source.error(&placed.span, message, Some("use fewer walking people".to_owned())));
                }
                postures.extend(gait.iter().map(|sketch| parts(sketch, &slots, &to_world, id, first)));
                actors.add(motion, postures, &mut object, placed, source)?;
            }
            None => all.extend(own),
        }
        objects.push(object);
    }
    actors.check(&expanded.placed, source)?;
    let bounds = bounds(&raw.bounds, source)?;
    let start = pose(&raw.start, "start", Some(&bounds), source)?;
    let preview = raw.preview.as_ref().map(|text| pose(text, "preview", Some(&bounds), source)).transpose()?;
    Ok(Scene {
        name: checked_name(&raw.name, source)?,
        description: description(raw.description.as_ref(), source)?,
        near: radius(&raw.near_m, "near_m", source)?,
        success_radius: radius(&raw.success_radius_m, "success_radius_m", source)?,
        max_altitude: raw.max_altitude_m.as_ref().map(|m| metres(m, "max_altitude_m", (1.0, 1000.0), source)).transpose()?,
        default_craft: raw.craft,
        preview: preview.unwrap_or_else(|| above(start, raw.craft)),
        start,
        bounds,
        objects,
        pieces,
        lighting: shining.lighting,
        weather: shining.weather,
        geometry: SceneGeometry { parts: all, materials: materials.list, textures, light: shining.light },
        actors: actors.list,
        warnings: expanded.models.warnings,
    })
}

/// Makes the parts with the name that the file gives the main ones of their object, in place of the mesh's own.
fn choose_main(placed: &Placed, pieces: &mut [PieceTag], source: &Source<'_>) -> Result<(), SceneError> {
    let Some((name, at)) = &placed.main_part else { return Ok(()) };
    if !pieces.iter().any(|piece| piece.name == *name) {
        let hint = nearest(name, pieces.iter().map(|piece| piece.name.as_str())).map(|near| format!("did you mean `{near}`?"));
        return Err(source.error(at, format!("`{}` has no part `{name}`", placed.key), hint));
    }
    pieces.iter_mut().for_each(|piece| piece.main = piece.name == *name);
    Ok(())
}

/// The meshes of a sketch, whose named parts are numbered from `first` + 1.
fn parts(sketch: &Sketch, slots: &[(&'static str, u16)], to_world: &Frame, object: ObjectId, first: u16) -> Vec<Part> {
    let part = |surface: &Surface| {
        let Some(&(_, material)) = slots.iter().find(|(slot, _)| *slot == surface.slot) else {
            unreachable!("a generator uses only its own slots; a test generates every mesh kind");
        };
        let vertices = surface.vertices.iter().map(|v| to_world.vertex(v)).collect();
        let numbered = |piece: u16| if piece == 0 { 0 } else { first.saturating_add(piece) };
        let pieces = surface.pieces().into_iter().map(numbered).collect();
        Part { vertices, triangles: surface.triangles.clone(), material, object, pieces, role: surface.role }
    };
    sketch.surfaces.iter().map(part).collect()
}

/// The meshes of a model; its material indices are offset by `more`, its named parts by `first`. Its texture coordinates count repetitions of an
/// image, so they do not scale with the object.
fn model_parts(parts: &[Part], (more, first): (u16, u16), to_world: &Frame, object: ObjectId) -> Vec<Part> {
    let vertex = |v: &Vertex| Vertex { uv: v.uv, ..to_world.vertex(v) };
    let part = |part: &Part| Part {
        vertices: part.vertices.iter().map(vertex).collect(),
        triangles: part.triangles.clone(),
        material: part.material + more,
        object,
        pieces: part.pieces.iter().map(|piece| first.saturating_add(*piece)).collect(),
        role: part.role,
    };
    parts.iter().map(part).collect()
}

/// The postures of a walking person; empty for everything else.
fn gait(generator: &dyn Generator, motion: &Motion) -> Vec<Sketch> {
    let drawn = |k: u32| {
        let mut sketch = Sketch::default();
        generator.draw_walking(&mut sketch, k as f32 / GAIT as f32).then_some(sketch)
    };
    if motion.gait == Gait::Walk { (0..GAIT).map_while(drawn).collect() } else { Vec::new() }
}

/// The material of each slot: the generator's default unless the object names another.
fn slots(
    defaults: &[(&'static str, &'static str)],
    placed: &Placed,
    materials: &mut Materials<'_>,
    source: &Source<'_>,
) -> Result<Vec<(&'static str, u16)>, SceneError> {
    for (slot, _, at) in &placed.materials {
        if !defaults.iter().any(|(name, _)| name == slot) {
            let names: Vec<&str> = defaults.iter().map(|(name, _)| *name).collect();
            let hint = nearest(slot, names.iter().copied())
                .map_or_else(|| format!("this mesh has the slots `{}`", names.join("`, `")), |n| format!("did you mean `{n}`?"));
            return Err(source.error(at, format!("unknown material slot `{slot}`"), Some(hint)));
        }
    }
    let mut slots = Vec::with_capacity(defaults.len());
    for &(slot, default) in defaults {
        let own = placed.materials.iter().find(|(name, _, _)| name == slot);
        let (name, at) = own.map_or((default, &placed.span), |(_, name, at)| (name.as_str(), at));
        slots.push((slot, materials.get(name, at, source)?));
    }
    Ok(slots)
}

/// Transform from the local frame of an object to the world: scaled, turned clockwise by the heading, moved.
struct Frame {
    cos: f32,
    sin: f32,
    scale: f32,
    offset: Vec3,
}

impl Frame {
    fn of(placed: &Placed) -> Self {
        let heading = placed.heading_deg.to_radians();
        let offset = Vec3::new(placed.position[0] as f32, placed.position[1] as f32, placed.position[2] as f32);
        Self { cos: libm::cos(heading) as f32, sin: libm::sin(heading) as f32, scale: placed.scale as f32, offset }
    }

    fn turn(&self, v: Vec3) -> Vec3 {
        Vec3::new(v.x * self.cos + v.y * self.sin, v.y * self.cos - v.x * self.sin, v.z)
    }

    fn point(&self, v: Vec3) -> Vec3 {
        self.turn(v) * self.scale + self.offset
    }

    fn vertex(&self, v: &Vertex) -> Vertex {
        Vertex { position: self.point(v.position), normal: self.turn(v.normal), uv: v.uv * self.scale }
    }

    fn sign(&self, writing: Writing) -> Sign {
        let (at, scale) = (self.point(writing.centre), f64::from(self.scale));
        Sign {
            text: writing.text,
            arrow: writing.arrow,
            centre: EnuPosition { east: f64::from(at.x), north: f64::from(at.y), up: f64::from(at.z) },
            heading: libm::atan2(f64::from(self.sin), f64::from(self.cos)),
            letter: f64::from(writing.letter) * scale,
            area: f64::from(writing.area) * scale * scale,
            double: writing.double,
        }
    }

    fn on_map(&self, p: Vec2) -> [f64; 2] {
        let at = self.point(p.extend(0.0));
        [f64::from(at.x), f64::from(at.y)]
    }
}

fn object(
    placed: &Placed,
    id: ObjectId,
    ids: &BTreeMap<&str, ObjectId>,
    parts: &[Part],
    sketch: &Sketch,
    to_world: &Frame,
    source: &Source<'_>,
) -> Result<Object, SceneError> {
    let corners = || parts.iter().flat_map(|p| p.vertices.iter().map(|v| v.position));
    let Some(bounds) = Aabb::around(corners()) else {
        return Err(source.error(&placed.span, format!("the mesh of `{}` is empty", placed.key), None));
    };
    let outline = if sketch.outline.is_empty() {
        vec![convex_hull(&corners().map(|p| [f64::from(p.x), f64::from(p.y)]).collect::<Vec<_>>())]
    } else {
        sketch.outline.iter().map(|polygon| polygon.iter().map(|&p| to_world.on_map(p)).collect()).collect()
    };
    let mut tags = placed.tags.clone();
    let named = |named: &Option<(String, Range<usize>)>| {
        let Some((of, at)) = named else { return Ok(None) };
        let hint = || nearest(of, ids.keys().copied()).map(|n| format!("did you mean `{n}`?"));
        ids.get(of.as_str()).copied().map(Some).ok_or_else(|| source.error(at, format!("unknown object `{of}`"), hint()))
    };
    tags.opening_of = named(&placed.opening_of)?;
    tags.looks_like = named(&placed.looks_like)?;
    let opening = !parts.is_empty() && parts.iter().all(|p| p.role == Role::Opening);
    Ok(Object { id, key: placed.key.clone(), tags, mesh: placed.mesh_kind, opening, bounds, outline, sign: None })
}

/// Moving objects.
#[derive(Default)]
struct Actors {
    list: Vec<Actor>,
    courses: Vec<Course>,
}

impl Actors {
    /// Adds one whose parts and object are in its own frame; the object is moved to its start.
    fn add(
        &mut self,
        motion: &Motion,
        postures: Vec<Vec<Part>>,
        object: &mut Object,
        placed: &Placed,
        source: &Source<'_>,
    ) -> Result<(), SceneError> {
        if self.list.len() >= MAX_ACTORS {
            return Err(source.error(&placed.span, format!("a scene may have at most {MAX_ACTORS} moving objects"), None));
        }
        let outline = core::mem::take(&mut object.outline);
        let actor = Actor { object: object.id, motion: motion.clone(), postures, outline };
        let course = Course::new(&actor, None);
        let start = course.start();
        object.outline = start.outline(&actor.outline);
        object.bounds = start.bounds(&actor.postures[0]).unwrap_or(object.bounds);
        self.list.push(actor);
        self.courses.push(course);
        Ok(())
    }

    /// No actor may start on another.
    fn check(&self, placed: &[Placed], source: &Source<'_>) -> Result<(), SceneError> {
        let Some((first, second)) = first_clash(&self.courses) else { return Ok(()) };
        let of = |actor: usize| &placed[usize::from(self.list[actor].object) - 1];
        let message = format!("`{}` overlaps `{}` at its start", of(second).key, of(first).key);
        let hint = "give one of them another `start`, a fraction of its path from 0 to 1".to_owned();
        Err(source.error(&of(second).span, message, Some(hint)))
    }
}

pub(super) fn checked_name(written: &Spanned<String>, source: &Source<'_>) -> Result<String, SceneError> {
    let name = written.get_ref();
    if name.is_empty() || name.chars().count() > 60 || name.chars().any(char::is_control) {
        return Err(source.error(&written.span(), "a scene's name must have 1 to 60 characters", None));
    }
    Ok(name.clone())
}

/// Reduces a text to one line, for lists of scenes.
pub(super) fn description(written: Option<&Spanned<String>>, source: &Source<'_>) -> Result<String, SceneError> {
    let Some(text) = written else { return Ok(String::new()) };
    if text.get_ref().chars().count() > 120 || text.get_ref().chars().any(char::is_control) {
        return Err(source.error(&text.span(), "a scene's description must be one line of at most 120 characters", None));
    }
    Ok(text.get_ref().clone())
}

pub(super) fn radius(value: &Spanned<f64>, key: &str, source: &Source<'_>) -> Result<f64, SceneError> {
    metres(value, key, (0.1, 50.0), source)
}

fn metres(value: &Spanned<f64>, key: &str, (least, most): (f64, f64), source: &Source<'_>) -> Result<f64, SceneError> {
    let v = *value.get_ref();
    if (least..=most).contains(&v) {
        return Ok(v);
    }
    Err(source.error(&value.span(), format!("`{key}` must be from {least} to {most} metres, not `{v}`"), None))
}

pub(super) fn bounds(raw: &Spanned<RawBounds>, source: &Source<'_>) -> Result<Aabb, SceneError> {
    let b = raw.get_ref();
    for range in [b.east, b.north, b.up] {
        if !(range[0] < range[1] && range.iter().all(|v| v.abs() <= 2000.0)) {
            let hint = "use `bounds = { east = [-100, 100], north = [-100, 100], up = [0, 60] }`".to_owned();
            return Err(source.error(&raw.span(), "each range of `bounds` must be increasing and within 2000 m", Some(hint)));
        }
    }
    let corner = |i: usize| EnuPosition { east: b.east[i], north: b.north[i], up: b.up[i] };
    Ok(Aabb { min: corner(0), max: corner(1) })
}

/// Parses the pose of a key, which must lie within `bounds` if there are any.
pub(super) fn pose(text: &Spanned<String>, key: &str, bounds: Option<&Aabb>, source: &Source<'_>) -> Result<Pose, SceneError> {
    let at = text.span();
    let hint = || Some(format!("use `{key} = \"east,north,up,heading_deg\"`"));
    let pose =
        parse_pose(text.get_ref()).ok_or_else(|| source.error(&at, format!("invalid pose `{}`", text.get_ref()), hint()))?;
    if bounds.is_some_and(|bounds| !bounds.contains(pose.position)) {
        return Err(source.error(&at, format!("the {key} is outside `bounds`"), hint()));
    }
    Ok(pose)
}

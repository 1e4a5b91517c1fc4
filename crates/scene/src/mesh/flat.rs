//! Flat pictures of other meshes, such as a look-alike painted on a wall.

use glam::Vec3;
use serde::Deserialize;

use super::{Generator, KINDS, Metres, Sketch, Slots, Surface};
use crate::geometry::{Role, Vertex};

/// The keys of a flat picture.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Raw {
    of: toml::Table,
    #[serde(default)]
    turn_deg: f64,
    #[serde(default = "usual_thickness")]
    thickness: Metres,
}

const fn usual_thickness() -> Metres {
    Metres(0.02)
}

/// Another mesh pressed flat against the wall behind it, with its shades: from the front it looks like the thing.
#[derive(Debug, Deserialize)]
#[serde(try_from = "Raw")]
pub(crate) struct Flat {
    of: Box<dyn Generator>,
    /// By how much the mesh is turned clockwise before, radians.
    turn: f64,
    thickness: f32,
}

impl TryFrom<Raw> for Flat {
    type Error = String;

    fn try_from(raw: Raw) -> Result<Self, Self::Error> {
        let mut table = raw.of;
        let Some(toml::Value::String(kind)) = table.remove("kind") else {
            return Err("`of` needs the `kind` of a mesh, for example `of = { kind = \"car\", style = \"taxi\" }`".to_owned());
        };
        // An opening shows nothing, and a picture of a picture would let a file nest without bound.
        let known = KINDS.iter().find(|(name, _)| *name == kind && !matches!(*name, "flat" | "opening"));
        let (_, read) = known.ok_or_else(|| format!("`of` cannot be a mesh of kind `{kind}`"))?;
        if raw.turn_deg.is_nan() || raw.turn_deg.abs() > 360.0 {
            return Err(format!("`turn_deg` must be from -360 to 360, not `{}`", raw.turn_deg));
        }
        let of = read(table).map_err(|error| format!("mesh `{kind}`: {}", error.message()))?;
        Ok(Self { of, turn: raw.turn_deg.to_radians(), thickness: raw.thickness.0 })
    }
}

impl Generator for Flat {
    fn slots(&self) -> Slots {
        self.of.slots()
    }

    fn draw(&self, sketch: &mut Sketch, seed: &str) {
        let mut thing = sketch.blank();
        self.of.draw(&mut thing, seed);
        let mut turned = sketch.blank();
        turned.append(&thing, self.turn, Vec3::ZERO);
        let shown = |surface: &&Surface| matches!(surface.role, Role::Solid | Role::Visual);
        let depths = turned.surfaces.iter().filter(shown).flat_map(|surface| &surface.vertices).map(|vertex| vertex.position.y);
        let (low, high) = depths.fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), y| (low.min(y), high.max(y)));
        // What is flat already stays so.
        let squeeze = if high > low { (self.thickness / (high - low)).min(1.0) } else { 0.0 };
        let pressed = |vertex: &Vertex| {
            let at = vertex.position;
            Vertex { position: Vec3::new(at.x, (at.y - low) * squeeze, at.z), ..*vertex }
        };
        sketch.surfaces.extend(turned.surfaces.iter().filter(shown).map(|surface| Surface {
            vertices: surface.vertices.iter().map(pressed).collect(),
            runs: Vec::new(),
            ..surface.clone()
        }));
    }
}

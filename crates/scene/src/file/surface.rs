//! Materials in a file, and their conversion for the renderer.

use std::collections::BTreeMap;
use std::sync::OnceLock;

use glam::{Vec2, Vec3};
use serde::{Deserialize, Deserializer};

use crate::geometry::{Material, Pattern};
use crate::texture::srgb_to_linear;

/// A colour written as `#rrggbb` in sRGB, stored as linear light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Colour(pub(super) Vec3);

impl<'de> Deserialize<'de> for Colour {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = String::deserialize(deserializer)?;
        let digits = text.strip_prefix('#').filter(|d| d.len() == 6 && d.bytes().all(|b| b.is_ascii_hexdigit()));
        let value = digits.and_then(|d| u32::from_str_radix(d, 16).ok());
        let value = value.ok_or_else(|| serde::de::Error::custom(format!("invalid colour `{text}`: use `#rrggbb`")))?;
        let linear = |shift: u32| srgb_to_linear(f64::from((value >> shift) & 0xff) / 255.0) as f32;
        Ok(Self(Vec3::new(linear(16), linear(8), linear(0))))
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
enum PatternName {
    #[default]
    Plain,
    Windows,
    Brick,
    Asphalt,
    Grass,
    Concrete,
    Foliage,
    Wood,
    Water,
    Stripes,
}

/// A material as written.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawMaterial {
    colour: Colour,
    accent: Option<Colour>,
    #[serde(default)]
    pattern: PatternName,
    /// Window cell, metres.
    cell: Option<[f32; 2]>,
    /// Fraction of a cell that is glass.
    glass: Option<f32>,
    /// Width of the marked road, metres.
    width: Option<f32>,
    /// Distance between joints, metres.
    joint: Option<f32>,
    /// Period of stripes, metres.
    period: Option<f32>,
    #[serde(default)]
    two_sided: bool,
    emission: Option<Colour>,
    /// Replaces `emission` where lamps are lit.
    emission_lit: Option<Colour>,
}

/// Emission of windows where lamps are lit: rooms behind them. The pattern leaves most of them dark.
const ROOMS: Vec3 = Vec3::new(0.62, 0.40, 0.17);

impl RawMaterial {
    /// The material, or an error; `lit`: whether lamps are lit, `wet`: whether it rains.
    pub(super) fn material(&self, lit: bool, wet: bool) -> Result<Material, String> {
        let measure = |name: &str, value: Option<f32>, default: f32, low: f32, high: f32| match value.unwrap_or(default) {
            v if (low..=high).contains(&v) => Ok(v),
            v => Err(format!("`{name}` must be from {low} to {high}, not `{v}`")),
        };
        let given = [
            ("cell", self.cell.is_some(), PatternName::Windows),
            ("glass", self.glass.is_some(), PatternName::Windows),
            ("width", self.width.is_some(), PatternName::Asphalt),
            ("joint", self.joint.is_some(), PatternName::Concrete),
            ("period", self.period.is_some(), PatternName::Stripes),
        ];
        if let Some((name, _, _)) = given.iter().find(|(_, given, wanted)| *given && *wanted != self.pattern) {
            return Err(format!("`{name}` does not apply to this pattern"));
        }
        let pattern = match self.pattern {
            PatternName::Plain => Pattern::Plain,
            PatternName::Windows => {
                let [w, h] = self.cell.unwrap_or([3.0, 3.3]);
                let cell = Vec2::new(measure("cell", Some(w), w, 0.2, 50.0)?, measure("cell", Some(h), h, 0.2, 50.0)?);
                Pattern::Windows { cell, glass: measure("glass", self.glass, 0.5, 0.05, 0.98)? }
            }
            PatternName::Brick => Pattern::Brick,
            PatternName::Asphalt => Pattern::Asphalt { width: measure("width", self.width, 0.0, 0.0, 100.0)? },
            PatternName::Grass => Pattern::Grass,
            PatternName::Concrete => Pattern::Concrete { joint: measure("joint", self.joint, 0.0, 0.0, 100.0)? },
            PatternName::Foliage => Pattern::Foliage,
            PatternName::Wood => Pattern::Wood,
            PatternName::Water => Pattern::Water,
            PatternName::Stripes => Pattern::Stripes { period: measure("period", self.period, 1.0, 0.02, 100.0)? },
        };
        let rooms = (self.pattern == PatternName::Windows).then_some(ROOMS);
        let lamps = self.emission_lit.map(|c| c.0).or(rooms).filter(|_| lit);
        // Water fills the pores of stone.
        let porous = matches!(self.pattern, PatternName::Asphalt | PatternName::Concrete | PatternName::Brick);
        let soaked = if wet && porous { 0.62 } else { 1.0 };
        let dimmed = self.colour.0 * 0.7;
        Ok(Material {
            colour: self.colour.0 * soaked,
            accent: self.accent.map_or(dimmed, |c| c.0),
            pattern,
            two_sided: self.two_sided,
            emission: lamps.or(self.emission.map(|c| c.0)).unwrap_or(Vec3::ZERO),
        })
    }
}

/// The palette available to every scene.
pub(super) fn palette() -> &'static BTreeMap<String, RawMaterial> {
    static PALETTE: OnceLock<BTreeMap<String, RawMaterial>> = OnceLock::new();
    PALETTE.get_or_init(|| toml::from_str(include_str!("palette.toml")).expect("the embedded palette is valid"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::KINDS;

    #[test]
    fn every_palette_material_is_valid() {
        for (name, material) in palette() {
            assert!(material.material(false, true).is_ok() && material.material(true, false).is_ok(), "{name}");
        }
        assert!(KINDS.windows(2).all(|pair| pair[0].0 < pair[1].0), "kinds are in order");
    }
}

//! Axis-aligned boxes in the world.

use glam::Vec3;
use serde::Serialize;
use spf_core::geometry::EnuPosition;

/// An axis-aligned box in the world, metres.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Aabb {
    /// Western, southern, lower corner.
    pub min: EnuPosition,
    /// Eastern, northern, upper corner.
    pub max: EnuPosition,
}

impl Aabb {
    /// Whether a position lies inside or on the boundary.
    #[must_use]
    pub fn contains(&self, p: EnuPosition) -> bool {
        (self.min.east..=self.max.east).contains(&p.east)
            && (self.min.north..=self.max.north).contains(&p.north)
            && (self.min.up..=self.max.up).contains(&p.up)
    }

    /// The smallest box around some points; `None` for no points.
    pub(crate) fn around(points: impl Iterator<Item = Vec3>) -> Option<Self> {
        let (min, max) =
            points.fold(None, |sum: Option<(Vec3, Vec3)>, p| Some(sum.map_or((p, p), |(min, max)| (min.min(p), max.max(p)))))?;
        let corner = |v: Vec3| EnuPosition { east: f64::from(v.x), north: f64::from(v.y), up: f64::from(v.z) };
        Some(Self { min: corner(min), max: corner(max) })
    }
}

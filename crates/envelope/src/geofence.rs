//! Geofences: where a craft may fly, as polygons on the map with an altitude band (`docs/explanation/safety.md`).
//!
//! A geofence is GeoJSON (RFC 7946) with one deviation: coordinates are **metres east and north** of the origin of the
//! craft's position (the take-off point for a craft that reports no position), not longitude and latitude. Each polygon
//! may have holes, which are forbidden, and the properties `min_altitude_m` and `max_altitude_m`, metres above the
//! take-off point. The allowed region is the union of the polygons, each with its own altitude band.
//!
//! ```
//! use crate::geofence::Geofence;
//! use spf_core::geometry::EnuPosition;
//!
//! let fence = Geofence::from_geojson(
//!     r#"{"type": "Feature", "properties": {"max_altitude_m": 30},
//!         "geometry": {"type": "Polygon", "coordinates": [[[-50, -50], [50, -50], [50, 80], [-50, 80], [-50, -50]]]}}"#,
//! )?;
//! assert!(fence.contains(EnuPosition { east: 10.0, north: 70.0, up: 29.0 }));
//! assert!(!fence.contains(EnuPosition { east: 10.0, north: 70.0, up: 31.0 }));
//! # Ok::<(), crate::geofence::GeofenceError>(())
//! ```

mod parse;

use std::borrow::Cow;

pub use parse::{GeofenceError, MAX_BYTES, MAX_VERTICES};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize};

use spf_core::geometry::EnuPosition;

/// A point on the map, metres east and north.
pub(crate) type MapPoint = (f64, f64);

/// Crossings of a ray closer together than this count as one, m: the common edge of two adjacent polygons.
const SAME: f64 = 1.0e-6;
/// A ray that passes the end of an edge within this distance intersects it, m.
const GRAZE: f64 = 1.0e-9;

/// Where a craft may fly. See the [module](self).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "serde_json::Value", into = "serde_json::Value")]
pub struct Geofence {
    areas: Vec<Area>,
}

/// One polygon with holes and its altitude band.
#[derive(Clone, Debug, PartialEq)]
struct Area {
    /// The outer ring, then the holes; each without its repeated last point.
    rings: Vec<Vec<MapPoint>>,
    /// Metres above the take-off point; infinite when not stated.
    min_altitude: f64,
    max_altitude: f64,
}

/// Where a ray leaves the allowed region.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Exit {
    /// Metres along the ray.
    pub(crate) distance: f64,
    /// Unit vector across the edge there, along the ray's side.
    pub(crate) out: MapPoint,
}

impl Area {
    /// Inside the outer ring and outside every hole.
    fn contains(&self, at: MapPoint) -> bool {
        let (outer, holes) = self.rings.split_first().expect("an area has an outer ring");
        in_ring(outer, at) && !holes.iter().any(|hole| in_ring(hole, at))
    }

    fn edges(&self) -> impl Iterator<Item = (MapPoint, MapPoint)> {
        self.rings.iter().flat_map(|ring| ring_edges(ring))
    }

    /// The point of the edges nearest to `at`, and its distance.
    fn nearest_edge_point(&self, at: MapPoint) -> (MapPoint, f64) {
        self.edges()
            .map(|edge| nearest_on(edge, at))
            .map(|p| (p, libm::hypot(p.0 - at.0, p.1 - at.1)))
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .expect("an area has edges")
    }

    /// The least extent across any of its outer edges, metres.
    fn width(&self) -> f64 {
        let outer = &self.rings[0];
        let across = |(from, to): (MapPoint, MapPoint)| {
            let (dx, dy) = (to.0 - from.0, to.1 - from.1);
            let length = libm::hypot(dx, dy);
            let off = |point: &MapPoint| (dx * (point.1 - from.1) - dy * (point.0 - from.0)) / length;
            let (low, high) = outer.iter().map(off).fold((0.0_f64, 0.0_f64), |(low, high), x| (low.min(x), high.max(x)));
            high - low
        };
        ring_edges(outer).map(across).filter(|width| width.is_finite()).fold(f64::INFINITY, f64::min)
    }

    fn nearest_altitude(&self, altitude: f64) -> f64 {
        altitude.max(self.min_altitude).min(self.max_altitude)
    }
}

impl Geofence {
    /// Reads a geofence: a `FeatureCollection`, `Feature`, `Polygon` or `MultiPolygon`.
    ///
    /// # Errors
    /// A [`GeofenceError`] with the problem and its place in the document: invalid JSON or GeoJSON, no polygon, rings
    /// that are open, too short, too small or self-intersecting, coordinates that look like degrees or exceed 100 km,
    /// inverted altitude bands, or a document beyond [`MAX_BYTES`] or [`MAX_VERTICES`].
    pub fn from_geojson(text: &str) -> Result<Self, GeofenceError> {
        parse::parse(text)
    }

    /// Whether a position is allowed; `up` is the altitude above the take-off point. A non-finite position is outside.
    #[must_use]
    pub fn contains(&self, at: EnuPosition) -> bool {
        self.areas.iter().any(|a| a.min_altitude <= at.up && at.up <= a.max_altitude && a.contains((at.east, at.north)))
    }

    /// Whether a position is inside horizontally and not too high. Being below `min_altitude_m` is not a breach, since
    /// every flight starts and ends there.
    pub(crate) fn contains_below_ceiling(&self, at: EnuPosition) -> bool {
        self.areas.iter().any(|a| at.up <= a.max_altitude && a.contains((at.east, at.north)))
    }

    /// Horizontal distance to the nearest edge of any polygon or hole, metres: positive inside some polygon, negative
    /// outside. Edges inside another polygon count, so the result errs on the near side.
    #[must_use]
    pub fn edge_distance(&self, at: EnuPosition) -> f64 {
        let point = (at.east, at.north);
        let distance = self.areas.iter().map(|a| a.nearest_edge_point(point).1).fold(f64::INFINITY, f64::min);
        if self.areas.iter().any(|a| a.contains(point)) { distance } else { -distance }
    }

    /// Width of the widest area, metres: the least extent across any of its outer edges.
    pub(crate) fn width(&self) -> f64 {
        self.areas.iter().map(Area::width).fold(0.0, f64::max)
    }

    /// The outer ring of the only polygon, then its holes, metres east and north, first point not repeated; `None` if there are
    /// several polygons.
    #[must_use]
    pub fn only_polygon(&self) -> Option<impl Iterator<Item = &[(f64, f64)]>> {
        let [area] = self.areas.as_slice() else { return None };
        Some(area.rings.iter().map(Vec::as_slice))
    }

    /// The outer rings and holes, for maps: metres east and north, first point not repeated.
    pub fn outlines(&self) -> impl Iterator<Item = &[(f64, f64)]> {
        self.areas.iter().flat_map(|a| a.rings.iter().map(Vec::as_slice))
    }

    /// The altitudes between which the craft may climb and descend on the spot: the bands of the surrounding polygons
    /// that contain its altitude, else the nearest band there, else that of the nearest polygon.
    pub(crate) fn band(&self, at: EnuPosition) -> (f64, f64) {
        let point = (at.east, at.north);
        let around = || self.areas.iter().filter(|a| a.contains(point));
        let within = around().filter(|a| a.min_altitude <= at.up && at.up <= a.max_altitude);
        let (min, max) =
            within.fold((f64::INFINITY, f64::NEG_INFINITY), |(min, max), a| (min.min(a.min_altitude), max.max(a.max_altitude)));
        if min <= max {
            return (min, max);
        }
        let off = |a: &&Area| (a.nearest_altitude(at.up) - at.up).abs();
        let nearest = around().min_by(|a, b| off(a).total_cmp(&off(b))).or_else(|| {
            let far = |a: &&Area| a.nearest_edge_point(point).1;
            self.areas.iter().min_by(|a, b| far(a).total_cmp(&far(b)))
        });
        nearest.map_or((f64::NEG_INFINITY, f64::INFINITY), |a| (a.min_altitude, a.max_altitude))
    }

    /// The polygons whose band contains all altitudes from `low` to `high`.
    fn open_at(&self, (low, high): (f64, f64)) -> impl Iterator<Item = &Area> + Clone {
        self.areas.iter().filter(move |a| a.min_altitude <= low && high <= a.max_altitude)
    }

    /// Whether a point is allowed for all altitudes of `band` within one polygon.
    pub(crate) fn allows(&self, at: MapPoint, band: (f64, f64)) -> bool {
        self.open_at(band).any(|a| a.contains(at))
    }

    /// From an allowed point: where the ray along the unit vector `along` first leaves what is allowed at `band`, if that is
    /// within `reach` metres.
    pub(crate) fn exit(&self, from: MapPoint, along: MapPoint, band: (f64, f64), reach: f64) -> Option<Exit> {
        let point = |t: f64| (from.0 + along.0 * t, from.1 + along.1 * t);
        let next = |after: f64| {
            self.open_at(band)
                .flat_map(Area::edges)
                .filter_map(|edge| crossing(from, along, edge).map(|t| (t, edge)))
                .filter(|&(t, _)| t > after && t <= reach)
                .min_by(|a, b| a.0.total_cmp(&b.0))
        };
        let mut here = 0.0;
        let mut edge = None;
        loop {
            let ahead = next(here + SAME);
            // Between two crossings all points are equivalent, so the midpoint decides.
            let middle = 0.5 * (here + ahead.map_or(reach.min(here + 1.0), |(t, _)| t));
            if !self.allows(point(middle), band) {
                let out = edge.map_or(along, |edge| across(edge, along));
                return Some(Exit { distance: here, out });
            }
            (here, edge) = ahead.map(|(t, edge)| (t, Some(edge)))?;
        }
    }

    /// From a point that is not allowed: the nearest allowed one at `band`. `None` if no polygon is open at that band.
    pub(crate) fn nearest_inside(&self, from: MapPoint, band: (f64, f64)) -> Option<MapPoint> {
        self.open_at(band).map(|a| a.nearest_edge_point(from)).min_by(|a, b| a.1.total_cmp(&b.1)).map(|(point, _)| point)
    }
}

/// Even-odd rule; the ring has no repeated last point.
fn in_ring(ring: &[MapPoint], (x, y): MapPoint) -> bool {
    let mut inside = false;
    for ((ax, ay), (bx, by)) in ring_edges(ring) {
        if (ay > y) != (by > y) && x < ax + (bx - ax) * ((y - ay) / (by - ay)) {
            inside = !inside;
        }
    }
    inside
}

fn ring_edges(ring: &[MapPoint]) -> impl Iterator<Item = (MapPoint, MapPoint)> {
    ring.iter().copied().zip(ring.iter().copied().cycle().skip(1))
}

fn nearest_on(((ax, ay), (bx, by)): (MapPoint, MapPoint), (x, y): MapPoint) -> MapPoint {
    let (dx, dy) = (bx - ax, by - ay);
    let length = dx * dx + dy * dy;
    let t = if length > 0.0 { (((x - ax) * dx + (y - ay) * dy) / length).clamp(0.0, 1.0) } else { 0.0 };
    (ax + dx * t, ay + dy * t)
}

/// Metres along the ray to the edge; `None` when they do not meet or are parallel.
fn crossing(from: MapPoint, along: MapPoint, (a, b): (MapPoint, MapPoint)) -> Option<f64> {
    let (ex, ey) = (b.0 - a.0, b.1 - a.1);
    let (ax, ay) = (a.0 - from.0, a.1 - from.1);
    let det = along.0 * ey - along.1 * ex;
    if det == 0.0 {
        return None;
    }
    // Twice the areas spanned by the ray's line and both ends: of equal sign if the edge lies on one side. The edge is
    // extended slightly, so that no ray slips through a corner.
    let (bx, by) = (b.0 - from.0, b.1 - from.1);
    let (side_a, side_b) = (ax * along.1 - ay * along.0, bx * along.1 - by * along.0);
    if side_a.min(side_b) > GRAZE || side_a.max(side_b) < -GRAZE {
        return None;
    }
    Some((ax * ey - ay * ex) / det).filter(|&t| t >= 0.0)
}

/// The unit normal of an edge on the side to which `along` points.
fn across((a, b): (MapPoint, MapPoint), along: MapPoint) -> MapPoint {
    let (nx, ny) = (b.1 - a.1, a.0 - b.0);
    let length = libm::hypot(nx, ny);
    let sign = if nx * along.0 + ny * along.1 < 0.0 { -1.0 } else { 1.0 };
    (sign * nx / length, sign * ny / length)
}

impl TryFrom<serde_json::Value> for Geofence {
    type Error = GeofenceError;

    fn try_from(value: serde_json::Value) -> Result<Self, GeofenceError> {
        parse::from_value(&value)
    }
}

impl From<Geofence> for serde_json::Value {
    /// A `FeatureCollection` that reads back as the same geofence.
    fn from(fence: Geofence) -> Self {
        parse::to_value(&fence)
    }
}

impl JsonSchema for Geofence {
    fn schema_name() -> Cow<'static, str> {
        "Geofence".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "GeoJSON polygons, coordinates in metres east and north of the origin; properties min_altitude_m and max_altitude_m",
            "type": "object",
            "required": ["type"],
            "properties": { "type": { "enum": ["FeatureCollection", "Feature", "Polygon", "MultiPolygon"] } },
        })
    }
}

#[cfg(test)]
mod tests;

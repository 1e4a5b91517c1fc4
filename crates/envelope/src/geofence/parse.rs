//! Reading geofences from GeoJSON, and writing them.

use serde_json::{Map, Value, json};

use super::{Area, Geofence, MapPoint, ring_edges};

/// Maximum size of a geofence document, bytes.
pub const MAX_BYTES: usize = 1 << 20;
/// Maximum number of vertices of all rings together.
pub const MAX_VERTICES: usize = 4096;
/// Maximum coordinate, metres.
const MAX_COORDINATE: f64 = 100_000.0;
/// Minimum area of a ring, square metres.
const MIN_AREA: f64 = 1.0;

/// Why a geofence could not be read. `at` is the place in the document.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum GeofenceError {
    /// The document is beyond [`MAX_BYTES`].
    #[error("the geofence file has `{bytes}` bytes, but at most `{MAX_BYTES}` are allowed; simplify it")]
    TooLarge {
        /// Its size.
        bytes: usize,
    },
    /// The document is not JSON.
    #[error("the geofence is not valid JSON: {0}")]
    Json(String),
    /// A value of an unexpected type.
    #[error("`{at}` must be {expected}, found {found}")]
    Type {
        /// Place in the document.
        at: String,
        /// The expected type.
        expected: &'static str,
        /// The type found.
        found: String,
    },
    /// The document has no polygon.
    #[error("the geofence has no polygon")]
    Empty,
    /// More than [`MAX_VERTICES`].
    #[error("`{at}`: the geofence has more than `{MAX_VERTICES}` vertices; simplify it")]
    TooManyVertices {
        /// Place at which the limit was exceeded.
        at: String,
    },
    /// A ring with fewer than three corners.
    #[error("`{at}` has `{points}` points; a ring needs at least 4, with the last equal to the first")]
    TooFewPoints {
        /// The ring.
        at: String,
        /// Number of points.
        points: usize,
    },
    /// A ring whose last point is not its first.
    #[error("`{at}` is not closed; repeat the first point at the end")]
    Open {
        /// The ring.
        at: String,
    },
    /// A coordinate that is out of range.
    #[error("`{at}` is `{value}`; coordinates must be within 100000 m of the origin")]
    Coordinate {
        /// The coordinate.
        at: String,
        /// Its value.
        value: f64,
    },
    /// The ring is tiny, and its coordinates could be degrees.
    #[error("`{at}` looks like longitude and latitude; use metres east and north of the origin")]
    Degrees {
        /// The ring.
        at: String,
    },
    /// The ring's area is nearly zero.
    #[error("`{at}` encloses `{area:.3}` m²; at least 1 m² is required")]
    TooSmall {
        /// The ring.
        at: String,
        /// Its area, m².
        area: f64,
    },
    /// Two edges of a ring cross or touch.
    #[error("`{at}` intersects itself at edges `{first}` and `{second}`; order the points along the outline")]
    Crossing {
        /// The ring.
        at: String,
        /// Index of the first edge's start point.
        first: usize,
        /// Index of the second edge's start point.
        second: usize,
    },
    /// A band whose floor is not below its ceiling.
    #[error("`{at}`: `min_altitude_m` `{min}` must be less than `max_altitude_m` `{max}`")]
    Band {
        /// The properties.
        at: String,
        /// Floor, m.
        min: f64,
        /// Ceiling, m.
        max: f64,
    },
    /// A property whose name resembles an altitude property and would be ignored.
    #[error("`{at}` has an unknown property `{name}`; only `min_altitude_m` and `max_altitude_m` are allowed")]
    Property {
        /// The properties.
        at: String,
        /// Its name.
        name: String,
    },
}

pub(super) fn parse(text: &str) -> Result<Geofence, GeofenceError> {
    if text.len() > MAX_BYTES {
        return Err(GeofenceError::TooLarge { bytes: text.len() });
    }
    let value = serde_json::from_str(text).map_err(|e| GeofenceError::Json(e.to_string()))?;
    from_value(&value)
}

pub(super) fn from_value(value: &Value) -> Result<Geofence, GeofenceError> {
    let mut reader = Reader { areas: Vec::new(), vertices: 0 };
    let root = object(value, "geofence")?;
    match kind(root) {
        "FeatureCollection" => {
            for (i, feature) in array(root.get("features"), "features")?.iter().enumerate() {
                let at = format!("features[{i}]");
                let feature = object(feature, &at)?;
                if kind(feature) != "Feature" {
                    return Err(wrong(format!("{at}.type"), "`Feature`", feature.get("type")));
                }
                reader.feature(feature, &format!("{at}."))?;
            }
        }
        "Feature" => reader.feature(root, "")?,
        _ => reader.geometry(root, "", (f64::NEG_INFINITY, f64::INFINITY))?,
    }
    if reader.areas.is_empty() {
        return Err(GeofenceError::Empty);
    }
    Ok(Geofence { areas: reader.areas })
}

pub(super) fn to_value(fence: &Geofence) -> Value {
    let features: Vec<Value> = fence
        .areas
        .iter()
        .map(|area| {
            let rings: Vec<Vec<[f64; 2]>> = area
                .rings
                .iter()
                .map(|ring| ring.iter().chain(ring.first()).map(|&(east, north)| [east, north]).collect())
                .collect();
            let mut properties = Map::new();
            for (name, value) in [("min_altitude_m", area.min_altitude), ("max_altitude_m", area.max_altitude)] {
                if value.is_finite() {
                    properties.insert(name.into(), value.into());
                }
            }
            json!({"type": "Feature", "properties": properties, "geometry": {"type": "Polygon", "coordinates": rings}})
        })
        .collect();
    json!({"type": "FeatureCollection", "features": features})
}

struct Reader {
    areas: Vec<Area>,
    vertices: usize,
}

impl Reader {
    /// `prefix` is empty or ends in a dot.
    fn feature(&mut self, feature: &Map<String, Value>, prefix: &str) -> Result<(), GeofenceError> {
        let at = format!("{prefix}properties");
        let band = match feature.get("properties") {
            None | Some(Value::Null) => (f64::NEG_INFINITY, f64::INFINITY),
            Some(properties) => band(object(properties, &at)?, &at)?,
        };
        let at = format!("{prefix}geometry");
        let geometry = feature.get("geometry").ok_or_else(|| wrong(at.clone(), "a geometry", None))?;
        self.geometry(object(geometry, &at)?, &format!("{at}."), band)
    }

    fn geometry(&mut self, geometry: &Map<String, Value>, prefix: &str, band: (f64, f64)) -> Result<(), GeofenceError> {
        let at = format!("{prefix}coordinates");
        let coordinates = geometry.get("coordinates");
        match kind(geometry) {
            "Polygon" => self.polygon(coordinates, at, band),
            "MultiPolygon" => {
                for (i, polygon) in array(coordinates, &at)?.iter().enumerate() {
                    self.polygon(Some(polygon), format!("{at}[{i}]"), band)?;
                }
                Ok(())
            }
            _ => Err(wrong(
                format!("{prefix}type"),
                "`Polygon`, `MultiPolygon`, `Feature` or `FeatureCollection`",
                geometry.get("type"),
            )),
        }
    }

    fn polygon(&mut self, value: Option<&Value>, at: String, band: (f64, f64)) -> Result<(), GeofenceError> {
        let rings = array(value, &at)?;
        if rings.is_empty() {
            return Err(wrong(at, "at least one ring", value));
        }
        let rings = rings.iter().enumerate().map(|(i, ring)| self.ring(ring, format!("{at}[{i}]"))).collect::<Result<_, _>>()?;
        self.areas.push(Area { rings, min_altitude: band.0, max_altitude: band.1 });
        Ok(())
    }

    fn ring(&mut self, value: &Value, at: String) -> Result<Vec<MapPoint>, GeofenceError> {
        let points = array(Some(value), &at)?;
        self.vertices = self.vertices.saturating_add(points.len());
        if self.vertices > MAX_VERTICES {
            return Err(GeofenceError::TooManyVertices { at });
        }
        if points.len() < 4 {
            return Err(GeofenceError::TooFewPoints { at, points: points.len() });
        }
        let mut ring =
            points.iter().enumerate().map(|(i, point)| position(point, format!("{at}[{i}]"))).collect::<Result<Vec<_>, _>>()?;
        if ring.first() != ring.last() {
            return Err(GeofenceError::Open { at });
        }
        ring.pop();
        // A repeated corner adds nothing and would be an edge without a direction.
        ring.dedup();
        if ring.len() < 3 {
            return Err(GeofenceError::TooFewPoints { at, points: ring.len() + 1 });
        }
        let area = area_of(&ring);
        if area < MIN_AREA {
            let degrees = ring.iter().all(|&(east, north)| east.abs() <= 180.0 && north.abs() <= 90.0);
            let fraction = ring.iter().any(|&(east, north)| east.fract() != 0.0 || north.fract() != 0.0);
            return Err(if degrees && fraction { GeofenceError::Degrees { at } } else { GeofenceError::TooSmall { at, area } });
        }
        if let Some((first, second)) = self_crossing(&ring) {
            return Err(GeofenceError::Crossing { at, first, second });
        }
        Ok(ring)
    }
}

/// The `type` of a GeoJSON object; empty when it has none.
fn kind(object: &Map<String, Value>) -> &str {
    object.get("type").and_then(Value::as_str).unwrap_or_default()
}

fn band(properties: &Map<String, Value>, at: &str) -> Result<(f64, f64), GeofenceError> {
    let mut band = (f64::NEG_INFINITY, f64::INFINITY);
    for (name, value) in properties {
        let side = match name.as_str() {
            "min_altitude_m" => &mut band.0,
            "max_altitude_m" => &mut band.1,
            _ if name.to_ascii_lowercase().contains("altitude") => {
                return Err(GeofenceError::Property { at: at.to_owned(), name: name.clone() });
            }
            _ => continue,
        };
        if !value.is_null() {
            *side = value.as_f64().ok_or_else(|| wrong(format!("{at}.{name}"), "a number of metres", Some(value)))?;
        }
    }
    // Also true for a value that overflowed to infinity on the wrong side.
    if band.0 >= band.1 {
        return Err(GeofenceError::Band { at: at.to_owned(), min: band.0, max: band.1 });
    }
    Ok(band)
}

fn position(value: &Value, at: String) -> Result<MapPoint, GeofenceError> {
    let numbers = array(Some(value), &at)?;
    let number = |i: usize| {
        let value = numbers.get(i);
        let at = format!("{at}[{i}]");
        match value.and_then(Value::as_f64) {
            Some(x) if x.abs() <= MAX_COORDINATE => Ok(x),
            Some(value) => Err(GeofenceError::Coordinate { at, value }),
            None => Err(wrong(at, "a number of metres", value)),
        }
    };
    // RFC 7946 allows a third number, an altitude; it is ignored here, since bands are properties.
    Ok((number(0)?, number(1)?))
}

fn array<'a>(value: Option<&'a Value>, at: &str) -> Result<&'a Vec<Value>, GeofenceError> {
    value.and_then(Value::as_array).ok_or_else(|| wrong(at.to_owned(), "an array", value))
}

fn object<'a>(value: &'a Value, at: &str) -> Result<&'a Map<String, Value>, GeofenceError> {
    value.as_object().ok_or_else(|| wrong(at.to_owned(), "an object", Some(value)))
}

fn wrong(at: String, expected: &'static str, found: Option<&Value>) -> GeofenceError {
    let found = match found {
        None => "nothing".to_owned(),
        Some(Value::Object(_)) => "an object".to_owned(),
        Some(Value::Array(_)) => "an array".to_owned(),
        Some(value) => {
            let text: String = value.to_string().chars().take(40).collect();
            format!("`{text}`")
        }
    };
    GeofenceError::Type { at, expected, found }
}

/// Enclosed area by the shoelace rule, about the first point so that far rings lose no digits.
fn area_of(ring: &[MapPoint]) -> f64 {
    let (ox, oy) = ring[0];
    let twice: f64 = ring_edges(ring).map(|((ax, ay), (bx, by))| (ax - ox) * (by - oy) - (bx - ox) * (ay - oy)).sum();
    0.5 * twice.abs()
}

/// Two edges of the ring that are not neighbours and share a point.
fn self_crossing(ring: &[MapPoint]) -> Option<(usize, usize)> {
    let n = ring.len();
    let edges: Vec<_> = ring_edges(ring).collect();
    for i in 0..n {
        for j in i + 2..n {
            let neighbours = i == 0 && j == n - 1;
            if !neighbours && meet(edges[i], edges[j]) {
                return Some((i, j));
            }
        }
    }
    None
}

fn meet((a, b): (MapPoint, MapPoint), (c, d): (MapPoint, MapPoint)) -> bool {
    let side = |p: MapPoint, q: MapPoint, r: MapPoint| (q.0 - p.0) * (r.1 - p.1) - (q.1 - p.1) * (r.0 - p.0);
    let apart = |a: f64, b: f64, c: f64, d: f64| a.max(b) < c.min(d) || c.max(d) < a.min(b);
    if apart(a.0, b.0, c.0, d.0) || apart(a.1, b.1, c.1, d.1) {
        return false;
    }
    side(a, b, c) * side(a, b, d) <= 0.0 && side(c, d, a) * side(c, d, b) <= 0.0
}

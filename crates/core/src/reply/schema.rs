//! The wire form of a reply: its JSON schema and its writer.

use schemars::{JsonSchema, Schema, SchemaGenerator, generate::SchemaSettings, json_schema};
use serde::{Serialize, Serializer};
use serde_json::Value;

use super::{DEPTH_LABELS, DepthAs, Look, Reply, Status};
use crate::grounding::GroundingProfile;
use crate::lift::range_of_label;
use crate::query::{ImageBox, ImagePoint};

// The order of the fields is the order in which a model is to think: what it looks for, whether it sees it, where it is.
// The comments on the fields reach the model, as descriptions in the schema.
/// What the image shows, and where the drone is to go next.
#[derive(Serialize, JsonSchema)]
struct WireReply<'a> {
    /// What you go to or look for now, in at most six words.
    target: Option<&'a str>,
    /// Whether the target is seen, followed, not seen or reached, or somebody passes first, or the path is blocked.
    #[schemars(schema_with = "status")]
    status: Status,
    /// Number of the stage being worked on, from 1.
    stage: Option<u32>,
    /// The box around the target; null if it is not seen.
    #[schemars(schema_with = "nullable_numbers")]
    target_box: Option<[Number; 4]>,
    /// The place on the target to fly to; null if it is not seen.
    #[schemars(schema_with = "nullable_numbers")]
    point: Option<[Number; 2]>,
    /// Depth label of the point; null without a point.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(schema_with = "nullable_label")]
    depth: Option<Option<u8>>,
    /// Distance of the point in metres; null without a point.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(schema_with = "nullable_number")]
    depth_m: Option<Option<Number>>,
    /// Degrees to turn in place, clockwise positive, if that is best; else null.
    #[schemars(schema_with = "nullable_number")]
    turn_deg: Option<Number>,
    /// Which way to look, with status not_visible; else null.
    #[schemars(schema_with = "nullable_look")]
    look: Option<Look>,
    /// The most open direction, with status not_visible or blocked; else null.
    #[schemars(schema_with = "nullable_way")]
    open_way: Option<WireWay>,
    /// The nearest solid things in the image that are nearer than the target, at most eight.
    #[serde(skip_serializing_if = "Option::is_none")]
    boxes: Option<Vec<WireBox<'a>>>,
}

/// An open direction as it is written.
#[derive(Serialize, JsonSchema)]
struct WireWay {
    /// Where it leads in the image.
    #[schemars(schema_with = "numbers")]
    point: [Number; 2],
    /// Depth label of its end.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(schema_with = "label")]
    depth: Option<u8>,
    /// Distance of its end in metres.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(schema_with = "number")]
    depth_m: Option<Number>,
}

/// One obstacle as it is written.
#[derive(Serialize, JsonSchema)]
struct WireBox<'a> {
    /// Its box in the image.
    #[serde(rename = "box")]
    #[schemars(schema_with = "numbers")]
    area: [Number; 4],
    /// Its depth label.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(schema_with = "label")]
    depth: Option<u8>,
    /// Its distance in metres.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(schema_with = "number")]
    depth_m: Option<Number>,
    /// What it is, in a few words.
    name: &'a str,
}

/// A number, written without decimals if it is whole, as models do.
struct Number(f64);

impl Serialize for Number {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        if self.0.fract() == 0.0 { serializer.serialize_i64(self.0 as i64) } else { serializer.serialize_f64(self.0) }
    }
}

// The portable subset: no `minimum`, `minItems` or `$ref`, which some vendors reject; a label is an enumeration.
fn status(_: &mut SchemaGenerator) -> Schema {
    json_schema!({ "type": "string", "enum": [Status::Navigating, Status::Following, Status::NotVisible, Status::Waiting, Status::Blocked, Status::Done] })
}

fn nullable_look(_: &mut SchemaGenerator) -> Schema {
    let words = [Look::Left, Look::Right, Look::Up, Look::Down, Look::Behind, Look::Ahead].map(Some);
    let words: Vec<_> = words.into_iter().chain([None]).collect();
    json_schema!({ "type": ["string", "null"], "enum": words })
}

fn numbers(_: &mut SchemaGenerator) -> Schema {
    json_schema!({ "type": "array", "items": { "type": "number" } })
}

fn nullable_numbers(_: &mut SchemaGenerator) -> Schema {
    json_schema!({ "type": ["array", "null"], "items": { "type": "number" } })
}

fn number(_: &mut SchemaGenerator) -> Schema {
    json_schema!({ "type": "number" })
}

fn nullable_number(_: &mut SchemaGenerator) -> Schema {
    json_schema!({ "type": ["number", "null"] })
}

fn nullable_way(generator: &mut SchemaGenerator) -> Schema {
    let mut way = WireWay::json_schema(generator);
    way.insert("type".to_owned(), Value::from(vec!["object", "null"]));
    way
}

fn label(_: &mut SchemaGenerator) -> Schema {
    json_schema!({ "type": "integer", "enum": (1..=DEPTH_LABELS).collect::<Vec<_>>() })
}

fn nullable_label(_: &mut SchemaGenerator) -> Schema {
    let labels: Vec<Option<u8>> = (1..=DEPTH_LABELS).map(Some).chain([None]).collect();
    json_schema!({ "type": ["integer", "null"], "enum": labels })
}

/// The JSON schema of a reply, properties in the order `target`, `status`, `stage`, `target_box`, `point`, `depth` (or
/// `depth_m`), `turn_deg`, `look`, `open_way` and, if `avoid`, `boxes`. Every property is required and absent values are
/// null, which is all that the strictest vendors support. The prompt defines the coordinates of a point, since they differ
/// by model.
#[must_use]
pub fn reply_schema(avoid: bool, depth: DepthAs) -> Value {
    let mut schema = inlined::<WireReply<'_>>();
    if let Some(properties) = schema.get_mut("properties").and_then(Value::as_object_mut) {
        if !avoid {
            properties.shift_remove("boxes");
        } else if let Some(boxes) = properties.get_mut("boxes").and_then(Value::as_object_mut) {
            // The option only lets the writer omit the list; in obstacle mode a model writes it, empty or not.
            boxes.insert("type".to_owned(), Value::from("array"));
        }
    }
    without(&mut schema, if depth == DepthAs::Labels { "depth_m" } else { "depth" });
    close(&mut schema);
    schema
}

/// Removes a property from an object and those in it.
fn without(schema: &mut Value, property: &str) {
    match schema {
        Value::Object(map) => {
            if let Some(Value::Object(properties)) = map.get_mut("properties") {
                properties.shift_remove(property);
            }
            map.values_mut().for_each(|value| without(value, property));
        }
        Value::Array(items) => items.iter_mut().for_each(|item| without(item, property)),
        _ => {}
    }
}

/// The schema of a type, with all subschemas inlined.
fn inlined<T: JsonSchema>() -> Value {
    let settings = SchemaSettings::draft2020_12().with(|s| {
        s.inline_subschemas = true;
        s.meta_schema = None;
    });
    settings.into_generator().into_root_schema_for::<T>().to_value()
}

/// The schema of a type in the portable subset: every object closed, every property required.
pub(crate) fn closed_schema<T: JsonSchema>() -> Value {
    let mut schema = inlined::<T>();
    close(&mut schema);
    schema
}

/// Closes every object of a schema, makes all its properties required, and removes keywords that only apply to Rust
/// types.
fn close(schema: &mut Value) {
    match schema {
        Value::Object(map) => {
            for key in ["title", "format", "minimum", "maximum", "default"] {
                if !map.get(key).is_some_and(Value::is_object) {
                    map.shift_remove(key);
                }
            }
            if let Some(Value::Object(properties)) = map.get("properties") {
                let required: Vec<Value> = properties.keys().cloned().map(Value::from).collect();
                map.insert("required".to_owned(), Value::from(required));
                map.insert("additionalProperties".to_owned(), Value::from(false));
            }
            map.values_mut().for_each(close);
        }
        Value::Array(items) => items.iter_mut().for_each(close),
        _ => {}
    }
}

impl Reply {
    /// Serialises the reply as JSON in the coordinates of `profile`, as a model that follows [`reply_schema`] would.
    /// `boxes` are written only if `avoid`. Coordinates are rounded as models of that family do
    /// ([`GroundingProfile::point_numbers`]).
    #[must_use]
    pub fn to_json(&self, profile: &GroundingProfile, avoid: bool) -> String {
        self.to_json_as(profile, avoid, self.stated())
    }

    /// The same with distances as labels or in metres. A label is written as the range that it stands for.
    #[must_use]
    pub fn to_json_as(&self, profile: &GroundingProfile, avoid: bool, depth: DepthAs) -> String {
        self.written(avoid, depth, |point| profile.point_numbers(point), |area| profile.area_numbers(area))
    }

    /// The same without rounding: for converting a reply from one model's coordinates to another's.
    #[must_use]
    pub fn to_json_exact(&self, profile: &GroundingProfile, avoid: bool) -> String {
        self.written(avoid, self.stated(), |point| profile.exact_point(point), |area| profile.exact_area(area))
    }

    /// How the reply itself states its distance.
    fn stated(&self) -> DepthAs {
        if self.range_m.is_some() { DepthAs::Metres } else { DepthAs::Labels }
    }

    fn written(
        &self,
        avoid: bool,
        depth: DepthAs,
        numbers: impl Fn(ImagePoint) -> [f64; 2],
        area_numbers: impl Fn(ImageBox) -> [f64; 4],
    ) -> String {
        let labels = depth == DepthAs::Labels;
        let metres = |label: u8| Number(tenths(range_of_label(f64::from(label))));
        let boxes = avoid.then(|| {
            let wire = self.boxes.iter().map(|b| WireBox {
                area: area_numbers(b.area).map(Number),
                depth: labels.then_some(b.depth),
                depth_m: (!labels).then(|| metres(b.depth)),
                name: &b.name,
            });
            wire.collect()
        });
        let range = self.range_m.map(|range| Number(tenths(range))).or(self.depth.map(metres));
        let wire = WireReply {
            target: self.target.as_deref(),
            status: self.status,
            stage: self.stage,
            target_box: self.target_box.map(|area| area_numbers(area).map(Number)),
            point: self.point.map(|point| numbers(point).map(Number)),
            depth: labels.then_some(self.depth),
            depth_m: (!labels).then_some(range),
            turn_deg: self.turn_deg.map(|degrees| Number(tenths(degrees))),
            look: self.look,
            open_way: self.open_way.map(|way| WireWay {
                point: numbers(way.point).map(Number),
                depth: labels.then_some(way.depth),
                depth_m: (!labels).then(|| metres(way.depth)),
            }),
            boxes,
        };
        serde_json::to_string(&wire).expect("a struct of numbers and texts always serialises")
    }
}

/// Rounded to tenths, and at least one of them if positive: a distance of zero is none.
fn tenths(number: f64) -> f64 {
    let rounded = libm::round(number * 10.0) / 10.0;
    if rounded == 0.0 && number > 0.0 { 0.1 } else { rounded }
}

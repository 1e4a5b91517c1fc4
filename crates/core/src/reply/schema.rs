//! The wire form of a reply: its JSON schema and its writer.

use schemars::{JsonSchema, Schema, SchemaGenerator, generate::SchemaSettings, json_schema};
use serde::{Serialize, Serializer};
use serde_json::Value;

use super::{DEPTH_LABELS, Look, Reply, Status};
use crate::grounding::GroundingProfile;
use crate::query::{ImageBox, ImagePoint};

// The order of the fields is the order in which a model is to think and in which a stream is read: decisive fields come
// first. The comments on the fields reach the model, as descriptions in the schema.
/// Where the drone is to go next.
#[derive(Serialize, JsonSchema)]
struct WireReply<'a> {
    /// Whether the target is in view, out of view, or the instruction fulfilled.
    #[schemars(schema_with = "status")]
    status: Status,
    /// Which way to look, with status not_visible; else null.
    #[schemars(schema_with = "nullable_look")]
    look: Option<Look>,
    /// Number of the stage being worked on, from 1.
    stage: Option<u32>,
    /// Where to go in the picture; with status not_visible an open way to look from; else null.
    #[schemars(schema_with = "nullable_numbers")]
    point: Option<[Number; 2]>,
    /// Depth label of what is at the point; null without one.
    #[schemars(schema_with = "nullable_label")]
    depth: Option<u8>,
    /// What is pointed at, in a few words.
    target: Option<&'a str>,
    /// Every obstacle on or near the way.
    #[serde(skip_serializing_if = "Option::is_none")]
    boxes: Option<Vec<WireBox<'a>>>,
}

/// One obstacle as it is written.
#[derive(Serialize, JsonSchema)]
struct WireBox<'a> {
    /// Its box in the picture.
    #[serde(rename = "box")]
    #[schemars(schema_with = "numbers")]
    area: [Number; 4],
    /// Its depth label.
    #[schemars(schema_with = "label")]
    depth: u8,
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
    json_schema!({ "type": "string", "enum": [Status::Navigating, Status::NotVisible, Status::Done] })
}

fn nullable_look(_: &mut SchemaGenerator) -> Schema {
    let words = [Look::Left, Look::Right, Look::Up, Look::Down, Look::Behind].map(Some);
    let words: Vec<_> = words.into_iter().chain([None]).collect();
    json_schema!({ "type": ["string", "null"], "enum": words })
}

fn numbers(_: &mut SchemaGenerator) -> Schema {
    json_schema!({ "type": "array", "items": { "type": "number" } })
}

fn nullable_numbers(_: &mut SchemaGenerator) -> Schema {
    json_schema!({ "type": ["array", "null"], "items": { "type": "number" } })
}

fn label(_: &mut SchemaGenerator) -> Schema {
    json_schema!({ "type": "integer", "enum": (1..=DEPTH_LABELS).collect::<Vec<_>>() })
}

fn nullable_label(_: &mut SchemaGenerator) -> Schema {
    let labels: Vec<Option<u8>> = (1..=DEPTH_LABELS).map(Some).chain([None]).collect();
    json_schema!({ "type": ["integer", "null"], "enum": labels })
}

/// The JSON schema of a reply, properties in the order `status`, `look`, `stage`, `point`, `depth`, `target` and, if
/// `avoid`, `boxes`. Every property is required and absent values are null, which is all that the strictest vendors
/// support. The prompt defines the coordinates of a point, since they differ by model.
#[must_use]
pub fn reply_schema(avoid: bool) -> Value {
    let mut schema = inlined::<WireReply<'_>>();
    if let Some(properties) = schema.get_mut("properties").and_then(Value::as_object_mut) {
        if !avoid {
            properties.shift_remove("boxes");
        } else if let Some(boxes) = properties.get_mut("boxes").and_then(Value::as_object_mut) {
            // The option only lets the writer omit the list; in obstacle mode a model writes it, empty or not.
            boxes.insert("type".to_owned(), Value::from("array"));
        }
    }
    close(&mut schema);
    schema
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
        self.written(avoid, |point| profile.point_numbers(point), |area| profile.area_numbers(area))
    }

    /// The same without rounding: for converting a reply from one model's coordinates to another's.
    #[must_use]
    pub fn to_json_exact(&self, profile: &GroundingProfile, avoid: bool) -> String {
        self.written(avoid, |point| profile.exact_point(point), |area| profile.exact_area(area))
    }

    fn written(
        &self,
        avoid: bool,
        numbers: impl Fn(ImagePoint) -> [f64; 2],
        area_numbers: impl Fn(ImageBox) -> [f64; 4],
    ) -> String {
        let boxes = avoid.then(|| {
            let wire =
                self.boxes.iter().map(|b| WireBox { area: area_numbers(b.area).map(Number), depth: b.depth, name: &b.name });
            wire.collect()
        });
        let wire = WireReply {
            status: self.status,
            look: self.look,
            stage: self.stage,
            point: self.point.or(self.open_way.map(|way| way.point)).map(|point| numbers(point).map(Number)),
            depth: self.depth.or(self.open_way.map(|way| way.depth)),
            target: self.target.as_deref(),
            boxes,
        };
        serde_json::to_string(&wire).expect("a struct of numbers and texts always serialises")
    }
}

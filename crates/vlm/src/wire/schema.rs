//! Reply schemas in the vendors' dialects, generated from the Rust types of the replies.

use std::sync::LazyLock;

use serde_json::{Map, Value, json};
use spf_core::query::{DepthAs, QueryKind};
use spf_core::reply::{choice_schema, completion_schema, moves_schema, refusal_schema, reply_schema};

// Needed for every decision.
static POINT: LazyLock<Value> = LazyLock::new(|| reply_schema(false, DepthAs::Labels));
static POINT_AND_BOXES: LazyLock<Value> = LazyLock::new(|| reply_schema(true, DepthAs::Labels));

/// The reply schema for a kind of query; `None` if any text is allowed.
pub(super) fn of(kind: &QueryKind) -> Option<Value> {
    match kind {
        QueryKind::Point { avoid: false, depth: DepthAs::Labels } => Some(POINT.clone()),
        QueryKind::Point { avoid: true, depth: DepthAs::Labels } => Some(POINT_AND_BOXES.clone()),
        QueryKind::Point { avoid, depth: DepthAs::Metres } => Some(reply_schema(*avoid, DepthAs::Metres)),
        QueryKind::Act { form } => Some(moves_schema(*form)),
        QueryKind::Choose => Some(choice_schema()),
        QueryKind::Done => Some(completion_schema()),
        QueryKind::Refuse => Some(refusal_schema()),
        _ => None,
    }
}

/// Converts a JSON schema to OpenAPI form.
pub(super) fn open_api(schema: &Value) -> Value {
    let Some(map) = schema.as_object() else { return schema.clone() };
    let mut out = Map::new();
    let words: Vec<&str> = match map.get("type") {
        Some(Value::String(word)) => vec![word],
        Some(Value::Array(words)) => words.iter().filter_map(Value::as_str).collect(),
        _ => Vec::new(),
    };
    let mut word = words.iter().find(|word| **word != "null").copied().unwrap_or("string");
    if let Some(values) = map.get("enum").and_then(Value::as_array) {
        // Only strings can be enumerated; the reply parser accepts numbers written as text.
        word = "string";
        let texts = values.iter().filter(|value| !value.is_null());
        out.insert(
            "enum".to_owned(),
            texts.map(|value| value.as_str().map_or_else(|| json!(value.to_string()), |text| json!(text))).collect(),
        );
    }
    out.insert("type".to_owned(), json!(word.to_uppercase()));
    if words.contains(&"null") {
        out.insert("nullable".to_owned(), json!(true));
    }
    for key in ["description", "required"] {
        if let Some(value) = map.get(key) {
            out.insert(key.to_owned(), value.clone());
        }
    }
    if let Some(items) = map.get("items") {
        out.insert("items".to_owned(), open_api(items));
    }
    if let Some(properties) = map.get("properties").and_then(Value::as_object) {
        out.insert("propertyOrdering".to_owned(), properties.keys().cloned().map(Value::from).collect());
        out.insert(
            "properties".to_owned(),
            properties.iter().map(|(key, value)| (key.clone(), open_api(value))).collect::<Map<_, _>>().into(),
        );
    }
    Value::Object(out)
}

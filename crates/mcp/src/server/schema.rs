//! Schemas that every client reads: one type each, and what may be missing is missing, not null.

use std::sync::Arc;

use rmcp::handler::server::tool::{schema_for_output, schema_for_type};
use rmcp::model::JsonObject;
use rmcp::schemars::JsonSchema;
use serde_json::Value;

/// Of a tool's arguments.
pub(super) fn input<T: JsonSchema + std::any::Any>() -> Arc<JsonObject> {
    portable(&schema_for_type::<T>())
}

/// Of a tool's answer.
pub(super) fn output<T: JsonSchema + std::any::Any>() -> Arc<JsonObject> {
    portable(&schema_for_output::<T>())
}

fn portable(schema: &JsonObject) -> Arc<JsonObject> {
    let mut schema = Value::Object(schema.clone());
    simplify(&mut schema);
    match schema {
        Value::Object(schema) => Arc::new(schema),
        _ => Arc::default(),
    }
}

/// Takes null out of the types. What could be null may be missing instead.
fn simplify(schema: &mut Value) {
    match schema {
        Value::Array(parts) => parts.iter_mut().for_each(simplify),
        Value::Object(map) => {
            let nullable: Vec<String> = match map.get("properties") {
                Some(Value::Object(properties)) => {
                    properties.iter().filter(|(_, field)| is_nullable(field)).map(|(name, _)| name.clone()).collect()
                }
                _ => Vec::new(),
            };
            if let Some(Value::Array(required)) = map.get_mut("required") {
                required.retain(|name| !nullable.iter().any(|nullable| name == nullable));
            }
            if let Some(Value::Array(kinds)) = map.get_mut("type") {
                kinds.retain(|kind| kind != "null");
                if let [kind] = kinds.as_slice() {
                    let kind = kind.clone();
                    map.insert("type".to_owned(), kind);
                }
            }
            if let Some(Value::Array(choices)) = map.get_mut("anyOf") {
                choices.retain(|choice| choice.get("type").is_none_or(|kind| kind != "null"));
                if let [Value::Object(only)] = choices.as_slice() {
                    let only = only.clone();
                    map.remove("anyOf");
                    map.extend(only);
                }
            }
            // Of Rust's numbers; other readers know none of them.
            if map.get("format").is_some_and(Value::is_string) {
                map.remove("format");
            }
            if map.get("default") == Some(&Value::Null) {
                map.remove("default");
            }
            map.values_mut().for_each(simplify);
        }
        _ => {}
    }
}

fn is_nullable(field: &Value) -> bool {
    let has_null = |key: &str| {
        let list = field.get(key).and_then(Value::as_array);
        list.is_some_and(|list| list.iter().any(|part| part == "null" || part.get("type").is_some_and(|kind| kind == "null")))
    };
    has_null("type") || has_null("anyOf")
}

/// Takes what is null out of an answer.
pub(super) fn without_nulls(value: &mut Value) {
    match value {
        Value::Array(parts) => parts.iter_mut().for_each(without_nulls),
        Value::Object(map) => {
            map.retain(|_, value| !value.is_null());
            map.values_mut().for_each(without_nulls);
        }
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::report::{Progress, Status};

    #[test]
    fn what_may_be_null_may_be_missing() {
        let mut schema = json!({
            "type": "object", "required": ["a", "b", "c"],
            "properties": {
                "a": {"type": ["string", "null"], "default": null}, "b": {"type": "number"},
                "c": {"anyOf": [{"$ref": "#/$defs/State"}, {"type": "null"}], "description": "what"},
            },
        });
        simplify(&mut schema);
        let expected = json!({
            "type": "object", "required": ["b"],
            "properties": {"a": {"type": "string"}, "b": {"type": "number"}, "c": {"description": "what", "$ref": "#/$defs/State"}},
        });
        assert_eq!(schema, expected);
        let mut answer = json!({"a": null, "b": [{"c": null, "d": 1}]});
        without_nulls(&mut answer);
        assert_eq!(answer, json!({"b": [{"d": 1}]}));
    }

    #[test]
    fn no_schema_of_an_answer_knows_null() {
        for schema in [output::<Status>(), output::<Progress>()] {
            let text = serde_json::to_string(&schema).unwrap();
            assert!(!text.contains("\"null\""), "{text}");
        }
    }
}

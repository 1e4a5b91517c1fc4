//! Metadata for this project in a file: `extras` of nodes, meshes and scenes.
//!
//! Either under one key, `{"spf": {"names": ["red car", "car"], "kind": "vehicle"}}`, or flat as Blender exports custom
//! properties, `{"spf_names": "red car, car", "spf_kind": "vehicle"}`.

use std::fmt;

use gltf::json::Extras;
use serde::de::{self, DeserializeOwned, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};
use serde_json::{Map, Value};
use spf_core::craft::CraftKind;

use super::UpAxis;
use super::problem::Problem;
use crate::error::hint_from;

/// Metadata of a node. Every key is optional.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct NodeSpec {
    pub(super) names: Option<Words>,
    pub(super) synonyms: Option<Words>,
    pub(super) qualities: Option<Words>,
    pub(super) colour: Option<String>,
    pub(super) kind: Option<String>,
    #[serde(rename = "use")]
    pub(super) uses: Option<Words>,
    pub(super) group: Option<String>,
    pub(super) number: Option<u32>,
    /// A surface to fly through, which neither hides nor collides with anything.
    pub(super) opening: Option<Switch>,
    /// Name of the node that an opening leads through; default: the one above.
    pub(super) opening_of: Option<String>,
    /// False for nodes that are rendered but not solid.
    pub(super) solid: Option<Switch>,
    /// True to omit a node with all nodes below it.
    pub(super) ignore: Option<Switch>,
}

/// Metadata of a scene about the flight. Every key is optional.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SceneSpec {
    pub(super) name: Option<String>,
    pub(super) craft: Option<CraftKind>,
    pub(super) start: Option<String>,
    pub(super) success_radius_m: Option<f64>,
    pub(super) near_m: Option<f64>,
    pub(super) scale: Option<f64>,
    pub(super) up: Option<UpAxis>,
}

/// Words or phrases: a list, or one text with commas. Lower case, trimmed, none empty.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Words(pub(super) Vec<String>);

impl<'de> Deserialize<'de> for Words {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Either;
        impl<'de> Visitor<'de> for Either {
            type Value = Vec<String>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("comma-separated words, or a list of words")
            }

            fn visit_str<E: de::Error>(self, text: &str) -> Result<Self::Value, E> {
                Ok(text.split(',').map(str::to_owned).collect())
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Self::Value, A::Error> {
                let mut words = Vec::new();
                while let Some(word) = list.next_element()? {
                    words.push(word);
                }
                Ok(words)
            }
        }
        let words = deserializer.deserialize_any(Either)?;
        Ok(Self(words.iter().map(|word| tidy(word)).filter(|word| !word.is_empty()).collect()))
    }
}

/// A tag in the form used in scenes: lower case, single spaces.
pub(super) fn tidy(word: &str) -> String {
    word.to_lowercase().split_whitespace().collect::<Vec<_>>().join(" ")
}

/// True or false; Blender's older custom properties know only 1 and 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Switch(pub(super) bool);

impl<'de> Deserialize<'de> for Switch {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        match Value::deserialize(deserializer)? {
            Value::Bool(on) => Ok(Self(on)),
            Value::Number(n) if n.as_f64() == Some(1.0) => Ok(Self(true)),
            Value::Number(n) if n.as_f64() == Some(0.0) => Ok(Self(false)),
            other => Err(de::Error::custom(format!("`{other}` is neither true nor false"))),
        }
    }
}

/// Our keys in some extras; `None` if there are none.
pub(super) fn ours(extras: &Extras) -> Result<Option<Map<String, Value>>, Problem> {
    let Some(raw) = extras else { return Ok(None) };
    let Value::Object(all) = serde_json::from_str(raw.get()).map_err(|e| Problem::new(format!("extras: {e}")))? else {
        return Ok(None);
    };
    let mut own = Map::new();
    for (key, value) in all {
        match (key.strip_prefix("spf_"), value) {
            (Some(key), value) => {
                own.insert(key.to_owned(), value);
            }
            (None, Value::Object(inner)) if key == "spf" => own.extend(inner),
            _ => {}
        }
    }
    Ok((!own.is_empty()).then_some(own))
}

/// Reads our keys; `of` names the owner in errors.
pub(super) fn read<T: DeserializeOwned>(own: Map<String, Value>, of: &str) -> Result<T, Problem> {
    serde_json::from_value(Value::Object(own)).map_err(|e| {
        let reason = e.to_string();
        Problem { hint: hint_from(&reason), message: format!("the extras of {of}: {reason}") }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn node(extras: &str) -> Result<Option<NodeSpec>, Problem> {
        let raw = serde_json::value::RawValue::from_string(extras.to_owned()).unwrap();
        ours(&Some(raw))?.map(|own| read(own, "node `x`")).transpose()
    }

    #[test]
    fn nested_and_flat_keys_mean_the_same() {
        let nested = node(r#"{"spf": {"names": ["Red  Car", "car"], "opening": true, "number": 7}}"#).unwrap().unwrap();
        let flat =
            node(r#"{"spf_names": "Red Car, car,", "spf_opening": 1, "spf_number": 7, "other": {"a": 1}}"#).unwrap().unwrap();
        for spec in [nested, flat] {
            assert_eq!(spec.names, Some(Words(vec!["red car".to_owned(), "car".to_owned()])));
            assert_eq!((spec.opening, spec.number), (Some(Switch(true)), Some(7)));
        }
        assert!(node(r#"{"other": 1}"#).unwrap().is_none());
        assert!(node("[1, 2]").unwrap().is_none());
    }

    #[test]
    fn a_slip_is_named_with_its_remedy() {
        let problem = node(r#"{"spf_nmaes": "car"}"#).unwrap_err();
        assert!(problem.message.starts_with("the extras of node `x`: unknown field `nmaes`"), "{}", problem.message);
        assert_eq!(problem.hint.as_deref(), Some("did you mean `names`?"));
        assert!(node(r#"{"spf_opening": "yes"}"#).unwrap_err().message.contains("neither true nor false"));
    }
}

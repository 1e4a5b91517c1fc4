//! Optional parameters that a vendor refuses by name: found in its error, and taken out of requests.
//!
//! Which parameters a model takes changes faster than any table. An error that names one of those sent costs one repeated
//! request, and is remembered by the backend.

use serde_json::{Map, Value};

/// Where a parameter is in a request's body.
pub(crate) type Parameter = Vec<String>;

/// Parts of a request without which it asks nothing.
const ESSENTIAL: [&str; 9] =
    ["model", "messages", "contents", "input", "prompt", "max_tokens", "stream", "system", "systemInstruction"];
/// Parts that only hold others.
const CONTAINERS: [&str; 4] = ["generationConfig", "output_config", "text", "provider"];
/// Parts whose contents are not parameters: the schema has the names of the reply's fields.
const WHOLE: [&str; 4] = ["response_format", "format", "responseJsonSchema", "responseSchema"];
/// Shorter names are ordinary words.
const SHORTEST: usize = 5;
/// Where the reply's schema is, in each format.
const SCHEMAS: [&[&str]; 5] = [
    &["response_format"],
    &["text", "format"],
    &["output_config", "format"],
    &["generationConfig", "responseJsonSchema"],
    &["generationConfig", "responseSchema"],
];
/// What servers that cannot use one call it.
const SCHEMA_WORDS: [&str; 5] = ["json_object", "json_schema", "json mode", "structured output", "structured outputs"];
/// The newer name of the limit of a reply's tokens, which some servers do not know.
pub(crate) const MAX_TOKENS: &str = "max_completion_tokens";
/// The image's detail, which is inside the messages.
const DETAIL: &str = "detail";

/// The optional parameter in a request's body that an error message names; the first one, if it names several.
pub(crate) fn named(body: &Value, message: &str) -> Option<Parameter> {
    let mut all = Vec::new();
    walk(body, &mut Vec::new(), &mut all);
    let message = Letters::of(message);
    let at = |parameter: &Parameter| message.find(parameter.last()?);
    let first = all
        .iter()
        .filter_map(|parameter| Some((at(parameter)?, parameter)))
        .min_by_key(|(at, parameter)| (*at, std::cmp::Reverse(parameter.last().map_or(0, String::len))));
    if let Some((_, parameter)) = first {
        return Some(parameter.clone());
    }
    if SCHEMA_WORDS.iter().any(|word| message.find(word).is_some())
        && let Some(path) = SCHEMAS.iter().find(|path| body.pointer(&format!("/{}", path.join("/"))).is_some())
    {
        return Some(path.iter().map(|name| (*name).to_owned()).collect());
    }
    if message.find(DETAIL).is_some() && has_detail(body) {
        return Some(vec![DETAIL.to_owned()]);
    }
    // OpenRouter names none: what most servers lack comes first.
    let routed = [vec!["reasoning".to_owned()], vec!["provider".to_owned(), "require_parameters".to_owned()]];
    let has = |parameter: &Parameter| body.pointer(&format!("/{}", parameter.join("/"))).is_some();
    message.find("requested parameters").and_then(|_| routed.into_iter().find(has))
}

/// Takes a parameter out of a request's body.
pub(crate) fn remove(body: &mut Value, parameter: &[String]) {
    match (parameter, body) {
        ([name], body) if name == DETAIL => plain_detail(body),
        ([name], Value::Object(map)) => {
            let value = map.shift_remove(name);
            // The older name of the same limit.
            if let Some(value) = value.filter(|_| name == MAX_TOKENS) {
                map.insert("max_tokens".to_owned(), value);
            }
        }
        ([name, rest @ ..], Value::Object(map)) => {
            if let Some(inner) = map.get_mut(name) {
                remove(inner, rest);
                if inner.as_object().is_some_and(Map::is_empty) {
                    map.shift_remove(name);
                }
            }
        }
        _ => {}
    }
}

fn walk(value: &Value, path: &mut Parameter, all: &mut Vec<Parameter>) {
    for (name, inner) in value.as_object().into_iter().flatten() {
        let name = name.as_str();
        if path.is_empty() && ESSENTIAL.contains(&name) {
            continue;
        }
        path.push(name.to_owned());
        if !CONTAINERS.contains(&name) && name.len() >= SHORTEST {
            all.push(path.clone());
        }
        if !WHOLE.contains(&name) {
            walk(inner, path, all);
        }
        path.pop();
    }
}

fn has_detail(value: &Value) -> bool {
    match value {
        Value::Object(map) => map
            .iter()
            .any(|(name, inner)| (name == DETAIL && inner.as_str().is_some_and(|word| word != "auto")) || has_detail(inner)),
        Value::Array(items) => items.iter().any(has_detail),
        _ => false,
    }
}

/// Leaves the detail to the vendor.
fn plain_detail(value: &mut Value) {
    match value {
        Value::Object(map) => {
            for (name, inner) in map {
                if name == DETAIL && inner.is_string() {
                    *inner = Value::from("auto");
                } else {
                    plain_detail(inner);
                }
            }
        }
        Value::Array(items) => items.iter_mut().for_each(plain_detail),
        _ => {}
    }
}

/// The letters and digits of a text in lower case, each with whether a word begins with it and whether one ends after
/// it: `thinkingLevel`, `thinking_level` and "Thinking level" are the same.
struct Letters {
    text: Vec<char>,
    begins: Vec<bool>,
    ends: Vec<bool>,
}

impl Letters {
    fn of(text: &str) -> Self {
        let mut letters = Self { text: Vec::new(), begins: Vec::new(), ends: Vec::new() };
        let mut before = ' ';
        for letter in text.chars() {
            let begins = !before.is_alphanumeric() || (before.is_lowercase() && letter.is_uppercase());
            if begins && let Some(end) = letters.ends.last_mut() {
                *end = true;
            }
            if letter.is_alphanumeric() {
                letters.text.extend(letter.to_lowercase().take(1));
                letters.begins.push(begins);
                letters.ends.push(false);
            } else if let Some(end) = letters.ends.last_mut() {
                *end = true;
            }
            before = letter;
        }
        if let Some(end) = letters.ends.last_mut() {
            *end = true;
        }
        letters
    }

    /// Where a name begins.
    fn find(&self, name: &str) -> Option<usize> {
        let name = Self::of(name).text;
        if name.is_empty() {
            return None;
        }
        (0..self.text.len().saturating_sub(name.len() - 1))
            .find(|&at| self.begins[at] && self.ends[at + name.len() - 1] && self.text[at..at + name.len()] == name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::Table;
    use crate::wire::Question;
    use proptest::prelude::*;
    use spf_core::query::QueryKind;

    fn body(name: &str) -> Value {
        let model = Table::shipped().select(name, "2026-11-21").unwrap().model;
        let kind = QueryKind::point(true);
        model.wire.request(&model, &Question { prompt: "Where?", jpeg: b"\xff\xd8", close_up: None, kind: &kind }).body
    }

    #[test]
    fn a_vendors_words_name_what_was_sent() {
        for (model, message, expected) in [
            ("openai", "Unsupported parameter: 'reasoning.effort' is not supported with this model.", "reasoning"),
            ("openai", "Unknown parameter: 'store'.", "store"),
            ("openai", "Invalid value: 'original'. (input[0].content[0].detail)", "detail"),
            ("openai", "Invalid parameter: 'text.format' of type 'json_schema' is not supported with this model", "text/format"),
            ("ollama", "unsupported parameter max_completion_tokens, use max_tokens", "max_completion_tokens"),
            (
                "gemini",
                "Invalid JSON payload received. Unknown name \"thinkingLevel\" at 'generation_config.thinking_config': Cannot \
             find field.",
                "generationConfig/thinkingConfig/thinkingLevel",
            ),
            ("gemini", "Thinking level LOW is not supported for this model.", "generationConfig/thinkingConfig/thinkingLevel"),
            ("gemini", "Unable to submit request because media_resolution is not supported", "generationConfig/mediaResolution"),
            ("anthropic", "thinking.type: disabled is not supported; use output_config.effort", "thinking"),
            ("anthropic", "output_config.effort: Extra inputs are not permitted", "output_config/effort"),
            ("ollama", "'response_format.type' must be 'json_schema' or 'text'", "response_format"),
            ("ollama", "json_object is not supported by this model", "response_format"),
            ("ollama", "JSON mode is not enabled for this model.", "response_format"),
            ("openai", "This model does not support structured outputs.", "text/format"),
            ("openrouter#some/model", "No endpoints found that can handle the requested parameters.", "reasoning"),
        ] {
            let mut body = body(model);
            let parameter = named(&body, message).unwrap_or_else(|| panic!("{message}"));
            assert_eq!(parameter.join("/"), expected, "{message}");
            let before = body.clone();
            remove(&mut body, &parameter);
            assert_ne!(body, before);
            assert_ne!(named(&body, message), Some(parameter), "{message}");
        }
        for (model, message) in [
            ("openai", "The model `gpt-6-luna` does not exist or you do not have access to it."),
            ("openai", "The server is being restored; its status and depth are unknown. Boxes."),
            ("anthropic", "messages.0.content.0.image.source.base64: The image is invalid"),
            ("gemini", "models/x is not found for API version v1beta, or is not supported for generateContent."),
        ] {
            assert_eq!(named(&body(model), message), None, "{message}");
        }
    }

    #[test]
    fn what_is_taken_out_leaves_no_empty_shell() {
        let mut gemini = body("gemini");
        let path = |path: &str| path.split('/').map(str::to_owned).collect::<Vec<_>>();
        remove(&mut gemini, &path("generationConfig/thinkingConfig/thinkingLevel"));
        assert_eq!(gemini.pointer("/generationConfig/thinkingConfig"), None);
        assert!(gemini.pointer("/generationConfig/responseJsonSchema").is_some());
        let mut chat = body("ollama");
        remove(&mut chat, &path("max_completion_tokens"));
        assert_eq!((chat.get("max_completion_tokens"), &chat["max_tokens"]), (None, &Value::from(4096)));
        let mut openai = body("openai");
        remove(&mut openai, &path("detail"));
        assert_eq!(openai["input"][0]["content"][0]["detail"], "auto");
        remove(&mut openai, &path("nothing/like/it"));
    }

    proptest! {
        #[test]
        fn no_message_panics(message in "\\PC{0,200}") {
            if let Some(parameter) = named(&body("openai"), &message) {
                remove(&mut body("openai"), &parameter);
            }
        }
    }
}

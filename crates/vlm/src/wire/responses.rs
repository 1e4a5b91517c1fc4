//! OpenAI's responses API.

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::chat::decline;
use super::{Ask, DATA_URL, End, Gathered, Request, SchemaDialect, typed};
use crate::error::VlmError;
use crate::usage::Tokens;

#[derive(Serialize)]
struct Body<'a> {
    model: &'a str,
    stream: bool,
    input: [Message<'a>; 1],
    max_output_tokens: u32,
    #[serde(skip_serializing_if = "Option::is_none")]
    text: Option<Value>,
}

#[derive(Serialize)]
struct Message<'a> {
    role: &'static str,
    content: Vec<Part<'a>>,
}

#[derive(Serialize)]
#[serde(tag = "type", rename_all = "snake_case")]
enum Part<'a> {
    InputImage { image_url: String, detail: &'a str },
    InputText { text: &'a str },
}

pub(super) fn request(ask: &Ask<'_>) -> Request {
    let model = ask.model;
    let format = ask.schema.as_ref().map(|schema| match model.schema {
        SchemaDialect::JsonObject => json!({ "format": { "type": "json_object" } }),
        _ => json!({ "format": { "type": "json_schema", "name": "spf_reply", "strict": true, "schema": schema } }),
    });
    let image = |image_url| Part::InputImage { image_url, detail: model.detail.as_deref().unwrap_or("auto") };
    let content = ask.images(DATA_URL).map(image).chain([Part::InputText { text: ask.prompt }]).collect();
    let body = Body {
        model: &model.id,
        stream: model.stream,
        input: [Message { role: "user", content }],
        max_output_tokens: model.max_output_tokens,
        text: format,
    };
    Request { path: "/responses".to_owned(), body: json!(body) }
}

/// An event of a stream, limited to the relevant kinds; or a complete response.
#[derive(Deserialize)]
#[serde(tag = "type")]
enum Event {
    #[serde(rename = "response.output_text.delta")]
    Text { delta: String },
    #[serde(rename = "response.refusal.delta")]
    Refusal { delta: String },
    #[serde(rename = "response.function_call_arguments.delta")]
    Arguments { delta: String },
    #[serde(rename = "response.created")]
    Created { response: Response },
    #[serde(rename = "response.completed", alias = "response.incomplete", alias = "response.failed")]
    Ended { response: Response },
    #[serde(other)]
    Other,
}

#[derive(Deserialize, Default)]
#[serde(default)]
struct Response {
    model: Option<String>,
    status: Option<String>,
    incomplete_details: Option<Incomplete>,
    output: Option<Vec<Item>>,
    usage: Option<Usage>,
}

#[derive(Deserialize, Default)]
#[serde(default)]
struct Incomplete {
    reason: Option<String>,
}

#[derive(Deserialize, Default)]
#[serde(default)]
struct Item {
    r#type: String,
    content: Option<Vec<Content>>,
    /// Of a function call.
    arguments: Option<Value>,
}

#[derive(Deserialize, Default)]
#[serde(default)]
struct Content {
    text: Option<String>,
    refusal: Option<String>,
}

#[derive(Deserialize, Default)]
#[serde(default)]
struct Usage {
    input_tokens: Option<u64>,
    output_tokens: Option<u64>,
    input_tokens_details: Option<Details>,
    output_tokens_details: Option<Details>,
}

#[derive(Deserialize, Default)]
#[serde(default)]
struct Details {
    cached_tokens: Option<u64>,
    reasoning_tokens: Option<u64>,
}

pub(super) fn read(host: &str, object: &Value, into: &mut Gathered) -> Result<(), VlmError> {
    if object.get("type").is_none() {
        return ended(host, typed(host, object)?, object, into);
    }
    match typed(host, object)? {
        Event::Text { delta } => into.text.push_str(&delta),
        Event::Refusal { delta } => decline(into, &delta),
        Event::Arguments { delta } => into.arguments.push_str(&delta),
        Event::Created { response } => into.served = response.model.or(into.served.take()),
        Event::Ended { response } => return ended(host, response, &object["response"], into),
        Event::Other => {}
    }
    Ok(())
}

fn ended(host: &str, response: Response, object: &Value, into: &mut Gathered) -> Result<(), VlmError> {
    if let Some(error) = super::error_of(host, 200, object) {
        return Err(error);
    }
    // A stream has already delivered its text.
    if into.text.is_empty() && into.end.is_none() {
        let items: Vec<Item> = response.output.into_iter().flatten().collect();
        if into.arguments.is_empty()
            && let Some(arguments) = items.iter().find_map(|item| item.arguments.as_ref())
        {
            into.call(arguments);
        }
        for content in items.into_iter().filter(|item| item.r#type == "message").flat_map(|item| item.content).flatten() {
            into.text.push_str(content.text.as_deref().unwrap_or_default());
            decline(into, content.refusal.as_deref().unwrap_or_default());
        }
    }
    if let Some(usage) = response.usage {
        let thinking = usage.output_tokens_details.and_then(|details| details.reasoning_tokens).unwrap_or(0);
        into.tokens = Some(Tokens {
            input: usage.input_tokens.unwrap_or(0),
            cached: usage.input_tokens_details.and_then(|details| details.cached_tokens).unwrap_or(0),
            output: usage.output_tokens.unwrap_or(0).saturating_sub(thinking),
            thinking,
            estimated: false,
        });
    }
    into.served = response.model.or(into.served.take());
    if matches!(into.end, Some(End::Declined(_))) {
        return Ok(());
    }
    let reason = response.incomplete_details.and_then(|details| details.reason);
    into.end = Some(match (response.status.as_deref(), reason) {
        (Some("incomplete"), Some(reason)) if reason == "content_filter" => End::Blocked(reason),
        (Some("incomplete"), reason) => End::CutOff(reason.unwrap_or_else(|| "incomplete".to_owned())),
        (Some("failed" | "cancelled"), _) => End::Fault("failed".to_owned()),
        _ => End::Whole,
    });
    Ok(())
}

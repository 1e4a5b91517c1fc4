//! Anthropic's messages API.

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::{Ask, End, Gathered, Request, SchemaDialect, typed};
use crate::error::VlmError;

#[derive(Serialize)]
struct Body<'a> {
    model: &'a str,
    max_tokens: u32,
    stream: bool,
    messages: [Message<'a>; 1],
    #[serde(skip_serializing_if = "Option::is_none")]
    output_config: Option<Value>,
}

#[derive(Serialize)]
struct Message<'a> {
    role: &'static str,
    content: Vec<Part<'a>>,
}

#[derive(Serialize)]
#[serde(tag = "type", rename_all = "snake_case")]
enum Part<'a> {
    Image { source: Source },
    Text { text: &'a str },
}

#[derive(Serialize)]
#[serde(tag = "type", rename_all = "snake_case")]
enum Source {
    Base64 { media_type: &'static str, data: String },
}

pub(super) fn request(ask: &Ask<'_>) -> Request {
    let model = ask.model;
    let schema = ask.schema.as_ref().filter(|_| model.schema == SchemaDialect::JsonSchema);
    let image = |data| Part::Image { source: Source::Base64 { media_type: "image/jpeg", data } };
    let content = ask.images("").map(image).chain([Part::Text { text: ask.prompt }]).collect();
    let body = Body {
        model: &model.id,
        max_tokens: model.max_output_tokens,
        stream: model.stream,
        messages: [Message { role: "user", content }],
        output_config: schema.map(|schema| json!({ "format": { "type": "json_schema", "schema": schema } })),
    };
    Request { path: "/messages".to_owned(), body: json!(body) }
}

#[derive(Deserialize)]
#[serde(tag = "type", rename_all = "snake_case")]
enum Event {
    Message(Answered),
    MessageStart {
        message: Answered,
    },
    ContentBlockDelta {
        delta: Delta,
    },
    MessageDelta {
        delta: Stop,
        usage: Option<Usage>,
    },
    #[serde(other)]
    Other,
}

/// A complete response, or the start of one.
#[derive(Deserialize, Default)]
#[serde(default)]
struct Answered {
    model: Option<String>,
    content: Vec<Block>,
    stop_reason: Option<String>,
    usage: Option<Usage>,
}

#[derive(Deserialize)]
#[serde(tag = "type", rename_all = "snake_case")]
enum Block {
    Text {
        text: String,
    },
    ToolUse {
        input: Value,
    },
    #[serde(other)]
    Other,
}

#[derive(Deserialize)]
#[serde(tag = "type", rename_all = "snake_case")]
enum Delta {
    #[serde(rename = "text_delta")]
    Text { text: String },
    #[serde(rename = "input_json_delta")]
    InputJson { partial_json: String },
    #[serde(other)]
    Other,
}

#[derive(Deserialize, Default)]
#[serde(default)]
struct Stop {
    stop_reason: Option<String>,
}

#[derive(Deserialize, Default)]
#[serde(default)]
struct Usage {
    input_tokens: Option<u64>,
    cache_creation_input_tokens: Option<u64>,
    cache_read_input_tokens: Option<u64>,
    output_tokens: Option<u64>,
}

pub(super) fn read(host: &str, object: &Value, into: &mut Gathered) -> Result<(), VlmError> {
    match typed(host, object)? {
        Event::Message(message) | Event::MessageStart { message } => {
            for block in message.content {
                match block {
                    Block::Text { text } => into.text.push_str(&text),
                    Block::ToolUse { input } => into.call(&input),
                    Block::Other => {}
                }
            }
            into.served = message.model.or(into.served.take());
            count(message.usage, into);
            stop(message.stop_reason, into);
        }
        Event::ContentBlockDelta { delta: Delta::Text { text } } => into.text.push_str(&text),
        Event::ContentBlockDelta { delta: Delta::InputJson { partial_json } } => into.arguments.push_str(&partial_json),
        Event::MessageDelta { delta, usage } => {
            count(usage, into);
            stop(delta.stop_reason, into);
        }
        Event::ContentBlockDelta { .. } | Event::Other => {}
    }
    Ok(())
}

/// Counts from the end of a message replace those from its start; reasoning is included in the output.
fn count(usage: Option<Usage>, into: &mut Gathered) {
    let Some(usage) = usage else { return };
    let tokens = into.tokens.get_or_insert_default();
    // Cached tokens, read or written, are not included in `input_tokens`.
    let cached = usage.cache_read_input_tokens.unwrap_or(0);
    if let Some(input) = usage.input_tokens {
        tokens.input = input + cached + usage.cache_creation_input_tokens.unwrap_or(0);
        tokens.cached = cached;
    }
    tokens.output = usage.output_tokens.unwrap_or(tokens.output);
}

fn stop(reason: Option<String>, into: &mut Gathered) {
    let Some(reason) = reason else { return };
    into.end = Some(match reason.as_str() {
        "max_tokens" | "model_context_window_exceeded" => End::CutOff(reason),
        // Any text before it is the model's own.
        "refusal" => End::Declined(if into.text.trim().is_empty() { reason } else { into.text.clone() }),
        _ => End::Whole,
    });
}

//! OpenAI's chat completions, as implemented by many servers, each with deviations.

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::{Ask, DATA_URL, End, Gathered, Request, SchemaDialect, typed};
use crate::error::VlmError;
use crate::usage::Tokens;

#[derive(Serialize)]
struct Body<'a> {
    model: &'a str,
    stream: bool,
    messages: [Message<'a>; 1],
    max_completion_tokens: u32,
    #[serde(skip_serializing_if = "Option::is_none")]
    response_format: Option<Value>,
}

#[derive(Serialize)]
struct Message<'a> {
    role: &'static str,
    content: Vec<Part<'a>>,
}

#[derive(Serialize)]
#[serde(tag = "type", rename_all = "snake_case")]
enum Part<'a> {
    ImageUrl { image_url: ImageUrl<'a> },
    Text { text: &'a str },
}

#[derive(Serialize)]
struct ImageUrl<'a> {
    url: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    detail: Option<&'a str>,
}

pub(super) fn request(ask: &Ask<'_>) -> Request {
    let model = ask.model;
    let format = ask.schema.as_ref().map(|schema| match model.schema {
        SchemaDialect::JsonObject => json!({ "type": "json_object" }),
        _ => json!({ "type": "json_schema", "json_schema": { "name": "spf_reply", "strict": true, "schema": schema } }),
    });
    let image = |url| Part::ImageUrl { image_url: ImageUrl { url, detail: model.detail.as_deref() } };
    let content = ask.images(DATA_URL).map(image).chain([Part::Text { text: ask.prompt }]).collect();
    let body = Body {
        model: &model.id,
        stream: model.stream,
        messages: [Message { role: "user", content }],
        max_completion_tokens: model.max_output_tokens,
        response_format: format,
    };
    Request { path: "/chat/completions".to_owned(), body: json!(body) }
}

#[derive(Deserialize, Default)]
#[serde(default)]
struct Response {
    model: Option<String>,
    choices: Option<Vec<Choice>>,
    usage: Option<Usage>,
}

#[derive(Deserialize, Default)]
#[serde(default)]
struct Choice {
    /// Part of a stream.
    delta: Option<Answered>,
    /// A complete reply.
    message: Option<Answered>,
    finish_reason: Option<String>,
}

#[derive(Deserialize, Default)]
#[serde(default)]
struct Answered {
    /// A text, or a list of parts.
    content: Option<Value>,
    refusal: Option<String>,
    /// Thoughts, by their name at most servers, some of which put the whole reply there; some send both names.
    reasoning_content: Option<Value>,
    /// The other name.
    reasoning: Option<Value>,
    tool_calls: Option<Vec<ToolCall>>,
    /// The older form of the same.
    function_call: Option<Function>,
}

#[derive(Deserialize, Default)]
#[serde(default)]
struct ToolCall {
    function: Option<Function>,
}

#[derive(Deserialize, Default)]
#[serde(default)]
struct Function {
    arguments: Option<Value>,
}

/// Adds the text of a content: a text, or parts of which those of another kind, such as thoughts, are none.
fn add_text(content: &Value, text: &mut String) {
    match content {
        Value::String(words) => text.push_str(words),
        Value::Array(parts) => parts.iter().for_each(|part| add_text(part, text)),
        Value::Object(part) if part.get("type").is_none_or(|kind| kind == "text" || kind == "output_text") => {
            text.push_str(part.get("text").and_then(Value::as_str).unwrap_or_default());
        }
        _ => {}
    }
}

#[derive(Deserialize, Default)]
#[serde(default)]
struct Usage {
    prompt_tokens: Option<u64>,
    completion_tokens: Option<u64>,
    /// OpenRouter's, US dollars.
    cost: Option<f64>,
    prompt_tokens_details: Option<Details>,
    completion_tokens_details: Option<Details>,
}

#[derive(Deserialize, Default)]
#[serde(default)]
struct Details {
    cached_tokens: Option<u64>,
    reasoning_tokens: Option<u64>,
}

pub(super) fn read(host: &str, object: &Value, into: &mut Gathered) -> Result<(), VlmError> {
    let response: Response = typed(host, object)?;
    for choice in response.choices.into_iter().flatten().take(1) {
        for answered in [choice.delta, choice.message].into_iter().flatten() {
            add_text(&answered.content.unwrap_or_default(), &mut into.text);
            let thoughts = answered.reasoning_content.as_ref().and_then(Value::as_str).filter(|thoughts| !thoughts.is_empty());
            into.think(thoughts.or(answered.reasoning.as_ref().and_then(Value::as_str)).unwrap_or_default());
            // One call is asked for, if any.
            let call = answered.tool_calls.into_iter().flatten().next().and_then(|call| call.function);
            if let Some(arguments) = call.or(answered.function_call).and_then(|function| function.arguments) {
                into.call(&arguments);
            }
            decline(into, answered.refusal.as_deref().unwrap_or_default());
        }
        if let Some(reason) = choice.finish_reason
            && !matches!(into.end, Some(End::Declined(_)))
        {
            into.end = Some(match reason.as_str() {
                "length" => End::CutOff(reason),
                "content_filter" => End::Blocked(reason),
                "error" => End::Fault(reason),
                _ => End::Whole,
            });
        }
    }
    if let Some(usage) = response.usage {
        into.cost_usd = usage.cost.filter(|cost| cost.is_finite() && *cost >= 0.0).or(into.cost_usd);
        let details = |details: &Option<Details>, of: fn(&Details) -> Option<u64>| details.as_ref().and_then(of).unwrap_or(0);
        let thinking = details(&usage.completion_tokens_details, |details| details.reasoning_tokens);
        into.tokens = Some(Tokens {
            input: usage.prompt_tokens.unwrap_or(0),
            cached: details(&usage.prompt_tokens_details, |details| details.cached_tokens),
            output: usage.completion_tokens.unwrap_or(0).saturating_sub(thinking),
            thinking,
            estimated: false,
        });
    }
    into.served = response.model.filter(|model| !model.is_empty()).or(into.served.take());
    Ok(())
}

/// Adds part of a refusal, which replaces the text.
pub(super) fn decline(into: &mut Gathered, words: &str) {
    if words.is_empty() {
        return;
    }
    match &mut into.end {
        Some(End::Declined(reason)) => reason.push_str(words),
        end => *end = Some(End::Declined(words.to_owned())),
    }
}

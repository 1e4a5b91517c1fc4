//! Gemini's `generateContent` and its stream.

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::{Ask, End, Gathered, Request, SchemaDialect, schema, typed};
use crate::error::VlmError;
use crate::usage::Tokens;

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
struct Body<'a> {
    contents: [Content<'a>; 1],
    generation_config: GenerationConfig,
}

#[derive(Serialize)]
struct Content<'a> {
    role: &'static str,
    parts: Vec<Part<'a>>,
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
enum Part<'a> {
    InlineData {
        #[serde(rename = "mimeType")]
        mime_type: &'static str,
        data: String,
    },
    #[serde(untagged)]
    Text { text: &'a str },
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
struct GenerationConfig {
    max_output_tokens: u32,
    #[serde(skip_serializing_if = "Option::is_none")]
    response_mime_type: Option<&'static str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    response_json_schema: Option<Value>,
    #[serde(skip_serializing_if = "Option::is_none")]
    response_schema: Option<Value>,
}

pub(super) fn request(ask: &Ask<'_>) -> Request {
    let model = ask.model;
    let method = if model.stream { "streamGenerateContent?alt=sse" } else { "generateContent" };
    let json_schema = ask.schema.clone().filter(|_| model.schema == SchemaDialect::JsonSchema);
    let open_api = ask.schema.as_ref().filter(|_| model.schema == SchemaDialect::OpenApi).map(schema::open_api);
    let images = ask.images("").map(|data| Part::InlineData { mime_type: "image/jpeg", data });
    let parts = images.chain([Part::Text { text: ask.prompt }]).collect();
    let body = Body {
        contents: [Content { role: "user", parts }],
        generation_config: GenerationConfig {
            max_output_tokens: model.max_output_tokens,
            response_mime_type: ask.schema.is_some().then_some("application/json"),
            response_json_schema: json_schema,
            response_schema: open_api,
        },
    };
    Request { path: format!("/models/{}:{method}", model.id), body: json!(body) }
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase", default)]
#[derive(Default)]
struct Response {
    candidates: Option<Vec<Candidate>>,
    prompt_feedback: Option<Feedback>,
    usage_metadata: Option<Usage>,
    model_version: Option<String>,
}

#[derive(Deserialize, Default)]
#[serde(rename_all = "camelCase", default)]
struct Candidate {
    content: Option<Answered>,
    finish_reason: Option<String>,
    finish_message: Option<String>,
}

#[derive(Deserialize, Default)]
#[serde(default)]
struct Answered {
    parts: Option<Vec<AnsweredPart>>,
}

#[derive(Deserialize, Default)]
#[serde(rename_all = "camelCase", default)]
struct AnsweredPart {
    text: Option<String>,
    thought: Option<bool>,
    function_call: Option<FunctionCall>,
}

#[derive(Deserialize, Default)]
#[serde(default)]
struct FunctionCall {
    args: Value,
}

#[derive(Deserialize, Default)]
#[serde(rename_all = "camelCase", default)]
struct Feedback {
    block_reason: Option<String>,
    block_reason_message: Option<String>,
}

#[derive(Deserialize, Default)]
#[serde(rename_all = "camelCase", default)]
struct Usage {
    prompt_token_count: Option<u64>,
    candidates_token_count: Option<u64>,
    thoughts_token_count: Option<u64>,
    cached_content_token_count: Option<u64>,
}

pub(super) fn read(host: &str, object: &Value, into: &mut Gathered) -> Result<(), VlmError> {
    let response: Response = typed(host, object)?;
    if let Some(feedback) = response.prompt_feedback
        && let Some(reason) = feedback.block_reason
    {
        let words = feedback.block_reason_message.map_or(String::new(), |words| format!(": {words}"));
        into.end = Some(End::Blocked(format!("{reason}{words}")));
    }
    for candidate in response.candidates.into_iter().flatten().take(1) {
        let parts = candidate.content.and_then(|content| content.parts).unwrap_or_default();
        for part in parts.into_iter().filter(|part| part.thought != Some(true)) {
            into.text.push_str(part.text.as_deref().unwrap_or_default());
            if let Some(call) = part.function_call {
                into.call(&call.args);
            }
        }
        if let Some(reason) = candidate.finish_reason {
            into.end = Some(end(&reason, candidate.finish_message.as_deref()));
        }
    }
    // Every part of a stream may report them; the last is correct.
    if let Some(usage) = response.usage_metadata {
        into.tokens = Some(Tokens {
            input: usage.prompt_token_count.unwrap_or(0),
            cached: usage.cached_content_token_count.unwrap_or(0),
            output: usage.candidates_token_count.unwrap_or(0),
            thinking: usage.thoughts_token_count.unwrap_or(0),
            estimated: false,
        });
    }
    into.served = response.model_version.or(into.served.take());
    Ok(())
}

fn end(reason: &str, message: Option<&str>) -> End {
    let reported = || message.filter(|words| !words.is_empty()).map_or(reason.to_owned(), |words| format!("{reason}: {words}"));
    match reason {
        "STOP" | "FINISH_REASON_UNSPECIFIED" => End::Whole,
        "MAX_TOKENS" | "CONTINUATION" => End::CutOff(reported()),
        "OTHER"
        | "MALFORMED_RESPONSE"
        | "MALFORMED_FUNCTION_CALL"
        | "UNEXPECTED_TOOL_CALL"
        | "TOO_MANY_TOOL_CALLS"
        | "MISSING_THOUGHT_SIGNATURE" => End::Fault(reported()),
        // The kinds of safety blocks, including future ones.
        _ => End::Blocked(reported()),
    }
}

//! The answers of each vendor, streamed and complete, as in its documentation. `vendors.py` reads them with the
//! vendors' own SDKs, which confirms their format.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};

use super::server::{Piece, Reply, Request};

/// A vendor in the tests.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Vendor {
    Gemini,
    OpenAi,
    Chat,
    Anthropic,
}

impl Vendor {
    pub(crate) const ALL: [Self; 4] = [Self::Gemini, Self::OpenAi, Self::Chat, Self::Anthropic];

    /// The name on the command line.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Gemini => "gemini",
            Self::OpenAi => "openai",
            Self::Chat => "vllm",
            Self::Anthropic => "anthropic",
        }
    }

    /// The variable that holds its key.
    pub(crate) fn key(self) -> &'static str {
        match self {
            Self::Gemini => "GEMINI_API_KEY",
            Self::OpenAi => "OPENAI_API_KEY",
            Self::Chat => "VLLM_API_KEY",
            Self::Anthropic => "ANTHROPIC_API_KEY",
        }
    }

    /// The header that carries the key.
    pub(crate) fn key_header(self) -> &'static str {
        match self {
            Self::Gemini => "x-goog-api-key",
            Self::Anthropic => "x-api-key",
            Self::OpenAi | Self::Chat => "authorization",
        }
    }

    /// The path of queries relative to the base address.
    pub(crate) fn path(self) -> &'static str {
        match self {
            Self::Gemini => "/v1/models/gemini-robotics-er-2-preview:streamGenerateContent?alt=sse",
            Self::OpenAi => "/v1/responses",
            Self::Chat => "/v1/chat/completions",
            Self::Anthropic => "/v1/messages",
        }
    }

    /// The model requested.
    pub(crate) fn model(self, request: &Request) -> String {
        match self {
            Self::Gemini => request.path.split(['/', ':']).nth(3).unwrap().to_owned(),
            _ => request.json()["model"].as_str().unwrap().to_owned(),
        }
    }

    /// The image in a request.
    pub(crate) fn image(self, request: &Request) -> Vec<u8> {
        let body = request.json();
        let data = match self {
            Self::Gemini => &body["contents"][0]["parts"][0]["inlineData"]["data"],
            Self::OpenAi => &body["input"][0]["content"][0]["image_url"],
            Self::Chat => &body["messages"][0]["content"][0]["image_url"]["url"],
            Self::Anthropic => &body["messages"][0]["content"][0]["source"]["data"],
        };
        let data = data.as_str().unwrap();
        STANDARD.decode(data.strip_prefix("data:image/jpeg;base64,").unwrap_or(data)).unwrap()
    }

    /// The objects of a stream that delivers a text in pieces.
    pub(crate) fn events(self, model: &str, text: &str) -> Vec<Value> {
        let pieces = pieces(text);
        match self {
            Self::Gemini => gemini_events(model, &pieces),
            Self::OpenAi => responses_events(model, text, &pieces),
            Self::Chat => chat_events(model, &pieces),
            Self::Anthropic => anthropic_events(model, &pieces),
        }
    }

    /// The complete answer with a text.
    pub(crate) fn whole(self, model: &str, text: &str) -> Value {
        match self {
            Self::Gemini => gemini_whole(model, text),
            Self::OpenAi => response(model, "completed", Some(text)),
            Self::Chat => json!({ "id": "chatcmpl-1", "object": "chat.completion", "created": 1_790_000_000, "model": model,
                "choices": [{ "index": 0, "message": { "role": "assistant", "content": text, "refusal": null },
                    "finish_reason": "stop", "logprobs": null }], "usage": chat_usage() }),
            Self::Anthropic => message(model, json!([{ "type": "text", "text": text }]), Some("end_turn"), 40),
        }
    }

    /// A stream as transmitted.
    pub(crate) fn stream(self, model: &str, text: &str) -> Reply {
        let mut bytes: String = self
            .events(model, text)
            .iter()
            .map(|event| match (self, event["type"].as_str()) {
                (Self::OpenAi | Self::Anthropic, Some(kind)) => format!("event: {kind}\ndata: {event}\n\n"),
                _ => format!("data: {event}\r\n\r\n"),
            })
            .collect();
        if self == Self::Chat {
            bytes = format!(": keep-alive\n\n{bytes}data: [DONE]\n\n");
        }
        Reply { pieces: vec![Piece::Bytes(bytes.into_bytes())], ..Reply::new(200, "text/event-stream", "") }
    }
}

/// Uneven pieces of a text.
fn pieces(text: &str) -> Vec<String> {
    let letters: Vec<char> = text.chars().collect();
    letters.chunks(7).map(|chunk| chunk.iter().collect()).collect()
}

fn gemini_usage(output: u32) -> Value {
    json!({ "promptTokenCount": 1200, "candidatesTokenCount": output, "thoughtsTokenCount": 3, "totalTokenCount": 1203 + output,
        "promptTokensDetails": [{ "modality": "IMAGE", "tokenCount": 560 }] })
}

fn gemini_events(model: &str, pieces: &[String]) -> Vec<Value> {
    let last = pieces.len().saturating_sub(1);
    let event = |(number, piece): (usize, &String)| {
        let mut candidate = json!({ "index": 0, "content": { "role": "model", "parts": [{ "text": piece }] } });
        if number == last {
            candidate["finishReason"] = "STOP".into();
        }
        json!({ "candidates": [candidate], "usageMetadata": gemini_usage(number as u32), "modelVersion": model, "responseId": "r1" })
    };
    pieces.iter().enumerate().map(event).collect()
}

fn gemini_whole(model: &str, text: &str) -> Value {
    json!({ "candidates": [{ "index": 0, "content": { "role": "model", "parts": [{ "text": text }] }, "finishReason": "STOP" }],
        "usageMetadata": gemini_usage(40), "modelVersion": model, "responseId": "r1" })
}

fn chat_usage() -> Value {
    json!({ "prompt_tokens": 1200, "completion_tokens": 43, "total_tokens": 1243,
        "prompt_tokens_details": { "cached_tokens": 0 }, "completion_tokens_details": { "reasoning_tokens": 3 } })
}

fn chat_events(model: &str, pieces: &[String]) -> Vec<Value> {
    let chunk = |choices: Value, usage: Value| {
        json!({ "id": "chatcmpl-1", "object": "chat.completion.chunk", "created": 1_790_000_000, "model": model,
            "choices": choices, "usage": usage })
    };
    let delta = |delta: Value, reason: Value| json!([{ "index": 0, "delta": delta, "finish_reason": reason, "logprobs": null }]);
    let mut events = vec![chunk(delta(json!({ "role": "assistant", "content": "" }), Value::Null), Value::Null)];
    events.extend(pieces.iter().map(|piece| chunk(delta(json!({ "content": piece }), Value::Null), Value::Null)));
    events.push(chunk(delta(json!({}), "stop".into()), Value::Null));
    events.push(chunk(json!([]), chat_usage()));
    events
}

/// A response object, with the fields that OpenAI's own types require.
fn response(model: &str, status: &str, text: Option<&str>) -> Value {
    let output: Vec<Value> = text.map(item).into_iter().collect();
    let usage = text.map(|_| {
        json!({ "input_tokens": 1200, "input_tokens_details": { "cached_tokens": 0, "cache_write_tokens": 0 },
            "output_tokens": 43, "output_tokens_details": { "reasoning_tokens": 3 }, "total_tokens": 1243 })
    });
    json!({ "id": "resp_1", "object": "response", "created_at": 1_790_000_000, "status": status, "error": null,
        "incomplete_details": null, "instructions": null, "metadata": {}, "model": model, "output": output,
        "parallel_tool_calls": true, "temperature": null, "tool_choice": "auto", "tools": [], "top_p": null, "usage": usage })
}

fn item(text: &str) -> Value {
    json!({ "id": "msg_1", "type": "message", "role": "assistant", "status": "completed",
        "content": [{ "type": "output_text", "text": text, "annotations": [] }] })
}

fn responses_events(model: &str, text: &str, pieces: &[String]) -> Vec<Value> {
    let place = json!({ "item_id": "msg_1", "output_index": 0, "content_index": 0 });
    let with = |kind: &str, more: Value| {
        let mut event = json!({ "type": kind });
        for part in [&place, &more] {
            event.as_object_mut().unwrap().extend(part.as_object().unwrap().clone());
        }
        event
    };
    let mut events = vec![
        json!({ "type": "response.created", "response": response(model, "in_progress", None) }),
        json!({ "type": "response.output_item.added", "output_index": 0,
            "item": { "id": "msg_1", "type": "message", "role": "assistant", "status": "in_progress", "content": [] } }),
        with("response.content_part.added", json!({ "part": { "type": "output_text", "text": "", "annotations": [] } })),
    ];
    events.extend(pieces.iter().map(|piece| with("response.output_text.delta", json!({ "delta": piece, "logprobs": [] }))));
    events.push(with("response.output_text.done", json!({ "text": text, "logprobs": [] })));
    events.push(json!({ "type": "response.output_item.done", "output_index": 0, "item": item(text) }));
    events.push(json!({ "type": "response.completed", "response": response(model, "completed", Some(text)) }));
    for (number, event) in events.iter_mut().enumerate() {
        event["sequence_number"] = number.into();
    }
    events
}

fn message(model: &str, content: Value, stop_reason: Option<&str>, output: u32) -> Value {
    json!({ "id": "msg_1", "type": "message", "role": "assistant", "model": model, "content": content,
        "stop_reason": stop_reason, "stop_sequence": null,
        "usage": { "input_tokens": 1200, "output_tokens": output, "cache_creation_input_tokens": 0, "cache_read_input_tokens": 0 } })
}

fn anthropic_events(model: &str, pieces: &[String]) -> Vec<Value> {
    let mut events = vec![
        json!({ "type": "message_start", "message": message(model, json!([]), None, 1) }),
        json!({ "type": "content_block_start", "index": 0, "content_block": { "type": "text", "text": "" } }),
        json!({ "type": "ping" }),
    ];
    let delta =
        |piece: &String| json!({ "type": "content_block_delta", "index": 0, "delta": { "type": "text_delta", "text": piece } });
    events.extend(pieces.iter().map(delta));
    events.push(json!({ "type": "content_block_stop", "index": 0 }));
    events.push(json!({ "type": "message_delta", "delta": { "stop_reason": "end_turn", "stop_sequence": null },
        "usage": { "output_tokens": 40 } }));
    events.push(json!({ "type": "message_stop" }));
    events
}

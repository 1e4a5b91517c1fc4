//! Anthropic's messages API.

use serde_json::{Value, json};

use super::{Answered, Question};

pub(super) fn read(body: &Value, question: &mut Question) {
    question.say(body["system"].as_str());
    for part in body["system"].as_array().into_iter().flatten() {
        question.say(part["text"].as_str());
    }
    for message in body["messages"].as_array().into_iter().flatten() {
        question.message();
        question.say(message["content"].as_str());
        for part in message["content"].as_array().into_iter().flatten() {
            question.say(part["text"].as_str());
            question.show(part["source"]["data"].as_str());
        }
    }
}

fn message(answered: &Answered<'_>, content: Value, stop_reason: Value, tokens_out: usize) -> Value {
    json!({ "id": format!("msg_{}", answered.number), "type": "message", "role": "assistant", "model": answered.model,
        "content": content, "stop_reason": stop_reason, "stop_sequence": null,
        "usage": { "input_tokens": answered.tokens_in, "output_tokens": tokens_out, "cache_creation_input_tokens": 0,
            "cache_read_input_tokens": 0 } })
}

pub(super) fn whole(answered: &Answered<'_>) -> Value {
    message(answered, json!([{ "type": "text", "text": answered.text }]), "end_turn".into(), answered.tokens_out)
}

pub(super) fn events(answered: &Answered<'_>) -> Vec<Value> {
    let mut events = vec![
        json!({ "type": "message_start", "message": message(answered, json!([]), Value::Null, 1) }),
        json!({ "type": "content_block_start", "index": 0, "content_block": { "type": "text", "text": "" } }),
    ];
    let delta =
        |piece: String| json!({ "type": "content_block_delta", "index": 0, "delta": { "type": "text_delta", "text": piece } });
    events.extend(answered.pieces().into_iter().map(delta));
    events.push(json!({ "type": "content_block_stop", "index": 0 }));
    events.push(json!({ "type": "message_delta", "delta": { "stop_reason": "end_turn", "stop_sequence": null },
        "usage": { "output_tokens": answered.tokens_out } }));
    events.push(json!({ "type": "message_stop" }));
    events
}

pub(super) fn error(message: &str) -> Value {
    json!({ "type": "error", "error": { "type": "invalid_request_error", "message": message } })
}

//! OpenAI's chat completions, supported by many servers and clients.

use serde_json::{Value, json};

use super::{Answered, Question};

pub(super) fn read(body: &Value, question: &mut Question) {
    for message in body["messages"].as_array().into_iter().flatten() {
        question.message();
        question.say(message["content"].as_str());
        for part in message["content"].as_array().into_iter().flatten() {
            question.say(part["text"].as_str());
            question.show(part["image_url"]["url"].as_str().or_else(|| part["image_url"].as_str()));
        }
    }
}

fn usage(answered: &Answered<'_>) -> Value {
    let Answered { tokens_in, tokens_out, .. } = answered;
    json!({ "prompt_tokens": tokens_in, "completion_tokens": tokens_out, "total_tokens": tokens_in + tokens_out })
}

pub(super) fn whole(answered: &Answered<'_>) -> Value {
    json!({ "id": format!("chatcmpl-{}", answered.number), "object": "chat.completion", "created": 0, "model": answered.model,
        "choices": [{ "index": 0, "message": { "role": "assistant", "content": answered.text, "refusal": null },
            "finish_reason": "stop", "logprobs": null }], "usage": usage(answered) })
}

pub(super) fn events(answered: &Answered<'_>) -> Vec<Value> {
    let chunk = |choices: Value, usage: Value| {
        json!({ "id": format!("chatcmpl-{}", answered.number), "object": "chat.completion.chunk", "created": 0,
            "model": answered.model, "choices": choices, "usage": usage })
    };
    let delta = |delta: Value, reason: Value| {
        chunk(json!([{ "index": 0, "delta": delta, "finish_reason": reason, "logprobs": null }]), Value::Null)
    };
    let mut events = vec![delta(json!({ "role": "assistant", "content": "" }), Value::Null)];
    events.extend(answered.pieces().iter().map(|piece| delta(json!({ "content": piece }), Value::Null)));
    events.push(delta(json!({}), "stop".into()));
    events.push(chunk(json!([]), usage(answered)));
    events
}

pub(super) fn error(message: &str) -> Value {
    json!({ "error": { "message": message, "type": "invalid_request_error", "param": null, "code": "unprocessable" } })
}

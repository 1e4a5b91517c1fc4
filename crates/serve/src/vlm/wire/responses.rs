//! OpenAI's responses API.

use serde_json::{Value, json};

use super::{Answered, Question};

pub(super) fn read(body: &Value, question: &mut Question) {
    question.say(body["instructions"].as_str());
    question.say(body["input"].as_str());
    for item in body["input"].as_array().into_iter().flatten() {
        question.message();
        question.say(item["content"].as_str());
        for part in item["content"].as_array().into_iter().flatten() {
            question.say(part["text"].as_str());
            question.show(part["image_url"].as_str());
        }
    }
}

fn id(answered: &Answered<'_>) -> String {
    format!("msg_{}", answered.number)
}

fn item(answered: &Answered<'_>, status: &str, content: Value) -> Value {
    json!({ "id": id(answered), "type": "message", "role": "assistant", "status": status, "content": content })
}

fn message(answered: &Answered<'_>) -> Value {
    item(answered, "completed", json!([{ "type": "output_text", "text": answered.text, "annotations": [] }]))
}

fn response(answered: &Answered<'_>, status: &str, output: Value, usage: Value) -> Value {
    json!({ "id": format!("resp_{}", answered.number), "object": "response", "created_at": 0, "status": status, "error": null,
        "incomplete_details": null, "instructions": null, "metadata": {}, "model": answered.model, "output": output,
        "parallel_tool_calls": true, "temperature": null, "tool_choice": "auto", "tools": [], "top_p": null, "usage": usage })
}

pub(super) fn whole(answered: &Answered<'_>) -> Value {
    let Answered { tokens_in, tokens_out, .. } = answered;
    let usage = json!({ "input_tokens": tokens_in, "input_tokens_details": { "cached_tokens": 0, "cache_write_tokens": 0 },
        "output_tokens": tokens_out, "output_tokens_details": { "reasoning_tokens": 0 }, "total_tokens": tokens_in + tokens_out });
    response(answered, "completed", json!([message(answered)]), usage)
}

pub(super) fn events(answered: &Answered<'_>) -> Vec<Value> {
    let at = |kind: &str, key: &str, value: Value| {
        let mut event = json!({ "type": kind, "item_id": id(answered), "output_index": 0, "content_index": 0 });
        event[key] = value;
        if kind.starts_with("response.output_text") {
            event["logprobs"] = json!([]);
        }
        event
    };
    let part = |text: &str| json!({ "type": "output_text", "text": text, "annotations": [] });
    let mut events = vec![
        json!({ "type": "response.created", "response": response(answered, "in_progress", json!([]), Value::Null) }),
        json!({ "type": "response.output_item.added", "output_index": 0, "item": item(answered, "in_progress", json!([])) }),
        at("response.content_part.added", "part", part("")),
    ];
    events.extend(answered.pieces().into_iter().map(|piece| at("response.output_text.delta", "delta", piece.into())));
    events.push(at("response.output_text.done", "text", answered.text.into()));
    events.push(at("response.content_part.done", "part", part(answered.text)));
    events.push(json!({ "type": "response.output_item.done", "output_index": 0, "item": message(answered) }));
    events.push(json!({ "type": "response.completed", "response": whole(answered) }));
    for (number, event) in events.iter_mut().enumerate() {
        event["sequence_number"] = number.into();
    }
    events
}

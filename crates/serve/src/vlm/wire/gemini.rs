//! Gemini's `generateContent` and `streamGenerateContent`.

use serde_json::{Value, json};

use super::{Answered, Question};

/// A member in either camelCase or snake_case: proto JSON allows both.
fn either<'a>(value: &'a Value, camel: &str, snake: &str) -> &'a Value {
    value.get(camel).unwrap_or(&value[snake])
}

pub(super) fn read(body: &Value, question: &mut Question) {
    let system = either(body, "systemInstruction", "system_instruction");
    for content in std::iter::once(system).chain(body["contents"].as_array().into_iter().flatten()) {
        question.message();
        for part in content["parts"].as_array().into_iter().flatten() {
            question.say(part["text"].as_str());
            question.show(either(part, "inlineData", "inline_data")["data"].as_str());
        }
    }
}

fn usage(answered: &Answered<'_>) -> Value {
    let Answered { tokens_in, tokens_out, .. } = answered;
    json!({ "promptTokenCount": tokens_in, "candidatesTokenCount": tokens_out, "totalTokenCount": tokens_in + tokens_out })
}

fn event(answered: &Answered<'_>, text: &str, last: bool) -> Value {
    let mut candidate = json!({ "index": 0, "content": { "role": "model", "parts": [{ "text": text }] } });
    if last {
        candidate["finishReason"] = "STOP".into();
    }
    json!({ "candidates": [candidate], "usageMetadata": usage(answered), "modelVersion": answered.model,
        "responseId": format!("r{}", answered.number) })
}

pub(super) fn whole(answered: &Answered<'_>) -> Value {
    event(answered, answered.text, true)
}

pub(super) fn events(answered: &Answered<'_>) -> Vec<Value> {
    let pieces = answered.pieces();
    let last = pieces.len().saturating_sub(1);
    pieces.iter().enumerate().map(|(number, piece)| event(answered, piece, number == last)).collect()
}

pub(super) fn error(status: u16, message: &str) -> Value {
    json!({ "error": { "code": status, "message": message, "status": "INVALID_ARGUMENT" } })
}

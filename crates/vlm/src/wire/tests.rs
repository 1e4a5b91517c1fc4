use super::*;
use crate::table::Table;
use serde_json::json;

fn model(name: &str) -> Model {
    Table::shipped().select(name, "2026-11-21").unwrap_or_else(|error| panic!("{name}: {error}")).model
}

fn request(name: &str) -> Request {
    let model = model(name);
    let kind = QueryKind::point(false);
    model.wire.request(&model, &Question { prompt: "Where?", jpeg: b"\xff\xd8", close_up: None, kind: &kind })
}

/// An enlarged part follows the image, in every format.
#[test]
fn a_close_up_follows_the_image() {
    let kind = QueryKind::point(false);
    for (name, parts) in [
        ("gemini", "/contents/0/parts"),
        ("anthropic", "/messages/0/content"),
        ("openai", "/input/0/content"),
        ("openrouter#a/b", "/messages/0/content"),
    ] {
        let model = model(name);
        let question = |close_up| Question { prompt: "Where?", jpeg: b"\xff\xd8", close_up, kind: &kind };
        let parts_of = |close_up| {
            let body = model.wire.request(&model, &question(close_up)).body;
            body.pointer(parts).and_then(|parts| parts.as_array()).unwrap().clone()
        };
        let (without, with) = (parts_of(None), parts_of(Some(b"\xff\xd9".as_slice())));
        assert_eq!((without.len(), with.len()), (2, 3), "{name}");
        assert_eq!((&with[0], &with[2]), (&without[0], &without[1]), "{name}");
        // The second byte differs: /9g= and /9k=.
        assert_eq!(with[1].to_string(), without[0].to_string().replace("/9g=", "/9k="), "{name}");
        assert_ne!(with[1], with[0], "{name}");
    }
}

/// The schema is tested in the core.
fn without_schema(mut request: Request, pointer: &str) -> Request {
    let schema = request.body.pointer_mut(pointer).unwrap_or_else(|| panic!("no {pointer}"));
    assert_eq!(schema["type"], "object");
    *schema = Value::Null;
    request
}

#[test]
fn gemini_requests_have_this_form() {
    let request = without_schema(request("gemini#gemini-3.8-flash"), "/generationConfig/responseJsonSchema");
    assert_eq!(request.path, "/models/gemini-3.8-flash:streamGenerateContent?alt=sse");
    let expected = json!({
        "contents": [{ "role": "user", "parts": [
            { "inlineData": { "mimeType": "image/jpeg", "data": "/9g=" } }, { "text": "Where?" }] }],
        "generationConfig": {
            "maxOutputTokens": 4096, "responseMimeType": "application/json", "responseJsonSchema": null,
            "mediaResolution": "MEDIA_RESOLUTION_MEDIUM", "thinkingConfig": { "thinkingLevel": "LOW" } },
    });
    assert_eq!(request.body, expected);
}

#[test]
fn openai_requests_have_this_form() {
    let responses = without_schema(request("openai"), "/text/format/schema");
    let expected = json!({
        "model": "gpt-6-luna", "stream": true, "store": false, "max_output_tokens": 1024, "reasoning": { "effort": "none" },
        "input": [{ "role": "user", "content": [
            { "type": "input_image", "image_url": "data:image/jpeg;base64,/9g=", "detail": "original" },
            { "type": "input_text", "text": "Where?" }] }],
        "text": { "format": { "type": "json_schema", "name": "spf_reply", "strict": true, "schema": null } },
    });
    assert_eq!((responses.path.as_str(), responses.body), ("/responses", expected));
    let chat = without_schema(request("ollama"), "/response_format/json_schema/schema");
    let expected = json!({
        "model": "qwen3-vl:8b", "stream": true, "stream_options": { "include_usage": true }, "reasoning_effort": "none",
        "max_completion_tokens": 4096,
        "messages": [{ "role": "user", "content": [
            { "type": "image_url", "image_url": { "url": "data:image/jpeg;base64,/9g=" } },
            { "type": "text", "text": "Where?" }] }],
        "response_format": { "type": "json_schema", "json_schema": { "name": "spf_reply", "strict": true, "schema": null } },
    });
    assert_eq!((chat.path.as_str(), chat.body), ("/chat/completions", expected));
}

#[test]
fn anthropic_requests_have_this_form() {
    let request = without_schema(request("anthropic"), "/output_config/format/schema");
    let expected = json!({
        "model": "claude-haiku-5-5", "stream": true, "max_tokens": 1024, "thinking": { "type": "disabled" },
        "messages": [{ "role": "user", "content": [
            { "type": "image", "source": { "type": "base64", "media_type": "image/jpeg", "data": "/9g=" } },
            { "type": "text", "text": "Where?" }] }],
        "output_config": { "effort": "low", "format": { "type": "json_schema", "schema": null } },
    });
    assert_eq!((request.path.as_str(), request.body), ("/messages", expected));
}

#[test]
fn a_schema_as_open_api_has_it() {
    let schema = schema::open_api(&schema::of(&QueryKind::point(true)).unwrap());
    assert_eq!((&schema["type"], &schema["propertyOrdering"][0]), (&json!("OBJECT"), &json!("target")));
    let depth = &schema["properties"]["depth"];
    assert_eq!((&depth["type"], &depth["nullable"], &depth["enum"][9]), (&json!("STRING"), &json!(true), &json!("10")));
    assert_eq!(schema["properties"]["boxes"]["items"]["properties"]["box"]["items"]["type"], "NUMBER");
    assert!(!schema.to_string().contains("additionalProperties"));
}

#[test]
fn an_unstructured_model_receives_no_schema() {
    assert_eq!(request("moondream").body.get("response_format"), None);
}

/// Reads objects one after the other.
fn read(wire: WireKind, objects: &[Value]) -> Result<Gathered, VlmError> {
    let mut gathered = Gathered::default();
    objects.iter().try_for_each(|object| wire.read("h", object, &mut gathered))?;
    Ok(gathered)
}

fn finished(wire: WireKind, objects: &[Value]) -> Result<String, VlmError> {
    read(wire, objects)?.finish("h")
}

#[test]
fn gemini_answers_are_read() {
    let piece = |text: &str| json!({ "candidates": [{ "content": { "parts": [{ "text": text }] } }], "modelVersion": "m-001" });
    let last = json!({ "candidates": [{ "content": { "role": "model" }, "finishReason": "STOP" }], "usageMetadata":
        { "promptTokenCount": 1200, "candidatesTokenCount": 40, "thoughtsTokenCount": 7, "cachedContentTokenCount": 100 } });
    let thought = json!({ "candidates": [{ "content": { "parts": [{ "text": "hm", "thought": true }] } }] });
    let gathered = read(WireKind::Gemini, &[thought, piece("{\"a\""), piece(":1}"), last]).unwrap();
    assert_eq!((gathered.text.as_str(), gathered.served.as_deref()), ("{\"a\":1}", Some("m-001")));
    assert_eq!(gathered.tokens, Some(Tokens { input: 1200, cached: 100, output: 40, thinking: 7, estimated: false }));
    assert_eq!(gathered.finish("h").unwrap(), "{\"a\":1}");
    let ended = |reason: &str| finished(WireKind::Gemini, &[json!({ "candidates": [{ "finishReason": reason }] })]).unwrap_err();
    assert_eq!(ended("MAX_TOKENS").code(), "cut_off");
    assert_eq!(ended("PROHIBITED_CONTENT").code(), "blocked");
    assert_eq!(ended("SOMETHING_NEW").code(), "blocked");
    assert_eq!(ended("OTHER").code(), "error_in_answer");
    assert_eq!(ended("STOP").code(), "empty");
    let blocked = finished(WireKind::Gemini, &[json!({ "promptFeedback": { "blockReason": "SAFETY" } })]).unwrap_err();
    assert_eq!(blocked.to_string(), "h blocked the query: SAFETY");
}

#[test]
fn openai_answers_are_read() {
    let chunk = |delta: Value| json!({ "model": "m", "choices": [{ "index": 0, "delta": delta, "finish_reason": null }] });
    let end = |reason: &str| json!({ "choices": [{ "delta": {}, "finish_reason": reason }] });
    let usage = json!({ "choices": [], "usage": { "prompt_tokens": 9, "completion_tokens": 8,
        "completion_tokens_details": { "reasoning_tokens": 3 }, "prompt_tokens_details": { "cached_tokens": 4 } } });
    let chat = WireKind::OpenaiChat;
    let all = [chunk(json!({ "role": "assistant", "content": null })), chunk(json!({ "content": "{}" })), end("stop"), usage];
    let gathered = read(chat, &all).unwrap();
    assert_eq!((gathered.text.as_str(), gathered.end.clone()), ("{}", Some(End::Whole)));
    assert_eq!(gathered.tokens, Some(Tokens { input: 9, cached: 4, output: 5, thinking: 3, estimated: false }));
    assert_eq!(finished(chat, &[chunk(json!({ "content": "{" })), end("length")]).unwrap_err().code(), "cut_off");
    let refused = [chunk(json!({ "refusal": "I can" })), chunk(json!({ "refusal": "not" })), end("stop")];
    assert_eq!(finished(chat, &refused), Err(VlmError::Declined("I cannot".to_owned())));
    let whole = json!({ "choices": [{ "message": { "content": "{}", "refusal": null }, "finish_reason": "stop" }] });
    assert_eq!(finished(chat, &[whole]).unwrap(), "{}");
    let responses = WireKind::OpenaiResponses;
    let body = json!({ "object": "response", "model": "m", "status": "completed", "error": null, "output": [
        { "type": "reasoning" }, { "type": "message", "content": [{ "type": "output_text", "text": "{}" }] }],
        "usage": { "input_tokens": 5, "output_tokens": 6 } });
    assert_eq!(finished(responses, std::slice::from_ref(&body)).unwrap(), "{}");
    let streamed = [
        json!({ "type": "response.created", "response": { "model": "m" } }),
        json!({ "type": "response.output_text.delta", "delta": "{}" }),
        json!({ "type": "response.output_text.done", "text": "{}" }),
        json!({ "type": "response.completed", "response": body }),
    ];
    assert_eq!(finished(responses, &streamed).unwrap(), "{}");
    let incomplete = json!({ "type": "response.incomplete", "response":
        { "status": "incomplete", "incomplete_details": { "reason": "max_output_tokens" } } });
    assert_eq!(finished(responses, &[incomplete]).unwrap_err().code(), "cut_off");
    let failed = json!({ "type": "response.failed", "response":
        { "status": "failed", "error": { "code": "server_error", "message": "sorry" } } });
    assert_eq!(finished(responses, &[failed]).unwrap_err().code(), "server_error");
}

#[test]
fn anthropic_answers_are_read() {
    let events = [
        json!({ "type": "message_start", "message": { "model": "m", "content": [], "usage":
            { "input_tokens": 10, "cache_read_input_tokens": 5, "cache_creation_input_tokens": 2, "output_tokens": 1 } } }),
        json!({ "type": "content_block_start", "index": 0, "content_block": { "type": "thinking", "thinking": "" } }),
        json!({ "type": "content_block_delta", "index": 0, "delta": { "type": "thinking_delta", "thinking": "hm" } }),
        json!({ "type": "ping" }),
        json!({ "type": "content_block_delta", "index": 1, "delta": { "type": "text_delta", "text": "{}" } }),
        json!({ "type": "message_delta", "delta": { "stop_reason": "end_turn" }, "usage": { "output_tokens": 20 } }),
        json!({ "type": "message_stop" }),
    ];
    let gathered = read(WireKind::Anthropic, &events).unwrap();
    assert_eq!(gathered.tokens, Some(Tokens { input: 17, cached: 5, output: 20, thinking: 0, estimated: false }));
    assert_eq!(gathered.finish("h").unwrap(), "{}");
    let message = |reason: &str| json!({ "type": "message", "content": [], "stop_reason": reason });
    assert_eq!(finished(WireKind::Anthropic, &[message("refusal")]).unwrap_err().code(), "declined");
    assert_eq!(finished(WireKind::Anthropic, &[message("max_tokens")]).unwrap_err().code(), "cut_off");
    let error = json!({ "type": "error", "error": { "type": "overloaded_error", "message": "Overloaded" } });
    let error = finished(WireKind::Anthropic, &[error]).unwrap_err();
    assert_eq!((error.code(), error.may_retry()), ("overloaded", true));
}

#[test]
fn errors_are_read_in_every_vendors_form() {
    let of = |status, object: Value| error_of("h", status, &object).unwrap();
    let quota = of(
        429,
        json!([{ "error": { "code": 429, "message": "Quota", "status": "RESOURCE_EXHAUSTED", "details": [
        { "@type": "type.googleapis.com/google.rpc.QuotaFailure" }, { "retryDelay": "46s" }] } }]),
    );
    assert_eq!(quota.retry_after(), Some(Duration::from_secs(46)));
    assert_eq!(quota.to_string(), "h returned HTTP 429 (RESOURCE_EXHAUSTED): Quota");
    let broke = of(429, json!({ "error": { "message": "m", "type": "insufficient_quota", "code": "insufficient_quota" } }));
    assert!(!broke.may_retry());
    let within = of(200, json!({ "error": { "code": 502, "message": "Provider" } }));
    assert_eq!((within.code(), within.may_retry()), ("server_error", true));
    assert_eq!(
        of(400, json!({ "object": "error", "message": "too long", "type": "BadRequestError", "code": 400 })).code(),
        "bad_request"
    );
    assert_eq!(of(500, json!({ "error": "model not found" })).to_string(), "h returned HTTP 500: model not found");
    assert_eq!(error_of("h", 200, &json!({ "error": null, "status": "completed" })), None);
    for (status, retry) in [
        (400, false),
        (401, false),
        (402, false),
        (403, false),
        (404, false),
        (408, true),
        (409, true),
        (413, false),
        (422, false),
        (429, true),
        (500, true),
        (503, true),
        (529, true),
    ] {
        assert_eq!(of(status, json!({ "error": { "message": "m" } })).may_retry(), retry, "{status}");
    }
}

proptest::proptest! {
    #[test]
    fn no_object_panics(text in "[\\[\\]{}\":,a-z_0-9 ]{0,80}", key in "(candidates|choices|type|error|output|promptFeedback|usage)", value in "(null|1|\"a\"|\\[\\]|\\[1\\]|\\{\\}|\\[\\{\\}\\])") {
        for text in [text, format!("{{\"{key}\":{value}}}")] {
            let Ok(object) = serde_json::from_str::<Value>(&text) else { continue };
            for wire in [WireKind::Gemini, WireKind::OpenaiChat, WireKind::OpenaiResponses, WireKind::Anthropic] {
                let _ = read(wire, std::slice::from_ref(&object));
            }
        }
    }
}

/// The text of a reply is found wherever servers put it.
#[test]
fn a_reply_in_another_place_is_read() {
    let chat = WireKind::OpenaiChat;
    let message = |message: Value| json!({ "choices": [{ "message": message, "finish_reason": "stop" }] });
    let delta = |delta: Value| json!({ "choices": [{ "delta": delta }] });
    let call =
        |arguments: Value| json!([{ "id": "1", "type": "function", "function": { "name": "reply", "arguments": arguments } }]);
    let reply = r#"{"a":1}"#;
    for said in [
        json!({ "content": [{ "type": "text", "text": reply }] }),
        json!({ "content": [{ "type": "thinking", "thinking": [{ "type": "text", "text": "hm" }] }, { "type": "text", "text": reply }] }),
        json!({ "content": [reply] }),
        json!({ "content": "", "reasoning_content": reply }),
        json!({ "content": null, "reasoning": reply }),
        json!({ "content": null, "reasoning": reply, "reasoning_content": reply }),
        json!({ "content": null, "tool_calls": call(json!(reply)) }),
        json!({ "content": "", "tool_calls": call(json!({ "a": 1 })) }),
        json!({ "content": null, "function_call": { "name": "reply", "arguments": reply } }),
        // What is said aloud counts more than thoughts.
        json!({ "content": reply, "reasoning_content": "{\"a\":2}" }),
    ] {
        assert_eq!(finished(chat, &[message(said.clone())]).as_deref(), Ok(reply), "{said}");
    }
    let pieces = |name: &str| {
        let piece = |text: &str| match name {
            "tool_calls" => delta(json!({ "tool_calls": [{ "index": 0, "function": { "arguments": text } }] })),
            "content" => delta(json!({ "content": [{ "type": "text", "text": text }] })),
            name => delta(json!({ "content": null, name: text })),
        };
        [piece("{\"a\""), piece(":1}"), json!({ "choices": [{ "delta": {}, "finish_reason": "stop" }] })]
    };
    for name in ["reasoning_content", "reasoning", "tool_calls", "content"] {
        assert_eq!(finished(chat, &pieces(name)).as_deref(), Ok(reply), "{name}");
    }
    // Thoughts without a reply are none, and neither are those that the limit cut off.
    assert_eq!(finished(chat, &[message(json!({ "content": "", "reasoning": "I see a crane" }))]).unwrap_err().code(), "empty");
    let mut cut = message(json!({ "content": "", "reasoning": reply }));
    cut["choices"][0]["finish_reason"] = json!("length");
    assert_eq!(finished(chat, &[cut]).unwrap_err().code(), "cut_off");

    let gemini = json!({ "candidates": [{ "content": { "parts": [{ "functionCall": { "name": "reply", "args": { "a": 1 } } }] },
        "finishReason": "STOP" }] });
    assert_eq!(finished(WireKind::Gemini, &[gemini]).as_deref(), Ok(reply));
    let anthropic = json!({ "type": "message", "content": [{ "type": "tool_use", "id": "1", "name": "reply", "input": { "a": 1 } }],
        "stop_reason": "tool_use" });
    assert_eq!(finished(WireKind::Anthropic, &[anthropic]).as_deref(), Ok(reply));
    let part = |text: &str| json!({ "type": "content_block_delta", "index": 0, "delta": { "type": "input_json_delta", "partial_json": text } });
    let start = json!({ "type": "message_start", "message": { "model": "m", "content": [] } });
    let end = json!({ "type": "message_delta", "delta": { "stop_reason": "tool_use" } });
    assert_eq!(finished(WireKind::Anthropic, &[start, part("{\"a\""), part(":1}"), end]).as_deref(), Ok(reply));
    let item = json!({ "type": "function_call", "name": "reply", "arguments": reply });
    let ended = json!({ "type": "response.completed", "response": { "status": "completed", "output": [item] } });
    let piece = json!({ "type": "response.function_call_arguments.delta", "delta": reply });
    assert_eq!(finished(WireKind::OpenaiResponses, std::slice::from_ref(&ended)).as_deref(), Ok(reply));
    assert_eq!(finished(WireKind::OpenaiResponses, &[piece, ended]).as_deref(), Ok(reply));
}

#[test]
fn a_context_that_is_too_short_names_what_helps() {
    let of = |status, message: &str, code: Value| {
        error_of("h", status, &json!({ "error": { "message": message, "code": code } })).unwrap()
    };
    for error in [
        of(
            400,
            "This model's maximum context length is 4096 tokens. However, you requested 5120 tokens",
            json!("context_length_exceeded"),
        ),
        of(400, "'max_completion_tokens' is too large: 4096. This model's maximum context length is 2048 tokens", json!(400)),
        of(400, "the request exceeds the available context size, try increasing it", json!("exceed_context_size_error")),
    ] {
        assert!(error.is_context(), "{error}");
        for words in ["-c", "--max-model-len", "num_ctx", "max_output_tokens", "vlm.image_long_side"] {
            assert!(error.to_string().contains(words), "{words}: {error}");
        }
    }
    assert!(!of(400, "bad image", Value::Null).is_context() && !of(429, "context length", Value::Null).is_context());
}

#[test]
fn a_quota_of_a_day_is_told_from_one_of_a_minute() {
    let of = |quota: &str| {
        error_of(
            "h",
            429,
            &json!({ "error": { "code": 429, "message": "You exceeded your current quota", "status": "RESOURCE_EXHAUSTED", "details": [
                { "violations": [{ "quotaId": quota }] }, { "retryDelay": "46s" }] } }),
        )
        .unwrap()
    };
    let (day, minute) =
        (of("GenerateRequestsPerDayPerProjectPerModel-FreeTier"), of("GenerateRequestsPerMinutePerProjectPerModel"));
    assert!(day.is_exhausted() && !day.may_retry() && day.to_string().contains("PerDay"), "{day}");
    assert!(!minute.is_exhausted() && minute.may_retry(), "{minute}");
}

//! Single requests over each vendor's wire: parameters that are refused, sockets that hang, costs that are told.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

use serde_json::{Value, json};
use spf_vlm::setup::Access;
use spf_vlm::table::Table;
use spf_vlm::{Answer, QueryImage, QueryRequest, Remote, RequestOptions, Vlm, VlmError, setup};

use super::server::{Piece, Reply, Request, Server};
use super::vendors::Vendor;
use super::{AHEAD, KEY};

struct Grey;

impl QueryImage for Grey {
    fn size(&self) -> (u32, u32) {
        (64, 48)
    }

    fn jpeg(&mut self, _: (u32, u32), _: u8) -> Result<Arc<[u8]>, VlmError> {
        Ok(Arc::new([0xff, 0xd8]))
    }
}

fn remote(server: &Server, name: &str, rows: &str) -> Remote {
    let table = Table::shipped().extended(rows).unwrap();
    let (key, send_to) = (|_: &str| Some(KEY.to_owned()), [server.host()]);
    // No variable sets another place.
    let access = Access { keys: &key, places: &|_| None, send_to: &send_to };
    setup::remote(&table, &[format!("{name}@{}", server.url()).as_str().into()], access, RequestOptions::default()).unwrap()
}

fn ask(remote: &mut Remote) -> Answer {
    let query = super::check::query();
    remote.answer(&QueryRequest::new(&query, Duration::from_secs(60)), &mut Grey)
}

/// Refuses whatever has the parameter at this place.
fn refusing(vendor: Vendor, pointer: &'static str, message: &'static str) -> Server {
    let error = match vendor {
        Vendor::Gemini => json!({ "error": { "code": 400, "status": "INVALID_ARGUMENT", "message": message } }),
        Vendor::Anthropic => json!({ "type": "error", "error": { "type": "invalid_request_error", "message": message } }),
        _ => json!({ "error": { "message": message, "type": "invalid_request_error", "param": null, "code": null } }),
    };
    Server::start(move |_, request: &Request| match request.json().pointer(pointer) {
        Some(_) => Reply::json(400, &error),
        None => vendor.stream(&vendor.model(request), AHEAD),
    })
}

#[test]
fn a_refused_parameter_costs_one_request() {
    for (vendor, pointer, message) in [
        (
            Vendor::Gemini,
            "/generationConfig/thinkingConfig",
            "Invalid JSON payload received. Unknown name \"thinkingLevel\" at 'generation_config.thinking_config': Cannot find field.",
        ),
        (Vendor::OpenAi, "/reasoning", "Unsupported parameter: 'reasoning.effort' is not supported with this model."),
        (Vendor::Chat, "/chat_template_kwargs", "Unrecognized request argument supplied: chat_template_kwargs"),
        (Vendor::Anthropic, "/output_config/effort", "output_config.effort: Extra inputs are not permitted"),
    ] {
        let server = refusing(vendor, pointer, message);
        let mut remote = remote(&server, vendor.name(), "");
        let first = ask(&mut remote);
        assert_eq!(first.text.as_deref(), Ok(AHEAD), "{vendor:?}");
        let again = ask(&mut remote);
        assert_eq!((first.account.requests, again.account.requests), (2, 1), "{vendor:?}");
        // Nothing else is left out: the schema, above all.
        let bodies: Vec<Value> = server.questions().iter().map(Request::json).collect();
        assert_eq!(bodies[1], bodies[2], "{vendor:?}");
        assert!(bodies[1].to_string().contains("\"required\""), "{vendor:?}");
    }
    // It was not the parameter: the error is told, and nothing is left out the next time.
    let server = Server::start(|_, _| Reply::json(400, &json!({ "error": { "message": "reasoning is off today" } })));
    let mut remote = remote(&server, "openai", "");
    assert_eq!(ask(&mut remote).text.unwrap_err().code(), "bad_request");
    assert_eq!(ask(&mut remote).text.unwrap_err().code(), "bad_request");
    let bodies: Vec<Value> = server.questions().iter().map(Request::json).collect();
    assert_eq!(bodies.len(), 4);
    assert!(bodies[0].get("reasoning").is_some() && bodies[1].get("reasoning").is_none());
    assert_eq!(bodies[0], bodies[2]);
}

#[test]
fn a_hung_socket_costs_its_models_timeout_and_no_more() {
    let rows: String = ["gemini", "openai", "vllm", "anthropic"]
        .map(|vendor| {
            format!(
                "[[model]]\nid = \"quick\"\nvendor = \"{vendor}\"\nstatus = \"current\"\n\
                 timeouts = {{ connect_s = 2.0, first_byte_s = 0.5, whole_s = 30.0 }}\n"
            )
        })
        .concat();
    for vendor in Vendor::ALL {
        // A head without a body, as servers send that begin to think.
        let hang = Reply { pieces: vec![Piece::Hang], ..Reply::new(200, "text/event-stream", "") };
        let server = Server::start(
            move |number, request| {
                if number == 0 { hang.clone() } else { vendor.stream(&vendor.model(request), AHEAD) }
            },
        );
        let mut remote = remote(&server, &format!("{}#quick", vendor.name()), &rows);
        let answer = ask(&mut remote);
        assert_eq!((answer.text.as_deref(), answer.account.requests), (Ok(AHEAD), 2), "{vendor:?}");
        assert!(answer.latency >= Duration::from_millis(500) && answer.latency < Duration::from_secs(20), "{:?}", answer.latency);
        assert_eq!(server.connections.load(Ordering::SeqCst), 2, "{vendor:?}: the hung connection is not used again");
        // What was dropped may be charged.
        assert!(answer.account.tokens.estimated, "{vendor:?}");
    }
    // Always: it has a name, within the query's time.
    let server = Server::start(|_, _| Reply { pieces: vec![Piece::Hang], ..Reply::new(200, "text/event-stream", "") });
    let mut remote = remote(&server, "vllm#quick", &rows);
    let query = super::check::query();
    let answer = remote.answer(&QueryRequest::new(&query, Duration::from_millis(1800)), &mut Grey);
    assert!(matches!(answer.text.as_ref().map_err(VlmError::code), Err("timeout" | "deadline")), "{:?}", answer.text);
    assert!(answer.account.requests >= 2, "{:?}", answer.account);
}

#[test]
fn openrouter_is_asked_for_what_the_model_has_and_its_costs_are_read() {
    let told = |cost: f64| {
        Server::start(move |_, request| {
            let mut events = Vendor::Chat.events(request.json()["model"].as_str().unwrap(), AHEAD);
            events.last_mut().unwrap()["usage"]["cost"] = cost.into();
            // The costs come a moment after the reply.
            let all: Vec<String> = events.iter().map(|event| format!("data: {event}\n\n")).collect();
            let (reply, costs) = all.split_at(all.len() - 1);
            let pieces = vec![Piece::Bytes(reply.concat().into_bytes()), Piece::Bytes(costs.concat().into_bytes())];
            Reply { pieces, ..Reply::new(200, "text/event-stream", "") }
        })
    };
    let server = told(0.0123);
    let answer = ask(&mut remote(&server, "openrouter", ""));
    assert_eq!((answer.text.as_deref(), answer.account.cost_usd), (Ok(AHEAD), Some(0.0123)));
    let body = server.questions()[0].json();
    // A listed model: every server must have what is sent, so nothing is sent that the model lacks.
    assert_eq!((&body["provider"]["require_parameters"], body.get("reasoning")), (&true.into(), None), "{body}");
    assert!(body.get("response_format").is_some() && body["provider"]["sort"] == "latency", "{body}");
    let server = told(0.5);
    let answer = ask(&mut remote(&server, "openrouter#some/model", ""));
    assert_eq!(answer.account.cost_usd, Some(0.5));
    let body = server.questions()[0].json();
    assert_eq!((body["provider"].get("require_parameters"), &body["reasoning"]["effort"]), (None, &"none".into()), "{body}");
}

#[test]
fn depth_labels_of_ones_own_are_put_right() {
    let rows = "[[model]]\nid = \"own\"\nvendor = \"vllm\"\nstatus = \"current\"\n\
                depth_m = [0.5, 1, 2, 4, 8, 16, 32, 64, 128, 256]\n";
    let server = Server::start(|_, request| Vendor::Chat.stream(&Vendor::Chat.model(request), AHEAD));
    let label = |name: &str| -> Value {
        let answer = ask(&mut remote(&server, &format!("vllm#{name}"), rows));
        serde_json::from_str::<Value>(&answer.text.unwrap()).unwrap()["depth"].clone()
    };
    // Its label 6 means 16 m: 1 + 4.5·log10(16) = 6.4; another model's 6 is left alone.
    assert_eq!((label("own"), label("other")), (6.into(), 6.into()));
    let rows = rows.replace("16, 32", "30, 32");
    let answer = ask(&mut remote(&server, "vllm#own", &rows));
    // 30 m: 7.6.
    assert_eq!(serde_json::from_str::<Value>(&answer.text.unwrap()).unwrap()["depth"], 8);
}

fn chat(message: &Value, reason: &str, tokens: u64) -> Reply {
    Reply::json(
        200,
        &json!({ "model": "m", "choices": [{ "message": message, "finish_reason": reason }],
            "usage": { "prompt_tokens": 900, "completion_tokens": tokens } }),
    )
}

#[test]
fn an_answer_that_came_and_was_empty_is_paid_for_twice_at_most() {
    let empty = || chat(&json!({ "content": "" }), "stop", 5);
    let server = Server::start(move |_, _| empty());
    let answer = ask(&mut remote(&server, "vllm", ""));
    assert_eq!(answer.text.unwrap_err().code(), "empty");
    assert_eq!((server.questions().len(), answer.account.requests, answer.account.tokens.input), (2, 2, 1800));
    // One of the other kind, that the model broke off, is no better.
    let broken = json!({ "candidates": [{ "content": { "parts": [] }, "finishReason": "MALFORMED_RESPONSE" }] });
    let server = Server::start(move |_, _| Reply::json(200, &broken));
    assert_eq!(ask(&mut remote(&server, "gemini", "")).text.unwrap_err().code(), "error_in_answer");
    assert_eq!(server.questions().len(), 2);
    let server =
        Server::start(move |number, _| if number == 0 { empty() } else { chat(&json!({ "content": AHEAD }), "stop", 50) });
    assert_eq!(ask(&mut remote(&server, "vllm", "")).text.as_deref(), Ok(AHEAD));
}

#[test]
fn a_server_that_knows_only_the_older_limit_is_told_by_it() {
    let server = Server::start(|_, request| match request.json().get("max_tokens") {
        // Its own limit, and no word about the parameter that it ignored.
        None => chat(&json!({ "content": &AHEAD[..30] }), "length", 16),
        Some(_) => chat(&json!({ "content": AHEAD }), "stop", 50),
    });
    let mut own = remote(&server, "vllm", "");
    let first = ask(&mut own);
    assert_eq!((first.text.as_deref(), first.account.requests), (Ok(AHEAD), 2));
    assert_eq!(ask(&mut own).account.requests, 1);
    let bodies: Vec<Value> = server.questions().iter().map(Request::json).collect();
    assert_eq!((&bodies[1]["max_tokens"], bodies[1].get("max_completion_tokens")), (&4096.into(), None));
    assert_eq!(bodies[2]["max_tokens"], 4096);
    // A reply at the limit that was asked for is not asked for again, and one that is cut anyway keeps the newer name.
    for (tokens, requests) in [(4096, 1), (16, 2)] {
        let server = Server::start(move |_, _| chat(&json!({ "content": "{" }), "length", tokens));
        let mut own = remote(&server, "vllm", "");
        assert_eq!(ask(&mut own).text.unwrap_err().code(), "cut_off");
        assert_eq!(server.questions().len(), requests, "{tokens}");
        drop(ask(&mut own));
        let again = server.questions()[requests].json();
        assert!(again.get("max_completion_tokens").is_some(), "{again}");
    }
}

#[test]
fn an_object_that_is_refused_is_asked_for_in_words() {
    let rows = "[[vendor]]\nname = \"own\"\ntitle = \"own\"\nwire = \"openai-chat\"\nbase_url = \"http://127.0.0.1:9/v1\"\n\
                auth = \"bearer\"\nkeys = [\"OWN_KEY\"]\nkey_needed = false\nfamily = \"thousand\"\nschema = \"json_object\"\n";
    for message in
        ["'response_format.type' must be 'json_schema' or 'text'", "json_object is not supported", "JSON mode is not enabled"]
    {
        let server = Server::start(move |_, request| match request.json().pointer("/response_format/type") {
            Some(kind) => {
                assert_eq!(kind, "json_object");
                Reply::json(400, &json!({ "error": message }))
            }
            None => Vendor::Chat.stream("m", AHEAD),
        });
        let mut own = remote(&server, "own#m", rows);
        assert_eq!(ask(&mut own).text.as_deref(), Ok(AHEAD), "{message}");
        assert_eq!((ask(&mut own).account.requests, server.questions().len()), (1, 3), "{message}");
    }
}

/// The parameter that such an error names has nothing to do with it.
#[test]
fn a_context_that_is_too_short_is_not_asked_again() {
    let message = "'max_completion_tokens' is too large: 4096. This model's maximum context length is 2048 tokens.";
    let server = Server::start(move |_, _| Reply::json(400, &json!({ "error": { "message": message, "code": 400 } })));
    let error = ask(&mut remote(&server, "vllm", "")).text.unwrap_err();
    assert!(error.is_context() && error.to_string().contains("--max-model-len"), "{error}");
    assert_eq!(server.questions().len(), 1);
}

#[test]
fn a_reply_in_thoughts_or_in_a_tool_call_is_one() {
    let events = |delta: Value| {
        let event = json!({ "model": "m", "choices": [{ "delta": delta, "finish_reason": "stop" }] });
        Reply::new(200, "text/event-stream", format!("data: {event}\n\ndata: [DONE]\n\n"))
    };
    for delta in [
        json!({ "content": null, "reasoning_content": AHEAD }),
        json!({ "content": "", "reasoning": AHEAD }),
        json!({ "content": [{ "type": "text", "text": AHEAD }] }),
        json!({ "tool_calls": [{ "index": 0, "function": { "name": "spf_reply", "arguments": AHEAD } }] }),
    ] {
        let reply = events(delta.clone());
        let server = Server::start(move |_, _| reply.clone());
        let answer = ask(&mut remote(&server, "vllm", ""));
        assert_eq!((answer.text.as_deref(), answer.account.requests), (Ok(AHEAD), 1), "{delta}");
    }
}

#[test]
fn another_model_than_the_one_asked_for_is_named_in_the_log() {
    let server = Server::start(|number, request| {
        let model = if number == 1 { Vendor::Gemini.model(request) } else { "gemini-3.8-flash".to_owned() };
        Vendor::Gemini.stream(&model, AHEAD)
    });
    let asked = |remote: &mut Remote| ask(remote).account.asked_model;
    let mut gemini = remote(&server, "gemini", "");
    assert_eq!(asked(&mut gemini).as_deref(), Some("gemini-robotics-er-2-preview"));
    assert_eq!(asked(&mut gemini), None);
    // A server of one's own has names of its own.
    let own = Server::start(|_, _| Vendor::Chat.stream("/models/a.gguf", AHEAD));
    assert_eq!(asked(&mut remote(&own, "vllm", "")), None);
    // The column, and one warning for all queries.
    let lab = crate::harness::Lab::new();
    let always = Server::start(|_, _| Vendor::Gemini.stream("gemini-3.8-flash", AHEAD));
    let vlm = format!("gemini@{}", always.url());
    let args = ["fly", "fly to the red crane", "--vlm", &vlm, "--no-video", "--max-queries", "3", "--out", "mine"];
    let run = crate::harness::Run::of(&lab.command(&args).env("GEMINI_API_KEY", KEY).output().unwrap());
    assert_eq!(
        run.stderr.matches("requested gemini-robotics-er-2-preview, served by gemini-3.8-flash").count(),
        1,
        "{}",
        run.stderr
    );
    let rows = crate::harness::rows(&lab.path("mine/vlm.jsonl"));
    let named = |row: &Value| row["model"] == "gemini-3.8-flash" && row["asked_model"] == "gemini-robotics-er-2-preview";
    assert!(rows.len() >= 3 && rows.iter().all(named), "{rows:?}");
}

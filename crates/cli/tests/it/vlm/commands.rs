//! User input: names, prompts, recordings, cost limits, the list.

use std::collections::BTreeMap;

use serde_json::Value;

use super::server::{Reply, Server};
use super::vendors::Vendor;
use super::{AHEAD, DONE, fly};
use crate::harness::Lab;

/// Ahead three times, then done, twice.
fn crane(vendor: Vendor) -> Server {
    Server::start(move |number, request| vendor.stream(&vendor.model(request), if number < 3 { AHEAD } else { DONE }))
}

#[test]
fn a_flight_reports_its_usage() {
    let (lab, server) = (Lab::new(), crane(Vendor::Gemini));
    let (code, summary) = fly(&lab, &server, Vendor::Gemini, "mine", &[]);
    // It believes that it has arrived, but the ground truth disagrees.
    assert_eq!((code, &summary["outcome"]), (3, &"reached".into()), "{summary}");
    let used = &summary["vlm_use"];
    assert_eq!((&used["questions"], &used["requests"]), (&5.into(), &5.into()), "{used}");
    assert_eq!(used["models"], serde_json::json!({ "gemini-robotics-er-2-preview": 5 }));
    assert_eq!(used["tokens_in"], 6000);
    // 5·1200 input tokens at 1 $ and the output tokens at 5 $ per million.
    let out = used["tokens_out"].as_f64().unwrap() + used["tokens_thinking"].as_f64().unwrap();
    assert!((used["cost_usd"].as_f64().unwrap() - (6000.0 + 5.0 * out) / 1e6).abs() < 1e-12, "{used}");
    let medians = ["encode_s", "upload_s", "first_text_s", "complete_s"].map(|part| used["median_parts"][part].as_f64().unwrap());
    assert!(medians[0] > 0.0 && medians.iter().sum::<f64>() < 60.0, "{used}");
    let rows = crate::harness::rows(&lab.path("mine/vlm.jsonl"));
    assert_eq!(rows.len(), 5);
    for row in &rows {
        let parts = &row["parts"];
        let order = ["encoded_s", "uploaded_s", "head_s", "first_text_s", "complete_s"].map(|part| parts[part].as_f64().unwrap());
        assert!(order.is_sorted() && order[4] <= row["latency_s"].as_f64().unwrap(), "{row}");
        assert!((10_000..130_000).contains(&row["bytes_sent"].as_u64().unwrap()), "{row}");
    }
    let run =
        lab.command(&["fly", "go", "--no-video", "--out", "said", "--vlm", &format!("gemini@{}", crane(Vendor::Gemini).url())]);
    let run = crate::harness::Run::of(&{ run }.env("GEMINI_API_KEY", super::KEY).output().unwrap());
    assert!(run.stdout.contains("VLM: gemini-robotics-er-2-preview, 5 queries") && run.stdout.contains('$'), "{}", run.stdout);
    assert!(run.stderr.contains("gemini-robotics-er-2-preview from Google Gemini at http://127.0.0.1"), "{}", run.stderr);
}

/// The files of a flight that depend on the flight alone.
fn files(lab: &Lab, name: &str) -> BTreeMap<String, Vec<u8>> {
    // The log contains the wall clock (docs/reference/flight-log.md).
    let names = lab.names(name).into_iter().filter(|file| file != "flight.mcap");
    names.map(|file| (file.clone(), lab.read(&format!("{name}/{file}")))).collect()
}

#[test]
fn a_recording_flies_the_same_flight_again_bit_for_bit() {
    let (lab, server) = (Lab::new(), crane(Vendor::Anthropic));
    // One query fails during the flight, which is recorded as well.
    let failing = Server::start(move |number, request| match number {
        1 => Reply::json(400, &serde_json::json!({ "error": { "type": "invalid_request_error", "message": "no" } })),
        0 | 2 => Vendor::Anthropic.stream(&Vendor::Anthropic.model(request), &AHEAD.replace("[480,500]", "[500,480]")),
        _ => Vendor::Anthropic.stream(&Vendor::Anthropic.model(request), DONE),
    });
    for (name, server) in [("good", &server), ("failing", &failing)] {
        let tape = format!("{name}.jsonl");
        let (code, _) = fly(&lab, server, Vendor::Anthropic, name, &["--vlm-record", &tape]);
        let again = format!("{name}-again");
        let (again_code, _) = lab.fly(&again, &["fly to the red crane", "--vlm", &format!("replay:{tape}")]);
        assert_eq!(code, again_code);
        assert_eq!(files(&lab, name), files(&lab, &again), "{name}");
        assert!(files(&lab, name).contains_key("vlm.jsonl"));
    }
    // Another instruction is another flight.
    let (code, summary) = lab.fly("other", &["fly to the bridge", "--vlm", "replay:good.jsonl"]);
    assert_eq!((code, &summary["outcome"]), (6, &"failed".into()), "{summary}");
    // Existing files are not overwritten.
    let run = lab.spf(&["fly", "go", "--vlm", "replay:good.jsonl", "--vlm-record", "good.jsonl", "--no-video"]);
    assert_eq!(run.code, Some(2), "{}", run.stderr);
    let run = lab.spf(&["fly", "go", "--vlm", "replay:none.jsonl"]);
    assert!(run.code == Some(2) && run.stderr.contains("--vlm-record"), "{}", run.stderr);
}

#[test]
fn spent_money_ends_the_flight() {
    let (lab, server) = (Lab::new(), Server::start(|_, request| Vendor::Gemini.stream(&Vendor::Gemini.model(request), AHEAD)));
    // A query costs about 0.0013 $.
    let (code, summary) = fly(&lab, &server, Vendor::Gemini, "mine", &["--max-cost", "0.003"]);
    assert_eq!((code, &summary["outcome"]), (5, &"aborted".into()), "{summary}");
    assert!(summary["cause"].as_str().unwrap().contains("of $0.003 (--max-cost)"), "{summary}");
    assert_eq!(server.questions().len(), 3);
    let run = lab.spf(&["fly", "go", "--vlm", "ollama", "--max-cost", "1"]);
    assert!(run.code == Some(2) && run.stderr.contains("--max-cost requires a known price"), "{}", run.stderr);
}

#[test]
fn prompts_are_files() {
    let (lab, server) = (Lab::new(), crane(Vendor::OpenAi));
    lab.write("mine.txt", "spf-prompt point mine-3\nGo: {{instruction}}. {{coordinates}} {{scale}}\n");
    let (_, summary) = fly(&lab, &server, Vendor::OpenAi, "mine", &["--prompt", "mine.txt"]);
    assert_eq!(summary["prompt"], "point-mine-3");
    let told = server.questions()[0].json()["input"][0]["content"][1]["text"].as_str().unwrap().to_owned();
    assert!(told.starts_with("Go: fly to the red crane. Points are [x, y]") && told.contains("in pixels"), "{told}");
    let again = lab.spf(&["replay", "mine/flight.mcap"]);
    assert!(again.code == Some(0) && again.stdout.starts_with("no difference"), "{}{}", again.stdout, again.stderr);
    lab.write("wrong.txt", "spf-prompt point 1\n{{instruction}} {{colour}}\n");
    let run = lab.spf(&["fly", "go", "--prompt", "wrong.txt"]);
    assert!(run.code == Some(2) && run.stderr.contains("line 2: unknown variable `{{colour}}`"), "{}", run.stderr);
    let run = lab.spf(&["fly", "go", "--prompt", "mine.txt", "--policy", "plain"]);
    assert!(run.code == Some(2) && run.stderr.contains("spf-prompt plain"), "{}", run.stderr);
}

/// The frames of a flight are rendered again for another model, which is queried at its own size and in its own
/// coordinates.
#[test]
fn a_model_is_queried_about_the_frames_of_a_flight() {
    let lab = Lab::new();
    lab.fly("mine", &["fly to the red crane", "--max-time", "15"]);
    let fails = serde_json::json!({ "error": { "message": "no", "type": "invalid_request_error" } });
    let server = Server::start(move |number, request| match number {
        1 => Reply::json(400, &fails),
        _ => Vendor::OpenAi.stream(&Vendor::OpenAi.model(request), &AHEAD.replace("[480,500]", "[384,288]")),
    });
    let vlm = format!("openai@{}", server.url());
    let args = ["replay", "mine/flight.mcap", "--vlm", &vlm, "--out", "pictures", "--json"];
    let run = crate::harness::Run::of(&lab.command(&args).env("OPENAI_API_KEY", super::KEY).output().unwrap());
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let told: Value = serde_json::from_str(&run.stdout).unwrap();
    let opinions = told["opinions"].as_array().unwrap();
    let questions = server.questions();
    assert!(opinions.len() >= 3 && opinions.len() == questions.len(), "{told}");
    assert_eq!(lab.names("pictures").len(), opinions.len());
    let middle = serde_json::json!({ "u": 0.5, "v": 0.5 });
    for (index, (opinion, request)) in opinions.iter().zip(&questions).enumerate() {
        assert_eq!(opinion["failed"].is_null(), index != 1, "{opinion}");
        assert!(index == 1 || (opinion["now"]["point"] == middle && opinion["cost_usd"].as_f64().unwrap() > 0.0), "{opinion}");
        let words = request.json()["input"][0]["content"][1]["text"].as_str().unwrap().to_owned();
        assert!(words.contains("fly to the red crane") && words.contains("in pixels of this image, 768 wide"), "{words}");
        let image = spf_media::jpeg::decode(&Vendor::OpenAi.image(request)).unwrap();
        assert_eq!((image.width(), image.height()), (768, 576));
    }
    let run = lab.spf(&["replay", "mine/flight.mcap", "--vlm", "replay:some.jsonl"]);
    assert!(run.code == Some(2) && run.stderr.contains("its own flight"), "{}", run.stderr);
}

#[test]
fn a_query_that_cannot_be_sent_is_reported_before_anything_flies() {
    let lab = Lab::new();
    for (args, message) in [
        (vec!["--vlm", "gemini"], vec!["no API key set for Google Gemini", "set GOOGLE_API_KEY or GEMINI_API_KEY", "https://"]),
        (vec!["--vlm", "auto"], vec!["no API key set for any vendor", "ANTHROPIC_API_KEY"]),
        (vec!["--vlm", "gemni"], vec!["did you mean `gemini`?"]),
        (
            vec!["--vlm", "gemini#gemini-2.0-flash"],
            vec!["was retired by Google Gemini on 2026-06-01", "--vlm gemini#gemini-3.5-flash-lite"],
        ),
        (vec!["--vlm", "anthropic#claude-3-7-sonnet"], vec!["--vlm anthropic#claude-sonnet-5-5"]),
        (vec!["--vlm", "http://localhost:1/v1"], vec!["a model name is required", "http://localhost:1/v1#MODEL"]),
        (vec!["--vlm", "http://me:secret@localhost:1/v1#m"], vec!["set API keys in the environment"]),
        (vec!["--vlm", "vllm@http://localhost:1/v1?key=secret"], vec!["set API keys in the environment"]),
        (vec!["--vlm", "vllm@http://"], vec!["invalid server URL"]),
        (vec!["--vlm", "vllm", "--send-key-to", "http://h"], vec!["--send-key-to: expected HOST or HOST:PORT"]),
        (vec!["--vlm-models", "none.toml", "--vlm", "vllm"], vec!["cannot read the models file"]),
    ] {
        let run = lab.spf(&[&["fly", "go"], args.as_slice()].concat());
        assert_eq!(run.code, Some(2), "{args:?} {}", run.stderr);
        for words in message {
            assert!(run.stderr.contains(words), "{args:?} {words}: {}", run.stderr);
        }
    }
    assert_eq!(lab.names("."), Vec::<String>::new());
}

#[test]
fn auto_takes_the_first_vendor_whose_key_is_set() {
    let (lab, server) = (Lab::new(), crane(Vendor::OpenAi));
    lab.write(".env", format!("OPENAI_API_KEY={}\nANTHROPIC_API_KEY=sk-other-key\n", super::KEY));
    let host = server.host().to_string();
    let args = ["fly", "fly to the red crane", "--vlm", "auto", "--send-key-to", &host, "--json", "--no-video", "--out", "mine"];
    let output = lab.command(&args).env("OPENAI_BASE_URL", server.url()).output().unwrap();
    let run = crate::harness::Run::of(&output);
    let summary: Value = serde_json::from_str(&run.stdout).unwrap_or_else(|error| panic!("{error}\n{}", run.stderr));
    assert_eq!((&summary["vlm"], &summary["vlm_use"]["models"]["gpt-6-luna"]), (&"openai".into(), &5.into()), "{summary}");
    assert_eq!(server.questions()[0].header("authorization"), Some(format!("Bearer {}", super::KEY).as_str()));
}

#[test]
fn the_list_names_every_model_and_its_end() {
    let lab = Lab::new();
    let run = lab.spf(&["vlm", "list"]);
    assert_eq!((run.code, run.stderr.as_str()), (Some(0), ""));
    insta::assert_snapshot!(run.stdout);
    let run = crate::harness::Run::of(&lab.command(&["vlm", "list", "--json"]).env("GOOGLE_API_KEY", "x").output().unwrap());
    let rows: Vec<Value> = serde_json::from_str(&run.stdout).unwrap();
    let row = |vlm: &str| rows.iter().find(|row| row["vlm"] == vlm).unwrap_or_else(|| panic!("no {vlm}"));
    assert_eq!((&row("gemini")["key_set"], &row("openai")["key_set"]), (&true.into(), &false.into()));
    assert_eq!(row("gemini#gemini-2.0-flash")["successor"], "gemini-3.5-flash-lite");
}

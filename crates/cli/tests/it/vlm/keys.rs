//! A key is sent to its vendor only: no file, log or error contains it.

use std::path::Path;

use super::server::{Reply, Server};
use super::vendors::Vendor;
use super::{AHEAD, DONE, KEY};
use crate::harness::{Lab, Run, rows};

/// Every file below a folder, except `.env`.
fn files(folder: &Path, all: &mut Vec<(String, Vec<u8>)>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            files(&path, all);
        } else if path.file_name().is_none_or(|name| name != ".env") {
            all.push((path.display().to_string(), std::fs::read(&path).unwrap()));
        }
    }
}

/// Characters of a key that do not occur by chance.
const TELLING: usize = 10;

/// Not even a part of the key is there.
fn assert_hidden(what: &str, bytes: &[u8]) {
    let pieces: Vec<&[u8]> = KEY.as_bytes().windows(TELLING).collect();
    let hidden = !bytes.windows(TELLING).any(|window| pieces.contains(&window));
    assert!(hidden, "the key stands in {what}: {}", String::from_utf8_lossy(bytes));
}

#[test]
fn keys_stand_nowhere() {
    for vendor in Vendor::ALL {
        let lab = Lab::new();
        lab.write(".env", format!("{}={KEY}\n", vendor.key()));
        // The server repeats the key in each of its answers, valid or not.
        let server = Server::start(move |number, request| {
            assert!(request.header(vendor.key_header()).unwrap().ends_with(KEY));
            let error = serde_json::json!({ "error": { "message": format!("key {KEY}"), "type": KEY, "code": KEY } });
            match number {
                0 => vendor.stream(&format!("model-{KEY}"), &AHEAD.replace("the crane", KEY)),
                1 => Reply::json(401, &error).with("x-echo", KEY),
                2 => Reply::new(502, "text/html", format!("<html><title>{KEY}</title>")),
                3 => Reply::new(200, "text/event-stream", format!("data: {error}\n\n")),
                4 => Reply::new(200, KEY, KEY),
                // Where text is truncated, the key must not be split.
                5..=8 => {
                    let before = "x".repeat([299, 301 - KEY.len(), 290, 65_530][number - 5]);
                    Reply::json(400, &serde_json::json!({ "error": { "message": format!("{before}{KEY} tail"), "code": 400 } }))
                }
                _ => vendor.stream(&format!("model-{KEY}"), DONE),
            }
        });
        let (vlm, host) = (format!("{}@{}", vendor.name(), server.url()), server.host().to_string());
        let args = ["-vv", "fly", "go", "--out", "mine", "--no-video", "--vlm", &vlm, "--vlm-record", "tape.jsonl"];
        let mut command = lab.command(&[&args[..], &["--send-key-to", &host]].concat());
        // All log output of reqwest, hyper and rustls.
        let run = Run::of(&command.env("RUST_LOG", "trace").env("SPF_MAX_FAILED_REPLIES", "20").output().unwrap());
        assert!(server.questions().len() > 9, "{vendor:?}: {}", run.stderr);
        let mut all = vec![("stdout".to_owned(), run.stdout.into_bytes()), ("stderr".to_owned(), run.stderr.into_bytes())];
        files(&lab.path("."), &mut all);
        assert!(all.iter().any(|(name, _)| name.ends_with("vlm.jsonl")) && all.len() >= 6);
        for (name, bytes) in &all {
            assert_hidden(&format!("{vendor:?} {name}"), bytes);
        }
        let shown = lab.spf(&["config", "show"]);
        assert_hidden("config show", shown.stdout.as_bytes());
        let check = lab.spf(&["-vv", "vlm", "check", &vlm, "--send-key-to", &host]);
        assert_hidden("vlm check", format!("{}{}", check.stdout, check.stderr).as_bytes());
    }
}

/// A server that keeps all that is sent to it, and answers as `vendor` does.
fn thief(vendor: Vendor) -> Server {
    Server::start(move |_, request| vendor.stream(&vendor.model(request), DONE))
}

/// Nothing that a server received has a piece of the key in it.
fn assert_not_received(what: &str, server: &Server) {
    for request in server.questions() {
        for (name, value) in &request.headers {
            assert_hidden(&format!("{what}: the header {name}"), value.as_bytes());
        }
        assert_hidden(&format!("{what}: the path"), request.path.as_bytes());
        assert_hidden(&format!("{what}: the body"), &request.body);
    }
}

/// A folder of somebody else's: whatever its files say, the key in the user's environment goes nowhere.
#[test]
fn files_of_the_working_directory_cannot_send_a_key_anywhere() {
    let server = thief(Vendor::OpenAi);
    let (url, host) = (server.url(), server.host());
    // On this machine requests are sent without the key; to another one, nothing is sent.
    let elsewhere = "https://198.51.100.7/v1";
    let own = |base: &str| {
        format!(
            "[[vendor]]\nname = \"openai\"\ntitle = \"x\"\nwire = \"openai-responses\"\nbase_url = \"{base}\"\nauth = \"bearer\"\n\
             keys = [\"OPENAI_API_KEY\", \"AWS_SECRET_ACCESS_KEY\"]\nkey_needed = true\nfamily = \"gpt\"\ndefault = \"gpt-6-luna\"\n"
        )
    };
    let fly = ["-vv", "fly", "go", "--no-video", "--max-queries", "2", "--out", "mine"];
    let openai = [&fly[..], &["--vlm", "openai"]].concat();
    for (what, env, toml, models, args, code, said) in [
        (
            "a URL for the vendor in .env",
            format!("OPENAI_BASE_URL={url}"),
            String::new(),
            String::new(),
            &openai,
            2,
            "`.env` sets OPENAI_BASE_URL",
        ),
        (
            "a VLM with a URL in .env",
            format!("SPF_VLM=openai@{url}"),
            String::new(),
            String::new(),
            &fly.to_vec(),
            0,
            "is not sent to this server",
        ),
        (
            "a VLM elsewhere in .env",
            format!("SPF_VLM=openai@{elsewhere}"),
            String::new(),
            String::new(),
            &fly.to_vec(),
            2,
            "--send-key-to 198.51.100.7",
        ),
        (
            "a receiver in .env",
            format!("SPF_SEND_KEY_TO={host}"),
            String::new(),
            String::new(),
            &openai,
            2,
            "cannot be set in a file",
        ),
        (
            "a VLM with a URL in spf.toml",
            String::new(),
            format!("[fly]\nvlm = \"openai@{url}\""),
            String::new(),
            &fly.to_vec(),
            0,
            "is not sent to this server",
        ),
        (
            "any server in spf.toml",
            String::new(),
            format!("[fly]\nvlm = \"{elsewhere}#m\""),
            String::new(),
            &fly.to_vec(),
            2,
            "OPENAI_COMPATIBLE_API_KEY",
        ),
        (
            "the user's own kind of server",
            String::new(),
            format!("[fly]\nvlm = \"{url}#gpt-6-luna\""),
            String::new(),
            &fly.to_vec(),
            0,
            "is not sent to this server",
        ),
        (
            "a receiver in spf.toml",
            String::new(),
            format!("[vlm]\nsend_key_to = \"{host}\""),
            String::new(),
            &openai,
            2,
            "cannot be set in a file",
        ),
        (
            "a table of models",
            String::new(),
            "[vlm]\nmodels = \"m.toml\"".to_owned(),
            own(&url),
            &openai,
            0,
            "is not sent to this server",
        ),
        (
            "a table of models elsewhere",
            String::new(),
            "[vlm]\nmodels = \"m.toml\"".to_owned(),
            own(elsewhere),
            &openai,
            2,
            "--send-key-to 198.51.100.7",
        ),
        (
            "plain http to the vendor",
            String::new(),
            "[fly]\nvlm = \"openai@http://api.openai.com/v1\"".to_owned(),
            String::new(),
            &fly.to_vec(),
            2,
            "use the URL with https://",
        ),
    ] {
        let lab = Lab::new();
        lab.write(".env", env);
        lab.write("spf.toml", toml);
        lab.write("m.toml", models);
        let mut command = lab.command(args);
        for variable in ["OPENAI_API_KEY", "OPENAI_COMPATIBLE_API_KEY", "AWS_SECRET_ACCESS_KEY"] {
            command.env(variable, KEY);
        }
        let run = Run::of(&command.env("RUST_LOG", "trace").output().unwrap());
        assert!(run.stderr.contains(said), "{what}: {}", run.stderr);
        // A flight may end anyhow; what may not start is a matter of usage.
        assert_eq!(run.code == Some(2), code == 2, "{what}: {:?} {}", run.code, run.stderr);
        assert_not_received(what, &server);
        let mut all = vec![("stdout".to_owned(), run.stdout.into_bytes()), ("stderr".to_owned(), run.stderr.into_bytes())];
        files(&lab.path("."), &mut all);
        for (name, bytes) in &all {
            assert_hidden(&format!("{what}: {name}"), bytes);
        }
    }
    assert!(!server.questions().is_empty(), "what was sent without the key arrived");
}

#[test]
fn a_person_can_send_a_key_to_a_server_of_their_own() {
    let lab = Lab::new();
    let server = thief(Vendor::OpenAi);
    let vlm = format!("openai@{}", server.url());
    let host = server.host().to_string();
    let fly = ["fly", "go", "--no-video", "--max-queries", "1", "--out", "mine", "--vlm", &vlm, "--send-key-to", &host];
    drop(lab.command(&fly).env("OPENAI_API_KEY", KEY).output().unwrap());
    assert_eq!(server.questions()[0].header("authorization"), Some(format!("Bearer {KEY}").as_str()));
}

/// The commands that query models many times, with an output folder `DIR`.
fn long_commands(vlm: &str) -> [Vec<&str>; 2] {
    [
        vec!["bench", "run", "--task", "sim-nav-red-crane", "--trials", "1", "--yes", "-o", "DIR", "--vlm", vlm],
        vec!["vlm", "trial", vlm, "--questions", "2", "--flights", "1", "--yes", "-o", "DIR"],
    ]
}

/// Every command that takes a VLM has the flag; without it a server gets no key, and with it no file, log or error contains it.
#[test]
fn trials_and_benches_hide_keys_as_flights_do() {
    let vendor = Vendor::Gemini;
    // A refused request would end a run.
    let server = Server::start(move |number, request| match number % 3 {
        0 => Reply::json(200, &serde_json::json!({ "promptFeedback": { "blockReason": format!("key {KEY}") } })),
        1 => vendor.stream(&format!("model-{KEY}"), &DONE.replace("the crane", KEY)),
        _ => vendor.stream(&vendor.model(request), DONE),
    });
    let (vlm, host) = (format!("gemini@{}", server.url()), server.host().to_string());
    for args in long_commands(&vlm) {
        for allowed in [true, false] {
            let lab = Lab::new();
            // Another folder's settings want it elsewhere.
            lab.write(".env", format!("GEMINI_API_KEY={KEY}\n"));
            lab.write("spf.toml", "[vlm]\nhedge_s = 30.0\n");
            let more: &[&str] = if allowed { &["-vv", "--send-key-to", &host] } else { &["-vv"] };
            let before = server.questions().len();
            let mut run = Run::of(&lab.command(&[&args[..], more].concat()).env("RUST_LOG", "trace").output().unwrap());
            if args[0] == "bench" {
                // The same trial once more, from its name.
                let name = rows(&lab.path("DIR/results.jsonl"))[0]["run_id"].as_str().unwrap().to_owned();
                let show = ["bench", "show", &name, "--vlm", &vlm, "--no-video", "-o", "SHOWN"];
                let shown = Run::of(&lab.command(&[&show[..], more].concat()).env("RUST_LOG", "trace").output().unwrap());
                assert!(lab.path("SHOWN/flight.mcap").exists(), "{}", shown.stderr);
                run.stderr.push_str(&shown.stderr);
                run.stdout.push_str(&shown.stdout);
            }
            let questions = server.questions().split_off(before);
            assert!(!questions.is_empty(), "{args:?}: {}", run.stderr);
            for request in &questions {
                let sent = request.header(vendor.key_header()).is_some_and(|value| value.ends_with(KEY));
                assert_eq!(sent, allowed, "{args:?}: {}", run.stderr);
            }
            let mut all = vec![("stdout".to_owned(), run.stdout.into_bytes()), ("stderr".to_owned(), run.stderr.into_bytes())];
            files(&lab.path("."), &mut all);
            // A trial in which no dot was answered as asked ends with its first file.
            assert!(all.len() > 3, "{args:?}: {:?}", all.iter().map(|(name, _)| name).collect::<Vec<_>>());
            for (name, bytes) in &all {
                assert_hidden(&format!("{args:?} {name}"), bytes);
            }
        }
    }
}

/// A folder of somebody else's redirects neither a bench nor a trial.
#[test]
fn files_cannot_send_the_key_of_a_trial_or_bench_anywhere() {
    let server = thief(Vendor::OpenAi);
    let own = format!(
        "[[vendor]]\nname = \"openai\"\ntitle = \"x\"\nwire = \"openai-responses\"\nbase_url = \"{}\"\nauth = \"bearer\"\n\
         keys = [\"OPENAI_API_KEY\"]\nkey_needed = true\nfamily = \"gpt\"\ndefault = \"gpt-6-luna\"\n",
        server.url()
    );
    for args in long_commands("openai") {
        for (env, toml) in [
            (String::new(), "[vlm]\nmodels = \"m.toml\"".to_owned()),
            (format!("OPENAI_BASE_URL={}", server.url()), String::new()),
            (format!("SPF_SEND_KEY_TO={}", server.host()), "[vlm]\nmodels = \"m.toml\"".to_owned()),
            (String::new(), format!("[vlm]\nmodels = \"m.toml\"\nsend_key_to = \"{}\"", server.host())),
        ] {
            let lab = Lab::new();
            let what = format!("{args:?} {env} {toml}");
            lab.write(".env", env);
            lab.write("spf.toml", toml);
            lab.write("m.toml", &own);
            let run = Run::of(&lab.command(&args).env("OPENAI_API_KEY", KEY).output().unwrap());
            assert_not_received(&what, &server);
            let mut all = vec![("stdout".to_owned(), run.stdout.into_bytes()), ("stderr".to_owned(), run.stderr.into_bytes())];
            files(&lab.path("."), &mut all);
            for (name, bytes) in &all {
                assert_hidden(&format!("{what}: {name}"), bytes);
            }
        }
    }
    assert!(!server.questions().is_empty(), "what was sent without the key arrived");
}

//! Runs of the bench and trials of models whose service refuses, fails or hangs: what is no flight has no row.

use serde_json::json;

use super::server::{Reply, Request, Server};
use super::vendors::Vendor;
use super::{AHEAD, DONE, KEY};
use crate::harness::{Lab, Run, rows};

fn error(status: u16, code: &str) -> Reply {
    Reply::json(status, &json!({ "error": { "message": format!("no: {KEY}"), "type": code, "code": code } }))
}

fn done(request: &Request) -> Reply {
    Vendor::OpenAi.stream(&Vendor::OpenAi.model(request), DONE)
}

/// Three flights with a server, in the folder `out`.
fn bench(lab: &Lab, server: &Server) -> Run {
    let vlm = format!("openai@{}", server.url());
    let args = ["bench", "run", "--task", "real-nav-chair", "--trials", "3", "--jobs", "1", "--vlm", &vlm, "--yes", "-o", "out"];
    Run::of(&lab.command(&args).env("OPENAI_API_KEY", KEY).output().unwrap())
}

#[test]
fn a_bench_whose_service_refuses_ends_with_the_reason_and_is_resumed() {
    let lab = Lab::new();
    // One address for all: it is a part of the run.
    let phase = std::sync::Arc::new(std::sync::atomic::AtomicU32::new(0));
    let now = phase.clone();
    let server = Server::start(move |number, request| match now.load(std::sync::atomic::Ordering::SeqCst) {
        0 => error(401, "invalid_api_key"),
        // One flight of two queries, and then no money.
        1 if number > 2 => error(429, "insufficient_quota"),
        // A rate limit and a broken server, both for a moment.
        2 if number == 4 => error(429, "rate_limit_exceeded").with("retry-after-ms", "1"),
        2 if number == 5 => error(500, "server_error"),
        _ => done(request),
    });
    let refused = |of: u32, words: &[&str], flown: usize| {
        phase.store(of, std::sync::atomic::Ordering::SeqCst);
        let run = bench(&lab, &server);
        assert_eq!(run.code, Some(6), "{}\n{}", run.stdout, run.stderr);
        for words in words {
            assert!(run.stderr.contains(words), "{words}: {}", run.stderr);
        }
        assert!(!run.stderr.contains(KEY) && !run.stdout.contains("STRICT"), "{}{}", run.stdout, run.stderr);
        assert_eq!(rows(&lab.path("out/results.jsonl")).len(), flown);
    };
    refused(0, &["HTTP 401 (invalid_api_key): no: ***", "the API key is invalid", "0 of 3 trials are done and kept"], 0);
    assert_eq!(server.questions().len(), 1);
    refused(1, &["insufficient_quota", "quota is used up", "1 of 3 trials are done and kept"], 1);
    phase.store(2, std::sync::atomic::Ordering::SeqCst);
    let run = bench(&lab, &server);
    assert_eq!(run.code, Some(0), "{}\n{}", run.stdout, run.stderr);
    assert!(run.stderr.contains("1 of 3 trials already done"), "{}", run.stderr);
    // Estimated from the flight that was answered, at two queries a flight.
    assert!(run.stderr.contains("2 flights = 4 queries × ") && run.stderr.contains("from the 1 flights"), "{}", run.stderr);
    let flown = rows(&lab.path("out/results.jsonl"));
    assert!(flown.len() == 3 && flown.iter().all(|row| row["n_vlm_calls"] == 2 && row["parse_failures"] == 0), "{flown:?}");
}

#[test]
fn a_trial_of_models_whose_credit_ends_says_so_and_goes_on_when_it_is_repeated() {
    let lab = Lab::new();
    let paid = std::sync::Arc::new(std::sync::atomic::AtomicBool::new(false));
    let has_credit = paid.clone();
    let server = Server::start(move |number, request| {
        if number < 4 || has_credit.load(std::sync::atomic::Ordering::SeqCst) {
            Vendor::OpenAi.stream(&Vendor::OpenAi.model(request), AHEAD)
        } else {
            error(402, "billing")
        }
    });
    let vlm = format!("openai@{}", server.url());
    let trial = || {
        let args = ["vlm", "trial", &vlm, "-o", "tried", "--questions", "3", "--flights", "1", "--parallel", "1", "--yes"];
        Run::of(&lab.command(&args).env("OPENAI_API_KEY", KEY).output().unwrap())
    };
    let run = trial();
    assert_eq!(run.code, Some(6), "{}\n{}", run.stdout, run.stderr);
    assert!(run.stderr.contains("no credit") && run.stderr.contains("the same command does the rest"), "{}", run.stderr);
    // Three dots, one question, and one that was refused.
    assert_eq!(server.questions().len(), 5);
    assert_eq!(rows(&lab.path("tried/pointing/answers.jsonl")).len(), 1);
    assert!(!lab.path("tried/flights").exists());
    paid.store(true, std::sync::atomic::Ordering::SeqCst);
    let run = trial();
    assert_eq!(run.code, Some(0), "{}\n{}", run.stdout, run.stderr);
    assert_eq!(rows(&lab.path("tried/pointing/answers.jsonl")).len(), 3);
}

/// A program that hangs would be waited for ten minutes.
#[cfg(unix)]
#[test]
fn the_first_signal_ends_the_wait_for_an_answer_and_keeps_what_is_flown() {
    use std::io::{BufRead, BufReader, Read};

    for signal in ["INT", "TERM"] {
        let lab = Lab::new();
        let script = format!(
            "count=0\nwhile read -r line; do\n\
             id=${{line#*'\"id\":'}}; id=${{id%%,*}}; count=$((count+1))\n\
             if [ $count -le 2 ]; then echo '{{\"id\":'$id',{}'; else echo hangs >&2; fi\ndone\n",
            &DONE[1..]
        );
        lab.write("model.sh", script);
        let vlm = format!("exec:sh '{}'", lab.path("model.sh").display());
        let args = ["-v", "bench", "run", "--task", "real-nav-chair", "--trials", "3", "--jobs", "1", "--vlm", &vlm, "-o", "out"];
        let mut child = lab.command(&args).spawn().unwrap();
        let mut talk = BufReader::new(child.stderr.take().unwrap());
        let mut told = String::new();
        while !told.contains("exec: hangs") {
            assert!(talk.read_line(&mut told).unwrap() > 0, "{told}");
        }
        let kill = format!("kill -{signal} {}", child.id());
        assert!(std::process::Command::new("sh").args(["-c", &kill]).status().unwrap().success());
        talk.read_to_string(&mut told).unwrap();
        assert_eq!(child.wait().unwrap().code(), Some(5), "{told}");
        let flown = rows(&lab.path("out/results.jsonl"));
        assert_eq!(flown.len(), 1, "{told}");
        assert!(told.contains("stopped after 1 of 3 trials") && !told.contains("second Ctrl-C"), "{told}");
        assert!(flown.iter().all(|row| row["parse_failures"] == 0 && row["outcome"] != "aborted"), "{flown:?}");
    }
}

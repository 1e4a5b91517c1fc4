//! Every vendor failure, as a whole flight: the craft holds, nothing late moves it, the flight ends or continues as in
//! docs/explanation/safety.md, and the failure is named.

use std::sync::Arc;
use std::time::{Duration, Instant};

use serde_json::json;
use spf_core::command::Command;
use spf_core::time::Time;
use spf_flight::flight::{FlightPlan, Site, fly};
use spf_flight::run::Observer;
use spf_flight::sim::VlmFactory;
use spf_flight::summary::Summary;
use spf_pilot::{Action, Note, Outcome, Pilot};
use spf_vlm::setup::{Access, KeyHost, Name};
use spf_vlm::table::Table;
use spf_vlm::{Hedge, RequestOptions, setup};

use super::oracle::plan;
use super::server::{Piece, Reply, Server};
use super::vendors::Vendor;
use super::{AHEAD, DONE, KEY};

/// The commands to the craft, and the results of queries.
#[derive(Default)]
struct Watch {
    setpoints: Vec<(Time, bool)>,
    failed: Vec<(Time, String)>,
    decided: Vec<Time>,
    finished: Option<Time>,
}

impl Observer for Watch {
    fn action(&mut self, now: Time, action: &Action, _: &Pilot) {
        match action {
            Action::Command(command) => {
                if let Command::Setpoint(setpoint) = command.get() {
                    self.setpoints.push((now, setpoint.is_hold()));
                }
            }
            Action::Note(Note::QueryFailed { reason, .. }) => self.failed.push((now, reason.clone())),
            Action::Note(Note::Decision(_)) => self.decided.push(now),
            Action::Finished(_) => self.finished = Some(now),
            _ => {}
        }
    }
}

impl Watch {
    /// From 0.2 s after each failure to the next decision only zero was commanded.
    fn assert_held(&self, what: &str) {
        assert!(!self.failed.is_empty(), "{what}");
        for (at, reason) in &self.failed {
            let until = self.decided.iter().find(|decided| *decided > at).copied().unwrap_or(Time::MAX);
            let within = |time: &Time| *time < until && time.since(*at) >= Duration::from_millis(200);
            let moved = self.setpoints.iter().find(|(time, hold)| within(time) && !hold);
            assert_eq!(moved, None, "{what}: after {reason} at {at}");
        }
    }
}

/// A flight with a vendor's models, each query answered by `answer`.
struct Flight {
    summary: Summary,
    watch: Watch,
    server: Server,
    took: Duration,
}

fn flown(
    vendor: Vendor,
    more: &[(Vendor, &Server)],
    strategy: RequestOptions,
    change: impl FnOnce(&mut FlightPlan),
    answer: impl Fn(usize, &super::server::Request) -> Reply + Send + Sync + 'static,
) -> Flight {
    let server = Server::start(answer);
    let mut names = vec![format!("{}@{}", vendor.name(), server.url())];
    names.extend(more.iter().map(|(vendor, server)| format!("{}@{}", vendor.name(), server.url())));
    let send_to: Vec<KeyHost> =
        std::iter::once(&server).chain(more.iter().map(|(_, server)| *server)).map(Server::host).collect();
    let names: Vec<Name<'_>> = names.iter().map(|name| name.as_str().into()).collect();
    let key = |variable: &str| Vendor::ALL.iter().any(|vendor| vendor.key() == variable).then(|| KEY.to_owned());
    let remote = setup::remote(&Table::shipped(), &names, Access { send_to: &send_to, ..Access::of(&key) }, strategy).unwrap();
    let vlm_factory: VlmFactory = Arc::new(move |_, _| Ok(Box::new(remote.clone())));
    let mut plan = plan(vlm_factory, false);
    plan.settings.reply_timeout = Duration::from_millis(1500);
    change(&mut plan);
    let mut watch = Watch::default();
    let began = Instant::now();
    let summary = fly(plan, &mut [&mut watch]).unwrap().summary;
    Flight { summary, watch, server, took: began.elapsed() }
}

/// Ahead at first, so that there is a motion to end; then always the fault.
fn always(vendor: Vendor, fault: Reply) -> Flight {
    flown(
        vendor,
        &[],
        RequestOptions::default(),
        |_| {},
        move |number, request| {
            if number == 0 { vendor.stream(&vendor.model(request), AHEAD) } else { fault.clone() }
        },
    )
}

fn sse(events: &str) -> Reply {
    Reply::new(200, "text/event-stream", events)
}

fn hanging(pieces: Vec<Piece>) -> Reply {
    Reply { pieces, ..sse("") }
}

/// The whole flight ends as failed at the fifth failure in a row, holding since the first.
fn ends(code: &str, vendor: Vendor, fault: Reply) -> Flight {
    let flight = always(vendor, fault);
    let summary = &flight.summary;
    assert_eq!((summary.outcome, summary.decisions), (Outcome::Failed, 1), "{code}: {summary:?}");
    let failed = &summary.vlm_use.as_ref().unwrap().failed;
    assert_eq!(failed.iter().map(|(code, count)| (code.as_str(), *count)).collect::<Vec<_>>(), [(code, 5)], "{summary:?}");
    flight.watch.assert_held(code);
    assert_eq!(flight.watch.failed.len(), 5, "{code}");
    assert!(flight.watch.finished.is_some(), "{code}");
    assert!(flight.took < Duration::from_secs(60), "{code} took {:?}", flight.took);
    flight
}

#[test]
fn errors_by_status_are_named() {
    let quota = json!({ "error": { "code": 429, "status": "RESOURCE_EXHAUSTED", "message": "Quota exceeded", "details": [
        { "@type": "type.googleapis.com/google.rpc.RetryInfo", "retryDelay": "100s" }] } });
    let flight = ends("rate_limit", Vendor::Gemini, Reply::json(429, &quota));
    // No query is sent for the requested time.
    assert_eq!(flight.server.questions().len(), 2);
    let limited = json!({ "error": { "message": "Rate limit", "type": "requests", "code": "rate_limit_exceeded" } });
    let flight = ends("rate_limit", Vendor::OpenAi, Reply::json(429, &limited).with("retry-after", "100"));
    assert_eq!(flight.server.questions().len(), 2);
    let flight = ends("server_error", Vendor::Chat, Reply::json(500, &json!({ "error": { "message": "boom" } })));
    assert!(flight.watch.failed[0].1.contains("returned HTTP 500: boom"), "{:?}", flight.watch.failed);
    // Queried again within its time.
    assert!(flight.server.questions().len() > 6, "{}", flight.server.questions().len());
    let overloaded = json!({ "type": "error", "error": { "type": "overloaded_error", "message": "Overloaded" } });
    ends("overloaded", Vendor::Anthropic, Reply::json(529, &overloaded));
    let key = json!({ "error": { "message": "Incorrect API key", "code": "invalid_api_key" } });
    let flight = ends("key", Vendor::OpenAi, Reply::json(401, &key));
    assert_eq!(flight.server.questions().len(), 6, "a wrong key is not tried again and again");
}

#[test]
fn pages_and_errors_in_good_answers_place_are_named() {
    ends("web_page", Vendor::Chat, Reply::new(502, "text/html", "<html><head><title>Bad Gateway</title></head></html>"));
    ends("web_page", Vendor::Gemini, Reply::new(200, "text/html; charset=utf-8", "<!doctype html><p>Sign in"));
    ends("content_type", Vendor::Anthropic, Reply::new(200, "text/plain", "hello"));
    ends("malformed", Vendor::OpenAi, sse("data: {\"type\":\n\n"));
    ends("malformed", Vendor::Gemini, Reply::new(200, "application/json", "[1, 2]"));
    let provider = json!({ "error": { "code": 502, "message": "Provider returned error" } });
    ends("server_error", Vendor::Chat, Reply::json(200, &provider));
    let within = json!({ "type": "error", "error": { "type": "overloaded_error", "message": "Overloaded" } });
    ends("overloaded", Vendor::Anthropic, sse(&format!("event: error\ndata: {within}\n\n")));
}

#[test]
fn answers_that_are_none_are_named() {
    let refusal =
        json!({ "model": "m", "choices": [{ "delta": { "refusal": "I cannot help with that." }, "finish_reason": "stop" }] });
    let flight = ends("declined", Vendor::Chat, sse(&format!("data: {refusal}\n\ndata: [DONE]\n\n")));
    assert!(flight.watch.failed[0].1.contains("I cannot help with that."));
    let truncated =
        json!({ "candidates": [{ "content": { "parts": [{ "text": "{\"status\":\"nav" }] }, "finishReason": "MAX_TOKENS" }] });
    ends("cut_off", Vendor::Gemini, sse(&format!("data: {truncated}\n\n")));
    let blocked = json!({ "promptFeedback": { "blockReason": "PROHIBITED_CONTENT" } });
    let flight = ends("blocked", Vendor::Gemini, sse(&format!("data: {blocked}\n\n")));
    assert!(flight.watch.failed[0].1.contains("PROHIBITED_CONTENT"));
    ends("empty", Vendor::Gemini, sse("data: {\"candidates\":[]}\n\n"));
    ends("empty", Vendor::Chat, Reply::json(200, &json!({ "choices": [] })));
}

#[test]
fn answers_without_end_are_ended() {
    let begin = "data: {\"choices\":[{\"delta\":{\"content\":\"{\"}}]}\n\n";
    ends("broken_off", Vendor::Chat, hanging(vec![Piece::Bytes(begin.into()), Piece::Break]));
    // As fast as possible: tests the memory bound.
    let piece = format!("data: {{\"choices\":[{{\"delta\":{{\"content\":\"{}\"}}}}]}}\n\n", "x".repeat(4000));
    ends("too_long", Vendor::Chat, hanging(vec![Piece::Endless(piece.into_bytes(), Duration::ZERO)]));
    ends("too_long", Vendor::Gemini, hanging(vec![Piece::Endless(vec![b'x'; 65_536], Duration::ZERO)]));
}

/// A query that reaches its deadline is abandoned by the flight, and its later answer counts as late and moves nothing.
#[test]
fn what_takes_too_long_is_taken_back_and_counted_late() {
    let trickle = "data: {\"choices\":[{\"delta\":{\"content\":\" \"}}]}\n\n";
    for fault in [hanging(vec![Piece::Hang]), hanging(vec![Piece::Endless(trickle.into(), Duration::from_millis(50))])] {
        let flight = ends("deadline", Vendor::Chat, fault);
        assert_eq!(flight.summary.late_replies, 5, "{:?}", flight.summary);
        assert!(flight.watch.failed.iter().all(|(_, reason)| reason == "no reply within 1.5 s"), "{:?}", flight.watch.failed);
        // The server's clients disconnected; the last may still be disconnecting.
        let left = flight.server.left.load(std::sync::atomic::Ordering::SeqCst);
        assert!(left >= 4, "{left}");
    }
}

/// On the wall clock a cancelled query frees its thread: the next is sent at once, and not after the first one's end.
#[test]
fn on_the_wall_clock_a_question_taken_back_holds_nobody_up() {
    let flight = flown(
        Vendor::Chat,
        &[],
        RequestOptions::default(),
        |plan| {
            if let Site::Simulated(site) = &mut plan.site {
                site.realtime = true;
            }
            plan.settings.reply_timeout = Duration::from_secs(1);
        },
        |_, _| hanging(vec![Piece::Hang]),
    );
    assert_eq!((flight.summary.outcome, flight.summary.decisions), (Outcome::Failed, 0), "{:?}", flight.summary);
    flight.watch.assert_held("never answered");
    assert_eq!(flight.server.questions().len(), 5);
    assert!(flight.summary.late_replies >= 4, "{:?}", flight.summary);
    assert!(flight.took < Duration::from_secs(60), "{:?}", flight.took);
}

#[test]
fn a_flight_goes_on_when_the_vendor_comes_back() {
    let patient = |plan: &mut FlightPlan| plan.settings.reply_timeout = Duration::from_secs(20);
    let flight = flown(Vendor::Anthropic, &[], RequestOptions::default(), patient, |number, request| match number {
        0 => Vendor::Anthropic.stream("m", AHEAD),
        1 => Reply::json(400, &json!({ "type": "error", "error": { "type": "invalid_request_error", "message": "no" } })),
        // Overloaded for an instant: queried again within the query's time, unnoticed by the flight.
        2 => Reply::json(529, &json!({ "type": "error", "error": { "type": "overloaded_error", "message": "no" } }))
            .with("retry-after", "0.2"),
        _ => Vendor::Anthropic.stream(&Vendor::Anthropic.model(request), DONE),
    });
    let summary = flight.summary;
    // Accepted after a second query.
    assert_eq!((summary.outcome, summary.decisions), (Outcome::Reached, 3), "{summary:?}");
    let used = summary.vlm_use.unwrap();
    assert_eq!((used.failed["bad_request"], used.questions, used.requests), (1, 4, 5), "{used:?}");
    flight.watch.assert_held("bad request");
}

#[test]
fn a_fallback_steps_in_in_its_own_coordinates() {
    // The second is a family with pixel coordinates, and points where the first would have.
    let second = Server::start(|number, _| {
        let ahead =
            r#"{"status":"navigating","look":null,"stage":1,"point":[384,276.48],"depth":6,"target":"the crane","boxes":[]}"#;
        Vendor::Anthropic.stream("claude-haiku-5-5", if number == 0 { ahead } else { DONE })
    });
    let patient = |plan: &mut FlightPlan| plan.settings.reply_timeout = Duration::from_secs(20);
    let flight = flown(Vendor::Gemini, &[(Vendor::Anthropic, &second)], RequestOptions::default(), patient, |_, _| {
        Reply::json(503, &json!({ "error": { "code": 503, "status": "UNAVAILABLE", "message": "overloaded" } }))
    });
    assert_eq!((flight.summary.outcome, flight.summary.decisions), (Outcome::Reached, 3), "{:?}", flight.summary);
    let used = flight.summary.vlm_use.unwrap();
    assert_eq!((used.models["claude-haiku-5-5"], used.questions, used.requests), (3, 3, 6), "{used:?}");
    // Queried once each, without retries: the other one was available.
    assert_eq!((flight.server.questions().len(), second.questions().len()), (3, 3));
    let told = second.questions()[0].json()["messages"][0]["content"][1]["text"].as_str().unwrap().to_owned();
    assert!(told.contains("in pixels of this image, 768 wide"), "{told}");
}

/// Its reply is rewritten in the first one's coordinates, and no list of boxes must not become an empty one.
#[test]
fn a_fallback_that_lists_no_boxes_moves_nothing_in_obstacle_mode() {
    let flown_by = |boxes: &'static str| {
        let second = Server::start(move |number, _| {
            let ahead =
                r#"{"status":"navigating","look":null,"stage":1,"point":[384,276.48],"depth":6,"target":"the crane"BOXES}"#;
            let text = if number < 5 { ahead.replace("BOXES", boxes) } else { DONE.to_owned() };
            Vendor::Anthropic.stream("claude-haiku-5-5", &text)
        });
        let avoiding = |plan: &mut FlightPlan| {
            plan.settings.reply_timeout = Duration::from_secs(20);
            plan.settings.avoid = true;
        };
        flown(Vendor::Gemini, &[(Vendor::Anthropic, &second)], RequestOptions::default(), avoiding, |_, _| {
            Reply::json(503, &json!({ "error": { "code": 503, "status": "UNAVAILABLE", "message": "overloaded" } }))
        })
    };
    let without = flown_by("");
    assert_eq!(without.summary.outcome, Outcome::Failed, "{:?}", without.summary);
    assert!(without.watch.setpoints.iter().all(|(_, hold)| *hold));
    let with = flown_by(r#","boxes":[]"#);
    assert!(with.watch.setpoints.iter().any(|(_, hold)| !hold), "{:?}", with.summary);
}

/// A backend that hangs leaves half of the time to the other, and both are counted.
#[test]
fn a_fallback_steps_in_for_one_that_hangs() {
    let second = Server::start(|number, _| Vendor::Anthropic.stream("claude-haiku-5-5", if number == 0 { AHEAD } else { DONE }));
    let patient = |plan: &mut FlightPlan| plan.settings.reply_timeout = Duration::from_secs(8);
    let flight = flown(Vendor::Gemini, &[(Vendor::Anthropic, &second)], RequestOptions::default(), patient, |_, _| {
        hanging(vec![Piece::Hang])
    });
    assert_eq!((flight.summary.outcome, flight.summary.decisions), (Outcome::Reached, 3), "{:?}", flight.summary);
    let used = flight.summary.vlm_use.unwrap();
    assert_eq!((flight.server.questions().len(), second.questions().len()), (3, 3));
    assert_eq!((used.questions, used.requests, used.failed.len()), (3, 6, 0), "{used:?}");
    // The cost of the three dropped requests was not reported: it is estimated, not omitted.
    let told = 3.0 * 1200.0;
    assert!(used.tokens_estimated && used.tokens_in as f64 > told + 3.0 * 1000.0, "{used:?}");
}

#[test]
fn a_hedge_takes_the_first_good_answer_and_takes_the_other_back() {
    let flight = flown(
        Vendor::Gemini,
        &[],
        RequestOptions { hedge: Some(Hedge::After(Duration::from_secs(2))), ..RequestOptions::default() },
        |plan| plan.settings.reply_timeout = Duration::from_secs(20),
        |number, _| match number {
            0 => hanging(vec![Piece::Hang]),
            1 => Vendor::Gemini.stream("m", AHEAD),
            _ => Vendor::Gemini.stream("m", DONE),
        },
    );
    let summary = flight.summary;
    assert_eq!((summary.outcome, summary.late_replies), (Outcome::Reached, 0), "{summary:?}");
    assert!(flight.server.questions().len() >= 4, "{}", flight.server.questions().len());
    let used = summary.vlm_use.unwrap();
    assert!(used.failed.is_empty() && used.median_latency_s.unwrap() < 15.0, "{used:?}");
    assert_eq!(used.requests as usize, flight.server.questions().len(), "{used:?}");
}

#[test]
fn an_adaptive_hedge_waits_for_what_replies_usually_take() {
    let flight = flown(
        Vendor::Gemini,
        &[],
        RequestOptions { hedge: Some(Hedge::Auto), ..RequestOptions::default() },
        |plan| plan.settings.reply_timeout = Duration::from_secs(20),
        |number, _| match number {
            0..6 => Vendor::Gemini.stream("m", AHEAD),
            6 => hanging(vec![Piece::Hang]),
            _ => Vendor::Gemini.stream("m", DONE),
        },
    );
    let (summary, asked) = (flight.summary, flight.server.questions().len());
    assert_eq!(summary.outcome, Outcome::Reached, "{summary:?}");
    // The seventh request hangs: 4 s later the eighth is sent for the same query.
    let used = summary.vlm_use.unwrap();
    assert!(used.failed.is_empty() && used.requests as usize == asked && used.questions as usize == asked - 1, "{used:?}");
    assert!(flight.took >= Duration::from_secs(4), "{:?}", flight.took);
}

//! Flights whose queries the caller answers.

use std::path::Path;
use std::time::{Duration, Instant};

use spf_api::flight::{Answerer, Flying, Happening, Request, fly, start};
use spf_api::log::read_log;
use spf_core::primitives::Primitives;
use spf_core::query::ImagePoint;
use spf_pilot::Outcome;

const AHEAD: &str = r#"{"status": "navigating", "point": [480, 360], "depth": 2}"#;
const DONE: &str = r#"{"status": "done"}"#;

/// A flight in the office, in a folder, answered by the caller.
fn asked(folder: &Path) -> Request {
    let mut request = Request::new("fly to the door");
    request.scene = "office".to_owned();
    request.answerer = Answerer::caller("test");
    request.out = Some(folder.join("flight"));
    request
}

/// What happens next, which must not take long.
fn next(flying: &mut Flying) -> Happening {
    flying.wait(Duration::from_secs(60)).unwrap()
}

#[test]
fn a_callers_answers_fly_and_count_as_having_taken_their_latency() {
    let folder = tempfile::tempdir().unwrap();
    let mut request = asked(folder.path());
    request.answerer = Answerer::Caller { name: "test".to_owned(), latency_s: 0.5 };
    let mut count = 0;
    let answer = |question: &spf_api::Question| {
        count += 1;
        assert_eq!((question.image().width(), question.image().height()), (960, 720));
        assert!(question.query().prompt.contains("fly to the door") && question.schema().is_some());
        Ok(if count > 3 { DONE } else { AHEAD }.to_owned())
    };
    let flight = fly(request, answer, |_| {}).unwrap();
    assert_eq!((flight.summary.outcome, flight.summary.vlm.as_str()), (Outcome::Reached, "test"));
    assert!(flight.summary.path_length_m > 0.5, "{}", flight.summary.path_length_m);
    assert!(flight.record.decisions.iter().all(|decision| (decision.latency_s - 0.5).abs() < 1e-9));
    assert!(!flight.summary.settings.avoid, "a function is not expected to list obstacles");
    assert!(std::fs::read_to_string(flight.map_path()).unwrap().contains("<svg"));
}

#[test]
fn a_caller_that_is_the_policy_flies_moves_from_rest_and_its_done_is_believed() {
    let folder = tempfile::tempdir().unwrap();
    let mut request = asked(folder.path());
    request.answerer = Answerer::Policy { name: "mine".to_owned(), latency_s: 0.1 };
    let mut flying = start(request).unwrap();
    for number in 0..4 {
        let Happening::Question(question) = next(&mut flying) else { panic!("question {number}") };
        assert_eq!(question.query().instruction, "fly to the door");
        let lifted = question.lift(ImagePoint { u: 0.5, v: 0.5 }, 3.0).unwrap();
        assert!((lifted.step_m - 1.145).abs() < 0.01 && question.lift(ImagePoint { u: 2.0, v: 0.5 }, 3.0).is_err());
        match number {
            0 => {
                let too_far = Primitives { forward: 5.5, ..Primitives::default() };
                assert!(
                    question.answer_move(too_far).is_err()
                        && question.answer_move(Primitives { yaw: f64::NAN, ..too_far }).is_err()
                );
                question.answer_move(Primitives { yaw: 0.3, forward: 1.0, ..Primitives::default() }).unwrap();
            }
            1 => question.answer_hold(),
            2 => {
                assert_eq!(question.query().memory.actions.len(), 2);
                question.answer_move(Primitives { climb: 0.5, ..Primitives::default() }).unwrap();
            }
            _ => question.answer_done(),
        }
    }
    assert!(matches!(next(&mut flying), Happening::Ended));
    let summary = flying.finish().unwrap().summary;
    assert_eq!((summary.outcome, summary.policy.as_str(), summary.vlm.as_str()), (Outcome::Reached, "mine", "mine"));
    // With the take-off.
    assert!((2.0..2.7).contains(&summary.path_length_m), "{}", summary.path_length_m);
}

#[test]
fn landing_gives_the_open_question_up() {
    let folder = tempfile::tempdir().unwrap();
    let mut flying = start(asked(folder.path())).unwrap();
    let Happening::Question(question) = next(&mut flying) else { panic!("a question is first") };
    let began = Instant::now();
    flying.land();
    assert!(matches!(next(&mut flying), Happening::Ended));
    assert!(began.elapsed() < Duration::from_secs(10), "{:?}", began.elapsed());
    question.answer(Ok(AHEAD.to_owned()));
    let flight = flying.finish().unwrap();
    assert_eq!(flight.summary.outcome, Outcome::Aborted, "{}", flight.summary.cause);
    assert!(flight.record.summary.is_some() && !flight.record.is_truncated);
}

#[test]
fn questions_without_an_answer_are_failed_queries_and_end_the_flight() {
    let folder = tempfile::tempdir().unwrap();
    let mut flying = start(asked(folder.path())).unwrap();
    while let Happening::Question(question) = next(&mut flying) {
        drop(question);
    }
    assert_eq!(flying.finish().unwrap().summary.outcome, Outcome::Failed);
}

#[test]
fn a_start_inside_of_something_gives_the_folder_back() {
    let folder = tempfile::tempdir().unwrap();
    let mut request = asked(folder.path());
    request.start = Some(spf_flight::pose::parse_pose("5000,0,1,0").unwrap());
    let error = fly(request, |_| Ok(DONE.to_owned()), |_| {}).unwrap_err();
    assert!(error.to_string().contains("not above the ground") && error.advice().is_some(), "{error}");
    assert!(!folder.path().join("flight").exists());
}

#[test]
fn a_log_that_is_cut_off_is_read_as_far_as_it_goes() {
    let folder = tempfile::tempdir().unwrap();
    let mut request = asked(folder.path());
    request.choices.max_time_s = Some(8.0);
    let flight = fly(request, |_| Ok(AHEAD.to_owned()), |_| {}).unwrap();
    let bytes = std::fs::read(flight.log_path()).unwrap();
    let cut = folder.path().join("cut.mcap");
    // The end of a log is its index.
    std::fs::write(&cut, &bytes[..bytes.len() / 2]).unwrap();
    let record = read_log(&cut).unwrap();
    assert!(record.is_truncated && record.summary.is_none());
    assert_eq!(record.header, flight.record.header);
    assert!(!record.trajectory.is_empty() && flight.record.trajectory.starts_with(&record.trajectory));
    assert!(record.trajectory.len() < flight.record.trajectory.len());
    let error = read_log(&folder.path().join("none.mcap")).unwrap_err();
    assert!(error.to_string().contains("none.mcap") && error.advice().is_some(), "{error}");
}

#[test]
fn limits_that_limit_nothing_and_what_only_the_program_has_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |change: fn(&mut Request)| {
        let mut request = asked(folder.path());
        change(&mut request);
        start(request).expect_err("it is refused").to_string()
    };
    assert!(refused(|request| request.max_cost_usd = Some(f64::NAN)).contains("cost"));
    assert!(refused(|request| request.choices.max_time_s = Some(-1.0)).contains("flight time"));
    assert!(refused(|request| request.choices.max_queries = Some(0)).contains("one query"));
    assert!(refused(|request| request.choices.depth_network = true).contains("program"));
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "nothing is left of them");
}

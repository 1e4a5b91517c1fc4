//! The examples work as documented.

#[allow(dead_code, reason = "an example's own `main` is not called here")]
#[path = "../../examples/drone.rs"]
mod drone;
#[allow(dead_code, reason = "an example's own `main` is not called here")]
#[path = "../../examples/policy.rs"]
mod policy;
#[allow(dead_code, reason = "an example's own `main` is not called here")]
#[path = "../../examples/read_log.rs"]
mod read_log;
#[allow(dead_code, reason = "an example's own `main` is not called here")]
#[path = "../../examples/vlm.rs"]
mod vlm;
#[allow(dead_code, clippy::duplicate_mod, reason = "its own `main` is not called here; `red` is a part of two examples")]
#[path = "../../examples/vlm_server.rs"]
mod vlm_server;

use std::net::TcpListener;
use std::sync::Arc;
use std::sync::atomic::AtomicU32;

use spf_core::camera::Camera;
use spf_core::frame::{FrameId, FrameMeta};
use spf_core::geometry::Pose;
use spf_core::query::VerticalRoom;
use spf_core::time::{Duration, Time};
use spf_media::Rgb;
use spf_pilot::Outcome;
use spf_pilot::policy::{Expected, Policy, PolicyEvent, Step, View};
use spf_vlm::check::{USUAL_CAMERA, Verdict, check};
use spf_vlm::setup::Access;
use spf_vlm::table::Table;
use spf_vlm::{RequestOptions, setup};

#[test]
fn a_drone_of_one_s_own_is_flown_to_its_ball() {
    let summary = drone::fly("red", drone::sees_red()).unwrap().summary;
    assert_eq!((summary.outcome, summary.drone.as_str()), (Outcome::Reached, "toy"), "{summary:?}");
    // 3 m up, and the ball is about 14 m away: the parameters are the toy's, so no corrections are needed.
    assert!((10.0..20.0).contains(&summary.path_length_m), "{}", summary.path_length_m);
}

#[test]
fn a_vlm_behind_http_flies_a_drone_of_one_s_own_without_a_key() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let name = format!("http://{}/v1#red", listener.local_addr().unwrap());
    std::thread::spawn(move || vlm_server::serve(&listener));
    let mut vlm =
        setup::remote(&Table::shipped(), &[name.as_str().into()], Access::of(&|_| None), RequestOptions::default()).unwrap();
    let verdict = check(&mut vlm, Duration::from_secs(20), USUAL_CAMERA).verdict;
    assert!(matches!(verdict, Verdict::Good(_)), "{verdict:?}");
    let summary = drone::fly(&name, Arc::new(move |_, _| Ok(Box::new(vlm.clone())))).unwrap().summary;
    assert_eq!((summary.outcome, summary.vlm), (Outcome::Reached, name));
}

#[test]
fn a_vlm_behind_http_points_straight_ahead_three_times_where_nothing_is_red() {
    let (grey, ahead) = (Rgb::filled(64, 48, [128; 3]), AtomicU32::default());
    for _flight in 0..2 {
        let prompts = ["first", "What came before: …", "What came before: …", "What came before: …", "What came before: …"];
        let message = prompts.map(|prompt| vlm_server::reply(prompt, &grey, &ahead)["status"].clone());
        assert_eq!(message, ["navigating", "navigating", "navigating", "done", "done"]);
    }
}

#[test]
fn a_policy_of_one_s_own_flies_its_square() {
    let summary = policy::fly().unwrap().summary;
    assert_eq!((summary.outcome, summary.policy.as_str()), (Outcome::Reached, "square"), "{summary:?}");
    assert!((10.0..16.0).contains(&summary.path_length_m), "{}", summary.path_length_m);
    assert_eq!(summary.decisions, 0, "it sends no query");
}

#[test]
fn an_instruction_starts_a_policy_of_one_s_own_over() {
    let mut square = policy::square(4);
    let frame = FrameMeta {
        id: FrameId(1),
        captured: Time::ZERO,
        received: Time::ZERO,
        capture_counter: 1,
        width: 960,
        height: 720,
        unusable: None,
    };
    let (room, expected, reckoned) = (VerticalRoom::default(), Expected::Unknown, None);
    let view = View { frame, camera: Camera::quad(), pose: Pose::default(), at_rest: true, room, expected, reckoned };
    assert_eq!(square.handle(PolicyEvent::Frame(&view)).step, Step::Done, "its four sides are flown");
    assert_eq!(square.handle(PolicyEvent::Instruction("fly a square")).step, Step::Look);
    assert!(matches!(square.handle(PolicyEvent::Frame(&view)).step, Step::Move(_)));
}

#[test]
fn a_custom_vlm_is_queried() {
    let summary = vlm::fly().unwrap().summary;
    assert_eq!((summary.vlm.as_str(), summary.outcome), ("lightest", Outcome::Reached), "{summary:?}");
    assert!(summary.decisions >= 3, "{}", summary.decisions);
}

#[test]
fn a_log_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let decisions = read_log::decisions(&read_log::flown(&folder.path().join("flight")).unwrap()).unwrap();
    assert!(decisions.len() > 2 && decisions.is_sorted_by(|a, b| a.0 <= b.0), "{decisions:?}");
}

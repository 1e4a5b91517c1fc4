//! The examples do what they say.

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

use spf_core::pilot::Outcome;

#[test]
fn a_drone_of_one_s_own_is_flown_to_its_ball() {
    let summary = drone::fly().unwrap().summary;
    assert_eq!((summary.outcome, summary.drone.as_str()), (Outcome::Reached, "toy"), "{summary:?}");
    assert!(summary.path_length_m > 10.0, "{}", summary.path_length_m);
}

#[test]
fn a_policy_of_one_s_own_flies_its_square() {
    let summary = policy::fly().unwrap().summary;
    assert_eq!((summary.outcome, summary.policy.as_str()), (Outcome::Reached, "square"), "{summary:?}");
    assert!((10.0..16.0).contains(&summary.path_length_m), "{}", summary.path_length_m);
}

#[test]
fn a_vlm_of_one_s_own_is_asked() {
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

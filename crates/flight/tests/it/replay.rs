//! Replaying a log gives the same flight, and a different one if the method differs.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde_json::Value;
use spf_core::camera::Camera;
use spf_core::command::Setpoint;
use spf_core::craft::CraftKind;
use spf_core::geometry::{EnuPosition, Pose};
use spf_core::grounding::{AxisOrder, GroundingProfile};
use spf_core::keep_out::KeepOut;
use spf_core::query::ImageBox;
use spf_core::step::StepRule;
use spf_core::time::{Duration, Time};
use spf_detect::{Detector, Place};
use spf_flight::detector::{DetectorPlan, model_detects};
use spf_flight::flight::{FlightPlan, Site, fly};
use spf_flight::policy::PolicyKind;
use spf_flight::recorder::RecordPlan;
use spf_flight::replay::{Changes, Report, head, replay, replay_keeping, row};
use spf_flight::sim::{LoadedScene, Simulated, oracle_factory};
use spf_flight::world::Script;
use spf_oracle::ErrorFile;
use spf_pilot::{OperatorEvent, PilotSettings, Preset};
use spf_record::log::{Entry, LogReader};
use spf_record::out_dir::OutDir;

/// Thirty seconds, in which some answers arrive too late.
fn settings() -> PilotSettings {
    let (max_time, reply_timeout) = (Duration::from_secs(30), Duration::from_secs(2));
    PilotSettings { max_time, reply_timeout, ..PilotSettings::preset(Preset::Default) }
}

/// The policy with a name.
pub(crate) fn policy(name: &str) -> Arc<PolicyKind> {
    Arc::new(PolicyKind::of_name(name).unwrap())
}

/// A flight with every pilot input: frames, telemetry, valid and invalid replies, an operator.
pub(crate) fn flown(folder: &Path, change: impl FnOnce(&mut FlightPlan)) -> PathBuf {
    let kind = CraftKind::Quad;
    let at = Time::from_millis;
    let hand = OperatorEvent::Setpoint(Setpoint { right: 9.0, ..Setpoint::HOLD });
    let events = vec![
        (at(11_000), hand),
        (at(11_500), OperatorEvent::Resume),
        (at(12_000), OperatorEvent::KeepOut(vec![marked(0), marked(1)])),
        (at(15_000), OperatorEvent::KeepOut(vec![marked(1)])),
        (at(19_000), OperatorEvent::Instruction("fly to the black car".to_owned())),
    ];
    let site = Simulated { kind, seed: 3, ..Simulated::new(Arc::new(LoadedScene::load("city").unwrap()), "city") };
    let vlm_factory = oracle_factory("oracle".to_owned(), ErrorFile::named("default").unwrap());
    let mut plan = FlightPlan {
        settings: settings(),
        script: Script::new(events),
        record: Some(RecordPlan { out: OutDir::at(folder).unwrap(), video: false, view: None }),
        ..FlightPlan::new(Site::Simulated(site), "fly to the red crane", "oracle", vlm_factory)
    };
    change(&mut plan);
    let flown = fly(plan, &mut []).unwrap();
    assert!(flown.recording_problems.is_empty(), "{:?}", flown.recording_problems);
    // Named after all instructions; the places that were marked are on the map, also the one that was removed.
    assert_eq!(flown.summary.title(), "fly to the red crane → fly to the black car");
    let map = std::fs::read_to_string(folder.join("trajectory.svg")).unwrap();
    for told in
        ["red crane → fly to the black car", "keep away 1: from 12.00 s to 15.00 s", "keep away 2: from 12.00 s to the end"]
    {
        assert!(map.contains(told), "{told}");
    }
    folder.join("flight.mcap")
}

/// A place far behind the start, which is in nobody's way.
fn marked(id: u32) -> KeepOut {
    let pose = Pose { position: EnuPosition { east: 0.0, north: -60.0, up: 2.0 }, ..Pose::default() };
    KeepOut::new(id, &Camera::quad(), pose, ImageBox { left: 0.4, top: 0.4, right: 0.6, bottom: 0.6 }, 3).unwrap()
}

fn replayed(log: &Path, changes: &Changes) -> Report {
    replay(LogReader::open(log).unwrap(), changes).unwrap()
}

fn differs_at(report: &Report, topic: &str) -> bool {
    report.differences.iter().any(|difference| difference.topic == topic)
}

#[test]
fn a_flight_is_the_same_again_and_another_method_is_not() {
    let folder = tempfile::tempdir().unwrap();
    let log = flown(&folder.path().join("flight"), |_| {});
    let same = replayed(&log, &Changes::default());
    assert_eq!(same.differences, []);
    assert!(!same.torn && same.inputs > 1000 && same.outputs > 200, "{} {}", same.inputs, same.outputs);

    let recorded = head(&mut LogReader::open(&log).unwrap()).unwrap().settings;
    // A hundredth more in the exponent changes the step, and therefore the path.
    let with_exponent = |exponent| {
        let step = StepRule::Adaptive { scale: 10.0, labels: 10, min: 0.1, exponent };
        Changes { settings: Some(PilotSettings { step, ..recorded }), ..Changes::default() }
    };
    let other = replayed(&log, &with_exponent(1.01 * 1.8));
    assert!(differs_at(&other, "/decision") && differs_at(&other, "/command"), "{} differences", other.differences.len());
    // Of many differences some are kept, and all are counted.
    let few = replay_keeping(LogReader::open(&log).unwrap(), &with_exponent(1.01 * 1.8), 3).unwrap();
    assert_eq!(few.differences, other.differences[..3]);
    assert_eq!(few.unkept, other.differences.len() as u64 - 3);
    assert_eq!(replayed(&log, &with_exponent(1.8)).differences, [], "only the exponent made the difference");

    let grounding = GroundingProfile { order: AxisOrder::Xy, ..GroundingProfile::default() };
    let swapped = replayed(&log, &Changes { grounding: Some(grounding), ..Changes::default() });
    let waypoint = |at: &str| at.starts_with("/reading") || at.starts_with("/query");
    assert!(swapped.differences.iter().any(|d| d.topic == "/decision" && waypoint(&d.at)), "{:?}", swapped.differences.first());
}

#[test]
fn other_policies_and_presets_are_the_same_again() {
    let folder = tempfile::tempdir().unwrap();
    let plain = flown(&folder.path().join("plain"), |plan| plan.policy = policy("plain"));
    assert_eq!(replayed(&plain, &Changes::default()).differences, []);
    let paper = flown(&folder.path().join("paper"), |plan| {
        let max_time = plan.settings.max_time;
        (plan.preset, plan.settings) = (Preset::Paper, PilotSettings { max_time, ..PilotSettings::preset(Preset::Paper) });
        plan.settings.avoid = true;
    });
    assert_eq!(replayed(&paper, &Changes::default()).differences, []);
}

/// The number of replies in the log of a flight with a detector's boxes, and what its header calls the detector.
fn with_boxes(log: &Path, name: &str) -> (usize, Option<String>) {
    let mut entries = LogReader::open(log).unwrap();
    let detector = head(&mut entries).unwrap().detector;
    let called = format!(r#"\"name\":\"{name}\""#);
    let told = |entry: &Entry| entry.topic == "/reply" && row::<Value>(entry).unwrap().to_string().contains(&called);
    (entries.map(Result::unwrap).filter(told).count(), detector)
}

#[test]
fn a_flight_with_a_detector_is_the_same_again() {
    let folder = tempfile::tempdir().unwrap();
    let log = flown(&folder.path().join("flight"), |plan| {
        plan.settings.avoid = true;
        let name = "oracle:perfect".to_owned();
        let factory = Some(oracle_factory(name.clone(), ErrorFile::named("perfect").unwrap()));
        plan.detector = Some(DetectorPlan { name, factory });
    });
    assert_eq!(replayed(&log, &Changes::default()).differences, []);
    let (told, detector) = with_boxes(&log, "car");
    assert!(told > 3, "{told} replies with its boxes");
    assert_eq!(detector.as_deref(), Some("oracle:perfect"));
}

#[test]
fn a_flight_with_a_model_is_the_same_again() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("squares.onnx");
    std::fs::write(&file, crate::made::model(&crate::made::Export::default())).unwrap();
    let detector = Detector::open(&file, &Place::Here).unwrap();
    let log = flown(&folder.path().join("flight"), |plan| {
        plan.settings.avoid = true;
        // The inference time varies: a replay takes it from the log.
        plan.detector = Some(DetectorPlan { name: detector.name().to_owned(), factory: Some(model_detects(detector, None)) });
    });
    assert_eq!(replayed(&log, &Changes::default()).differences, []);
    assert_eq!(with_boxes(&log, "").1.as_deref(), Some("squares.onnx"));
}

#[test]
fn a_torn_log_is_replayed_as_far_as_it_goes() {
    let folder = tempfile::tempdir().unwrap();
    let log = flown(&folder.path().join("flight"), |_| {});
    let whole = std::fs::read(&log).unwrap();
    for fraction in [0.3, 0.6, 0.9] {
        std::fs::write(&log, &whole[..(fraction * whole.len() as f64) as usize]).unwrap();
        let report = replayed(&log, &Changes::default());
        assert!(report.torn && report.differences.is_empty(), "{fraction}: {:?}", report.differences.first());
        assert!(report.inputs > 50, "{fraction}: {} inputs", report.inputs);
    }
}

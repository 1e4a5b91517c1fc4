//! Flights with the simulated depth sensor and the brake before obstacles.

use std::path::Path;
use std::sync::Arc;

use serde_json::Value;
use spf_core::craft::{Craft, CraftKind};
use spf_core::depth::DepthGrid;
use spf_core::time::{Duration, Time};
use spf_envelope::{BrakeLimits, Limits};
use spf_flight::flight::{FlightPlan, Site, fly};
use spf_flight::log::Channel;
use spf_flight::recorder::RecordPlan;
use spf_flight::replay::{Changes, replay, row};
use spf_flight::sim::{FlightConditions, LoadedScene, Simulated, oracle_factory};
use spf_oracle::ErrorFile;
use spf_pilot::method::{Measured, Method};
use spf_pilot::{Decision, PilotSettings, Preset};
use spf_record::log::{Entry, LogReader};
use spf_record::out_dir::OutDir;
use spf_sim::depth_sensor::{DepthFault, DepthSensor};

/// A flight of at most 14 s towards the crane, at up to 3 m/s, with anchor and map if `guided`.
fn flown(folder: &Path, fault: Option<DepthFault>, guided: bool) -> Vec<Entry> {
    let flight_conditions = FlightConditions { depth_sensor: Some(DepthSensor { fault }), ..FlightConditions::default() };
    let loaded = Arc::new(LoadedScene::load("city").unwrap());
    let site = Simulated { kind: CraftKind::Quad, seed: 3, flight_conditions, ..Simulated::new(loaded, "city") };
    let vlm_factory = oracle_factory("oracle:perfect".to_owned(), ErrorFile::named("perfect").unwrap());
    let plan = FlightPlan {
        settings: PilotSettings {
            max_time: Duration::from_secs(14),
            method: if guided { Method::Depth(Measured::View) } else { Method::Paper },
            ..PilotSettings::preset(Preset::Default)
        },
        limits: Limits { brake: Some(BrakeLimits::with_sensor()), ..Limits::for_craft(&Craft::quad()) },
        record: Some(RecordPlan { out: OutDir::at(folder).unwrap(), video: false, view: None }),
        ..FlightPlan::new(Site::Simulated(site), "fly to the red crane", "oracle:perfect", vlm_factory)
    };
    let flown = fly(plan, &mut []).unwrap();
    assert!(flown.recording_problems.is_empty(), "{:?}", flown.recording_problems);
    LogReader::open(&folder.join("flight.mcap")).unwrap().map(|entry| entry.unwrap()).collect()
}

/// Horizontal speeds of the cleared setpoints, with their times.
fn speeds(entries: &[Entry]) -> Vec<(Time, f64)> {
    let commands = entries.iter().filter(|entry| entry.topic == "/command");
    commands
        .filter_map(|entry| {
            let row: Value = row(entry).unwrap();
            let setpoint = row.get("cleared")?.clone();
            let part = |name: &str| setpoint.get(name).and_then(Value::as_f64).unwrap();
            Some((entry.time, part("right").hypot(part("forward"))))
        })
        .collect()
}

#[test]
fn a_flight_with_a_depth_sensor_is_recorded_and_the_same_again() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path().join("flight");
    let entries = flown(&folder, None, false);
    let grids: Vec<DepthGrid> = entries.iter().filter(|e| e.topic == "/depth").map(|entry| row(entry).unwrap()).collect();
    assert!(grids.len() > 150, "{}", grids.len());
    assert!(grids.iter().all(|grid| grid.check().is_ok()));
    // In the air the ground is in view.
    assert!(grids[100].valid_fraction() > 0.1, "{}", grids[100].valid_fraction());
    assert!(speeds(&entries).iter().any(|(_, speed)| *speed > 1.0));

    let again = replay(LogReader::open(&folder.join("flight.mcap")).unwrap(), &Changes::default()).unwrap();
    assert_eq!(again.differences, []);
    // The grids are among the inputs of the replayed pilot.
    assert!(again.inputs > grids.len() as u64);
}

/// From 10 s on the same values come again and again, stamped new: three of them take 0.2 s.
#[test]
fn a_frozen_depth_sensor_slows_the_flight_within_half_a_second() {
    let folder = tempfile::tempdir().unwrap();
    let entries = flown(&folder.path().join("flight"), Some(DepthFault::Frozen), false);
    let (before, after): (Vec<_>, Vec<_>) = speeds(&entries).into_iter().partition(|(at, _)| *at < Time::from_millis(10_500));
    assert!(before.iter().any(|(_, speed)| *speed > 1.0), "it flew");
    assert!(after.len() > 10 && after.iter().all(|(_, speed)| *speed <= 0.5 + 1e-9), "{after:?}");
}

/// Anchor, map, planner and brake know what drivers and VLM deliver, and nothing else: given the inputs of the log alone, without
/// scene, truth, ids or judge, the pilot sends the same commands.
#[test]
fn a_guided_flight_follows_from_what_drivers_and_vlm_deliver() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path().join("flight");
    let entries = flown(&folder, None, true);
    let decisions: Vec<Decision> = entries.iter().filter(|e| e.topic == "/decision").map(|entry| row(entry).unwrap()).collect();
    let anchored = decisions.iter().filter_map(|decision| decision.anchor).filter(|anchor| anchor.hits > 1).count();
    assert!(anchored > 0, "{decisions:?}");
    let inputs_and_outputs = LogReader::open(&folder.join("flight.mcap")).unwrap().filter(|entry| {
        entry.as_ref().is_ok_and(|entry| {
            Channel::of_topic(&entry.topic).is_some_and(|of| of == Channel::Flight || of.is_input() || of.is_output())
        })
    });
    let again = replay(inputs_and_outputs, &Changes::default()).unwrap();
    assert_eq!(again.differences, []);
    assert!(again.outputs > 100, "{}", again.outputs);
}

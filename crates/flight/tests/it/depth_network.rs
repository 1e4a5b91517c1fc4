//! A flight in the simulator with a depth network, made here, that knows level ground by the row of the image.

use std::path::Path;
use std::sync::Arc;

use spf_core::craft::CraftKind;
use spf_core::depth::{DepthGrid, DepthSource};
use spf_core::time::{Duration, Time};
use spf_detect::{DepthNetwork, DepthOptions, OutputKind, Place};
use spf_flight::depth_network::DepthPlan;
use spf_flight::flight::{FlightPlan, Site, fly};
use spf_flight::recorder::RecordPlan;
use spf_flight::replay::{Changes, replay, row};
use spf_flight::run::Observer;
use spf_flight::sim::{LoadedScene, Simulated, oracle_factory};
use spf_oracle::ErrorFile;
use spf_pilot::method::{Measured, Method};
use spf_pilot::{Action, Pilot, PilotSettings, Preset};
use spf_record::log::{Entry, LogReader};
use spf_record::out_dir::OutDir;
use spf_space::obstacle_map::Cell;

use crate::made::{DepthExport, depth};

const SIZE: (usize, usize) = (112, 84);

/// Disparity grows with the row from the horizon down, as it does over level ground. Above it there is nothing: less than
/// zero, by what is red, since a network without a trace of the image is refused.
fn knows_ground() -> DepthNetwork {
    let camera = CraftKind::Quad.camera().resized(SIZE.0 as u32, SIZE.1 as u32);
    let horizon = camera.cy - camera.fy * camera.tilt.tan();
    let rows = (0..SIZE.1).map(|row| 0.4 * (row as f64 + 0.5 - horizon).max(0.0) as f32).collect();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("ground.onnx");
    std::fs::write(&path, depth(&DepthExport { gain: -1e-9, size: Some(SIZE), rows, ..DepthExport::default() })).unwrap();
    DepthNetwork::open(&path, DepthOptions { kind: OutputKind::Disparity, size: None }, &Place::Here).unwrap()
}

/// Heights of the occupied cells at the end, metres.
#[derive(Default)]
struct Heights(Vec<f64>);

impl Observer for Heights {
    fn action(&mut self, _: Time, _: &Action, pilot: &Pilot) {
        let map = pilot.obstacle_map().unwrap();
        self.0 = map.occupied().map(|cell| Cell::middle(cell).up).collect();
    }
}

fn flown(folder: &Path) -> (Vec<f64>, Vec<Entry>) {
    let site =
        Simulated { kind: CraftKind::Quad, seed: 3, ..Simulated::new(Arc::new(LoadedScene::load("city").unwrap()), "city") };
    let vlm_factory = oracle_factory("oracle:perfect".to_owned(), ErrorFile::named("perfect").unwrap());
    let plan = FlightPlan {
        settings: PilotSettings {
            max_time: Duration::from_secs(9),
            avoid: false,
            method: Method::Depth(Measured::Part),
            ..PilotSettings::preset(Preset::Default)
        },
        depth_network: Some(DepthPlan::onnx(knows_ground(), Duration::from_millis(500))),
        record: Some(RecordPlan { out: OutDir::at(folder).unwrap(), video: false, view: None }),
        ..FlightPlan::new(Site::Simulated(site), "fly to the red crane", "oracle:perfect", vlm_factory)
    };
    let mut heights = Heights::default();
    let flown = fly(plan, &mut [&mut heights]).unwrap();
    assert!(flown.recording_problems.is_empty(), "{:?}", flown.recording_problems);
    assert_eq!(flown.summary.depth_model.as_deref(), Some("ground.onnx"));
    (heights.0, LogReader::open(&folder.join("flight.mcap")).unwrap().map(|entry| entry.unwrap()).collect())
}

#[test]
fn a_networks_ground_is_in_the_map_and_the_flight_the_same_again() {
    let folder = tempfile::tempdir().unwrap();
    let (heights, entries) = flown(&folder.path().join("first"));
    let near = heights.iter().filter(|up| up.abs() < 0.6).count();
    assert!(near > 50 && near * 10 > heights.len() * 9, "{near} of {}", heights.len());

    let of = |entries: &[Entry], topic: &str| -> Vec<(Time, Vec<u8>)> {
        entries.iter().filter(|entry| entry.topic == topic).map(|entry| (entry.time, entry.data.to_vec())).collect()
    };
    let (_, again) = flown(&folder.path().join("second"));
    for topic in ["/depth", "/command"] {
        assert!(!of(&entries, topic).is_empty());
        assert_eq!(of(&entries, topic), of(&again, topic), "{topic}");
    }
    // Each is 0.4 s old, and at most two a second are asked for, after take-off.
    let grids: Vec<(Time, DepthGrid)> =
        entries.iter().filter(|entry| entry.topic == "/depth").map(|entry| (entry.time, row(entry).unwrap())).collect();
    assert!((6..=10).contains(&grids.len()), "{}", grids.len());
    assert!(grids.iter().all(|(at, grid)| at.since(grid.captured) >= Duration::from_millis(400)));
    assert!(grids.iter().all(|(_, grid)| grid.check().is_ok() && grid.source == DepthSource::Network));

    let log = LogReader::open(&folder.path().join("first/flight.mcap")).unwrap();
    assert_eq!(replay(log, &Changes::default()).unwrap().differences, []);
}

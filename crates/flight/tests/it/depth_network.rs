//! A flight in the simulator with a depth network, made here, that knows level ground by the row of the image.

use std::path::Path;
use std::sync::Arc;

use spf_core::craft::CraftKind;
use spf_core::guidance::Guidance;
use spf_core::mono_depth::{MonoDepth, ScaleSource};
use spf_core::obstacle_map::Cell;
use spf_core::pilot::{Action, Note, Pilot, PilotSettings, Preset};
use spf_core::time::{Duration, Time};
use spf_detect::{DepthNetwork, DepthOptions, OutputKind, Place};
use spf_flight::depth_network::{DepthPlan, OnnxDepth};
use spf_flight::flight::{FlightPlan, Site, fly};
use spf_flight::recorder::RecordPlan;
use spf_flight::replay::{Changes, replay, row};
use spf_flight::run::Observer;
use spf_flight::sim::{LoadedScene, Simulated, oracle_factory};
use spf_oracle::ErrorFile;
use spf_record::log::{Entry, LogReader};
use spf_record::out_dir::OutDir;

use crate::made::{DepthExport, depth};

const SIZE: (usize, usize) = (112, 84);

/// Disparity grows with the row from the horizon down, as it does over level ground. Above it there is nothing.
fn knows_ground() -> DepthNetwork {
    let camera = CraftKind::Quad.camera().resized(SIZE.0 as u32, SIZE.1 as u32);
    let horizon = camera.cy - camera.fy * camera.tilt.tan();
    let rows = (0..SIZE.1).map(|row| 0.4 * (row as f64 + 0.5 - horizon).max(0.0) as f32).collect();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("ground.onnx");
    std::fs::write(&path, depth(&DepthExport { gain: 0.0, size: Some(SIZE), rows, ..DepthExport::default() })).unwrap();
    DepthNetwork::open(&path, DepthOptions { kind: OutputKind::Disparity, size: None }, &Place::Here).unwrap()
}

/// What the pilot made of it.
#[derive(Default)]
struct Seen {
    scaled: usize,
    by_parallax: usize,
    refused: usize,
    said: Vec<String>,
    /// Heights of the occupied cells at the end, metres.
    heights: Vec<f64>,
}

impl Observer for Seen {
    fn action(&mut self, _: Time, action: &Action, pilot: &Pilot) {
        match pilot.depth_scale() {
            Some(Ok(scale)) => {
                self.scaled += 1;
                self.by_parallax += usize::from(scale.source == ScaleSource::Parallax);
            }
            Some(Err(_)) => self.refused += 1,
            None => {}
        }
        if let Action::Note(Note::DepthScale(words)) = action {
            self.said.push(words.clone());
        }
        let map = pilot.obstacle_map().unwrap();
        self.heights = map.occupied().map(|cell| Cell::middle(cell).up).collect();
    }
}

fn flown(folder: &Path) -> (Seen, Vec<Entry>) {
    let site =
        Simulated { kind: CraftKind::Quad, seed: 3, ..Simulated::new(Arc::new(LoadedScene::load("city").unwrap()), "city") };
    let vlm_factory = oracle_factory("oracle:perfect".to_owned(), ErrorFile::named("perfect").unwrap());
    let network = Box::new(OnnxDepth(knows_ground()));
    let plan = FlightPlan {
        settings: PilotSettings {
            max_time: Duration::from_secs(9),
            avoid: false,
            guidance: Guidance { map: true, mono_depth: true, ..Guidance::default() },
            ..PilotSettings::preset(Preset::Default)
        },
        depth_network: Some(DepthPlan { network, period: Duration::from_millis(500), latency: Duration::from_millis(400) }),
        record: Some(RecordPlan { out: OutDir::at(folder).unwrap(), video: false, view: None }),
        ..FlightPlan::new(Site::Simulated(site), "fly to the red crane", "oracle:perfect", vlm_factory)
    };
    let mut seen = Seen::default();
    let flown = fly(plan, &mut [&mut seen]).unwrap();
    assert!(flown.recording_problems.is_empty(), "{:?}", flown.recording_problems);
    assert_eq!(flown.summary.depth_model.as_deref(), Some("ground.onnx"));
    (seen, LogReader::open(&folder.join("flight.mcap")).unwrap().map(|entry| entry.unwrap()).collect())
}

#[test]
fn a_networks_ground_is_in_the_map_and_the_flight_the_same_again() {
    let folder = tempfile::tempdir().unwrap();
    let (seen, entries) = flown(&folder.path().join("first"));
    assert!(seen.scaled > 10 * seen.refused.max(1), "{} scaled, {} not", seen.scaled, seen.refused);
    // At rest there is no parallax.
    assert!(seen.said[0].contains("scaled by the ground"), "{:?}", seen.said);
    assert!(seen.by_parallax > 0 && seen.by_parallax < seen.scaled, "{} of {}", seen.by_parallax, seen.scaled);
    let near = seen.heights.iter().filter(|up| up.abs() < 0.6).count();
    assert!(near > 50 && near * 10 > seen.heights.len() * 9, "{near} of {}", seen.heights.len());

    let of = |entries: &[Entry], topic: &str| -> Vec<(Time, Vec<u8>)> {
        entries.iter().filter(|entry| entry.topic == topic).map(|entry| (entry.time, entry.data.to_vec())).collect()
    };
    let (_, again) = flown(&folder.path().join("second"));
    for topic in ["/depth/network", "/command"] {
        assert!(!of(&entries, topic).is_empty());
        assert_eq!(of(&entries, topic), of(&again, topic), "{topic}");
    }
    // Each is 0.4 s old, and at most two a second are asked for, after take-off.
    let estimates: Vec<(Time, MonoDepth)> =
        entries.iter().filter(|entry| entry.topic == "/depth/network").map(|entry| (entry.time, row(entry).unwrap())).collect();
    assert!((6..=10).contains(&estimates.len()), "{}", estimates.len());
    assert!(estimates.iter().all(|(at, estimate)| at.since(estimate.captured) >= Duration::from_millis(400)));

    let log = LogReader::open(&folder.path().join("first/flight.mcap")).unwrap();
    assert_eq!(replay(log, &Changes::default()).unwrap().differences, []);
}

//! Any text as the depths of a grid in a log: read or refused, within its bounds, and the same when it is written again.
#![no_main]

use libfuzzer_sys::fuzz_target;
use spf_core::depth::{DepthGrid, MAX_DEPTHS};

/// The beginning of a row with a camera of 2 × 2 pixels.
const HEAD: &str = r#"{"captured":1500,"counter":7,"camera":{"width":2,"height":2,"fx":2.0,"fy":2.0,"cx":1.0,"cy":1.0,
    "distortion":{"k1":0.0,"k2":0.0,"p1":0.0,"p2":0.0},"tilt":0.0},"cm":""#;

fuzz_target!(|text: &str| {
    // As the whole grid, and as its depths.
    for json in [text.to_owned(), format!("{HEAD}{text}\"}}")] {
        let Ok(grid) = serde_json::from_str::<DepthGrid>(&json) else { continue };
        assert!(grid.cm.len() <= MAX_DEPTHS && grid.cm.len() <= json.len() / 2);
        let written = serde_json::to_string(&grid).expect("a grid that was read can be written");
        assert_eq!(serde_json::from_str::<DepthGrid>(&written).ok().as_ref(), Some(&grid));
        if grid.check().is_ok() {
            assert!((0.0..=1.0).contains(&grid.valid_fraction()));
            assert!(grid.points().all(|(place, at)| place < grid.cm.len() && at.forward > 0.0));
        }
    }
});

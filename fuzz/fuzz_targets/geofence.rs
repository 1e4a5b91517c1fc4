//! Any bytes as a geofence: parsed or rejected, and a parsed one is written and parsed again unchanged.
#![no_main]

use libfuzzer_sys::fuzz_target;
use spf_envelope::geofence::Geofence;
use spf_core::geometry::EnuPosition;

fuzz_target!(|data: &[u8]| {
    let Ok(text) = core::str::from_utf8(data) else { return };
    let Ok(fence) = Geofence::from_geojson(text) else { return };
    let again = serde_json::to_string(&fence).expect("a geofence is JSON");
    assert_eq!(Geofence::from_geojson(&again).as_ref(), Ok(&fence));
    let _ = fence.contains(EnuPosition::default());
    assert!(!fence.edge_distance(EnuPosition::default()).is_nan());
});

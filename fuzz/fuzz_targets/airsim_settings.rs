//! Any text as AirSim's `settings.json`: refused, or with vehicles and pictures within bounds.
#![no_main]

use libfuzzer_sys::fuzz_target;
use spf_drone::airsim::wire::structs::ImageType;
use spf_serve::airsim::Settings;

fuzz_target!(|text: &str| {
    let Ok(settings) = Settings::parse(text) else { return };
    assert!((1..=16).contains(&settings.vehicles.len()) && (0.01..=100.0).contains(&settings.clock_speed));
    for vehicle in &settings.vehicles {
        assert!(vehicle.start.x_val.abs() <= 1e5 && vehicle.cameras.len() <= 64 + 5);
        for camera in vehicle.cameras.values() {
            for image_type in ImageType::ALL {
                let capture = camera.capture(image_type);
                assert!((1..=4096).contains(&capture.width) && (1..=4096).contains(&capture.height));
                assert!((1.0..=170.0).contains(&capture.fov));
            }
        }
        assert!(vehicle.ranges.values().all(|range| range.nearest <= range.farthest));
    }
});

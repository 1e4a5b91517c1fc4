//! Targets above and below the image.

use super::super::view_height::{Correction, correction};
use super::*;
use crate::method::{Measured, Method};
use spf_core::depth::{DepthGrid, DepthSource};
use spf_core::geometry::Attitude;

fn correction_to(target: EnuPosition) -> Option<Correction> {
    let pose = Pose { position: EnuPosition { east: 0.0, north: 0.0, up: 2.0 }, attitude: Attitude::default() };
    correction(&Camera::quad(), pose, target)
}

/// The quadrotor's image reaches from 41.9° below the horizon to 31.9° above it.
#[test]
fn a_target_beyond_the_upper_or_lower_edge_is_brought_five_degrees_inside() {
    let inside = |degrees: f64| degrees.to_radians().tan();
    // 45° up: from 2 m away and 2 m below.
    let Correction { climb, back } = correction_to(target(0.0, 2.0, 4.0)).unwrap();
    assert!((climb - (2.0 - 2.0 * inside(26.85))).abs() < 0.01, "{climb}");
    assert!((back - (2.0 / inside(26.85) - 2.0)).abs() < 0.01, "{back}");
    // 45° down: from 2 m away and 2 m above.
    let Correction { climb, back } = correction_to(target(0.5, 2.0, 0.0)).unwrap();
    assert!((climb - (-2.0 + 2.0 * inside(36.85))).abs() < 0.01, "{climb}");
    assert!(back > 0.5, "{back}");
    // In view, beside the image and behind the craft nothing is to be corrected.
    for seen in [target(0.0, 2.0, 2.5), target(9.0, 2.0, 6.0), target(0.0, -2.0, 6.0)] {
        assert_eq!(correction_to(seen), None, "{seen:?}");
    }
}

/// It climbs only where the map has nothing above; back it flies only over what frames have shown.
#[test]
fn a_craft_that_is_too_low_for_its_target_climbs_unless_something_is_above() {
    let flown = |ceiling: bool| {
        let mut setup = Setup::preset(Preset::Default);
        setup.settings.method = Method::Depth(Measured::View);
        let mut flight = setup.fly(|_, _| Answer::Never);
        flight.until_phase(Phase::Flying);
        flight.pass(2.0);
        let at = flight.model.position;
        if ceiling {
            let camera = Camera::from_fov(16, 12, 90.0_f64.to_radians(), 73.7_f64.to_radians(), -60.0_f64.to_radians());
            let grid =
                DepthGrid { captured: flight.now, counter: 0, camera, cm: vec![150; 16 * 12], source: DepthSource::Sensor };
            flight.pilot.space.depth(flight.now, &grid, Pose { position: at, attitude: Attitude::default() });
        }
        let sign = EnuPosition { north: at.north + 2.0, up: at.up + 2.0, ..at };
        assert!(flight.pilot.bring_into_view(flight.now, sign));
        // A sign in view is left alone.
        assert!(!flight.pilot.bring_into_view(flight.now, EnuPosition { up: at.up, ..sign }));
        flight.pass(4.0);
        let now = flight.model.position;
        (now.up - at.up, now.north - at.north)
    };
    let (climb, forward) = flown(false);
    assert!(climb > 0.7 && forward.abs() < 0.2, "{climb} {forward}");
    let (climb, forward) = flown(true);
    assert!(climb.abs() < 0.2 && forward < 0.2, "{climb} {forward}");
}

//! Ranges of sensors around the craft reach brake and map.

use super::*;
use crate::method::{Measured, Method};
use spf_core::ranges::{RangeRay, RangeScan};
use spf_envelope::{BrakeLimits, Cause};
use spf_space::obstacle_map::Cell;

/// A wall ahead, in the way of a flight that sees nothing of it. Returns how far the craft came, and whether the map has the wall.
fn towards_a_wall(sensor: bool) -> (f64, bool, bool) {
    let wall = 8.0;
    let mut setup = Setup::preset(Preset::Default);
    setup.limits.brake = Some(BrakeLimits::without_sensor());
    setup.settings.method = Method::Depth(Measured::Part);
    setup.settings.avoid = false;
    setup.settings.max_time = secs(30.0);
    let mut flight = setup.fly(always(navigate(0.5, 0.5, 8), 1.0));
    let mut braked = false;
    for _ in 0..250 {
        flight.pass(0.1);
        if sensor && flight.phase == FlightPhase::Flying {
            let heading = flight.model.known().attitude.heading;
            let position = flight.model.position;
            let rays = (-6..=6).map(|n| {
                let azimuth = f64::from(n) * 5.0_f64.to_radians();
                // The wall is a plane to the north.
                let metres = (wall - position.north) / libm::cos(heading + azimuth);
                RangeRay { azimuth, elevation: 0.0, width: 0.0873, metres: (metres < 9.0).then_some(metres.max(0.0)), reach: 9.0 }
            });
            let scan = RangeScan { captured: flight.now, sensor: 1, rays: rays.collect() };
            flight.tell(Event::Ranges(Box::new(scan)));
        }
        braked |= flight.notes.iter().any(|(_, note)| *note == Note::Envelope(Cause::Obstacle));
    }
    let occupied = flight.pilot.obstacle_map().is_some_and(|map| {
        map.occupied().map(Cell::middle).any(|place| (place.north - wall).abs() < 0.5 && place.east.abs() < 1.0)
    });
    (flight.model.position.north, braked, occupied)
}

#[test]
fn ranges_around_the_craft_stop_it_before_a_wall_that_no_frame_shows() {
    let (blind, _, known) = towards_a_wall(false);
    assert!(blind > 8.0 && !known, "without them it flies on: {blind} m");
    let (north, braked, known) = towards_a_wall(true);
    assert!(north < 7.7 && known, "{north} m, braked: {braked}");
}

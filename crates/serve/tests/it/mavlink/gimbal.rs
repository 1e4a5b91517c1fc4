//! A camera on a gimbal: told where to look, read, and used for lifting.

use super::*;

#[test]
fn a_gimbal_is_pointed_by_its_manager_or_as_an_older_mount_and_turns_the_picture() {
    for (autopilot, old) in [(Autopilot::Px4, false), (Autopilot::ArduPilot, false), (Autopilot::ArduPilot, true)] {
        let loaded = park();
        let start = loaded.scene.start;
        let world = SimWorld::new(loaded, CraftKind::Quad, start, 5);
        let mut drone = WiredVehicle::new(world.clone(), autopilot, &[], none(), Vec::new());
        drone.carry_gimbal(old);
        drone.get_ready();
        drone.steps(1.0);
        assert!(drone.driver.camera_tilt(drone.now).is_some_and(|tilt| tilt.abs() < 0.01), "{autopilot:?}, old: {old}");
        let now = drone.now;
        drone.driver.tilt(now, 30.0_f64.to_radians());
        drone.steps(6.0);
        let told = drone.driver.camera_tilt(drone.now).unwrap().to_degrees();
        let true_tilt = drone.camera_tilt().unwrap().to_degrees();
        assert!((told - 30.0).abs() < 0.5 && (true_tilt - 30.0).abs() < 0.5, "{autopilot:?}, old: {old}: {told}, {true_tilt}");
        // The camera of the simulator, which is fixed to its craft, is where the gimbal's would see the same.
        let seen = world.snapshot_at(world.truth().time).unwrap().pose.attitude;
        assert!((world.camera().tilt - seen.pitch - 30.0_f64.to_radians()).abs() < 0.01, "{seen:?}");
        assert!(!drone.told.lock().unwrap().notices.iter().any(|(_, it)| matches!(it, Notice::Refused { .. })));
        // Beyond its range it looks straight down.
        if !old {
            let now = drone.now;
            drone.driver.tilt(now, 3.0);
            drone.steps(4.0);
            assert!((drone.camera_tilt().unwrap().to_degrees() - 90.0).abs() < 0.5);
        }
    }
}

/// Another station has control of it: it is not taken from them.
#[test]
fn a_gimbal_that_another_station_has_is_left_to_it() {
    let loaded = park();
    let start = loaded.scene.start;
    let world = SimWorld::new(loaded, CraftKind::Quad, start, 5);
    let take = VehicleCommand::new(ids::GIMBAL_CONFIGURE, &[255.0, 190.0, -1.0, -1.0]);
    let mut drone = WiredVehicle::new(world, Autopilot::Px4, &[], none(), vec![(0.001, Deed::Station(take))]);
    drone.carry_gimbal(false);
    drone.get_ready();
    let now = drone.now;
    drone.driver.tilt(now, 0.5);
    drone.steps(4.0);
    assert!(drone.camera_tilt().unwrap().abs() < 0.01);
    let told = drone.told.lock().unwrap();
    assert_eq!(told.notices.iter().filter(|(_, it)| matches!(it, Notice::Refused { .. })).count(), 1, "{:?}", told.notices);
}

/// With 30° instead of the 5° of the mount: lifted with the wrong one, the target would be meant far below or above.
#[test]
fn a_flight_by_language_with_the_camera_tilted_by_its_gimbal_reaches() {
    for autopilot in BOTH {
        let flight = fly_charged(autopilot, &[], none(), Vec::new(), "", (1.0, AtEnd::Land, Some(25.0)));
        let (_, outcome, cause) = flight.seen.outcome.clone().unwrap();
        assert_eq!((outcome, flight.phase()), (Outcome::Reached, FlightPhase::OnGround), "{autopilot:?}: {cause}");
        assert!(flight.world.truth().collided_with.is_empty());
    }
}

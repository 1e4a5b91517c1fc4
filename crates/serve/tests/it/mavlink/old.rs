//! An ArduPilot of old firmware: no rates of single messages, no landed state.

use super::*;

#[test]
fn an_old_ardupilot_is_asked_for_groups_of_messages_and_tells_by_its_state_that_it_has_landed() {
    let loaded = park();
    let start = loaded.scene.start;
    let world = SimWorld::new(loaded, CraftKind::Quad, start, 5);
    let mut drone = WiredVehicle::new(world.clone(), Autopilot::ArduPilot, &[], none(), Vec::new());
    drone.grow_old();
    let world = take_off(drone, world);
    let mut drone = world.0;
    for _ in 0..400 {
        drone.driver.heartbeat(drone.now);
        drone.step();
    }
    assert_eq!(world.1.truth().phase, FlightPhase::Flying);
    let asked = |drone: &WiredVehicle| {
        let told = drone.told.lock().unwrap();
        told.sent.iter().filter(|(_, sent)| matches!(sent, Outgoing::RequestStream(..))).count()
    };
    assert!(asked(&drone) >= 4);
    // Its estimator's report is in one of the groups.
    assert_eq!(drone.driver.facts().position_error(drone.now), Some(0.5));
    let mut envelope = spf_envelope::Envelope::new(Limits::for_craft(&Craft::quad()), Craft::quad());
    let land = envelope.clear(drone.now, spf_core::command::Command::Land).unwrap();
    drone.apply(drone.now, &land.cleared).unwrap();
    let until = drone.now + Duration::from_secs(25);
    while drone.now < until {
        drone.driver.heartbeat(drone.now);
        drone.step();
    }
    assert_eq!((world.1.truth().phase, drone.driver.is_ours()), (FlightPhase::OnGround, false));
}

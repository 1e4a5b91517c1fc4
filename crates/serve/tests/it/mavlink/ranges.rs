//! Sensors around the vehicle: what they measure reaches the pilot, and what the pilot's map shows reaches a vehicle without them.

use spf_core::command::{Command, Setpoint};
use spf_core::geometry::{Attitude, EnuPosition, Pose};
use spf_core::ranges::{RangeRay, RangeScan};
use spf_core::telemetry::Telemetry;
use spf_drone::DroneEvent;
use spf_envelope::{BrakeLimits, Cause, Envelope};

use super::*;

/// A place from which something is 3 to 5 m ahead at the heights of a take-off, and nothing is nearer than 2 m.
pub(super) fn beside_something(loaded: &LoadedScene) -> Pose {
    let start = loaded.scene.start;
    let steps = || (-20..=20).map(|n| f64::from(n) * 1.5);
    let places = steps().flat_map(|east| steps().map(move |north| (east, north)));
    let posed = places.flat_map(|(east, north)| {
        (0..8).map(move |eighth| {
            let (position, heading) = (start.position, f64::from(eighth) * core::f64::consts::FRAC_PI_4);
            let position = EnuPosition { east: position.east + east, north: position.north + north, ..position };
            Pose { position, attitude: Attitude { heading, ..Attitude::default() } }
        })
    });
    let ahead = RangeRay { azimuth: 0.0, elevation: 0.0, width: 0.0, metres: None, reach: 10.0 };
    let fits = |pose: &Pose| {
        let ground = loaded.collider.ground_below(EnuPosition { up: 40.0, ..pose.position }).map_or(0.0, |ground| ground.up);
        [2.3, 2.7, 3.2].into_iter().all(|height| {
            let up = Pose { position: EnuPosition { up: ground + height, ..pose.position }, ..*pose };
            let away = loaded.collider.range(up.position, ahead.end(up, 0.0));
            let clear = loaded.collider.nearest(up.position).is_none_or(|near| near.distance > 2.0);
            clear && away.is_some_and(|away| (3.0..5.0).contains(&away))
        })
    };
    posed.into_iter().find(fits).expect("the park has a place beside something tall")
}

fn hovering_with_sensors(autopilot: Autopilot) -> (WiredVehicle, SimWorld) {
    let loaded = park();
    let start = beside_something(&loaded);
    let world = SimWorld::new(loaded, CraftKind::Quad, start, 5);
    let mut drone = WiredVehicle::new(world.clone(), autopilot, &[], none(), Vec::new());
    drone.measure_ranges();
    take_off(drone, world)
}

/// The newest telemetry and scans within a second.
fn hear(drone: &mut WiredVehicle) -> (Telemetry, Vec<RangeScan>) {
    let (mut telemetry, mut scans) = (Telemetry::default(), Vec::<RangeScan>::new());
    let until = drone.now + Duration::from_secs(1);
    while let Some((_, event)) = drone.next_event(until) {
        match event {
            DroneEvent::Telemetry(report) => telemetry = report,
            DroneEvent::Ranges(scan) => {
                scans.retain(|before| before.sensor != scan.sensor);
                scans.push(*scan);
            }
            _ => {}
        }
    }
    (telemetry, scans)
}

#[test]
fn ranges_around_the_vehicle_are_those_of_the_scene_and_brake_the_pilot() {
    for autopilot in BOTH {
        let (mut drone, world) = hovering_with_sensors(autopilot);
        let (telemetry, scans) = hear(&mut drone);
        assert!(drone.capabilities().ranges);
        let mut sensors: Vec<usize> = scans.iter().map(|scan| scan.rays.len()).collect();
        sensors.sort_unstable();
        assert_eq!(sensors, [1, 1, 1, 72], "three rangefinders and a proximity sensor");
        let truth = world.truth().pose;
        let craft = world.shared_craft();
        let collider = craft.lock().unwrap().collider().clone();
        let mut nearest = RangeRay { azimuth: 0.0, elevation: 0.0, width: 0.0, metres: None, reach: 0.0 };
        for ray in scans.iter().flat_map(|scan| &scan.rays) {
            let Some(metres) = ray.metres else { continue };
            // Within its beam there is something that near, and nothing nearer by more than what the craft has moved.
            let sides = (-8..=8).map(|n| 0.5 * ray.width * f64::from(n) / 8.0);
            let far = RangeRay { metres: None, ..*ray };
            let found = sides.filter_map(|side| collider.range(truth.position, far.end(truth, side)));
            let found = found.fold(f64::INFINITY, f64::min);
            assert!(found < metres + 0.5, "{ray:?}: {found}");
            if metres < nearest.metres.unwrap_or(f64::INFINITY) {
                nearest = *ray;
            }
        }
        // Towards the nearest thing the envelope slows the pilot down, and away from it it does not.
        let craft = Craft { cruise_speed: 3.0, ..Craft::quad() };
        let limits = Limits { brake: Some(BrakeLimits::without_sensor()), max_speed: 5.0, ..Limits::for_craft(&craft) };
        let mut envelope = Envelope::new(limits, craft);
        envelope.observe_telemetry(drone.now, &telemetry);
        let frame = spf_core::frame::FrameMeta {
            id: spf_core::frame::FrameId(0),
            captured: drone.now,
            received: drone.now,
            capture_counter: 0,
            width: 960,
            height: 720,
            unusable: None,
        };
        envelope.observe_frame(drone.now, &frame);
        let pose = Pose { position: telemetry.position.unwrap(), attitude: telemetry.attitude };
        scans.iter().for_each(|scan| envelope.observe_ranges(drone.now, scan, pose));
        let mut towards = |sign: f64| {
            let speed = 5.0 * sign;
            let (right, forward) = (speed * nearest.azimuth.sin(), speed * nearest.azimuth.cos());
            envelope.clear(drone.now, Command::Setpoint(Setpoint { right, forward, ..Setpoint::HOLD })).unwrap()
        };
        let metres = nearest.metres.unwrap();
        let slowed = towards(1.0);
        if metres < 6.0 {
            assert_eq!(slowed.changed, Some(Cause::Obstacle), "{metres}");
            // To rest before it, with the acceleration of the craft.
            assert!(slowed.setpoint().unwrap().speed() < (2.0 * 4.0 * metres).sqrt());
        } else {
            panic!("nothing is near the start: {metres}");
        }
    }
}

#[test]
fn a_vehicle_without_sensors_is_told_what_the_map_shows() {
    let (mut drone, _world) = hovering(Autopilot::ArduPilot, &[]);
    assert!(drone.wants_surroundings() && drone.told_obstacles().is_none());
    let ray = |degrees: f64, metres| RangeRay { azimuth: degrees.to_radians(), elevation: 0.0, width: 0.087, metres, reach: 9.0 };
    let scan = RangeScan { captured: drone.now, sensor: 0, rays: vec![ray(0.0, Some(4.0)), ray(90.0, None)] };
    drone.surroundings(drone.now, &scan);
    for _ in 0..20 {
        drone.driver.heartbeat(drone.now);
        drone.step();
    }
    let told = drone.told_obstacles().unwrap();
    assert_eq!((told[0], told[18], told[36]), (400, 901, u16::MAX));
    // It tells again what it was told, which is no measurement: it is told on.
    drone.steps(1.0);
    drone.surroundings(drone.now, &scan);
    let (_, scans) = hear(&mut drone);
    assert!(scans.is_empty() && drone.wants_surroundings() && !drone.capabilities().ranges, "{scans:?}");
    // One with sensors of its own is not told its own ranges.
    let (with, _world) = hovering_with_sensors(Autopilot::ArduPilot);
    assert!(!with.wants_surroundings());
}

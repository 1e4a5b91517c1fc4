//! The autopilot's own fence: read, replaced, and kept by the autopilot.

use spf_core::command::Setpoint;
use spf_mavlink::dialect::MavMessage;
use spf_mavlink::fence::{FenceShape, items};
use spf_mavlink::frames::GlobalPosition;
use spf_mavlink::wire::{Body, Encoder};

use std::net::SocketAddr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use spf_drone::mavlink::settings::{FencePlan, MavlinkSettings};
use spf_drone::options::Options;
use spf_drone::registry;
use spf_serve::mavlink::{Equipment, VehicleServer, VehicleSetup};
use spf_serve::tello::FaultSource;
use spf_sim::craft::SimCraft;
use spf_sim::model::Model;

use super::tap::tap;
use super::*;
use crate::boxes::{at, facing, scene};

/// A radio that loses and repeats a fifth.
fn bad_radio() -> FaultPlan {
    let rules = [Stream::Telemetry, Stream::Commands].into_iter().flat_map(|stream| {
        let rule = |fault| Rule { stream, from: 0.0, until: None, fault };
        [rule(Fault::Drop { p: 0.2 }), rule(Fault::Duplicate { p: 0.2, after: 0.3 })]
    });
    FaultPlan { rules: rules.collect(), ..FaultPlan::default() }
}

fn passes(drone: &mut WiredVehicle, seconds: f64, mut done: impl FnMut(&mut WiredVehicle) -> bool) -> bool {
    let until = drone.now + spf_core::time::duration_from_secs(seconds);
    while drone.now < until {
        drone.driver.heartbeat(drone.now);
        drone.step();
        if done(drone) {
            return true;
        }
    }
    false
}

/// A square of 10 m around the origin, and a circle of 200 m.
fn square(origin: GlobalPosition) -> Vec<FenceShape> {
    let place = |east: f64, north: f64| origin.offset(spf_core::geometry::EnuPosition { east, north, up: 0.0 }).e7();
    let corners = vec![place(-5.0, -5.0), place(5.0, -5.0), place(5.0, 5.0), place(-5.0, 5.0)];
    vec![
        FenceShape::Polygon { inside: true, corners },
        FenceShape::Circle { inside: false, centre: place(100.0, 100.0), radius: 20.0 },
    ]
}

#[test]
fn a_fence_is_sent_read_back_and_kept_by_the_autopilot_over_a_bad_radio() {
    for autopilot in BOTH {
        let loaded = park();
        let start = loaded.scene.start;
        let world = SimWorld::new(loaded, CraftKind::Quad, start, 5);
        let action = if autopilot == Autopilot::Px4 { ("GF_ACTION", 2.0) } else { ("FENCE_ACTION", 4.0) };
        let mut drone = WiredVehicle::new(world.clone(), autopilot, &[action], bad_radio(), Vec::new());
        drone.get_ready();
        assert!(passes(&mut drone, 20.0, |drone| drone.driver.facts().fence.is_some()));
        assert_eq!(drone.driver.facts().fence, Some(Vec::new()), "{autopilot:?}: it has none");
        assert!(passes(&mut drone, 10.0, |drone| drone.driver.facts().origin.is_some()));
        let fence = items(&square(drone.driver.facts().origin.unwrap()));
        let now = drone.now;
        drone.driver.send_fence(now, fence.clone());
        assert!(passes(&mut drone, 60.0, |drone| drone.driver.has_fence(&fence).is_some()), "{:?}", drone.driver.fence_sent());
        assert_eq!((drone.driver.fence_sent(), drone.driver.has_fence(&fence)), (Some(Ok(())), Some(true)), "{autopilot:?}");
        assert_eq!(drone.driver.has_fence(&fence[1..]), Some(false));
        // PX4 does not tell.
        let told = if autopilot == Autopilot::Px4 { None } else { Some(true) };
        let enabled = (0..4).any(|_| {
            drone.driver.enable_fence(true);
            passes(&mut drone, 5.0, |drone| drone.driver.facts().fenced == told)
        });
        assert!(enabled, "{autopilot:?}");
        drone.steps(1.0);
        assert_eq!(drone.driver.facts().fenced, told, "{autopilot:?}");
        let words = drone.driver.facts().fence_in_words().join(", ");
        assert!(words.starts_with("inside a polygon of 4 corners, outside a circle of 20 m"), "{words}");
        // It holds at its border, whatever we send: that is somebody else who has taken over.
        let (mut drone, world) = take_off(drone, world);
        let mut envelope = spf_envelope::Envelope::new(Limits::for_craft(&Craft::quad()), Craft::quad());
        let left = passes(&mut drone, 20.0, |drone| {
            while let Some((_, event)) = drone.driver.take_event() {
                if let spf_drone::DroneEvent::Telemetry(telemetry) = event {
                    envelope.observe_telemetry(drone.now, &telemetry);
                    let ahead = Setpoint { forward: 1.5, ..Setpoint::HOLD };
                    let cleared = envelope.clear_manual(drone.now, ahead).cleared;
                    let now = drone.now;
                    drone.driver.apply(now, &cleared);
                }
            }
            !drone.driver.is_ours()
        });
        assert!(left, "{autopilot:?}: {:?}", drone.told.lock().unwrap().modes);
        let away = world.truth().pose.position.horizontal_distance(start.position);
        assert!((3.0..9.0).contains(&away), "{autopilot:?}: {away} m");
        let texts = drone.driver.facts().last_words().join("; ");
        assert!(texts.to_lowercase().contains("fence"), "{texts}");
    }
}

/// Home is 12 m from where the estimator started, as after a flight: the origin is where it was.
#[test]
fn where_the_position_counts_from_is_not_home() {
    for autopilot in BOTH {
        let loaded = park();
        let start = loaded.scene.start;
        let world = SimWorld::new(loaded, CraftKind::Quad, start, 5);
        let mut drone = WiredVehicle::new(world, autopilot, &[], none(), Vec::new());
        drone.get_ready();
        assert!(passes(&mut drone, 10.0, |drone| drone.driver.facts().home.is_some()));
        let origin = drone.driver.facts().origin.unwrap();
        let home = spf_core::geometry::EnuPosition { east: 12.0, north: -5.0, up: 0.0 };
        drone.set_home(origin.offset(home));
        assert!(passes(&mut drone, 10.0, |drone| {
            drone.driver.facts().home.is_some_and(|told| told.horizontal_distance(home) < 0.1)
        }));
        assert_eq!(drone.driver.facts().origin, Some(origin), "{autopilot:?}");
    }
}

/// A vehicle that is served by UDP.
fn serve(autopilot: Autopilot, parameters: &[(&str, f64)]) -> VehicleServer {
    let craft = SimCraft::new(scene(), Model::quad(), facing(at(0.0, 0.0, 0.0), 0.0), 1);
    VehicleServer::start(VehicleSetup {
        autopilot,
        links: vec!["udpin:127.0.0.1:0".parse().unwrap()],
        parameters: parameters.iter().map(|(name, value)| ((*name).to_owned(), *value)).collect(),
        craft: Arc::new(Mutex::new(craft)),
        faults: FaultSource::Plan(FaultPlan::default()),
        camera_tilt: Default::default(),
        equipment: Equipment::default(),
        seed: 1,
        start: Instant::now(),
    })
    .unwrap()
}

/// What connecting to an address says, with a fence that is uploaded.
fn connect(address: SocketAddr, fence: Option<FencePlan>) -> Result<String, String> {
    let options = Options { mavlink: MavlinkSettings { fence, ..MavlinkSettings::default() }, ..Options::default() };
    let (_, target) = registry::named(&format!("mavlink@udpout:{address}")).unwrap();
    match target.connect(&options, Instant::now()) {
        Ok(connected) => Ok(connected.warning),
        Err(error) => {
            let mut words = Vec::new();
            let mut source: Option<&(dyn std::error::Error + 'static)> = Some(&error);
            while let Some(error) = source {
                words.push(error.to_string());
                source = error.source();
            }
            Err(words.join(": "))
        }
    }
}

/// The same with a circle of 40 m.
fn connect_with_fence(autopilot: Autopilot, parameters: &[(&str, f64)]) -> Result<String, String> {
    let server = serve(autopilot, parameters);
    connect(server.bound()[0].unwrap(), Some(FencePlan::Circle { radius: 40.0 }))
}

/// The new fence arrives changed: what is read back is not what was sent. The vehicle gets back the one that it had.
#[test]
fn a_fence_that_cannot_be_replaced_is_put_back() {
    let replacing = BOTH.map(|autopilot| {
        std::thread::spawn(move || {
            let server = serve(autopilot, &[]);
            let vehicle = server.bound()[0].unwrap();
            let former =
                FencePlan::Polygon { outer: vec![(-9.0, -9.0), (9.0, -9.0), (9.0, 9.0), (-9.0, 9.0)], holes: Vec::new() };
            let uploaded = connect(vehicle, Some(former)).unwrap();
            assert!(uploaded.contains("inside a polygon of 4 corners"), "{autopilot:?}: {uploaded}");
            let ends = Arc::new(AtomicBool::new(false));
            let mut changed = None;
            let address = tap(vehicle, ends.clone(), move |_, packet| {
                // The first fence that is sent: of the circle, another radius.
                let Some(MavMessage::MISSION_ITEM_INT(mut it)) = packet.message() else { return None };
                (it.param1 == 40.0).then(|| {
                    it.param1 = 400.0;
                    let body = Body::from(&MavMessage::MISSION_ITEM_INT(it));
                    changed.get_or_insert_with(|| Encoder::new([packet.system, packet.component])).frame(&body)
                })
            });
            let refused = connect(address, Some(FencePlan::Circle { radius: 40.0 })).unwrap_err();
            ends.store(true, Ordering::Relaxed);
            for words in ["the flight is refused", "has its former fence again", "read back is not the one that was sent"] {
                assert!(refused.contains(words), "{autopilot:?}: {words}: {refused}");
            }
            let found = connect(vehicle, None).unwrap();
            assert!(found.contains("inside a polygon of 4 corners") && !found.contains("circle"), "{autopilot:?}: {found}");
        })
    });
    for test in replacing {
        test.join().unwrap();
    }
}

#[test]
fn a_fence_is_uploaded_at_connect_or_the_flight_is_refused_and_nothing_changed() {
    let cases = [
        (Autopilot::Px4, None),
        (Autopilot::ArduPilot, None),
        (Autopilot::Px4, Some(("GF_ACTION", 1.0))),
        (Autopilot::ArduPilot, Some(("FENCE_TYPE", 3.0))),
    ];
    let connecting = cases.map(|(autopilot, parameter)| {
        std::thread::spawn(move || (autopilot, connect_with_fence(autopilot, parameter.as_slice()), parameter))
    });
    for connected in connecting {
        let (autopilot, said, refusal) = connected.join().unwrap();
        match refusal {
            None => assert!(said.as_ref().is_ok_and(|it| it.contains("inside a circle of 40 m")), "{autopilot:?}: {said:?}"),
            Some((name, _)) => assert!(said.as_ref().is_err_and(|it| it.contains(name)), "{autopilot:?}: {said:?}"),
        }
    }
}

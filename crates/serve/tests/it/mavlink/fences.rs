//! The autopilot's own fence: read, replaced, and kept by the autopilot.

use spf_core::command::Setpoint;
use spf_mavlink::fence::{FenceShape, items};
use spf_mavlink::frames::GlobalPosition;

use super::*;

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
        assert_eq!(drone.driver.facts().fence, Some(Vec::new()), "{autopilot:?}: it has none");
        assert!(passes(&mut drone, 10.0, |drone| drone.driver.facts().origin.is_some()));
        let fence = items(&square(drone.driver.facts().origin.unwrap()));
        let now = drone.now;
        drone.driver.send_fence(now, fence.clone());
        assert!(passes(&mut drone, 60.0, |drone| drone.driver.has_fence(&fence).is_some()), "{:?}", drone.driver.fence_sent());
        assert_eq!((drone.driver.fence_sent(), drone.driver.has_fence(&fence)), (Some(Ok(())), Some(true)), "{autopilot:?}");
        assert_eq!(drone.driver.has_fence(&fence[1..]), Some(false));
        drone.driver.enable_fence();
        assert!(passes(&mut drone, 10.0, |drone| drone.driver.facts().fenced == Some(true)), "{autopilot:?}");
        let words = drone.driver.facts().fence_in_words().join(", ");
        assert!(words.starts_with("inside a polygon of 4 corners, outside a circle of 20 m"), "{words}");
        // It holds at its border, whatever we send: that is somebody else who has taken over.
        let (mut drone, world) = take_off(drone, world);
        let mut envelope = spf_core::envelope::Envelope::new(Limits::for_craft(&Craft::quad()), Craft::quad());
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

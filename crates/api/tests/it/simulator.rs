//! A craft that is flown by velocities.

use spf_api::simulator::{Observation, Simulator, SimulatorSettings};
use spf_core::command::Setpoint;

fn office(seed: u64) -> Simulator {
    let size = Some((64, 48));
    Simulator::new(&SimulatorSettings { scene: "office".to_owned(), craft: None, seed, start: None, size }).unwrap()
}

fn ahead(forward: f64) -> Setpoint {
    Setpoint { forward, ..Setpoint::HOLD }
}

#[test]
fn nothing_moves_on_the_ground_and_after_take_off_it_flies() {
    let mut simulator = office(0);
    let on_ground = simulator.step(ahead(0.5), 1.0).unwrap();
    assert!(!on_ground.is_airborne && on_ground.limited.is_some(), "{on_ground:?}");
    let up = simulator.takeoff().unwrap();
    assert!(up.is_airborne && up.pose.position.up > on_ground.pose.position.up + 0.5, "{up:?}");
    assert!(simulator.takeoff().is_err(), "it is in the air");
    let flown = simulator.step(ahead(0.5), 2.0).unwrap();
    let metres = flown.pose.position.distance(up.pose.position);
    // 0.5 m/s for 2 s, less what the craft takes to react and accelerate.
    assert!((0.5..1.0).contains(&metres), "{metres}");
    assert_eq!((flown.limited.as_deref(), flown.time_s - up.time_s), (None, 2.0));
    assert!(!simulator.land().unwrap().is_airborne);
}

#[test]
fn the_envelope_limits_speed_and_height() {
    let mut simulator = office(0);
    simulator.takeoff().unwrap();
    let fast = simulator.step(ahead(100.0), 0.5).unwrap();
    assert!(fast.limited.is_some() && fast.velocity.east.hypot(fast.velocity.north) < 2.0, "{fast:?}");
    let high = simulator.step(Setpoint { up: 1.0, ..Setpoint::HOLD }, 30.0).unwrap();
    assert!(high.limited.is_some() && high.touched.is_empty(), "the office has a ceiling: {high:?}");
    assert!(simulator.step(ahead(f64::NAN), 0.1).is_err());
    for dt in [0.0, -1.0, f64::NAN, 61.0] {
        assert!(simulator.step(Setpoint::HOLD, dt).is_err(), "{dt}");
    }
}

#[test]
fn a_wall_is_touched_and_seen_before() {
    let mut simulator = office(0);
    let seen = simulator.takeoff().unwrap();
    let (width, height) = seen.size();
    let pixels = width as usize * height as usize;
    assert_eq!((seen.rgb().len(), seen.depth().len(), seen.ids().len()), (3 * pixels, pixels, pixels));
    // Walls all around, with windows in them.
    let solid = seen.depth().iter().zip(seen.ids()).filter(|(metres, id)| **id != 0 && (0.05..60.0).contains(*metres)).count();
    assert!(solid * 2 > pixels && seen.rgb().iter().any(|byte| *byte > 100), "{solid} of {pixels}");
    let crashed = simulator.step(ahead(1.0), 40.0).unwrap();
    let keys: Vec<&str> = simulator.scene().tags.iter().map(|tags| tags.key.as_str()).collect();
    assert!(!crashed.touched.is_empty() && crashed.touched.iter().all(|key| keys.contains(&key.as_str())), "{crashed:?}");
}

#[test]
fn the_same_seed_flies_the_same_and_images_keep_their_instant() {
    let fly = |seed| -> Vec<Observation> {
        let mut simulator = office(seed);
        let up = simulator.takeoff().unwrap();
        vec![up, simulator.step(Setpoint { yaw_rate: 0.5, ..ahead(0.3) }, 2.0).unwrap()]
    };
    let (one, two) = (fly(3), fly(3));
    assert_eq!(one[1].pose, two[1].pose);
    // The first is rendered before the second flight has gone on, and long after it.
    assert!(one[0].rgb() == two[0].rgb() && one[1].rgb() == two[1].rgb());
    assert!(one[0].rgb() != one[1].rgb(), "it has turned");
}

//! A craft that is flown by velocities.

use std::sync::Mutex;

use spf_api::simulator::{Observation, Simulator, SimulatorSettings, step_all};
use spf_core::command::Setpoint;
use spf_core::query::ImagePoint;

fn office_settings() -> SimulatorSettings {
    SimulatorSettings { scene: "office".to_owned(), craft: None, seed: 0, start: None, size: Some((64, 48)) }
}

fn office(seed: u64) -> Simulator {
    Simulator::new(&SimulatorSettings { seed, ..office_settings() }).unwrap()
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

#[test]
fn a_point_is_flown_to_as_the_method_lifts_it() {
    let mut simulator = office(1);
    let middle = ImagePoint { u: 0.5, v: 0.5 };
    assert!(simulator.point(middle, 4.0).is_err(), "it stands on the ground");
    let up = simulator.takeoff().unwrap();
    for (point, label) in [(middle, 0.9), (middle, f64::NAN), (ImagePoint { u: 1.2, v: 0.5 }, 4.0)] {
        assert!(simulator.point(point, label).is_err(), "{point:?} {label}");
    }
    // 10 m · (4/10)^1.8 = 1.92 m ahead, then 60 % of the half image to the right.
    let ahead = simulator.point(middle, 4.0).unwrap();
    let metres = ahead.pose.position.distance(up.pose.position);
    assert!((metres - 1.92).abs() < 0.15 && ahead.velocity.east.hypot(ahead.velocity.north) < 0.15, "{metres} {ahead:?}");
    let aside = simulator.point(ImagePoint { u: 0.8, v: 0.5 }, 3.0).unwrap();
    assert!(aside.pose.attitude.heading > ahead.pose.attitude.heading + 0.2, "it turns to the right: {aside:?}");
    assert!(aside.touched.is_empty() && aside.limited.is_none(), "{aside:?}");
}

#[test]
fn distances_are_to_surfaces() {
    let mut simulator = office(0);
    let up = simulator.takeoff().unwrap();
    let places = simulator.places();
    let (key, centre) = places.iter().find(|(key, _)| key.contains("whiteboard")).expect("the office has one");
    let near = up.distance_to(key).unwrap();
    assert!(near <= centre.distance(up.pose.position) && near > 0.0, "{near}");
    assert!(up.distance_to("vending machin").unwrap_err().to_string().contains("vending machin"));
}

#[test]
fn the_first_image_of_a_scene_is_made_in_one_thread_while_many_are_stepped_in_others() {
    let yard = |seed| Simulator::new(&SimulatorSettings { scene: "yard".to_owned(), seed, ..office_settings() }).unwrap();
    let all: Vec<Mutex<Simulator>> = (0..4).map(|seed| Mutex::new(yard(seed))).collect();
    let craft: Vec<_> = all.iter().map(|one| (one, Setpoint::HOLD)).collect();
    // They would wait for each other for ever, had the scene to be made ready in the pool's own tasks.
    std::thread::scope(|scope| {
        scope.spawn(|| assert!(!yard(9).observe().rgb().is_empty()));
        assert!(step_all(&craft, 0.1).iter().all(|one| one.as_ref().is_ok_and(|seen| !seen.rgb().is_empty())));
    });
}

#[test]
fn many_fly_at_once_as_each_does_alone() {
    let all: Vec<Mutex<Simulator>> = (0..3).map(|seed| Mutex::new(office(seed))).collect();
    all.iter().for_each(|one| drop(one.lock().unwrap().takeoff().unwrap()));
    let setpoints = [ahead(0.4), ahead(f64::NAN), Setpoint { yaw_rate: 0.5, ..ahead(0.2) }];
    let craft: Vec<_> = all.iter().zip(setpoints).collect();
    let together = step_all(&craft, 1.0);
    assert!(together[1].is_err(), "of numbers that are none");
    for seed in [0, 2] {
        let mut alone = office(seed as u64);
        alone.takeoff().unwrap();
        let one = alone.step(setpoints[seed], 1.0).unwrap();
        let same = together[seed].as_ref().unwrap();
        assert!(same.pose == one.pose && same.rgb() == one.rgb(), "{seed}");
    }
}

//! Actors and the craft among them: they stop for it, and it can collide with them.

use spf_core::command::{Command, Setpoint};
use spf_core::craft::CraftKind;
use spf_core::geometry::{Attitude, EnuPosition, Pose};
use spf_core::time::Time;
use spf_sim::craft::SimCraft;
use spf_sim::dynamics::SimConditions;
use spf_sim::model::Model;

use crate::stage::{Stage, drive, walk};

fn hovering(stage: &Stage, at: [f64; 3]) -> SimCraft {
    let position = EnuPosition { east: at[0], north: at[1], up: at[2] };
    let pose = Pose { position, attitude: Attitude::default() };
    let conditions = SimConditions { hovering: true, exact: true, ..SimConditions::new(4) };
    SimCraft::with_traffic(stage.cast.clone(), stage.collider.clone(), Model::of(CraftKind::Quad), pose, conditions)
}

#[test]
fn a_car_and_a_person_stop_for_a_hovering_craft_and_not_for_one_high_above() {
    let car = Stage::of(&[("car", "car", drive("[[0, -40], [0, 40]]", ", loop = \"once\""))]);
    let person = Stage::of(&[("person", "person", walk("[[0, -10], [0, 40]]", ", loop = \"once\""))]);
    // Half a car of 4.5 m, or half a person, the craft's radius, and the clearance.
    for (stage, half) in [(&car, 2.25), (&person, 0.25)] {
        let mut below = hovering(stage, [0.0, 0.0, 0.8]);
        let mut above = hovering(stage, [0.0, 0.0, 4.0]);
        let mut beside = hovering(stage, [3.0, 0.0, 0.8]);
        for craft in [&mut below, &mut above, &mut beside] {
            craft.advance_to(Time::from_secs_f64(20.0));
            assert!(craft.truth().collided_with.is_empty());
        }
        let north = |craft: &SimCraft| craft.actors_at(craft.time()).unwrap()[0].position.north;
        let left = -north(&below) - half - 0.3;
        assert!((0.3..1.2).contains(&left), "{left}");
        assert!(north(&above) > 5.0 && north(&beside) > 5.0);
    }
}

#[test]
fn a_craft_that_flies_into_a_person_hits_them() {
    let stage = Stage::of(&[("person", "person", walk("[[0, 3], [0, 2.9]]", ", loop = \"once\""))]);
    let mut craft = hovering(&stage, [0.0, 0.0, 0.8]);
    let forward = Setpoint { forward: 1.0, ..Setpoint::HOLD };
    craft.apply(Time::ZERO, Command::Setpoint(forward), Time::from_secs_f64(10.0));
    craft.advance_to(Time::from_secs_f64(10.0));
    let contacts = craft.truth().collided_with;
    assert_eq!(contacts.len(), 1);
    assert_eq!(stage.scene.object(contacts[0].1).unwrap().key, "person");
}

#[test]
fn the_place_of_a_frame_is_kept() {
    let stage = Stage::of(&[("a", "person", walk("[[5, 0], [5, 20]]", ""))]);
    let mut craft = hovering(&stage, [0.0, 0.0, 3.0]);
    craft.advance_to(Time::from_secs_f64(12.0));
    assert!(craft.actors_at(Time::from_secs_f64(11.85)).is_some() && craft.actors_at(Time::from_secs_f64(2.1)).is_some());
    assert!(craft.actors_at(Time::from_secs_f64(1.0)).is_none() && craft.actors_at(Time::from_secs_f64(12.1)).is_none());
}

#[test]
fn a_craft_that_is_put_elsewhere_forgets_its_crash_and_flies_on_there() {
    let stage = Stage::of(&[("person", "person", walk("[[0, 3], [0, 2.9]]", ", loop = \"once\""))]);
    let mut craft = hovering(&stage, [0.0, 0.0, 0.8]);
    let forward = Setpoint { forward: 1.0, ..Setpoint::HOLD };
    craft.apply(Time::ZERO, Command::Setpoint(forward), Time::from_secs_f64(10.0));
    craft.advance_to(Time::from_secs_f64(10.0));
    assert!(craft.dynamics().crashed());
    let there = Pose { position: EnuPosition { east: 5.0, north: 6.0, up: 9.0 }, attitude: Attitude::default() };
    craft.place(there, spf_core::geometry::EnuVelocity::default(), true);
    assert_eq!(craft.true_pose_at(craft.time()), Some(there));
    craft.advance_to(Time::from_secs_f64(12.0));
    assert!(!craft.dynamics().crashed() && craft.truth().collided_with.is_empty());
    assert!(craft.truth().pose.position.distance(there.position) < 0.01, "{:?}", craft.truth());
    // A wind that begins there pushes it, until its controller has learnt it.
    craft.set_wind(6.0, 0.0);
    craft.advance_to(Time::from_secs_f64(12.5));
    assert!(craft.truth().velocity.east > 0.1, "{:?}", craft.truth());
}

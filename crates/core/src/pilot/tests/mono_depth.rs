//! A network's depth reaches the map, at its frame's time and pose, and nothing else.

use super::*;
use crate::camera::Camera;
use crate::depth::CameraAxes;
use crate::envelope::BrakeLimits;
use crate::geometry::EnuPosition;
use crate::mono_depth::{DepthKind, MonoDepth, ScaleSource};
use crate::obstacle_map::Cell;
use crate::query::ImagePoint;

/// A wall to the north of the start, metres.
const WALL: f64 = 9.0;

/// What a network says of a wall and of level ground, seen at `pose`: a third of the depth, or the same everywhere if it knows nothing.
fn estimate(camera: &Camera, pose: Pose, captured: Time, knows: bool) -> MonoDepth {
    let axes = CameraAxes::new(camera, pose);
    let (width, height) = (48_usize, 36_usize);
    let value = |index: usize| {
        let place = |i: usize, of: usize| (i as f64 + 0.5) / of as f64;
        let ray = camera.ray(ImagePoint { u: place(index % width, width), v: place(index / width, height) });
        let along = axes.place(ray.right, 1.0, ray.up);
        let (north, down) = (along.north - pose.position.north, pose.position.up - along.up);
        let wall = if north > 0.0 { (WALL - pose.position.north) / north } else { f64::INFINITY };
        let ground = if down > 0.0 { pose.position.up / down } else { f64::INFINITY };
        if knows { (wall.min(ground) / 3.0) as f32 } else { 1.0 }
    };
    let output: Vec<f32> = (0..width * height).map(value).collect();
    MonoDepth::new((FrameId(1), captured), camera, DepthKind::Relative, (width, height), &output).unwrap()
}

/// A flight of some seconds to the north, with an estimate every 0.5 s that is `late`.
fn flown(late: f64, knows: bool) -> Flight {
    let mut setup = Setup::preset(Preset::Default);
    setup.limits.brake = Some(BrakeLimits::without_sensor());
    setup.settings.guidance.map = true;
    setup.settings.guidance.mono_depth = true;
    setup.settings.avoid = false;
    setup.settings.max_time = secs(30.0);
    let mut flight = setup.fly(always(navigate(0.5, 0.5, 3), 1.0));
    let mut under_way: Vec<(Time, MonoDepth)> = Vec::new();
    let mut next = Time::ZERO;
    for _ in 0..100 {
        flight.pass(0.1);
        let now = flight.now;
        if flight.phase == FlightPhase::Flying && now >= next {
            next = now + secs(0.5);
            let pose = flight.model.known().pose();
            under_way.push((now + secs(late), estimate(&flight.pilot.camera.clone(), pose, now, knows)));
        }
        let due: Vec<MonoDepth> = under_way.extract_if(.., |(at, _)| *at <= now).map(|(_, one)| one).collect();
        due.into_iter().for_each(|one| flight.tell(Event::MonoDepth(Box::new(one))));
    }
    flight
}

/// Distances to the north of the occupied cells that are well above the ground.
fn occupied(flight: &Flight) -> Vec<f64> {
    let map = flight.pilot.obstacle_map().unwrap();
    map.occupied().map(Cell::middle).filter(|place| place.up > 1.0).map(|place| place.north).collect()
}

fn said(flight: &Flight) -> Vec<&str> {
    let words = |(_, note): &'_ (Time, Note)| if let Note::DepthScale(words) = note { Some(words.clone()) } else { None };
    let all: Vec<String> = flight.notes.iter().filter_map(words).collect();
    all.into_iter().map(|text| if text.contains("scaled by the ground") { "scaled" } else { "not in use" }).collect()
}

#[test]
fn an_estimate_is_in_the_map_where_its_frame_saw_it_however_late_it_comes() {
    for late in [0.1, 1.0, 2.5] {
        let flight = flown(late, true);
        let walls = occupied(&flight);
        assert!(flight.model.position.north > 2.0, "it flew");
        assert!(walls.len() > 20 && walls.iter().all(|north| (north - WALL).abs() < 0.8), "{late} s: {walls:?}");
        assert_eq!(said(&flight), ["scaled"]);
        assert_eq!(flight.pilot.depth_scale().unwrap().unwrap().source, ScaleSource::Ground);
        assert!(flight.pilot.network_depth().is_some());
    }
}

#[test]
fn an_estimate_that_is_older_than_three_seconds_or_has_no_scale_is_not_used() {
    assert_eq!(occupied(&flown(3.5, true)), [0.0; 0]);
    let blind = flown(0.5, false);
    assert_eq!(occupied(&blind), [0.0; 0]);
    assert_eq!(said(&blind), ["not in use"]);
    assert!(blind.pilot.network_depth().is_none());
}

/// The brake measures depth by sensors alone: without a map, an estimate changes nothing.
#[test]
fn the_brake_does_not_see_an_estimate() {
    let speeds = |told: bool| {
        let mut setup = Setup::preset(Preset::Default);
        setup.limits.brake = Some(BrakeLimits::with_sensor());
        setup.settings.guidance.mono_depth = told;
        setup.settings.avoid = false;
        let mut flight = setup.fly(always(navigate(0.5, 0.5, 8), 1.0));
        for _ in 0..60 {
            flight.pass(0.1);
            if told && flight.phase == FlightPhase::Flying {
                let near =
                    Pose { position: EnuPosition { north: WALL - 0.6, up: 2.0, ..EnuPosition::default() }, ..Pose::default() };
                let one = estimate(&flight.pilot.camera.clone(), near, flight.now, true);
                flight.tell(Event::MonoDepth(Box::new(one)));
            }
        }
        flight.model.position
    };
    assert_eq!(speeds(true), speeds(false));
}

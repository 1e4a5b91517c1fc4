//! The scenes of the real-world set, office and yard: their contents, and that a small craft can fly there.

use std::collections::BTreeSet;

use spf_core::craft::CraftKind;
use spf_core::geometry::EnuPosition;
use spf_scene::collide::Collider;
use spf_scene::geometry::Role;
use spf_scene::{Object, Scene};

const NAMES: [&str; 2] = ["office", "yard"];
/// Height at which a Tello flies after take-off, metres.
const FLYING: f64 = 0.8;

fn scene(name: &str) -> (Scene, Collider) {
    let scene = Scene::load(name).expect("the scene is part of the program");
    let collider = Collider::new(&scene.geometry).expect("its meshes are sound");
    (scene, collider)
}

fn key<'a>(scene: &'a Scene, key: &str) -> &'a Object {
    scene.by_key(key).unwrap_or_else(|| panic!("no `{key}` in {}", scene.name))
}

fn called<'a>(scene: &'a Scene, name: &'a str) -> impl Iterator<Item = &'a Object> {
    scene.objects.iter().filter(move |o| o.tags.names.iter().any(|n| n == name))
}

#[test]
fn they_belong_to_the_real_world_set() {
    for name in NAMES {
        let (scene, _) = scene(name);
        assert_eq!((scene.near, scene.success_radius, scene.default_craft), (0.8, 1.0, CraftKind::Tello), "{name}");
        let triangles: usize = scene.geometry.parts.iter().map(|p| p.triangles.len()).sum();
        assert!((20_000..150_000).contains(&triangles), "{name}: {triangles}");
    }
}

#[test]
fn they_have_what_the_real_world_tasks_need() {
    for name in NAMES {
        let (scene, _) = scene(name);
        assert!(called(&scene, "chair").count() >= 6, "{name}");
        let styles: BTreeSet<&str> = called(&scene, "chair").map(|o| o.tags.names[0].as_str()).collect();
        assert!(styles.len() >= 4, "{name}: {styles:?}");
        for (what, least) in [("cone", 2), ("person", 6), ("bottle", 2), ("vending machine", 1), ("door", 2), ("open door", 1)] {
            assert!(called(&scene, what).count() >= least, "{name}: {what}");
        }
        assert!(scene.objects.iter().any(|o| o.mesh == "sign"), "{name}");
        assert_eq!(key(&scene, "person_green").tags.colour.as_deref(), Some("green"));
        let long = key(&scene, "person_lying").bounds;
        assert!(long.max.up - long.min.up < 0.6, "{name}: who lies is low");
    }
    let (yard, _) = scene("yard");
    let (chair, roof) = (key(&yard, "covered_armchair").bounds, key(&yard, "terrace_roof").bounds);
    assert!(chair.min.east > roof.min.east && chair.max.east < roof.max.east && chair.max.north < roof.max.north);
    assert!(chair.min.north > roof.min.north && chair.max.up < 1.2 && roof.max.up > 2.0);
}

#[test]
fn their_starts_are_free_and_their_targets_within_reach() {
    for name in NAMES {
        let (scene, collider) = scene(name);
        let start = scene.start.position;
        let air = EnuPosition { up: start.up + FLYING, ..start };
        assert_eq!(collider.sweep(EnuPosition { up: start.up + 0.3, ..start }, air, 0.25), None, "{name}");
        let (s, c) = scene.start.attitude.heading.sin_cos();
        let ahead = EnuPosition { east: air.east + s, north: air.north + c, ..air };
        assert_eq!(collider.sweep(air, ahead, 0.25), None, "{name}");
        // Moving objects are not part of the collider.
        let still = |o: &&Object| scene.actors.iter().all(|actor| actor.object != o.id);
        let targets = scene.objects.iter().filter(still).filter(|o| ["person", "chair", "cone"].contains(&o.tags.kind.as_str()));
        for object in targets.chain([key(&scene, "vending_machine")]) {
            let range = collider.distance_to(object.id, air).expect("targets are solid");
            assert!((1.0..=16.0).contains(&range), "{name}: {} at {range:.1} m", object.key);
        }
    }
}

#[test]
fn a_small_craft_fits_through_every_open_door() {
    for name in NAMES {
        let (scene, collider) = scene(name);
        let openings: Vec<&Object> = scene.objects.iter().filter(|o| o.opening).collect();
        assert!(openings.len() >= 2, "{name}");
        for opening in openings {
            let (min, max) = (opening.bounds.min, opening.bounds.max);
            let (wide, deep) = (max.east - min.east, max.north - min.north);
            assert!(wide.max(deep) >= 0.9 && max.up - min.up >= 2.0, "{name}: {}", opening.key);
            let middle = EnuPosition { east: 0.5 * (min.east + max.east), north: 0.5 * (min.north + max.north), up: 0.0 };
            let (e, n) = if wide > deep { (0.0, 0.9) } else { (0.9, 0.0) };
            for up in [0.8, 1.5] {
                let from = EnuPosition { east: middle.east - e, north: middle.north - n, up };
                let to = EnuPosition { east: middle.east + e, north: middle.north + n, up };
                let met = collider.sweep(from, to, 0.25).map(|c| scene.object(c.object).expect("it is one").key.clone());
                assert_eq!(met, None, "{name}: the way through {} at {up} m", opening.key);
            }
        }
    }
}

#[test]
fn windows_look_open_and_stop_what_flies_into_them() {
    let (scene, collider) = scene("office");
    let window = key(&scene, "window_1").bounds;
    let up = window.min.up + 0.45;
    // Off the middle, where there is no bar.
    let east = 0.5 * (window.min.east + window.max.east) + 0.4;
    let (inside, outside) = (EnuPosition { east, north: 1.9, up }, EnuPosition { east, north: -2.0, up });
    let met = collider.sweep(inside, outside, 0.05).expect("the pane holds");
    assert!(scene.object(met.object).is_some_and(|o| o.mesh == "window") && met.centre.north < 0.2, "{met:?}");
    assert!(scene.geometry.parts.iter().any(|p| p.role == Role::Glass));
}

#[test]
fn no_lamp_lights_the_person_in_the_dark() {
    for name in NAMES {
        let (scene, collider) = scene(name);
        let body = key(&scene, "person_in_the_dark").bounds;
        // About 10 cm in front of the face, so that the body itself hides nothing.
        let face =
            EnuPosition { east: 0.5 * (body.min.east + body.max.east), north: body.min.north - 0.1, up: body.max.up - 0.15 };
        for lamp in &scene.geometry.light.lamps {
            let [east, north, up] = lamp.position.to_array().map(f64::from);
            let from = EnuPosition { east, north, up };
            let reaches = from.distance(face) < f64::from(lamp.reach);
            assert!(!reaches || collider.segment_blocked(from, face).is_some(), "{name}: the lamp at {from:?}");
        }
    }
}

//! The park: it contains the targets of the simulation tasks, its start is free, and its gates can be flown through.
#![allow(clippy::unwrap_used)]

use std::collections::BTreeSet;

use spf_core::craft::CraftKind;
use spf_core::geometry::EnuPosition;
use spf_scene::collide::Collider;
use spf_scene::{Object, Scene};

fn park() -> Scene {
    Scene::load("park").expect("the park is part of the program")
}

fn named<'a>(scene: &'a Scene, name: &str) -> Vec<&'a Object> {
    scene.objects.iter().filter(|o| o.tags.names.iter().any(|n| n == name)).collect()
}

#[test]
fn the_park_has_what_its_tasks_name() {
    let scene = park();
    assert_eq!((scene.near, scene.success_radius, scene.default_craft), (3.0, 5.0, CraftKind::Quad));
    for (name, count) in [
        ("gate", 4),
        ("tower", 2),
        ("hill", 1),
        ("plane", 1),
        ("lake", 1),
        ("locomotive", 1),
        ("carriage", 3),
        ("monorail train", 1),
        ("tower crane", 1),
        ("balloon", 5),
    ] {
        let found: Vec<&str> = named(&scene, name).iter().map(|o| o.key.as_str()).collect();
        assert_eq!(found.len(), count, "{name}: {found:?}");
    }
    let red = named(&scene, "balloon").into_iter().filter(|o| o.tags.colour.as_deref() == Some("red")).count();
    assert_eq!(red, 3);
    assert!(named(&scene, "tree").len() >= 20);
    // The names of several objects differ by something visible.
    for name in ["gate", "tower", "carriage"] {
        let colours: BTreeSet<_> = named(&scene, name).iter().map(|o| o.tags.colour.clone()).collect();
        assert_eq!(colours.len(), named(&scene, name).len(), "{name}: {colours:?}");
    }
}

#[test]
fn targets_lie_within_the_bounds() {
    let scene = park();
    for object in scene.objects.iter().filter(|o| !["ground", "tree", "wood"].contains(&o.tags.kind.as_str())) {
        let (min, max) = (object.bounds.min, object.bounds.max);
        let middle = EnuPosition { east: 0.5 * (min.east + max.east), north: 0.5 * (min.north + max.north), up: min.up.max(0.0) };
        assert!(scene.bounds.contains(middle) || object.tags.names[0] == "distant building", "{}", object.key);
    }
}

#[test]
fn the_start_and_the_space_above_it_are_free() {
    let scene = park();
    let world = Collider::new(&scene.geometry).unwrap();
    let above = |up: f64| EnuPosition { up, ..scene.start.position };
    assert!(world.sweep(above(1.6), above(30.0), 1.5).is_none());
}

#[test]
fn the_park_stays_within_its_triangle_budget() {
    let scene = park();
    let count = |id: Option<u16>| -> usize {
        scene.geometry.parts.iter().filter(|p| id.is_none_or(|id| p.object == id)).map(|p| p.triangles.len()).sum()
    };
    assert!((30_000..=150_000).contains(&count(None)), "{}", count(None));
    for object in &scene.objects {
        assert!(count(Some(object.id)) <= 3000, "{} has {}", object.key, count(Some(object.id)));
    }
}

#[test]
fn a_sphere_passes_every_gate() {
    let scene = park();
    let world = Collider::new(&scene.geometry).unwrap();
    let openings: Vec<&Object> = scene.objects.iter().filter(|o| o.opening).collect();
    assert_eq!(openings.len(), 5);
    for opening in openings {
        let (min, max) = (opening.bounds.min, opening.bounds.max);
        let (width, height) = ((max.east - min.east).max(max.north - min.north), max.up - min.up);
        assert!(width >= 2.5 && height >= 2.5, "{}: {width:.2} by {height:.2} m", opening.key);
        assert!(min.up >= 0.8 || min.up <= 0.0, "{} begins at {:.2} m", opening.key, min.up);
        assert!(!scene.object(opening.tags.opening_of.unwrap()).unwrap().opening, "{}", opening.key);
        // The park's gates face north and south: 6 m before and behind, at the middle and near each edge.
        assert!(max.north - min.north < 1e-3, "{} faces north or south", opening.key);
        let (east, up) = (0.5 * (min.east + max.east), 0.5 * (min.up + max.up));
        for (across, above) in [(0.0, 0.0), (0.6, 0.0), (-0.6, 0.0), (0.0, 0.6), (0.0, -0.6)] {
            let (east, up) = (east + across * 0.5 * width, up + above * 0.5 * height);
            let at = |north: f64| EnuPosition { east, north, up };
            let hit = world.sweep(at(min.north - 6.0), at(min.north + 6.0), 0.4);
            assert!(
                hit.is_none(),
                "{} at ({across}, {above}): {:?}",
                opening.key,
                hit.map(|h| scene.object(h.object).unwrap().key.clone())
            );
        }
    }
}

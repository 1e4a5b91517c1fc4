//! The named parts of objects in the built-in scenes.

use std::collections::{BTreeMap, BTreeSet};

use spf_core::tags::SURFACES;
use spf_scene::geometry::{Part, Role};
use spf_scene::{Object, Scene};

/// Metres: what is smaller than this is one thing to whoever flies around it.
const LARGE: f32 = 3.0;
/// Least fraction of an object's rectangle, seen from a side, that the object must fill to be described by one box.
const FULL: f32 = 0.5;
/// Metres: what is narrower than this from one side is not looked at from there.
const THIN: f32 = 1.5;
/// Cells along each side of that rectangle.
const CELLS: usize = 60;

fn scenes() -> impl Iterator<Item = Scene> {
    ["city", "park", "office", "yard"].into_iter().map(|name| Scene::load(name).expect("it is built in"))
}

/// The fraction of an object's bounding rectangle, seen along x or along y, that it fills: what its triangles cover, and what lies
/// between them both across and up and down, such as the meshes of a fence.
fn filled(parts: &[&Part], along: usize) -> f32 {
    let across = 1 - along;
    let points = || parts.iter().flat_map(|part| &part.vertices).map(|v| (v.position[across], v.position.z));
    let fold = |pick: fn((f32, f32)) -> f32| {
        points().map(pick).fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)))
    };
    let ((left, right), (low, top)) = (fold(|p| p.0), fold(|p| p.1));
    // Seen from its end, something thin is no wider than a craft.
    if right - left < THIN {
        return 1.0;
    }
    let mut cells = vec![false; CELLS * CELLS];
    let cell = |value: f32, from: f32, to: f32| {
        ((value - from) / (to - from).max(1e-6) * CELLS as f32).clamp(0.0, CELLS as f32 - 1.0) as usize
    };
    for part in parts {
        for triangle in &part.triangles {
            let corners = triangle.map(|i| part.vertices[i as usize].position).map(|p| (p[across], p.z));
            let steps = 2 * CELLS;
            for i in 0..=steps {
                for j in 0..=steps - i {
                    let (a, b) = (i as f32 / steps as f32, j as f32 / steps as f32);
                    let at = |pick: fn(&(f32, f32)) -> f32| {
                        pick(&corners[0]) * (1.0 - a - b) + pick(&corners[1]) * a + pick(&corners[2]) * b
                    };
                    cells[cell(at(|p| p.1), low, top) * CELLS + cell(at(|p| p.0), left, right)] = true;
                }
            }
        }
    }
    let span = |of: &dyn Fn(usize) -> bool| Some((0..CELLS).find(|i| of(*i))?..=(0..CELLS).rfind(|i| of(*i))?);
    let rows: Vec<_> = (0..CELLS).map(|row| span(&|column| cells[row * CELLS + column])).collect();
    let columns: Vec<_> = (0..CELLS).map(|column| span(&|row| cells[row * CELLS + column])).collect();
    let within = |cell: &usize| {
        let (row, column) = (cell / CELLS, cell % CELLS);
        rows[row].as_ref().is_some_and(|span| span.contains(&column))
            && columns[column].as_ref().is_some_and(|span| span.contains(&row))
    };
    (0..CELLS * CELLS).filter(within).count() as f32 / (CELLS * CELLS) as f32
}

fn is_large(object: &Object) -> bool {
    let b = &object.bounds;
    let size = [b.max.east - b.min.east, b.max.north - b.min.north, b.max.up - b.min.up];
    size.iter().any(|side| *side > f64::from(LARGE)) && size[2] > 1.0
}

#[test]
fn what_one_box_would_describe_badly_has_named_parts() {
    let mut wanting = BTreeSet::new();
    for scene in scenes() {
        let mut seen = BTreeSet::new();
        let mut parts: BTreeMap<u16, Vec<&Part>> = BTreeMap::new();
        for part in scene.meshes().filter(|part| part.role == Role::Solid) {
            parts.entry(part.object).or_default().push(part);
        }
        let named: BTreeSet<u16> = scene.pieces.iter().map(|piece| piece.object).collect();
        for object in &scene.objects {
            let solid = !object.opening && !SURFACES.contains(&object.tags.kind.as_str()) && object.mesh != "person";
            if !solid || !is_large(object) || named.contains(&object.id) || !seen.insert((object.mesh, object.tags.names.clone()))
            {
                continue;
            }
            let parts = &parts[&object.id];
            if filled(parts, 0).min(filled(parts, 1)) < FULL {
                wanting.insert(format!("{} of {} ({})", object.key, scene.name, object.mesh));
            }
        }
    }
    assert!(wanting.is_empty(), "name their parts: {wanting:?}");
}

#[test]
fn every_triangle_of_a_crane_a_bridge_and_a_gate_belongs_to_one_of_its_parts() {
    let mut checked = BTreeSet::new();
    for scene in scenes() {
        for object in scene.objects.iter().filter(|o| ["tower_crane", "bridge", "gate", "lookout_tower"].contains(&o.mesh)) {
            checked.insert(object.mesh);
            for part in scene.meshes().filter(|part| part.object == object.id) {
                assert_eq!(part.pieces.len(), part.triangles.len(), "{}", object.key);
                for piece in &part.pieces {
                    let piece = &scene.pieces[usize::from(*piece) - 1];
                    assert_eq!(piece.object, object.id, "{}: {}", object.key, piece.name);
                }
            }
        }
    }
    assert_eq!(checked.len(), 4, "{checked:?}");
}

#[test]
fn a_crane_is_its_mast_and_a_bridge_its_deck() {
    let city = scenes().next().unwrap();
    let main = |key: &str| {
        let object = city.by_key(key).unwrap().id;
        let of = city.pieces.iter().filter(|piece| piece.object == object && piece.main);
        of.map(|piece| piece.name.as_str()).collect::<Vec<_>>()
    };
    assert_eq!((main("red_crane"), main("bridge")), (vec!["mast"], vec!["deck"]));
}

#[test]
fn names_of_parts_are_words_in_lower_case() {
    for scene in scenes() {
        assert!(scene.pieces.is_sorted_by_key(|piece| piece.object), "{}", scene.name);
        for piece in &scene.pieces {
            assert!(piece.name.bytes().all(|b| b.is_ascii_lowercase() || b == b' ' || b == b'-'), "{}", piece.name);
        }
    }
}

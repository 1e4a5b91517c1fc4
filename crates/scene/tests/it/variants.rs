//! Variants of scenes: every seed gives a valid scene, the same seed the same one, different seeds different ones.

use std::collections::BTreeSet;
use std::sync::Arc;

use glam::DVec2;
use proptest::prelude::*;
use spf_core::geometry::EnuPosition;
use spf_core::time::Time;
use spf_scene::actors::{Cast, Traffic};
use spf_scene::collide::Collider;
use spf_scene::geometry::{Part, Role, SceneGeometry};
use spf_scene::{Object, Scene};

/// Built-in scenes that have variants.
const VARIED: &[&str] = &["city", "park", "office", "yard"];
const SEEDS: core::ops::Range<u64> = 0..4;
/// Further seeds, for `--ignored`.
const MORE_SEEDS: core::ops::Range<u64> = 4..150;

fn variant(name: &str, seed: u64) -> Scene {
    Scene::load(&format!("{name}@{seed}")).unwrap_or_else(|error| panic!("{name}@{seed}: {error}"))
}

/// Position and colour of every object, to the centimetre.
fn layout(scene: &Scene) -> Vec<(String, Option<String>, [i64; 4])> {
    let cm = |v: f64| (v * 100.0).round() as i64;
    let row = |o: &Object| {
        let (min, max) = (o.bounds.min, o.bounds.max);
        (o.tags.names[0].clone(), o.tags.colour.clone(), [cm(min.east), cm(min.north), cm(max.east), cm(max.north)])
    };
    scene.objects.iter().map(row).collect()
}

/// The solid parts of an object.
fn parts_of(scene: &Scene, object: &Object) -> Vec<Part> {
    scene.geometry.parts.iter().filter(|p| p.object == object.id && p.role == Role::Solid).cloned().collect()
}

/// The touchable surface of an object.
fn collider_of(scene: &Scene, object: &Object) -> Collider {
    let light = scene.geometry.light.clone();
    let only = SceneGeometry { parts: parts_of(scene, object), materials: Vec::new(), textures: Vec::new(), light };
    Collider::new(&only).expect("meshes are sound")
}

/// Whether an edge of one of two objects pierces the other, as for overlapping objects. The one with the higher base
/// may stand on the other, so it is raised by a centimetre.
fn pierces(scene: &Scene, low: &Object, high: &Object) -> bool {
    let raised = if high.bounds.min.up - low.bounds.min.up < 0.01 { 0.0 } else { 0.01 };
    cuts(scene, high, raised, low) || cuts(scene, low, -raised, high)
}

fn cuts(scene: &Scene, object: &Object, raised: f64, other: &Object) -> bool {
    let collider = collider_of(scene, other);
    parts_of(scene, object).iter().any(|part| {
        part.triangles.iter().any(|t| {
            (0..3).any(|k| {
                let [p, q] = [t[k], t[(k + 1) % 3]].map(|i| part.vertices[i as usize].position);
                let at = |v: glam::Vec3| EnuPosition { east: v.x.into(), north: v.y.into(), up: f64::from(v.z) + raised };
                collider.segment_blocked(at(p), at(q)).is_some()
            })
        })
    })
}

fn touching(a: &Object, b: &Object) -> bool {
    let over = |al: f64, ah: f64, bl: f64, bh: f64| al < bh && bl < ah;
    let (p, q, r, s) = (a.bounds.min, a.bounds.max, b.bounds.min, b.bounds.max);
    over(p.east, q.east, r.east, s.east) && over(p.north, q.north, r.north, s.north) && over(p.up + 0.03, q.up, r.up + 0.03, s.up)
}

/// Static obstacles.
fn solid(scene: &Scene) -> Vec<&Object> {
    let moves: BTreeSet<u16> = scene.actors.iter().map(|actor| actor.object).collect();
    let flat = |o: &Object| matches!(o.tags.kind.as_str(), "ground" | "water") && o.bounds.max.up - o.bounds.min.up < 0.5;
    scene.objects.iter().filter(|o| !o.opening && !moves.contains(&o.id) && !flat(o)).collect()
}

/// Every seed gives a scene in which no moved or added object overlaps another, the start or an opening, and whose
/// colour words match the visible colours; no two seeds give the same.
fn are_sound(name: &str, seeds: core::ops::Range<u64>) {
    let base = Scene::load(name).expect("it is part of the program");
    let place = |row: &(String, Option<String>, [i64; 4])| row.2;
    let at_home: BTreeSet<_> = layout(&base).iter().map(place).collect();
    let (mut layouts, mut lights, mut moved_in_all) = (BTreeSet::new(), BTreeSet::new(), 0);
    let count = seeds.end - seeds.start;
    for seed in seeds {
        let scene = variant(name, seed);
        assert_eq!(scene.name, format!("{name}@{seed}"));
        let keys: BTreeSet<_> = scene.objects.iter().map(|o| &o.key).collect();
        assert_eq!(keys.len(), scene.objects.len(), "{name}@{seed}: keys");
        assert!(scene.objects.len() >= base.objects.len());
        let rows = layout(&scene);
        let moved = |o: &Object| !at_home.contains(&place(&rows[usize::from(o.id) - 1]));
        let all = solid(&scene);
        moved_in_all += all.iter().filter(|o| moved(o)).count();
        for a in all.iter().filter(|o| moved(o)) {
            for b in all.iter().filter(|b| b.id != a.id && touching(a, b)) {
                let (low, high) = if a.bounds.min.up < b.bounds.min.up { (b, a) } else { (a, b) };
                assert!(!pierces(&scene, low, high), "{name}@{seed}: {} is in {}", a.key, b.key);
            }
        }
        start_is_free(&scene, &moved);
        openings_lead_through_their_objects(&scene);
        words_tell_the_colours(&scene, &base);
        layouts.insert(rows);
        lights.insert(format!("{:?}", scene.geometry.light.to_sun));
    }
    assert_eq!(layouts.len() as u64, count, "{name}");
    assert!(lights.len() as u64 > count / 2, "{name}: {} lights", lights.len());
    let mean = moved_in_all as f64 / count as f64;
    assert!(mean > 15.0, "{name}: only {mean} things a variant are not as in the file");
}

#[test]
fn variants_of_the_city_are_sound() {
    are_sound("city", SEEDS);
}

#[test]
fn variants_of_the_park_are_sound() {
    are_sound("park", SEEDS);
}

#[test]
fn variants_of_the_office_are_sound() {
    are_sound("office", SEEDS);
}

#[test]
fn variants_of_the_yard_are_sound() {
    are_sound("yard", SEEDS);
}

#[test]
#[ignore = "long: a command of CONTRIBUTING.md"]
fn many_more_variants_are_sound() {
    for name in VARIED {
        are_sound(name, MORE_SEEDS);
    }
}

fn start_is_free(scene: &Scene, moved: &dyn Fn(&Object) -> bool) {
    let (start, heading) = (scene.start.position, scene.start.attitude.heading);
    let (room, view) = (0.6 * scene.success_radius, 1.6 * scene.success_radius);
    for object in solid(scene).into_iter().filter(|o| moved(o) && o.bounds.min.up < start.up + 2.0) {
        for k in 0..=16 {
            let ahead = view * f64::from(k) / 16.0;
            let (east, north) = (start.east + ahead * heading.sin(), start.north + ahead * heading.cos());
            let gap_east = (object.bounds.min.east - east).max(east - object.bounds.max.east).max(0.0);
            let gap_north = (object.bounds.min.north - north).max(north - object.bounds.max.north).max(0.0);
            let gap = gap_east.hypot(gap_north);
            // Bounding boxes of trees and lamps are wider than their bases.
            let wide = ["tree", "street furniture"].contains(&object.tags.kind.as_str());
            assert!(gap > 0.0 || wide, "{}: {} stands before the start", scene.name, object.key);
            assert!(k > 0 || gap > 0.5 * room || wide, "{}: {} stands at the start", scene.name, object.key);
        }
    }
}

fn openings_lead_through_their_objects(scene: &Scene) {
    for opening in scene.objects.iter().filter(|o| o.opening) {
        let of = opening.tags.opening_of.and_then(|of| scene.object(of)).expect("an opening leads through something");
        let middle =
            |o: &Object| DVec2::new(o.bounds.min.east + o.bounds.max.east, o.bounds.min.north + o.bounds.max.north) * 0.5;
        let reach = (of.bounds.max.east - of.bounds.min.east).max(of.bounds.max.north - of.bounds.min.north);
        assert!(middle(opening).distance(middle(of)) < 0.6 * reach, "{}: {} is not in {}", scene.name, opening.key, of.key);
    }
}

/// Whether a colour, linear red, green and blue, matches a word; `None` for words unknown here.
fn goes_by(word: &str, [r, g, b]: [f32; 3]) -> Option<bool> {
    let (most, least) = (r.max(g).max(b), r.min(g).min(b));
    Some(match word {
        "red" => r > 2.0 * g && r > 2.0 * b,
        "green" => g > 1.3 * r && g > 1.3 * b,
        "blue" => b > 1.3 * r && b > 1.1 * g,
        "yellow" => r > 2.0 * b && g > 1.5 * b && g > 0.4 * r,
        "orange" => r > 2.0 * b && (0.1 * r..0.6 * r).contains(&g),
        "white" => least > 0.35,
        "black" => most < 0.1,
        "purple" => b > g && r > g,
        _ => return None,
    })
}

/// An object tagged with a colour shows it, and none of its names contains another.
fn words_tell_the_colours(scene: &Scene, base: &Scene) {
    let painted = ["vehicle", "person", "crane"];
    let known = |o: &Object| base.objects.get(usize::from(o.id) - 1).is_some_and(|b| b.key == o.key && b.tags == o.tags);
    for object in scene.objects.iter().filter(|o| painted.contains(&o.tags.kind.as_str()) && !known(o)) {
        let Some(word) = &object.tags.colour else { continue };
        let own = scene.actors.iter().filter(|a| a.object == object.id).flat_map(|a| &a.postures[0]);
        let mut parts = scene.geometry.parts.iter().filter(|p| p.object == object.id).chain(own);
        let shown = parts.any(|part| {
            let colour = scene.geometry.materials[usize::from(part.material)].colour;
            goes_by(word, colour.into()).unwrap_or(true)
        });
        assert!(shown, "{}: {} is called {word}", scene.name, object.key);
        let others = ["red", "blue", "green", "yellow", "purple", "orange"];
        for other in others.into_iter().filter(|other| !word.contains(other)) {
            let mut names = object.tags.names.iter().chain(&object.tags.synonyms).chain(&object.tags.qualities);
            let wrong = names.find(|name| name.split(' ').any(|w| w == other));
            assert_eq!(wrong, None, "{}: {} is {word}", scene.name, object.key);
            assert!(!object.key.split('_').any(|w| w == other), "{}: {} is {word}", scene.name, object.key);
        }
    }
}

#[test]
fn the_same_seed_gives_the_same_bits() {
    for name in VARIED {
        let (a, b) = (variant(name, 7), variant(name, 7));
        assert_eq!(a.objects, b.objects);
        assert_eq!(a.geometry.light, b.geometry.light);
        for (p, q) in a.geometry.parts.iter().zip(&b.geometry.parts) {
            assert!(p.vertices == q.vertices && p.triangles == q.triangles && p.material == q.material);
        }
    }
}

#[test]
fn actors_of_variants_walk_into_nothing() {
    for name in VARIED {
        for seed in 0..3 {
            let scene = variant(name, seed);
            let collider = Collider::new(&scene.geometry).unwrap();
            let cast = Arc::new(Cast::new(&scene.actors, &collider).unwrap());
            let mut traffic = Traffic::new(cast.clone(), seed);
            for step in 0..300 {
                let at = Time::from_millis(step * 500);
                traffic.advance_to(at);
                for (object, place) in cast.objects().zip(traffic.places_at(at).unwrap()) {
                    let chest = EnuPosition { up: place.position.up + 1.0, ..place.position };
                    let near = collider.nearest(chest).unwrap();
                    let key = |id: u16| scene.object(id).unwrap().key.clone();
                    assert!(near.distance > 0.3, "{name}@{seed}: {} is in {} at {at}", key(object), key(near.object));
                }
            }
        }
    }
}

/// The places that a sphere can reach from the craft's position after take-off, on a grid, up to some height.
fn reached(scene: &Scene, collider: &Collider, cell: f64, top: f64) -> Vec<EnuPosition> {
    let (low, high) = (scene.bounds.min, scene.bounds.max);
    let start = scene.start.position;
    let begin = EnuPosition { up: start.up + 0.4 * top, ..start };
    let at = |[x, y, z]: [i32; 3]| EnuPosition {
        east: begin.east + cell * f64::from(x),
        north: begin.north + cell * f64::from(y),
        up: begin.up + cell * f64::from(z),
    };
    let inside = |p: EnuPosition| {
        (low.east..high.east).contains(&p.east) && (low.north..high.north).contains(&p.north) && (0.3..top).contains(&p.up)
    };
    let (mut seen, mut todo) = (BTreeSet::from([[0; 3]]), vec![[0; 3]]);
    let mut places = Vec::new();
    while let Some(here) = todo.pop() {
        places.push(at(here));
        for (axis, step) in [(0, 1), (0, -1), (1, 1), (1, -1), (2, 1), (2, -1)] {
            let mut next = here;
            next[axis] += step;
            let free = |p| inside(p) && collider.nearest(p).is_none_or(|near| near.distance > 0.5 * cell);
            if !seen.contains(&next) && free(at(next)) {
                seen.insert(next);
                todo.push(next);
            }
        }
    }
    places
}

/// Objects whose success radius the craft can reach.
fn reachable(scene: &Scene, cell: f64, top: f64) -> BTreeSet<u16> {
    let collider = Collider::new(&scene.geometry).expect("meshes are sound");
    let places = reached(scene, &collider, cell, top);
    let far = scene.success_radius;
    let near = |o: &Object, p: &EnuPosition| {
        let (a, b) = (o.bounds.min, o.bounds.max);
        let out = |v: f64, low: f64, high: f64| (low - v).max(v - high).max(0.0);
        let gap = out(p.east, a.east, b.east).hypot(out(p.north, a.north, b.north)).hypot(out(p.up, a.up, b.up));
        gap <= far && collider.distance_to(o.id, *p).is_some_and(|distance| distance <= far)
    };
    scene.objects.iter().filter(|o| places.iter().any(|p| near(o, p))).map(|o| o.id).collect()
}

/// Targets reachable in the file are reachable in its variants.
#[test]
fn nothing_becomes_out_of_reach() {
    for (name, cell, top, seeds) in
        [("office", 0.3, 2.5, 3), ("yard", 0.3, 2.5, 3), ("city", 1.5, 12.0, 1), ("park", 1.5, 12.0, 1)]
    {
        let home = reachable(&Scene::load(name).unwrap(), cell, top);
        assert!(home.len() > 60, "{name}: {}", home.len());
        for seed in 0..seeds {
            let scene = variant(name, seed);
            let now = reachable(&scene, cell, top);
            let lost: Vec<_> = home.difference(&now).map(|id| &scene.object(*id).unwrap().key).collect();
            assert!(lost.is_empty(), "{name}@{seed}: {lost:?}");
        }
    }
}

#[test]
fn a_scene_without_vary_has_no_variants() {
    let text = r#"format = 1
name = "test"
craft = "quad"
start = "0,0,0,90"
success_radius_m = 5.0
near_m = 3.0
bounds = { east = [-50, 50], north = [-50, 50], up = [0, 50] }
[[objects]]
id = "tree"
position = [10.0, 5.0]
mesh = { kind = "tree", style = "conifer", height = 9.0 }
names = ["tree"]
kind = "tree"
"#;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mine.toml").to_str().unwrap().to_owned();
    let load = |vary: &str| {
        std::fs::write(&path, format!("{text}{vary}")).unwrap();
        Scene::load(&format!("{path}@3")).map_err(|error| error.to_string())
    };
    let refused = load("").unwrap_err();
    assert!(refused.contains("has no variants") && refused.contains("[vary]"), "{refused}");
    for (vary, message) in [
        ("[[vary.shuffle]]\nobjects = [\"treee\"]\n", "unknown object `treee`"),
        ("[[vary.jitter]]\nobjects = [\"tree\"]\ndistance_m = -1\n", "`distance_m` must be from 0 to 1000"),
        ("[[vary.depart]]\nobjects = [\"tree\"]\n", "`tree` does not move"),
        ("[[vary.repaint]]\nobjects = [\"tree\"]\nslot = \"leaf\"\ncolours = {}\n", "`colours` is empty"),
        ("[[vary.repaint]]\nobjects = [\"tree\"]\nslot = \"leaf\"\ncolours = { red = \"snow\" }\n", "unknown material `snow`"),
        ("[[vary.add]]\nid = \"x\"\nlike = \"oak\"\ncount = [1, 1]\nplaces = [[9, 9]]\n", "unknown template `oak`"),
        ("[[vary.add]]\nid = \"x\"\nlike = \"oak\"\ncount = [2, 1]\nplaces = [[9, 9]]\n", "`count` must be an increasing range"),
        ("[vary.light]\nsun_azimuth_deg = [90.0, 10.0]\n", "the range must be increasing"),
        ("[[vary.shuffel]]\n", "did you mean `shuffle`?"),
        (
            "[[vary.repaint]]\nobjects = [\"tree\"]\nslot = \"body\"\ncolours = { red = \"red_paint\" }\n",
            "unknown material slot `body`",
        ),
        ("[[vary.repaint]]\nobjects = [\"tree\"]\nslot = \"leaf\"\ncolours = { Red = \"red_paint\" }\n", "invalid colour `Red`"),
        (
            "[[vary.add]]\nid = \"x\"\nlike = \"oak\"\ncount = [0, 201]\nplaces = [[9, 9]]\n",
            "`count` must be an increasing \
            range",
        ),
        ("[[vary.add]]\nid = \"x\"\nlike = \"oak\"\ncount = [0, 1]\nplaces = []\n", "1 to 200 `places`"),
    ] {
        let error = load(vary).map(|scene| scene.name).unwrap_err();
        assert!(error.contains(message), "{error}\nshould say: {message}");
    }
    let scene = load("[[vary.jitter]]\nobjects = [\"tree\"]\ndistance_m = 5.0\n").unwrap();
    assert_eq!(scene.name, "test@3");
    let bounds = scene.objects[0].bounds;
    let (east, north) = (0.5 * (bounds.min.east + bounds.max.east), 0.5 * (bounds.min.north + bounds.max.north));
    let away = (east - 10.0).hypot(north - 5.0);
    assert!((0.05..5.2).contains(&away), "{away}");
}

/// A scene with one of everything that tables may name.
const SMALL: &str = r#"format = 1
name = "small"
craft = "quad"
start = "0,0,0,90"
success_radius_m = 2.0
near_m = 1.0
bounds = { east = [-30, 30], north = [-30, 30], up = [0, 50] }
[templates.cone]
mesh = { kind = "cone", height = 0.5 }
names = ["red cone", "cone"]
colour = "red"
kind = "cone"
[templates.gate]
mesh = { kind = "gate", width = 3.0, height = 2.5, sill = 1.0, number = 1 }
names = ["gate"]
kind = "gate"
[[objects]]
id = "red_cone"
like = "cone"
places = [[5.0, 5.0], [6.0, 5.0], [7.0, 5.0]]
[[objects]]
id = "gate"
like = "gate"
position = [10.0, -5.0]
[[objects]]
id = "hole"
position = [10.0, -5.0, 1.0]
opening_of = "gate"
mesh = { kind = "opening", shape = "rectangle", width = 3.0, height = 2.5 }
names = ["opening"]
kind = "opening"
[[objects]]
id = "walker"
mesh = { kind = "person" }
names = ["person"]
kind = "person"
walk = { path = [[-10, -10], [-10, 10]], speed_m_s = 1.0 }
[[objects]]
id = "other"
mesh = { kind = "person" }
names = ["person"]
kind = "person"
walk = { path = [[-10, 10], [-10, -10]], speed_m_s = 1.0 }
"#;

fn number() -> impl Strategy<Value = String> {
    let odd = ["0", "-1", "0.5", "3", "180", "1e300", "-1e300", "inf", "nan", "2000", "1e-300"];
    prop_oneof![proptest::sample::select(odd.to_vec()).prop_map(str::to_owned), (-40.0..40.0_f64).prop_map(|v| format!("{v:.2}"))]
}

fn ids() -> impl Strategy<Value = String> {
    let known = vec!["red_cone", "red_cone_2", "gate", "hole", "walker", "other", "nobody", "red", ""];
    proptest::collection::vec(proptest::sample::select(known), 0..5).prop_map(|ids| format!("{ids:?}"))
}

fn table() -> impl Strategy<Value = String> {
    let places = proptest::collection::vec(proptest::collection::vec(number(), 0..6), 0..5)
        .prop_map(|places| places.iter().map(|p| format!("[{}]", p.join(", "))).collect::<Vec<_>>().join(", "));
    prop_oneof![
        ids().prop_map(|ids| format!("[[vary.shuffle]]\nobjects = {ids}\n")),
        (ids(), number(), number(), any::<bool>()).prop_map(|(ids, distance, turn, together)| format!(
            "[[vary.jitter]]\nobjects = {ids}\ndistance_m = {distance}\nturn_deg = {turn}\ntogether = {together}\n"
        )),
        ids().prop_map(|ids| format!("[[vary.depart]]\nobjects = {ids}\n")),
        (ids(), "(body|leaf)", "(red|dark blue|RED||[a-z ]{0,50})").prop_map(|(ids, slot, word)| format!(
            "[[vary.repaint]]\nobjects = {ids}\nslot = \"{slot}\"\ncolours = {{ \"{word}\" = \"blue_paint\", green = \"green_paint\" }}\n"
        )),
        ("(x|red_cone|walker|X)", "(cone|gate|tree)", 0..4_u32, 0..300_u32, places).prop_map(|(id, like, least, most, places)| {
            format!("[[vary.add]]\nid = \"{id}\"\nlike = \"{like}\"\ncount = [{least}, {most}]\nplaces = [{places}]\n")
        }),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    /// For any tables: a scene or an error with its line, reproducibly; and if one seed is accepted, so is the next.
    #[test]
    fn any_tables_give_a_scene_or_an_error(tables in proptest::collection::vec(table(), 0..5), seed in any::<u64>()) {
        let text = format!("{SMALL}{}[vary.light]\n", tables.concat());
        let scene = Scene::parse_variant(&text, "small.toml", seed).map_err(|error| error.to_string());
        let again = Scene::parse_variant(&text, "small.toml", seed).map_err(|error| error.to_string());
        let next = Scene::parse_variant(&text, "small.toml", seed.wrapping_add(1)).map_err(|error| error.to_string());
        prop_assert_eq!(scene.is_ok(), next.is_ok(), "{:?} {:?}", scene.as_ref().err(), next.as_ref().err());
        match (scene, again) {
            (Ok(scene), Ok(again)) => prop_assert_eq!(scene.objects, again.objects),
            (scene, again) => {
                let error = scene.unwrap_err();
                prop_assert!(error.starts_with("small.toml:"), "{}", error);
                prop_assert_eq!(Some(error), again.err());
            }
        }
    }
}

/// A file that requires far more work than any scene needs is nevertheless read or rejected.
#[test]
#[ignore = "long: .ci/interop runs it"]
fn hostile_tables_come_to_an_end() {
    let all = (0..400).map(|i| format!("[{}, {}]", i % 40 - 20, i / 40 - 5)).collect::<Vec<_>>().join(", ");
    let crowd = format!("[[objects]]\nid = \"crowd\"\nlike = \"cone\"\nplaces = [{all}]\n");
    let shuffles = "[[vary.shuffle]]\nobjects = [\"crowd\"]\n".repeat(64);
    let jitters = "[[vary.jitter]]\nobjects = [\"crowd\"]\ndistance_m = 1000\nturn_deg = 180\n".repeat(64);
    let text = format!("{SMALL}{crowd}{shuffles}{jitters}");
    let scene = Scene::parse_variant(&text, "small.toml", 1).unwrap();
    assert_eq!(scene.objects.len(), 407);
    let error = Scene::parse_variant(&format!("{text}[[vary.shuffle]]\nobjects = [\"crowd\"]\n"), "small.toml", 1).unwrap_err();
    assert!(error.to_string().contains("at most 64 tables"), "{error}");
}

//! Actors: none collides with another, all make progress, and the same seed gives the same motion.

use std::sync::Arc;

use glam::DVec2;
use proptest::prelude::*;
use spf_core::geometry::EnuPosition;
use spf_core::time::Time;
use spf_scene::actors::{ActorPlace, Cast, Traffic};
use spf_scene::collide::Collider;
use spf_scene::geometry::Role;
use spf_scene::{Scene, SceneError};

use crate::stage::{HEAD, Stage, actor, drive, walk};

impl Stage {
    /// Hulls of the solid parts of the first postures (the very first is standing) in the actors' own frames.
    fn hulls(&self, postures: usize) -> Vec<Vec<DVec2>> {
        let hull = |all: &Vec<Vec<spf_scene::geometry::Part>>| {
            let solid = all.iter().take(postures).flatten().filter(|part| part.role == Role::Solid);
            hull(solid.flat_map(|p| &p.vertices).map(|v| DVec2::new(v.position.x.into(), v.position.y.into())).collect())
        };
        self.scene.actors.iter().map(|actor| hull(&actor.postures)).collect()
    }
}

/// Convex hull by gift wrapping.
fn hull(points: Vec<DVec2>) -> Vec<DVec2> {
    let first = points.iter().copied().min_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y))).expect("a mesh has corners");
    let mut hull = vec![first];
    loop {
        let last = hull[hull.len() - 1];
        let mut next = points[0];
        for &p in &points {
            let turn = (next - last).perp_dot(p - last);
            if next == last || turn < 0.0 || (turn == 0.0 && p.distance(last) > next.distance(last)) {
                next = p;
            }
        }
        if next == first || hull.len() > points.len() {
            return hull;
        }
        hull.push(next);
    }
}

fn placed(hull: &[DVec2], place: &ActorPlace) -> Vec<DVec2> {
    let (sin, cos) = (place.heading.sin(), place.heading.cos());
    let at = DVec2::new(place.position.east, place.position.north);
    hull.iter().map(|p| at + DVec2::new(p.x * cos + p.y * sin, p.y * cos - p.x * sin)).collect()
}

/// Separating axes: whether two convex polygons share a point.
fn overlap(a: &[DVec2], b: &[DVec2]) -> bool {
    let edges = |p: &[DVec2]| (0..p.len()).map(|i| (p[(i + 1) % p.len()] - p[i]).perp()).collect::<Vec<_>>();
    let span = |p: &[DVec2], axis: DVec2| {
        p.iter().map(|v| v.dot(axis)).fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)))
    };
    !edges(a).into_iter().chain(edges(b)).any(|axis| {
        let ((al, ah), (bl, bh)) = (span(a, axis), span(b, axis));
        ah < bl || bh < al
    })
}

/// The first two actors that overlap at a time, checked every quarter of a tick.
fn first_overlap(stage: &Stage, seed: u64, seconds: u64) -> Option<(usize, usize, f64)> {
    let hulls = stage.hulls(1);
    let mut traffic = Traffic::new(stage.cast.clone(), seed);
    for step in 0..seconds * 80 {
        let at = Time::from_nanos(step * 12_500_000);
        traffic.advance_to(at);
        let places = traffic.places_at(at).expect("it went there");
        for j in 0..places.len() {
            for i in 0..j {
                let near = places[i].position.horizontal_distance(places[j].position) < 8.0;
                if near && overlap(&placed(&hulls[i], &places[i]), &placed(&hulls[j], &places[j])) {
                    return Some((i, j, at.as_secs_f64()));
                }
            }
        }
    }
    None
}

fn after(stage: &Stage, seed: u64, seconds: f64) -> Vec<ActorPlace> {
    let mut traffic = Traffic::new(stage.cast.clone(), seed);
    let at = Time::from_secs_f64(seconds);
    traffic.advance_to(at);
    traffic.places_at(at).expect("it went there")
}

#[test]
fn persons_on_one_line_pass_each_other() {
    let stage = Stage::of(&[
        ("a", "person", walk("[[0, -10], [0, 10]]", ", loop = \"once\"")),
        ("b", "person", walk("[[0, 10], [0, -10]]", ", loop = \"once\"")),
    ]);
    assert_eq!(first_overlap(&stage, 1, 40), None);
    let places = after(&stage, 1, 25.0);
    assert!(places[0].position.north > 9.5 && places[1].position.north < -9.5, "{places:?}");
    // Each passed on its right and returned to its path.
    let middle = after(&stage, 1, 8.0);
    assert!(middle[0].position.east > 0.1 && middle[1].position.east < -0.1, "{middle:?}");
    assert!(places.iter().all(|place| place.position.east.abs() < 0.05), "{places:?}");
}

#[test]
fn a_car_stops_for_a_person_and_goes_on() {
    // The person stands on the road for about 20 s, then walks off it.
    let stage = Stage::of(&[
        ("person", "person", walk("[[-6, 0], [0, 0]]", ", wait_s = 20.0, start = 1.0, aside_m = 0.0")),
        ("car", "car", drive("[[0, -40], [0, 60]]", ", loop = \"once\"")),
    ]);
    assert_eq!(first_overlap(&stage, 3, 120), None);
    let waiting = after(&stage, 3, 9.9)[1];
    assert!(waiting.speed == 0.0 && (-8.0..-2.5).contains(&waiting.position.north), "{waiting:?}");
    let gone = after(&stage, 3, 100.0)[1];
    assert!(gone.position.north > 59.0, "{gone:?}");
}

#[test]
fn a_vehicle_follows_a_slower_one() {
    let stage = Stage::of(&[
        ("slow", "car", drive("[[0, 0], [0, 80]]", ", loop = \"once\", start = 0.1").replace("8.0", "2.0")),
        ("fast", "car", drive("[[0, -40], [0, 80]]", ", loop = \"once\"")),
    ]);
    assert_eq!(first_overlap(&stage, 0, 60), None);
    let places = after(&stage, 0, 30.0);
    let gap = places[0].position.north - places[1].position.north;
    assert!((4.5..8.0).contains(&gap) && places[1].speed > 1.5, "{gap} {places:?}");
}

#[test]
fn speeds_and_turns_are_those_of_persons_and_vehicles() {
    let square = "[[-20, -20], [-20, 20], [20, 20], [20, -20]]";
    let stage = Stage::of(&[("car", "car", drive(square, "")), ("person", "person", walk("[[30, 0], [40, 0]]", ", wait_s = 2"))]);
    let mut traffic = Traffic::new(stage.cast.clone(), 5);
    let mut before = traffic.places_at(Time::ZERO).unwrap();
    let (mut least, mut paused) = (f64::INFINITY, 0);
    for step in 1..1600 {
        let at = Time::from_millis(step * 50);
        traffic.advance_to(at);
        let now = traffic.places_at(at).unwrap();
        for (a, b) in before.iter().zip(&now) {
            let turned = spf_core::geometry::wrap_angle(b.heading - a.heading).abs();
            assert!(turned < 0.18 && (b.speed - a.speed).abs() < 0.21, "{a:?} {b:?}");
            assert!(a.position.distance(b.position) < 8.0 * 0.05 + 1e-6);
        }
        assert!(now[0].speed <= 8.0 && now[1].speed <= 1.3);
        if step > 200 {
            least = least.min(now[0].speed);
        }
        paused += usize::from(now[1].speed == 0.0);
        before = now;
    }
    // √(2 m/s² · 5 m) in the corners.
    assert!((2.8..3.6).contains(&least), "{least}");
    assert!(paused > 100, "{paused}");
}

#[test]
fn actors_keep_to_the_ground_below_them() {
    let kerb = "[[objects]]\nid = \"kerb\"\nposition = [0.0, 10.0]\n\
        mesh = { kind = \"slab\", size = [4.0, 8.0], thickness = 0.15, base = true }\nnames = [\"kerb\"]\nkind = \"ground\"\n";
    let mut text = format!("{HEAD}{kerb}");
    actor(&mut text, "a", "person", &walk("[[0, 0], [0, 10]]", ", loop = \"once\""));
    actor(&mut text, "b", "person", &walk("[[10, 0, 2.0], [10, 10, 4.0]]", ", loop = \"once\""));
    let stage = Stage::new(&text).unwrap();
    let (start, end) = (stage.cast.starts(), after(&stage, 0, 30.0));
    assert!(start[0].position.up.abs() < 1e-6 && (end[0].position.up - 0.15).abs() < 1e-5, "{start:?} {end:?}");
    assert!((start[1].position.up - 2.0).abs() < 1e-6 && (end[1].position.up - 4.0).abs() < 0.02);
    let object = &stage.scene.objects[usize::from(stage.scene.actors[0].object) - 1];
    assert!(object.bounds.max.north < 1.0 && object.bounds.min.north > -1.0 && object.key == "a");
}

/// In every built-in scene: actors overlap nothing, walk into nothing, keep away from the start, and make progress.
#[test]
fn the_actors_of_built_in_scenes_are_free() {
    for name in Scene::built_in() {
        let scene = Scene::load(name).unwrap();
        let collider = Arc::new(Collider::new(&scene.geometry).unwrap());
        let cast = Arc::new(Cast::new(&scene.actors, &collider).unwrap());
        let stage = Stage { scene, collider, cast };
        assert_eq!(first_overlap(&stage, 1, 300), None, "{name}");
        let (hulls, start) = (stage.hulls(usize::MAX), stage.scene.start.position);
        let mut traffic = Traffic::new(stage.cast.clone(), 1);
        let mut places = Vec::new();
        for step in 0..600 {
            let at = Time::from_millis(step * 500);
            traffic.advance_to(at);
            places = traffic.places_at(at).unwrap();
            for ((actor, place), hull) in stage.scene.actors.iter().zip(&places).zip(&hulls) {
                let key = &stage.scene.object(actor.object).unwrap().key;
                assert!(place.position.distance(start) > 3.0 * stage.scene.success_radius, "{key} at {place:?}");
                for height in [0.5, 1.0, 1.5] {
                    let up = place.position.up + height;
                    let middle = EnuPosition { up, ..place.position };
                    for corner in placed(hull, place) {
                        let rim = EnuPosition { east: corner.x, north: corner.y, up };
                        let hit = stage.collider.segment_blocked(middle, rim).map(|id| &stage.scene.object(id).unwrap().key);
                        assert_eq!(hit, None, "{name}: {key} stands in it at {at}: {place:?}");
                    }
                }
            }
        }
        for (actor, place) in stage.scene.actors.iter().zip(&places) {
            assert!(place.walked > 60.0, "{name}: {} got {:.0} m on", actor.object, place.walked);
        }
    }
}

fn refused(motion: &str) -> String {
    let mut text = HEAD.to_owned();
    actor(&mut text, "a", "person", motion);
    match Stage::new(&text) {
        Err(error @ SceneError::Invalid { .. }) => error.to_string(),
        Err(other) => panic!("{other}"),
        Ok(_) => panic!("`{motion}` was accepted"),
    }
}

#[test]
fn errors_state_what_to_write() {
    for (motion, message) in [
        ("walk = { path = [[0, 0]], speed_m_s = 1.0 }", "2 to 1000 corners"),
        ("walk = { path = [[0, 0], [0, 1]], speed_m_s = 1.0, loop = \"circle\" }", "3 to 1000 corners"),
        ("walk = { path = [[0, 0], [0, 0.01]], speed_m_s = 1.0 }", "0.1 m apart"),
        ("walk = { path = [[0, 0], [0, 1, 2]], speed_m_s = 1.0 }", "two numbers, or all three"),
        ("walk = { path = [[0, 0], [0, 9000]], speed_m_s = 1.0 }", "within 2000 m"),
        ("walk = { path = [[0, 0], [0, nan]], speed_m_s = 1.0 }", "within 2000 m"),
        ("walk = { path = [[0, 0], [0, 9]], speed_m_s = 0.0 }", "`speed_m_s` must be from 0.05 to 30"),
        ("walk = { path = [[0, 0], [0, 9]], speed_m_s = 1.0, start = 1.5 }", "`start` must be from 0 to 1"),
        ("walk = { path = [[0, 0], [0, 9]], speed_m_s = 1.0, loop = \"twice\" }", "unknown variant `twice`"),
        ("walk = { path = [[0, 0], [0, 9]], speed_m_s = 1.0, pause_s = 3 }", "unknown field `pause_s`"),
        ("drive = { path = [[0, 0], [0, 9]], speed_m_s = 1.0, loop = \"there_and_back\" }", "cannot turn on the spot"),
        ("drive = { path = [[0, 0], [0, 9], [9, 9]], speed_m_s = 1.0, aside_m = 1 }", "`aside_m` is not valid for a vehicle"),
        ("walk = { path = [[0, 0], [0, 9]], speed_m_s = 1.0 }\nposition = [1, 1]", "placed by its path"),
        (
            "walk = { path = [[0, 0], [0, 9]], speed_m_s = 1 }\ndrive = { path = [[0, 0], [0, 9]], speed_m_s = 1 }",
            "cannot be \
            combined",
        ),
    ] {
        let error = refused(motion);
        assert!(error.contains(message) && error.starts_with("test.toml:"), "{error}\nshould say: {message}");
    }
    let mut text = HEAD.to_owned();
    actor(&mut text, "a", "person", &walk("[[0, 0], [0, 9]]", ""));
    actor(&mut text, "b", "person", &walk("[[0, 0.5], [5, 9]]", ""));
    let error = Stage::new(&text).map(|_| ()).unwrap_err().to_string();
    assert!(error.contains("`b` overlaps `a`") && error.contains("another `start`"), "{error}");
}

fn corner(reach: f64) -> impl Strategy<Value = [f64; 2]> {
    [-reach..reach, -reach..reach]
}

/// Some people in a yard of 24 m, some vehicles on wider loops through it.
fn crowd() -> impl Strategy<Value = String> {
    let round = prop::sample::select(vec!["circle", "there_and_back", "once"]);
    let person = (prop::collection::vec(corner(12.0), 3..6), round, 0.3..2.0_f64, 0.0..5.0_f64, 0.0..1.0_f64);
    let vehicle = (prop::collection::vec(corner(40.0), 3..6), 1.0..12.0_f64, 0.0..1.0_f64);
    (prop::collection::vec(person, 1..7), prop::collection::vec(vehicle, 0..3)).prop_map(|(persons, vehicles)| {
        let mut text = HEAD.to_owned();
        for (i, (path, round, speed, wait, start)) in persons.into_iter().enumerate() {
            let motion = format!(
                "walk = {{ path = {path:?}, speed_m_s = {speed}, loop = \"{round}\", wait_s = {wait}, start = {start} }}"
            );
            actor(&mut text, &format!("p{i}"), "person", &motion);
        }
        for (i, (path, speed, start)) in vehicles.into_iter().enumerate() {
            actor(
                &mut text,
                &format!("v{i}"),
                "car",
                &format!("drive = {{ path = {path:?}, speed_m_s = {speed}, start = {start} }}"),
            );
        }
        text
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, max_global_rejects: 4096, ..ProptestConfig::default() })]

    /// For any paths, actors do not overlap for ten minutes.
    #[test]
    fn nobody_runs_into_anybody(text in crowd(), seed: u64) {
        // Actors with overlapping starts are rejected.
        let Ok(stage) = Stage::new(&text) else { return Err(TestCaseError::reject("begins on another")) };
        prop_assert_eq!(first_overlap(&stage, seed, 600), None, "{}", text);
    }

    /// The motion does not depend on when and how often it is queried.
    #[test]
    fn any_pattern_of_queries_gives_the_same_places(
        text in crowd(), seed: u64, gaps in prop::collection::vec(0u64..400_000_000, 1..60),
    ) {
        let Ok(stage) = Stage::new(&text) else { return Err(TestCaseError::reject("begins on another")) };
        let (mut fine, mut coarse) = (Traffic::new(stage.cast.clone(), seed), Traffic::new(stage.cast.clone(), seed));
        let mut now = 0;
        for gap in gaps {
            now += gap;
            let at = Time::from_nanos(now);
            coarse.advance_to(at);
            for k in 0..=10 {
                fine.advance_to(Time::from_nanos(now - gap + gap * k / 10));
            }
            prop_assert_eq!(fine.places_at(at), coarse.places_at(at));
            prop_assert!(fine.places_at(at).is_some());
        }
    }
}

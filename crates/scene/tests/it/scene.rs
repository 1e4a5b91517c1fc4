//! The scene format and the city: accepted input, error messages, and valid meshes.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use glam::{DVec3, Vec3};
use proptest::prelude::*;
use spf_core::craft::CraftKind;
use spf_core::geometry::EnuPosition;
use spf_scene::collide::Collider;
use spf_scene::geometry::{Part, Role};
use spf_scene::{Lighting, Scene, SceneError, SceneLook, Weather};

const HEAD: &str = r#"format = 1
name = "test"
craft = "quad"
start = "0,0,0,90"
success_radius_m = 5.0
near_m = 3.0
bounds = { east = [-50, 50], north = [-50, 50], up = [0, 50] }
"#;

const TREE: &str = r#"
[[objects]]
id = "tree"
position = [10.0, 5.0]
mesh = { kind = "tree", style = "conifer", height = 9.0 }
names = ["tree"]
kind = "tree"
"#;

fn city() -> Scene {
    Scene::load("city").expect("the city is part of the program")
}

/// The message of a scene that must not load.
fn refused(text: &str) -> String {
    match Scene::parse(text, "test.toml") {
        Err(e @ SceneError::Invalid { .. }) => e.to_string(),
        other => panic!("expected a refusal, got {other:?}"),
    }
}

#[test]
fn the_city_loads_with_its_landmarks() {
    let scene = city();
    assert_eq!((scene.near, scene.success_radius, scene.default_craft), (3.0, 5.0, CraftKind::Quad));
    assert!(scene.bounds.max.east - scene.bounds.min.east >= 200.0);
    for (key, colour) in [
        ("red_crane", Some("red")),
        ("tall_white_building", Some("white")),
        ("needle_tower", Some("white")),
        ("black_car", Some("black")),
        ("tunnel", Some("grey")),
        ("hollow_building", Some("beige")),
        ("bridge", Some("grey")),
    ] {
        let object = scene.by_key(key).unwrap_or_else(|| panic!("{key}"));
        assert_eq!(object.tags.colour.as_deref(), colour, "{key}");
        // Targets lie 25 to 120 m from the start: the nearest corner of the box about each.
        let p = scene.start.position;
        let (east, north) = (
            p.east.clamp(object.bounds.min.east, object.bounds.max.east),
            p.north.clamp(object.bounds.min.north, object.bounds.max.north),
        );
        let range = (east - p.east).hypot(north - p.north);
        assert!((20.0..=120.0).contains(&range), "{key} at {range:.0} m");
    }
    assert_eq!(scene.object(0), None);
    assert_eq!(scene.object(1), Some(&scene.objects[0]));
}

#[test]
fn openings_name_their_object() {
    let scene = city();
    for (key, of) in [("hollow", "hollow_building"), ("tunnel_mouth", "tunnel"), ("tunnel_far_mouth", "tunnel")] {
        let opening = scene.by_key(key).unwrap();
        assert!(opening.opening);
        assert_eq!(opening.tags.opening_of, Some(scene.by_key(of).unwrap().id));
        let tagged = &scene.tagged()[usize::from(opening.id) - 1];
        assert_eq!((tagged.key.as_str(), tagged.opening_of.as_deref()), (key, Some(of)));
    }
    assert_eq!(scene.objects.iter().filter(|o| o.opening).count(), 5);
}

#[test]
fn every_object_is_tagged_bounded_and_outlined() {
    let scene = city();
    assert!(scene.objects.len() > 100 && scene.objects.len() < 300, "{}", scene.objects.len());
    for (i, object) in scene.objects.iter().enumerate() {
        assert_eq!(usize::from(object.id), i + 1);
        assert!(!object.tags.names.is_empty() && !object.tags.kind.is_empty(), "{}", object.key);
        let (min, max) = (object.bounds.min, object.bounds.max);
        assert!(max.east >= min.east && max.north >= min.north && max.up >= min.up, "{}", object.key);
        assert!(object.outline.iter().any(|polygon| polygon.len() >= 2), "{}", object.key);
        let moves = scene.actors.iter().any(|actor| actor.object == object.id);
        let drawn = scene.geometry.parts.iter().any(|p| p.object == object.id);
        assert!(moves != drawn, "{}: what moves is not part of what stands still", object.key);
    }
    let keys: BTreeSet<_> = scene.objects.iter().map(|o| &o.key).collect();
    assert_eq!(keys.len(), scene.objects.len());
}

#[test]
fn the_city_stays_within_its_triangle_budget() {
    let scene = city();
    let triangles: usize = scene.geometry.parts.iter().map(|p| p.triangles.len()).sum();
    assert!((20_000..=90_000).contains(&triangles), "{triangles}");
}

fn corners(part: &Part, triangle: [u32; 3]) -> [Vec3; 3] {
    triangle.map(|i| part.vertices[i as usize].position)
}

#[test]
fn meshes_have_area_unit_normals_and_sides_that_agree() {
    for scene in Scene::built_in().into_iter().map(|name| Scene::load(name).unwrap()) {
        check_meshes(&scene);
    }
}

fn check_meshes(scene: &Scene) {
    for part in &scene.geometry.parts {
        let key = &scene.object(part.object).expect("every part is an object's").key;
        for vertex in &part.vertices {
            assert!((vertex.normal.length() - 1.0).abs() < 1e-3, "{key}: normal {:?}", vertex.normal);
            assert!(vertex.position.is_finite() && vertex.uv.is_finite(), "{key}");
        }
        for &triangle in &part.triangles {
            let [a, b, c] = corners(part, triangle);
            let normal = (b - a).cross(c - a);
            assert!(normal.length() > 1e-9, "{key}: a triangle without area at {a}");
            let mean: Vec3 = triangle.iter().map(|&i| part.vertices[i as usize].normal).sum();
            assert!(normal.dot(mean) > 0.0, "{key}: a triangle at {a} is wound against its normals");
        }
    }
}

#[test]
fn solids_enclose_a_positive_volume() {
    // The divergence theorem about a point on the ground below the middle: an open floor adds nothing. Sheets are left out.
    for (name, sheets) in [("city", ["tunnel", "hill", "hollow"].as_slice()), ("park", &[])] {
        let scene = Scene::load(name).unwrap();
        let moves = |id| scene.actors.iter().any(|actor| actor.object == id);
        for object in scene.objects.iter().filter(|o| !o.opening && !moves(o.id) && !sheets.contains(&o.key.as_str())) {
            let (min, max) = (object.bounds.min, object.bounds.max);
            let origin = DVec3::new(0.5 * (min.east + max.east), 0.5 * (min.north + max.north), min.up);
            let mut volume = 0.0;
            for part in scene.geometry.parts.iter().filter(|p| p.object == object.id && p.role == Role::Solid) {
                for &triangle in &part.triangles {
                    let [a, b, c] = corners(part, triangle).map(|p| p.as_dvec3() - origin);
                    volume += a.dot(b.cross(c)) / 6.0;
                }
            }
            assert!(volume > 0.0, "{} of the {name}: volume {volume}", object.key);
        }
    }
}

#[test]
fn the_start_and_the_space_above_it_are_free() {
    let scene = city();
    let p = scene.start.position;
    for object in scene.objects.iter().filter(|o| o.tags.kind != "ground") {
        let (min, max) = (object.bounds.min, object.bounds.max);
        let near = min.east < p.east + 3.0 && max.east > p.east - 3.0 && min.north < p.north + 3.0 && max.north > p.north - 3.0;
        assert!(!near || min.up > 5.0, "{} stands at the start", object.key);
    }
}

#[test]
fn a_drone_fits_through_every_opening() {
    let scene = city();
    let collider = Collider::new(&scene.geometry).unwrap();
    // A ball of 0.5 m goes straight through the opening's middle, from 6 m before it to 6 m behind.
    for opening in scene.objects.iter().filter(|o| o.opening) {
        let (min, max) = (opening.bounds.min, opening.bounds.max);
        let middle =
            EnuPosition { east: 0.5 * (min.east + max.east), north: 0.5 * (min.north + max.north), up: 0.5 * (min.up + max.up) };
        let (east, north) = if max.east - min.east > max.north - min.north { (0.0, 6.0) } else { (6.0, 0.0) };
        let from = EnuPosition { east: middle.east - east, north: middle.north - north, ..middle };
        let to = EnuPosition { east: middle.east + east, north: middle.north + north, ..middle };
        let met = collider.sweep(from, to, 0.5).map(|met| &scene.object(met.object).unwrap().key);
        assert_eq!(met, None, "{} is blocked", opening.key);
    }
}

#[test]
fn loading_twice_gives_the_same_bits() {
    let (a, b) = (city(), city());
    assert_eq!(a.objects, b.objects);
    for (p, q) in a.geometry.parts.iter().zip(&b.geometry.parts) {
        assert!(p.vertices == q.vertices && p.triangles == q.triangles && p.material == q.material);
    }
}

#[test]
fn the_legend_lists_every_id() {
    let scene = city();
    let legend = scene.legend_json();
    let objects = legend["objects"].as_array().unwrap();
    assert_eq!(objects.len(), scene.objects.len());
    assert_eq!(objects[0]["key"], "red_crane");
    assert_eq!(objects[0]["tags"]["names"][0], "tower crane");
}

#[test]
fn a_small_scene_loads_with_pose_heading_and_place() {
    let scene = Scene::parse(&format!("{HEAD}{TREE}"), "test.toml").unwrap();
    assert!((scene.start.attitude.heading - std::f64::consts::FRAC_PI_2).abs() < 1e-12);
    let tree = &scene.objects[0];
    assert!(tree.bounds.min.east > 7.0 && tree.bounds.max.east < 13.0 && tree.bounds.max.up > 7.0);
}

#[test]
fn a_scene_states_what_it_shows_and_from_where() {
    let say = |line: &str| format!("{HEAD}{line}\n{TREE}");
    let plain = Scene::parse(&say(""), "test.toml").unwrap();
    // Without a given pose: from the start, at the quad's take-off height.
    assert_eq!((plain.description.as_str(), plain.preview.position.up), ("", plain.start.position.up + 3.0));
    let scene = Scene::parse(&say("description = \"A tree\"\npreview = \"-5,4,3,60,-10\""), "test.toml").unwrap();
    let (east, pitch) = (scene.preview.position.east, scene.preview.attitude.pitch);
    assert_eq!((scene.description.as_str(), east, pitch), ("A tree", -5.0, (-10.0f64).to_radians()));
    assert!(refused(&say("preview = \"-51,4,3,60\"")).starts_with("test.toml:8: the preview is outside `bounds`"));
    assert!(refused(&say("description = \"two\\nlines\"")).starts_with("test.toml:8: a scene's description must be one line"));
    assert!(refused(&say(&format!("description = \"{}\"", "long".repeat(31)))).contains("at most 120 characters"));
}

#[test]
fn the_built_in_scenes_are_made_of_many_kinds_of_mesh() {
    let kinds = Scene::mesh_kinds();
    let scenes: Vec<Scene> = Scene::built_in().into_iter().map(|name| Scene::load(name).unwrap()).collect();
    let used: BTreeSet<&str> = scenes.iter().flat_map(|scene| &scene.objects).map(|object| object.mesh).collect();
    assert!(used.iter().all(|kind| kinds.contains(kind)), "{used:?}");
    assert!(used.len() >= 25, "{} kinds stand in a scene: {used:?}", used.len());
    assert!(scenes.iter().all(|scene| !scene.description.is_empty()));
}

#[test]
fn headings_turn_clockwise() {
    let slab = r#"
[[objects]]
id = "slab"
position = [10.0, 0.0]
heading_deg = 90.0
mesh = { kind = "slab", size = [2.0, 8.0], thickness = 1.0 }
names = ["slab"]
kind = "ground"
"#;
    let scene = Scene::parse(&format!("{HEAD}{slab}"), "test.toml").unwrap();
    // Eight metres along its heading, east now: from 6 to 14.
    let bounds = scene.objects[0].bounds;
    assert!((bounds.min.east - 6.0).abs() < 1e-5 && (bounds.max.east - 14.0).abs() < 1e-5);
    assert!((bounds.min.north + 1.0).abs() < 1e-5 && (bounds.max.up).abs() < 1e-5);
}

#[test]
fn errors_name_file_line_and_remedy() {
    let cases = [
        (format!("{HEAD}{}", TREE.replace("names", "nmaes")), "test.toml:13: unknown field `nmaes`", "did you mean `names`?"),
        (
            format!("{HEAD}{}", TREE.replace("\"tree\", style", "\"treee\", style")),
            "unknown mesh kind `treee`",
            "did you mean `tree`?",
        ),
        (
            format!("{HEAD}{}", TREE.replace("height =", "hieght =")),
            "mesh `tree`: unknown field `hieght`",
            "did you mean `height`?",
        ),
        (format!("{HEAD}{}", TREE.replace("height = 9.0", "height = 1e9")), "from 0.01 to 2000 metres", ""),
        (format!("{HEAD}{TREE}{TREE}"), "duplicate id `tree`", "must be unique"),
        (format!("{HEAD}{TREE}materials = {{ leaf = \"snow\" }}"), "test.toml:15: unknown material `snow`", ""),
        (format!("{HEAD}{TREE}materials = {{ leav = \"bark\" }}"), "unknown material slot `leav`", "did you mean `leaf`?"),
        (format!("{HEAD}{TREE}opening_of = \"tree\""), "only valid on an opening", "kind = \"opening\""),
        (format!("{HEAD}{TREE}like = \"oak\""), "unknown template `oak`", ""),
        (
            format!("{}{TREE}", HEAD.replace("format = 1", "format = 7")),
            "test.toml:1: unsupported scene format `7`",
            "format = 1",
        ),
        (format!("{}{TREE}", HEAD.replace("0,0,0,90", "0,0,north")), "test.toml:4: invalid pose `0,0,north`", "east,north,up"),
        (format!("{}{TREE}", HEAD.replace("0,0,0,90", "90,0,0,0")), "outside `bounds`", ""),
        (format!("{}{TREE}", HEAD.replace("near_m = 3.0", "near_m = -1")), "test.toml:6: `near_m`", ""),
        (
            format!("{}{TREE}", HEAD.replace("near_m = 3.0", "near_m = 3.0\nmax_altitude_m = 0.5")),
            "test.toml:7: `max_altitude_m` must be from 1 to 1000 metres",
            "",
        ),
        (format!("{HEAD}{}", TREE.replace("kind = \"tree\"\n", "kind = \"Tree\"\n")), "invalid tag `Tree`", "lower-case"),
        (format!("{HEAD}{}", TREE.replace("position = [10.0, 5.0]\n", "")), "missing `position`", "places"),
        ("format = 1\n= 3".to_owned(), "test.toml:2:", ""),
    ];
    for (text, message, hint) in cases {
        let error = refused(&text);
        assert!(error.contains(message) && error.contains(hint), "{error}\nshould say: {message} / {hint}");
    }
}

#[test]
fn unknown_scenes_name_the_built_in_ones() {
    let error = Scene::load("citty").unwrap_err().to_string();
    assert!(error.contains("`citty`") && error.contains("did you mean `city`?"), "{error}");
    let error = Scene::load("/nowhere/of/that/name.toml").unwrap_err().to_string();
    assert!(error.contains("/nowhere/of/that/name.toml"), "{error}");
}

#[test]
fn a_scene_file_is_read_from_its_path() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mine.toml");
    std::fs::write(&path, format!("{HEAD}{TREE}")).unwrap();
    assert_eq!(Scene::load(path.to_str().unwrap()).unwrap().name, "test");
}

fn under(text: &str, lighting: Option<Lighting>, weather: Option<Weather>) -> Scene {
    let folder = tempfile::tempdir().expect("a folder can be made");
    let path = folder.path().join("mine.toml");
    std::fs::write(&path, text).expect("a file can be written");
    Scene::load_with(path.to_str().expect("temporary paths are text"), &SceneLook { lighting, weather }).expect("it is sound")
}

#[test]
fn keys_of_the_light_apply_until_another_is_requested() {
    let light = "\n[light]\ntime = \"dusk\"\nsun_elevation_deg = 9.0\nhaze_per_m = 0.02\nexposure = 2.0\nsun = \"#ff0000\"\n";
    let text = format!("{HEAD}{light}{TREE}");
    let own = under(&text, None, None);
    assert_eq!((own.lighting, own.weather), (Lighting::Dusk, Weather::Clear));
    let elevation = |scene: &Scene| libm::asinf(scene.geometry.light.to_sun.z).to_degrees();
    assert!((elevation(&own) - 9.0).abs() < 0.01);
    assert_eq!((own.geometry.light.haze, own.geometry.light.exposure), (0.02, Some(2.0)));
    assert_eq!(own.geometry.light.sun.truncate(), glam::Vec2::X);
    // With the same names nothing changes; another light keeps the haze, another weather the sun's position.
    assert_eq!(under(&text, Some(Lighting::Dusk), Some(Weather::Clear)).geometry.light, own.geometry.light);
    let day = under(&text, Some(Lighting::Day), None);
    assert!((elevation(&day) - 46.0).abs() < 0.01 && day.geometry.light.haze == 0.02 && day.geometry.light.exposure.is_none());
    let rain = under(&text, None, Some(Weather::Rain));
    assert!((elevation(&rain) - 9.0).abs() < 0.01 && rain.geometry.light.haze < 0.02 && rain.geometry.light.rain > 0.0);
}

#[test]
fn lamps_shine_when_it_is_dark_or_always() {
    let lamps = "\n[[lamps]]\nposition = [1.0, 2.0, 3.0]\ncolour = \"#ffffff\"\nstrength = 5.0\nreach_m = 8.0\nalways = true\n";
    let post = "\n[[objects]]\nid = \"post\"\nposition = [3.0, 3.0]\nheading_deg = 90.0\nnames = [\"lamp\"]\nkind = \"structure\"\n\
                mesh = { kind = \"street_lamp\", height = 6.0, arm = 1.5 }\n";
    let text = format!("{HEAD}{lamps}{TREE}{post}");
    let shining = |lighting| under(&text, Some(lighting), None).geometry.light.lamps;
    assert_eq!(shining(Lighting::Day).len(), 1);
    let [own, street] = shining(Lighting::Night)[..] else { panic!("two lamps") };
    assert_eq!((own.position, own.colour, own.reach), (Vec3::new(1.0, 2.0, 3.0), Vec3::splat(5.0), 8.0));
    // Its arm reaches east.
    assert!((street.position - Vec3::new(3.0 + 1.88, 3.0, 5.84)).length() < 1e-3, "{street:?}");
}

#[test]
fn a_lamp_out_of_range_is_refused() {
    let lamp =
        |more: &str| refused(&format!("{HEAD}\n[[lamps]]\nposition = [1.0, 2.0, 3.0]\ncolour = \"#ffffff\"\n{more}\n{TREE}"));
    assert!(lamp("strength = 5.0\nreach_m = 1e9").contains("test.toml:9: `reach_m` must be from 0.5 to 60 metres"));
    assert!(lamp("strength = -1.0\nreach_m = 5.0").contains("`strength` must be from 0 to 10000"));
}

#[test]
fn rows_and_sizes_are_bounded() {
    let row = "\nrepeat = { count = 4000000000, step = [0.0, 0.001] }\n";
    assert!(refused(&format!("{HEAD}{TREE}{row}")).contains("`count` must be from 1 to 1000"));
    let row = "\nrepeat = { count = 1000, step = [0.0, 0.001] }\n";
    let heavy = TREE.replace("conifer", "broadleaf");
    assert!(refused(&format!("{HEAD}{heavy}{row}")).contains("exceeds 500000 triangles"));
}

fn toml_value() -> impl Strategy<Value = String> {
    prop_oneof![
        any::<f64>().prop_map(|v| format!("{v:?}")),
        any::<i64>().prop_map(|v| v.to_string()),
        (-50.0..50.0f64).prop_map(|v| format!("{v:?}")),
        prop::collection::vec(-1e3..1e3f64, 0..5).prop_map(|v| format!("{v:?}")),
        "[a-z_]{0,12}".prop_map(|s| format!("\"{s}\"")),
        Just("true".to_owned()),
        Just("[[1.0, 2.0, 3.0]]".to_owned()),
        Just("{ kind = \"car\" }".to_owned()),
    ]
}

/// A text as a basic string of TOML.
fn toml_string(text: &str) -> String {
    let mut out = String::from("\"");
    for c in text.chars() {
        match c {
            '"' | '\\' => out.extend(['\\', c]),
            c if c.is_control() => out += &format!("\\u{:04X}", c as u32),
            c => out.push(c),
        }
    }
    out + "\""
}

#[test]
fn a_sign_can_be_painted_on_a_wall_and_a_picture_can_look_like_a_thing() {
    let painted = r#"
[[objects]]
id = "words"
mesh = { kind = "sign", text = "LAND\nHERE", arrow = "down", letter = 0.5, board = false }
position = [4.0, 2.0, 1.0]
heading_deg = 90.0
names = ["writing"]
kind = "sign"

[[objects]]
id = "picture"
mesh = { kind = "flat", of = { kind = "barrel", height = 1.0 } }
position = [4.1, 6.0, 1.0]
heading_deg = 90.0
looks_like = "tree"
names = ["picture"]
kind = "picture"
"#;
    let scene = Scene::parse(&format!("{HEAD}{TREE}{painted}"), "test.toml").unwrap();
    let words = scene.by_key("words").unwrap();
    // Only strokes, 4 mm before the wall that faces east.
    assert!((words.bounds.max.east - words.bounds.min.east).abs() < 1e-3 && words.bounds.min.east > 4.003);
    let sign = words.sign.as_ref().unwrap();
    assert!((sign.heading - core::f64::consts::FRAC_PI_2).abs() < 1e-9 && sign.area < 1.5, "{sign:?}");
    let view = |east| scene.signs_from(EnuPosition { east, north: 2.0, up: 1.9 });
    assert!(view(9.0)[0].facing > 0.99 && view(-9.0).is_empty());
    let picture = scene.by_key("picture").unwrap();
    assert!((picture.bounds.max.east - picture.bounds.min.east) < 0.021, "{:?}", picture.bounds);
    assert!((picture.bounds.max.up - picture.bounds.min.up - 1.0).abs() < 0.01);
    let tagged = scene.tagged();
    assert_eq!(tagged.iter().find(|tags| tags.key == "picture").unwrap().looks_like.as_deref(), Some("tree"));
    for (bad, words) in [
        (painted.replace("\"tree\"", "\"three\""), "did you mean `tree`"),
        (painted.replace("kind = \"barrel\", height = 1.0", "kind = \"flat\", of = {}"), "cannot be a mesh of kind `flat`"),
        (painted.replace("kind = \"barrel\", height = 1.0", "height = 1.0"), "needs the `kind`"),
        (painted.replace("height = 1.0 }", "height = 1.0 }, turn_deg = 400"), "`turn_deg`"),
    ] {
        let error = Scene::parse(&format!("{HEAD}{TREE}{bad}"), "test.toml").unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    #[test]
    fn arbitrary_text_never_panics(text in ".{0,400}") {
        prop_assert!(Scene::parse(&text, "test.toml").is_err());
    }

    #[test]
    fn arbitrary_keys_and_values_never_panic(
        entries in prop::collection::vec((prop::sample::select(vec![
            "id", "like", "mesh", "materials", "position", "heading_deg", "scale", "places", "repeat", "opening_of", "looks_like",
            "names", "synonyms", "colour", "kind", "use", "number", "nonsense",
        ]), toml_value()), 0..8),
    ) {
        let mut text = format!("{HEAD}\n[[objects]]\n");
        for (key, value) in entries {
            writeln!(text, "{key} = {value}").unwrap();
        }
        let _ = Scene::parse(&text, "test.toml").is_ok();
    }

    #[test]
    fn any_sign_is_read_or_refused(
        text in prop_oneof!["[A-Z0-9 :!?\n]{0,50}", ".{0,50}"], arrow in prop::option::of("left|right|up|down|north"),
        board in any::<bool>(), double in any::<bool>(), posts in prop::option::of(0.1..4.0f64), letter in 0.02..3.0f64,
    ) {
        let mut keys = format!("text = {}, letter = {letter}", toml_string(&text));
        arrow.iter().for_each(|arrow| write!(keys, ", arrow = \"{arrow}\"").unwrap());
        posts.iter().for_each(|posts| write!(keys, ", posts = {posts}").unwrap());
        if !board {
            keys += ", board = false";
        }
        if double {
            keys += ", double = true";
        }
        let mesh = format!("kind = \"sign\", {keys}");
        let object = TREE.replace("kind = \"tree\", style = \"conifer\", height = 9.0", &mesh);
        match Scene::parse(&format!("{HEAD}{object}"), "test.toml") {
            Ok(scene) => {
                let sign = scene.objects.last().unwrap().sign.as_ref().unwrap();
                prop_assert_eq!(&sign.text, &text);
                prop_assert!(sign.letter > 0.0 && sign.letter <= 1.4 * letter && sign.area > 0.0 && sign.area.is_finite());
                prop_assert!(board || !double && posts.is_none());
                prop_assert_eq!(sign.arrow.is_some(), arrow.is_some());
            }
            Err(error) => prop_assert!(error.to_string().starts_with("test.toml:"), "{error}"),
        }
    }

    #[test]
    fn any_measures_give_a_sound_mesh_or_a_refusal(
        kind in prop::sample::select(vec![
            "building", "hollow_building", "tower_crane", "lattice_mast", "needle_tower", "tunnel", "hill", "bridge", "tree",
            "house", "church", "factory", "frame_building", "fence", "bus", "truck", "fountain", "water_tower", "quay", "pile",
            "gate", "balloon", "balloon_arch", "hot_air_balloon", "plane", "lookout_tower", "clock_tower", "lake", "knoll", "patch",
            "grove", "bush", "oval_bed", "footbridge", "pavilion", "windmill", "jetty", "hangar", "windsock", "carriage", "monorail_train", "path",
            "stream", "railway_track", "monorail_beam",
            "person", "chair", "wall", "door", "window", "sign", "desk", "table", "shelf", "carton", "bin", "cone", "bottle",
            "parasol", "canopy", "ladder", "hedge", "flower_bed", "potted_plant", "whiteboard", "ceiling_lamp", "clock",
            "barrel", "flat", "arrow",
        ]),
        a in 0.01..300.0f64, b in 0.01..300.0f64, c in 0.01..300.0f64, n in 0u32..120,
    ) {
        let measures = match kind {
            "building" => format!("size = [{a}, {b}, {c}]"),
            "hollow_building" => format!("size = [{a}, {b}, {c}], hole = [{b}, {c}], sill = {a}"),
            "tower_crane" => format!("mast_height = {a}, jib = {b}, counter_jib = {c}, mast_width = 2"),
            "lattice_mast" => format!("height = {a}, width = {b}"),
            "needle_tower" => format!("height = {a}, pod_height = {b}"),
            "tunnel" => format!("length = {a}, width = {b}, height = {c}, cutting = {a}"),
            "hill" => format!("size = [{a}, {b}], height = {c}, tunnel_length = {b}, tunnel_height = {a}, cutting = {c}"),
            "bridge" => format!("width = {a}, deck_length = {b}, ramp_length = {c}, deck_height = {a}, depth_below = {b}"),
            "tree" => format!("style = \"broadleaf\", height = {a}"),
            "house" => format!("size = [{a}, {b}], wall_height = {c}, roof_height = {a}"),
            "church" => format!("size = [{a}, {b}], wall_height = {c}, spire_height = {a}"),
            "factory" => format!("size = [{a}, {b}], wall_height = {c}"),
            "frame_building" => format!("size = [{a}, {b}], storeys = {n}, storey_height = {c}"),
            "fence" => format!("length = {a}, height = {b}"),
            "bus" | "truck" => format!("length = {a}"),
            "fountain" => format!("radius = {a}"),
            "water_tower" => format!("height = {a}"),
            "quay" => format!("width = {a}, length = {b}, depth = {c}"),
            "gate" => format!("width = {a}, height = {b}, sill = {c}, number = {n}"),
            "balloon" => format!("diameter = {a}, height = {b}"),
            "balloon_arch" => format!("width = {a}, height = {b}"),
            "hot_air_balloon" | "lookout_tower" | "clock_tower" | "windmill" | "windsock" => format!("height = {a}"),
            "plane" => format!("span = {a}"),
            "lake" => format!("size = [{a}, {b}], outlet_deg = {c}"),
            "knoll" | "hangar" => format!("size = [{a}, {b}], height = {c}"),
            "bush" => format!("height = {a}"),
            "patch" | "jetty" | "oval_bed" => format!("size = [{a}, {b}]"),
            "grove" => format!("size = [{a}, {b}], count = {n}"),
            "footbridge" => format!("length = {a}, width = {b}, rise = {c}"),
            "pavilion" => format!("radius = {a}"),
            "carriage" => format!("length = {a}"),
            "monorail_train" => format!("cars = {n}"),
            "path" | "stream" => format!("points = [[0, 0], [{a}, {b}], [{c}, 400]], width = {a}"),
            "railway_track" => format!("points = [[0, 0], [{a}, {b}], [{c}, 400]]"),
            "monorail_beam" => format!("points = [[0, 0], [{a}, {b}], [{c}, 400]], height = {a}"),
            "person" => format!("height = {a}, posture = \"sitting\", seat = {b}, holds = \"umbrella\""),
            "chair" => format!("style = \"armchair\", width = {a}"),
            "wall" => format!("length = {a}, height = {b}, thickness = {c}, skirting = true"),
            "door" => format!("width = {a}, height = {b}, open_deg = 30"),
            "window" => format!("width = {a}, height = {b}, transom = 0.5"),
            "sign" => format!("text = \"E\\n5\", letter = {a}, posts = {b}, thickness = {c}"),
            "arrow" => format!("arrow = \"{}\", letter = {a}, board = false", ["left", "right", "up", "down"][n as usize % 4]),
            "flat" => format!("of = {{ kind = \"car\", style = \"taxi\" }}, turn_deg = {c}, thickness = {a}"),
            "barrel" => format!("height = {a}"),
            "desk" | "whiteboard" | "ceiling_lamp" => format!("size = [{a}, {b}]"),
            "table" => format!("size = [{a}, {b}], height = {c}, round = {}", n % 2 == 0),
            "shelf" => format!("size = [{a}, {b}, {c}], boards = {}", n.clamp(1, 100)),
            "carton" | "hedge" | "flower_bed" => format!("size = [{a}, {b}, {c}]"),
            "bin" | "cone" | "bottle" => format!("height = {a}"),
            "canopy" => format!("size = [{a}, {b}], height = {c}, rise = {a}"),
            "ladder" => format!("length = {a}"),
            "potted_plant" => format!("height = {a}, style = \"{}\"", ["leafy", "cactus", "flowers"][n as usize % 3]),
            "clock" => format!("radius = {a}"),
            _ => format!("radius = {a}, height = {b}"),
        };
        let kind = if kind == "arrow" { "sign" } else { kind };
        let object = TREE.replace("kind = \"tree\", style = \"conifer\", height = 9.0", &format!("kind = \"{kind}\", {measures}"));
        match Scene::parse(&format!("{HEAD}{object}"), "test.toml") {
            Ok(scene) => for vertex in scene.geometry.parts.iter().flat_map(|p| &p.vertices) {
                prop_assert!(vertex.position.is_finite() && (vertex.normal.length() - 1.0).abs() < 1e-3, "{kind}: {vertex:?}");
            },
            Err(e) => prop_assert!(n == 0 || n > 100, "{kind} {measures}: {e}"),
        }
    }
}

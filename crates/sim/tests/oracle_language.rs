//! The oracle's language over the city's own object list.
#![allow(clippy::unwrap_used)]

use spf_core::geometry::{EnuPosition, Pose};
use spf_sim::oracle::{Place, Placed, Tagged, resolve_truth};

/// Tags and rough places of the city's objects, straight from the scene file: the language needs no meshes.
struct City {
    tags: Vec<Tagged>,
    places: Vec<Place>,
}

impl City {
    fn load() -> Self {
        let text = include_str!("../../../scenes/city.toml");
        let scene: toml::Table = text.parse().unwrap();
        let templates = scene["templates"].as_table().unwrap();
        let (mut tags, mut places) = (Vec::new(), Vec::new());
        for object in scene["objects"].as_array().unwrap() {
            let object = object.as_table().unwrap();
            let template = object.get("like").map(|name| templates[name.as_str().unwrap()].as_table().unwrap());
            let get = |key: &str| object.get(key).or_else(|| template.and_then(|t| t.get(key)));
            let words = |key: &str| -> Vec<String> {
                get(key).and_then(|v| v.as_array()).into_iter().flatten().filter_map(|v| v.as_str().map(str::to_owned)).collect()
            };
            let word = |key: &str| get(key).and_then(|v| v.as_str()).map(str::to_owned);
            let mesh = get("mesh").and_then(|m| m.as_table());
            let number = |key: &str| mesh.and_then(|m| m.get(key)).and_then(float);
            let size =
                |i: usize| mesh.and_then(|m| m.get("size")).and_then(|s| s.as_array()).and_then(|s| s.get(i)).and_then(float);
            let spots: Vec<Vec<f64>> = match (object.get("position"), object.get("places")) {
                (Some(one), _) => vec![floats(one)],
                (None, Some(many)) => many.as_array().unwrap().iter().map(floats).collect(),
                _ => vec![vec![0.0, 0.0]],
            };
            for spot in spots {
                tags.push(Tagged {
                    id: tags.len() as u16 + 1,
                    key: word("id").unwrap(),
                    names: words("names"),
                    synonyms: words("synonyms"),
                    colour: word("colour"),
                    kind: word("kind").unwrap_or_default(),
                    qualities: words("qualities"),
                    uses: words("use"),
                    opening: word("kind").as_deref() == Some("opening"),
                    opening_of: word("opening_of"),
                });
                places.push(Place {
                    centre: EnuPosition { east: spot[0], north: spot[1], up: 0.0 },
                    height: number("height").or(number("mast_height")).or(size(2)).or(number("wall_height")).unwrap_or(1.5),
                    width: size(0).or(number("jib")).or(number("length")).unwrap_or(4.0),
                });
            }
        }
        Self { tags, places }
    }

    /// Keys that the last stage may mean, sorted, each once.
    fn meant(&self, instruction: &str) -> Vec<&str> {
        let objects: Vec<Placed<'_>> =
            self.tags.iter().zip(&self.places).map(|(tags, place)| Placed { tags, place: Some(*place) }).collect();
        let found = resolve_truth(instruction, &objects, Some(Pose::default())).objects;
        let mut keys: Vec<&str> = found.iter().map(|id| self.tags[usize::from(*id) - 1].key.as_str()).collect();
        keys.sort_unstable();
        keys.dedup();
        keys
    }
}

fn float(value: &toml::Value) -> Option<f64> {
    value.as_float().or_else(|| value.as_integer().map(|i| i as f64))
}

fn floats(value: &toml::Value) -> Vec<f64> {
    value.as_array().unwrap().iter().filter_map(float).collect()
}

#[test]
fn ways_of_saying_it_mean_the_same() {
    let city = City::load();
    let cases: &[(&str, &[&str])] = &[
        ("Take off and fly to the red crane", &["red_crane"]),
        ("take off and fly to the tall white building", &["tall_white_building"]),
        ("Take off and fly to the white needle", &["needle_tower"]),
        ("Take off and fly to the black car", &["black_car"]),
        ("Fly through the tunnel in front of you", &["tunnel"]),
        ("head over to the yellow construction crane please", &["yellow_crane"]),
        ("Could you pay a visit to the needle?", &["needle_tower"]),
        ("I want you to approach the red crain", &["red_crane"]),
        ("flyy to teh blakc car", &["black_car"]),
        ("go to the tall white building then the black car", &["black_car"]),
        ("Don't fly to the red crane, go to the needle", &["needle_tower"]),
        ("fly to the crane that is not red", &["yellow_crane"]),
        ("fly to the crane, but not the yellow one", &["red_crane"]),
        ("before going to the black car, visit the red crane", &["black_car"]),
        ("go to the fountain after visiting the church", &["fountain"]),
        ("find the digger", &["excavator"]),
        ("the church", &["church"]),
        ("fly to the elephant", &[]),
        ("fly to the purple car", &[]),
        ("go to the police station", &[]),
        ("fly to the horse", &[]),
        ("fly to the thing that broadcasts television", &["needle_tower"]),
        ("something you can use to lift heavy loads", &["red_crane", "yellow_crane"]),
        ("fly to the white building next to the needle tower", &["tall_white_building"]),
        ("fly to the tallest building", &["blue_glass_tower"]),
        ("go to the low white building", &["low_white_building"]),
        ("instead of the red crane, go to the yellow one", &["yellow_crane"]),
        ("Avoid the trees and fly to the bus", &["bus"]),
        ("Somewhere to pray", &["church"]),
        ("go to the hollow building", &["hollow_building"]),
        ("fly to the cab", &["taxi"]),
        ("get me to the school", &["brick_school"]),
        ("fly to the red crane and land next to it", &["red_crane"]),
        ("Search for the lighthouse", &[]),
        ("I'm looking for the water tower", &["water_tower"]),
        ("fly to the second tallest building", &["tall_white_building"]),
        ("go and see the fountain in the plaza", &["fountain"]),
        ("take me to the place where children learn", &["brick_school"]),
        ("It's hot. Find something that gives shade", &["conifer", "tree"]),
        ("I'd like you to go past the black car and up to the red building", &["red_brick_building"]),
        ("fly to the bridge that crosses the canal", &["bridge"]),
        ("any crane except the red one", &["yellow_crane"]),
        ("fly to the other crane, not the red one", &["yellow_crane"]),
        ("fly to the vehicle that digs holes", &["excavator"]),
        ("navigate to the white tower", &["needle_tower"]),
        ("make your way to the radio mast then return to the landing pad", &["landing_pad"]),
        ("can you find me the hotel", &["yellow_building"]),
        ("if you see a red bus, fly to it", &["bus"]),
        ("hover over to the smokestack", &["chimney"]),
        ("First visit the needle, then the church and finally the water tower", &["water_tower"]),
        ("fly to the building on the left of the needle tower", &["tall_white_building"]),
        ("go to the car that is closest to you", &["taxi"]),
        ("go to the factory with the chimney", &["factory"]),
        ("fly to the Eiffel Tower", &[]),
        ("fly to the helicopter", &[]),
        ("fly straight to the chimney, please, and stop there", &["chimney"]),
    ];
    let wrong: Vec<String> = cases
        .iter()
        .filter_map(|(words, keys)| {
            let found = city.meant(words);
            (found != *keys).then(|| format!("{words}: {found:?}, not {keys:?}"))
        })
        .collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn verbs_that_need_the_bench_are_not_checkable() {
    let city = City::load();
    let objects: Vec<Placed<'_>> = city.tags.iter().map(|tags| Placed { tags, place: None }).collect();
    let checkable = |words: &str| resolve_truth(words, &objects, None).checkable;
    for words in [
        "fly through the tunnel",
        "fly around the tree",
        "fly over the bridge",
        "go behind the hollow building",
        "scan the city",
        "follow the red bus",
        "circle the church",
    ] {
        assert!(!checkable(words), "{words}");
    }
    for words in
        ["fly through the tunnel, then go to the bus", "head over to the church", "search for the bus", "find the tunnel"]
    {
        assert!(checkable(words), "{words}");
    }
}

proptest::proptest! {
    #[test]
    fn any_text_is_read_without_failing(text in "\\PC{0,200}") {
        let tags = [Tagged { id: 1, names: vec!["red crane".to_owned()], ..Tagged::default() }];
        let objects = [Placed { tags: &tags[0], place: None }];
        let target = resolve_truth(&text, &objects, None);
        proptest::prop_assert_eq!(target.fits, !target.objects.is_empty());
    }

    #[test]
    fn any_order_of_its_own_words_is_read(words in proptest::collection::vec(proptest::sample::select(vec![
        "fly", "to", "the", "a", "red", "crane", "not", "and", "then", ",", ".", "before", "after", "between", "left", "of",
        "next", "second", "from", "if", "it", "one", "that", "is", "other", "tallest", "something", "people", "drive",
        "behind", "through", "without", "dont", "with", "in", "front", "you",
    ]), 0..24)) {
        let tags = [Tagged { id: 1, names: vec!["red crane".to_owned()], ..Tagged::default() }];
        let objects = [Placed { tags: &tags[0], place: None }];
        let target = resolve_truth(&words.join(" "), &objects, None);
        proptest::prop_assert!(target.objects.len() <= 1);
    }
}

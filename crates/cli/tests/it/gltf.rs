//! Flights in worlds written by third-party exporters.

use std::path::Path;
use std::process::Command;

use serde_json::Value;

use crate::harness::{Lab, rows};
use crate::python;

/// The object with a key in a legend of ids.
fn object<'a>(legend: &'a Value, key: &str) -> Option<&'a Value> {
    legend["objects"].as_array().unwrap().iter().find(|object| object["key"] == key)
}

#[test]
#[ignore = "needs Python: .ci/interop runs it"]
fn worlds_of_trimesh_and_pygltflib_are_flown_in() {
    let Some(python) = python::environment() else { return };
    let lab = Lab::new();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/it/gltf/make.py");
    let made = Command::new(python).arg(script).arg(lab.path(".")).output().unwrap();
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    untagged(&lab);
    tagged(&lab);
    a_broken_file(&lab);
}

fn legend(lab: &Lab, scene: &str) -> Value {
    let run = lab.spf(&["sim", "render", scene, "-o", "seen.png", "--ids", "ids.png", "--size", "320x240"]);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    assert!(lab.read("seen.png").starts_with(b"\x89PNG"));
    serde_json::from_slice(&lab.read("ids.json")).unwrap()
}

/// The names alone identify the objects, and the start is found.
fn untagged(lab: &Lab) {
    let legend = legend(lab, "yard.glb");
    assert_eq!(legend["scene"], "yard");
    let car = object(&legend, "red_car_001").unwrap();
    assert_eq!((&car["tags"]["names"][0], &car["tags"]["colour"]), (&"red car".into(), &"red".into()));
    assert_eq!(object(&legend, "ground").unwrap()["tags"]["kind"], "ground");
    assert_eq!(object(&legend, "gate").unwrap()["tags"]["colour"], "orange");
    // 8 m east and 22 m north, a car's height: z up in the script was converted to y up, and back.
    let bounds = &car["bounds"];
    let middle = |axis: &str| 0.5 * (bounds["min"][axis].as_f64().unwrap() + bounds["max"][axis].as_f64().unwrap());
    assert!((middle("east") - 8.0).abs() < 0.1 && (middle("north") - 22.0).abs() < 0.1, "{bounds}");
    assert!((bounds["max"]["up"].as_f64().unwrap() - 1.7).abs() < 0.01, "{bounds}");
    let (code, flown) = lab.fly("car", &["--scene", "yard.glb", "fly to the red car", "--vlm", "oracle:perfect"]);
    assert_eq!((code, &flown["verified"], &flown["targets"][0]), (0, &true.into(), &"red_car_001".into()), "{flown}");
    // An absent object is not found.
    let (code, flown) = lab.fly("none", &["--scene", "yard.glb", "fly to the helicopter", "--max-time", "60"]);
    assert_eq!((code, &flown["verified"]), (3, &false.into()), "{flown}");
}

/// Extras contain names, opening and start; buffers and images are beside the file.
fn tagged(lab: &Lab) {
    assert!(lab.names(".").iter().any(|name| name.ends_with(".bin")) && lab.names(".").iter().any(|name| name.ends_with(".png")));
    let legend = legend(lab, "tagged.gltf");
    assert_eq!(legend["scene"], "tagged yard");
    assert_eq!(object(&legend, "red_car_001").unwrap()["tags"]["uses"][0], "drive to work");
    assert!(object(&legend, "tower").is_none(), "the tower is ignored");
    let (gate, opening) = (object(&legend, "gate").unwrap(), object(&legend, "gate_opening").unwrap());
    assert_eq!((&opening["opening"], &opening["tags"]["opening_of"]), (&true.into(), &gate["id"]));
    let (code, flown) = lab.fly("through", &["--scene", "tagged.gltf", "fly through the archway", "--vlm", "oracle:perfect"]);
    assert_eq!((code, &flown["outcome"], &flown["collisions"]), (0, &"reached".into(), &0.into()), "{flown}");
    // From 18 m south of the gate's posts to beyond them, between them.
    let rows = rows(&lab.path("through/decisions.jsonl"));
    let place = |row: &Value| {
        let at = &row["pose"]["position"];
        (at["east"].as_f64().unwrap(), at["north"].as_f64().unwrap(), at["up"].as_f64().unwrap())
    };
    let places: Vec<(f64, f64, f64)> = rows.iter().map(place).collect();
    assert!(places[0].1 < -14.0, "{places:?}");
    let bound = |of: &str| gate["bounds"][of]["north"].as_f64().unwrap();
    let gate = 0.5 * (bound("min") + bound("max"));
    let crossing = places.windows(2).find(|pair| pair[0].1 < gate && pair[1].1 >= gate).unwrap();
    let along = (gate - crossing[0].1) / (crossing[1].1 - crossing[0].1);
    let east = crossing[0].0 + (crossing[1].0 - crossing[0].0) * along;
    assert!(east.abs() < 2.5, "{east} {places:?}");
}

fn a_broken_file(lab: &Lab) {
    let whole = lab.read("yard.glb");
    lab.write("broken.glb", &whole[..whole.len() / 2]);
    let run = lab.spf(&["fly", "--scene", "broken.glb", "fly to the red car"]);
    assert_eq!(run.code, Some(2), "{}", run.stderr);
    assert!(run.stderr.contains("broken.glb: ") && run.stderr.contains("hint: "), "{}", run.stderr);
}

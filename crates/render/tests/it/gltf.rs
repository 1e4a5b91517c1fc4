//! Rendering of glTF files.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

use serde_json::json;
use spf_core::camera::Camera;
use spf_core::geometry::{Attitude, EnuPosition, Pose};
use spf_render::{Channels, Renderer};
use spf_scene::Scene;

use crate::model::{Model, object, png};

#[test]
fn a_model_without_ground_is_seen_from_its_start() {
    let mut model = Model::new();
    let mesh = model.block(2.0, 1.0, 4.0);
    model.node(json!({"name": "car", "translation": [0.0, 1.0, 0.0], "mesh": mesh}));
    let scene = model.scene();
    let image = Renderer::new(&scene.geometry).render(&Camera::quad(), &scene.preview, Channels::TRUTH);
    assert!(image.ids.unwrap().contains(&object(&scene, "car").id));
}

#[test]
fn images_are_rendered_where_the_coordinates_put_them() {
    let mut model = Model::new();
    let image = model.image(&png(2, 2, |x, y| {
        [[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255], [250, 250, 250, 0]][(y * 2 + x) as usize]
    }));
    let floor = model.floor(20.0, 1.0, Some(image));
    model.node(json!({"name": "carpet", "mesh": floor}));
    let scene = model.scene();
    assert_eq!(scene.geometry.textures.len(), 1);
    let down = Attitude { pitch: -std::f64::consts::FRAC_PI_2, ..Attitude::default() };
    let pose = Pose { position: EnuPosition { east: 0.0, north: 0.0, up: 20.0 }, attitude: down };
    let camera = Camera { tilt: 0.0, ..Camera::quad() };
    let rgb = Renderer::new(&scene.geometry).render(&camera, &pose, Channels::RGB).rgb.unwrap();
    // North is up in the image, and v = 0 is north.
    let at = |x: usize, y: usize| {
        let i = (y * 960 + x) * 3;
        [rgb[i], rgb[i + 1], rgb[i + 2]]
    };
    let strongest = |c: [u8; 3]| c.iter().enumerate().max_by_key(|(_, v)| **v).unwrap().0;
    let [red, green, blue, clear] = [at(360, 240), at(600, 240), at(360, 480), at(600, 480)];
    assert_eq!([strongest(red), strongest(green), strongest(blue)], [0, 1, 2], "{red:?} {green:?} {blue:?}");
    // Transparent parts have the mean of the rest, a third of each: grey.
    assert!(clear[0].abs_diff(clear[1]) < 40 && clear[1].abs_diff(clear[2]) < 40, "{clear:?}");
}

#[test]
fn a_model_in_a_scene_file_is_drawn_in_its_own_colours() {
    let mut model = Model::new();
    let mesh = model.block(2.0, 2.0, 2.0);
    let red = model.paint([0.8, 0.0, 0.0, 1.0]);
    model.json["meshes"][mesh]["primitives"][0]["material"] = json!(red);
    model.node(json!({"name": "block", "mesh": mesh}));
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("block.glb"), model.glb()).unwrap();
    let path = folder.path().join("scene.toml");
    let text = r#"format = 1
name = "test"
craft = "tello"
start = "0,0,0,0"
success_radius_m = 1.0
near_m = 0.8
bounds = { east = [-20, 20], north = [-20, 20], up = [0, 15] }

[[objects]]
id = "block"
mesh = { kind = "model", file = "block.glb" }
position = [0.0, 8.0]
names = ["block"]
kind = "thing"
"#;
    std::fs::write(&path, text).unwrap();
    let scene = Scene::load(&path.to_string_lossy()).unwrap();
    let position = EnuPosition { east: 0.0, north: 0.0, up: 1.0 };
    let camera = Camera { tilt: 0.0, ..Camera::quad() };
    let image = Renderer::new(&scene.geometry).render(&camera, &Pose { position, ..Pose::default() }, Channels::ALL);
    let middle = (image.height / 2 * image.width + image.width / 2) as usize;
    assert_eq!(image.ids.unwrap()[middle], object(&scene, "block").id);
    assert!((image.depth.unwrap()[middle] - 7.0).abs() < 1e-3);
    let rgb = image.rgb.unwrap();
    let [r, g, b] = [rgb[3 * middle], rgb[3 * middle + 1], rgb[3 * middle + 2]];
    assert!(r > 2 * g && r > 2 * b, "{r} {g} {b}");
}

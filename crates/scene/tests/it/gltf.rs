//! glTF files as worlds: axes, objects, tags, appearance, ground and start.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

use std::f32::consts::FRAC_1_SQRT_2;
use std::fs;

use glam::Vec3;
use serde_json::json;
use spf_core::craft::CraftKind;
use spf_core::geometry::EnuPosition;
use spf_scene::collide::Collider;
use spf_scene::geometry::{Part, Pattern, Role};
use spf_scene::{Object, Scene};

use crate::model::{BYTE, Model, SHORT, SIGNED_SHORT, object, png, yard};

/// West, south, bottom, east, north, top.
fn extent(object: &Object) -> [f64; 6] {
    let (min, max) = (object.bounds.min, object.bounds.max);
    [min.east, min.north, min.up, max.east, max.north, max.up].map(|v| (v * 1000.0).round() / 1000.0)
}

fn parts<'a>(scene: &'a Scene, object: &Object) -> Vec<&'a Part> {
    scene.geometry.parts.iter().filter(|part| part.object == object.id).collect()
}

/// A file with one block, 2 m wide (x), 1 m high, 4 m deep (z).
fn block(node: serde_json::Value) -> Model {
    let mut model = Model::new();
    let mesh = model.block(2.0, 1.0, 4.0);
    let mut node = node;
    node["mesh"] = json!(mesh);
    model.node(node);
    model
}

#[test]
fn x_is_east_y_is_up_and_z_is_south() {
    let scene = block(json!({"name": "Red_Car.003", "translation": [10.0, 2.0, -30.0]})).scene();
    let car = object(&scene, "red_car_003");
    assert_eq!(extent(car), [9.0, 28.0, 2.0, 11.0, 32.0, 3.0]);
    assert_eq!(car.tags.names, ["red car", "car"]);
    assert_eq!((car.tags.colour.as_deref(), car.tags.kind.as_str(), car.mesh), (Some("red"), "object", "gltf"));
    // A quarter turn about the vertical, counter-clockwise from above.
    let scene = block(json!({"rotation": [0.0, FRAC_1_SQRT_2, 0.0, FRAC_1_SQRT_2], "scale": [1.0, 3.0, 1.0]})).scene();
    let thing = object(&scene, "object");
    assert_eq!(extent(thing), [-2.0, -1.0, 0.0, 2.0, 1.0, 3.0]);
    // The glTF default material is white.
    assert_eq!((thing.tags.names[0].as_str(), thing.tags.colour.as_deref()), ("object", Some("white")));
}

#[test]
fn sides_face_outwards_also_when_mirrored() {
    for scale in [[1.0, 1.0, 1.0], [-1.0, 1.0, 1.0], [2.0, -1.0, 0.5]] {
        let scene = block(json!({"name": "block", "scale": scale})).scene();
        let block = object(&scene, "block");
        let middle = Vec3::new(0.0, 0.0, (0.5 * (block.bounds.min.up + block.bounds.max.up)) as f32);
        let [part] = parts(&scene, block)[..] else { panic!("one part") };
        assert_eq!((part.triangles.len(), part.vertices.len()), (12, 24), "corners are split at the edges of a box");
        for &triangle in &part.triangles {
            let [a, b, c] = triangle.map(|i| part.vertices[i as usize]);
            let across = (b.position - a.position).cross(c.position - a.position).normalize();
            assert!(across.dot(a.position - middle) > 0.0, "{scale:?}: a side looks inwards");
            assert!([a, b, c].iter().all(|v| v.normal.dot(across) > 0.999), "{scale:?}: a side is not flat");
        }
    }
}

#[test]
fn a_wrapper_scales_turns_and_overrides() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("block.GLB"), block(json!({"name": "block"})).glb()).unwrap();
    let wrapper = r#"format = 1
name = "my block"
description = "a block"
craft = "quad"
start = "0,-9,0,0"
near_m = 1.5
light = { sun_elevation_deg = 10.0 }
gltf = { file = "block.GLB", scale = 2.0, up = "z" }
"#;
    let path = folder.path().join("mine.toml");
    fs::write(&path, wrapper).unwrap();
    let scene = Scene::load(path.to_str().unwrap()).unwrap();
    // The height has become depth.
    assert_eq!(extent(object(&scene, "block")), [-2.0, 0.0, -4.0, 2.0, 2.0, 4.0]);
    assert_eq!((scene.name.as_str(), scene.description.as_str(), scene.near), ("my block", "a block", 1.5));
    assert_eq!((scene.default_craft, scene.start.position.north), (CraftKind::Quad, -9.0));
    assert!(scene.geometry.light.to_sun.z < 0.2);
    // Errors of the wrapper have its lines, those of the model its name.
    let refused = |from: &str, to: &str| {
        fs::write(&path, wrapper.replace(from, to)).unwrap();
        Scene::load(path.to_str().unwrap()).unwrap_err().to_string()
    };
    assert!(refused("scale = 2.0", "scale = 0.0").contains("mine.toml:8: `scale` must be"));
    assert!(refused("up = \"z\"", "up = \"x\"").contains("mine.toml:8: unknown variant `x`"));
    assert!(refused("near_m", "naer_m").contains("did you mean `near_m`?"));
    assert!(refused("block.GLB", "other.glb").contains("other.glb"));
    assert!(refused("block.GLB", "mine.toml").contains("does not end in `.glb`"));
    assert!(Scene::parse(wrapper, "mine.toml").unwrap_err().to_string().contains("from its path"));
    let far = refused("scale = 2.0", "scale = 5000.0");
    assert!(far.contains("block.GLB: mesh 0 of `block` extends") && far.contains("scale it down"), "{far}");
}

#[test]
fn tags_come_from_extras_names_and_colours() {
    let scene = yard().scene();
    let keys: Vec<&str> = scene.objects.iter().map(|o| o.key.as_str()).collect();
    assert_eq!(keys, ["floor", "car_001", "gate", "way_through", "sail"]);
    let car = object(&scene, "car_001");
    assert_eq!((car.tags.names.as_slice(), car.tags.colour.as_deref()), (["car".to_owned()].as_slice(), Some("red")));
    assert_eq!(object(&scene, "floor").tags.kind, "floor");
    assert_eq!(object(&scene, "sail").tags.colour.as_deref(), Some("green"), "colours by corner count");
    let gate = object(&scene, "gate");
    assert_eq!((gate.tags.names[0].as_str(), gate.tags.kind.as_str(), gate.tags.number), ("archway", "structure", Some(4)));
    assert_eq!(parts(&scene, gate).len(), 2, "what is below a tagged node belongs to it");
    let hole = object(&scene, "way_through");
    assert!(hole.opening && hole.tags.opening_of == Some(gate.id) && hole.tags.kind == "opening");
    assert!(parts(&scene, hole).iter().all(|part| part.role == Role::Opening));
}

#[test]
fn extras_omit_open_and_describe_the_flight() {
    let mut model = yard();
    model.json["nodes"][1]["extras"] = json!({"spf_ignore": 1});
    model.json["meshes"][0]["extras"] = json!({"spf_names": "paving", "spf_solid": false});
    model.json["nodes"][0]["extras"] = json!({"spf_group": "Market  Place"});
    model.json["scenes"][0]["extras"] = json!({
        "spf": {"name": "market", "craft": "quad", "near_m": 2.0, "scale": 2.0, "success_radius_m": 4.0, "start": "0,-30,0,0"}
    });
    let scene = model.scene();
    assert!(scene.by_key("car_001").is_none());
    let floor = object(&scene, "floor");
    assert_eq!((floor.tags.names[0].as_str(), floor.tags.group.as_deref()), ("paving", Some("market place")));
    assert_eq!(parts(&scene, floor)[0].role, Role::Visual);
    assert_eq!(extent(floor)[..2], [-60.0, -60.0]);
    assert_eq!(
        (scene.name.as_str(), scene.default_craft, scene.near, scene.success_radius),
        ("market", CraftKind::Quad, 2.0, 4.0)
    );
    assert_eq!(scene.start.position, EnuPosition { east: 0.0, north: -30.0, up: 0.0 });
}

#[test]
fn the_start_is_a_node_a_camera_or_a_free_place() {
    let mut model = yard();
    let scene = model.scene();
    assert_eq!(scene.start.position, EnuPosition { east: 0.0, north: -10.0, up: 0.0 }, "it stands on the floor below the node");
    assert!(scene.start.attitude.heading.abs() < 1e-9);
    // A camera that looks east.
    model.json["nodes"].as_array_mut().unwrap().pop();
    model.json["scenes"][0]["nodes"].as_array_mut().unwrap().pop();
    model.push("cameras", json!({"type": "perspective", "perspective": {"yfov": 0.8, "znear": 0.1}}));
    let east = [0.0, -FRAC_1_SQRT_2, 0.0, FRAC_1_SQRT_2];
    model.node(json!({"camera": 0, "translation": [3.0, 2.0, 4.0], "rotation": east}));
    let start = model.scene().start;
    assert!((start.attitude.heading - std::f64::consts::FRAC_PI_2).abs() < 1e-6, "{start:?}");
    assert_eq!(start.position, EnuPosition { east: 3.0, north: -4.0, up: 0.0 });
    // Neither: near the edge, in the south, facing the middle.
    model.json["nodes"][7] = json!({"name": "nothing"});
    let start = model.scene().start;
    assert!((start.position.north + 27.0).abs() < 0.1 && start.position.east.abs() < 0.1, "{start:?}");
    assert!(start.attitude.heading.abs() < 1e-9);
}

#[test]
fn a_model_without_ground_stands_on_a_meadow() {
    let scene = block(json!({"name": "car", "translation": [0.0, 1.0, 0.0]})).scene();
    let ground = object(&scene, "ground");
    assert_eq!((ground.tags.kind.as_str(), extent(ground)[5]), ("ground", 0.99));
    let collider = Collider::new(&scene.geometry).unwrap();
    let start = scene.start.position;
    assert_eq!(collider.ground_below(EnuPosition { up: start.up + 1.0, ..start }).unwrap().object, ground.id);
    assert!(collider.contact(EnuPosition { up: start.up + 1.5, ..start }, 0.9).is_none());
    assert!(scene.bounds.contains(start) && scene.default_craft == CraftKind::Tello && scene.success_radius == 1.0);
}

#[test]
fn materials_are_kept_as_far_as_they_can_be_rendered() {
    let mut model = yard();
    let red = &mut model.json["materials"][1];
    red["doubleSided"] = json!(true);
    red["emissiveFactor"] = json!([0.0, 0.5, 1.0]);
    red["extensions"] = json!({"KHR_materials_emissive_strength": {"emissiveStrength": 4.0}});
    red["pbrMetallicRoughness"] =
        json!({"baseColorFactor": [0.5, 0.02, 0.02, 1.0], "metallicFactor": 1.0, "roughnessFactor": 0.0});
    let scene = model.scene();
    let car = parts(&scene, object(&scene, "car_001"))[0];
    let material = &scene.geometry.materials[usize::from(car.material)];
    assert!(material.two_sided && material.emission == Vec3::new(0.0, 2.0, 4.0));
    assert_eq!(
        (material.colour, material.pattern),
        (Vec3::new(0.5, 0.02, 0.02), Pattern::Image { texture: u16::MAX, mirror: 1.0 })
    );
    // Fully transparent glass is solid but not rendered.
    model.json["materials"][1]["alphaMode"] = json!("BLEND");
    model.json["materials"][1]["pbrMetallicRoughness"]["baseColorFactor"] = json!([1.0, 1.0, 1.0, 0.0]);
    let scene = model.scene();
    assert_eq!(parts(&scene, object(&scene, "car_001"))[0].role, Role::Glass);
}

/// The colour of the only part of an object, and whether it has an image.
fn paint(scene: &Scene, key: &str) -> (Vec3, bool) {
    let [part] = parts(scene, object(scene, key))[..] else { panic!("one part") };
    let material = &scene.geometry.materials[usize::from(part.material)];
    (material.colour, matches!(material.pattern, Pattern::Image { texture, .. } if texture != u16::MAX))
}

#[test]
fn textures_in_other_formats_have_a_fallback_or_are_left_out_with_a_warning() {
    // As exporters write them: only the extension names the image.
    for (extension, bytes) in
        [("KHR_texture_basisu", &b"\xabKTX 20\xbb\r\n\x1a\n"[..]), ("EXT_texture_webp", b"RIFF\0\0\0\0WEBPVP8 ")]
    {
        let mut model = yard();
        model.json["extensionsRequired"] = json!([extension]);
        let view = model.view(bytes);
        let other = model.push("images", json!({"bufferView": view, "mimeType": "image/other"}));
        model.json["textures"][0]["extensions"] = json!({extension: {"source": other}});
        let kept = model.scene();
        assert!(paint(&kept, "floor").1 && kept.warnings.is_empty(), "the fallback is drawn: {:?}", kept.warnings);
        model.json["textures"][0].as_object_mut().unwrap().remove("source");
        let pbr = &mut model.json["materials"][0]["pbrMetallicRoughness"];
        pbr["baseColorFactor"] = json!([0.5, 0.02, 0.02, 1.0]);
        let plain = model.scene();
        assert_eq!(paint(&plain, "floor"), (Vec3::new(0.5, 0.02, 0.02), false));
        assert_eq!(object(&plain, "floor").tags.colour.as_deref(), Some("red"));
        let [warning] = &plain.warnings[..] else { panic!("{:?}", plain.warnings) };
        let costs = warning.contains("plain colour") && warning.contains("PNG or JPEG");
        assert!(warning.starts_with(&format!("texture 0 needs `{extension}`, which cannot be read")) && costs, "{warning}");
        // Some exporters name such an image as if every program could read it.
        model.json["textures"][0]["source"] = json!(other);
        let plain = model.scene();
        assert!(!paint(&plain, "floor").1 && plain.warnings[0].contains("neither PNG nor JPEG"), "{:?}", plain.warnings);
        // As a map of what glows, it leaves the surface dark.
        model.json["materials"][0]["pbrMetallicRoughness"] = json!({});
        model.json["materials"][0]["emissiveTexture"] = json!({"index": 0});
        model.json["materials"][0]["emissiveFactor"] = json!([1.0, 1.0, 1.0]);
        let dark = model.scene();
        assert!(dark.geometry.materials.iter().all(|material| material.emission == Vec3::ZERO) && dark.warnings.len() == 1);
    }
    let mut empty = yard();
    empty.json["textures"][0] = json!({});
    assert!(empty.scene().warnings[0].contains("an image that the file does not name"));
}

#[test]
fn colours_of_specular_glossiness_are_drawn() {
    const NAME: &str = "KHR_materials_pbrSpecularGlossiness";
    let mut model = yard();
    model.json["extensionsRequired"] = json!([NAME]);
    // Without a colour of the usual kind it would be white.
    let red = json!({"diffuseFactor": [0.5, 0.02, 0.02, 1.0], "specularFactor": [0.04, 0.04, 0.04], "glossinessFactor": 0.0});
    model.json["materials"][1] = json!({"extensions": {NAME: red}});
    let scene = model.scene();
    assert_eq!(paint(&scene, "car_001"), (Vec3::new(0.5, 0.02, 0.02), false));
    assert_eq!(object(&scene, "car_001").tags.colour.as_deref(), Some("red"));
    // A metal has the colour of what it reflects.
    let gold = json!({"diffuseFactor": [0.0, 0.0, 0.0, 1.0], "specularFactor": [0.9, 0.6, 0.1], "glossinessFactor": 1.0});
    model.json["materials"][1] = json!({"extensions": {NAME: gold}});
    // An image of the diffuse colour.
    let image = model.json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"].take();
    model.json["materials"][0] =
        json!({"extensions": {NAME: {"diffuseTexture": image, "specularFactor": [0.0, 0.0, 0.0], "glossinessFactor": 0.1}}});
    let scene = model.scene();
    let car = parts(&scene, object(&scene, "car_001"))[0];
    let material = &scene.geometry.materials[usize::from(car.material)];
    assert_eq!(material.colour, Vec3::new(0.9, 0.6, 0.1));
    assert_eq!(material.pattern, Pattern::Image { texture: u16::MAX, mirror: 1.0 });
    assert_eq!((paint(&scene, "floor"), scene.warnings), ((Vec3::ONE, true), Vec::new()));
}

#[test]
fn each_instance_of_a_mesh_is_drawn() {
    let mut model = block(json!({"name": "Tree", "translation": [100.0, 0.0, 0.0]}));
    let moved = model.floats(&[[0.0, 0.0, -10.0], [5.0, 0.0, -20.0], [0.0, 2.0, 0.0]]);
    // A quarter turn about the vertical, as a fraction of 16 bits; the third is as in the file.
    let quarter = (f32::from(i16::MAX) * FRAC_1_SQRT_2) as i16;
    let turned: Vec<u8> = [[0, 0, 0, i16::MAX], [0, quarter, 0, quarter], [0, 0, 0, i16::MAX]]
        .iter()
        .flatten()
        .flat_map(|v| v.to_le_bytes())
        .collect();
    let turned = model.accessor(&turned, SIGNED_SHORT, "VEC4", 3);
    model.json["accessors"][turned]["normalized"] = json!(true);
    let scaled = model.floats(&[[1.0, 1.0, 1.0], [1.0, 1.0, 1.0], [1.0, 3.0, 1.0]]);
    let attributes = json!({"TRANSLATION": moved, "ROTATION": turned, "SCALE": scaled});
    model.json["nodes"][0]["extensions"] = json!({"EXT_mesh_gpu_instancing": {"attributes": attributes}});
    model.json["extensionsRequired"] = json!(["EXT_mesh_gpu_instancing"]);
    let scene = model.scene();
    assert_eq!(extent(object(&scene, "tree")), [99.0, 8.0, 0.0, 101.0, 12.0, 1.0]);
    assert_eq!(extent(object(&scene, "tree_2")), [103.0, 19.0, 0.0, 107.0, 21.0, 1.0]);
    assert_eq!(extent(object(&scene, "tree_3")), [99.0, -2.0, 2.0, 101.0, 2.0, 5.0]);
    assert!(scene.warnings.is_empty() && scene.objects[..3].iter().all(|tree| tree.tags.names[0].ends_with("tree")));
    // Of a tagged node they are one object.
    model.json["nodes"][0]["extras"] = json!({"spf_names": "wood"});
    let scene = model.scene();
    let wood = object(&scene, "tree");
    assert_eq!((parts(&scene, wood).len(), extent(wood)), (3, [99.0, -2.0, 0.0, 107.0, 21.0, 5.0]));
}

#[test]
fn things_a_hundred_times_too_tall_are_doubted() {
    let chair = |height: f32, scale: f32| {
        let mut model = Model::new();
        let mesh = model.block(0.5 * height, height, 0.5 * height);
        model.node(json!({"name": "Chair", "mesh": mesh, "scale": [scale, scale, scale]}));
        model.scene().warnings
    };
    assert_eq!(chair(0.9, 1.0), Vec::<String>::new());
    assert_eq!(chair(9.0, 1.0), Vec::<String>::new());
    let centimetres = &chair(90.0, 1.0)[0];
    assert!(centimetres.starts_with("`chair` is 90 m tall: if the lengths of the file are in centimetres, set `scale = 0.01`"));
    assert!(chair(900.0, 1.0)[0].contains("in millimetres, set `scale = 0.001`"));
    assert_eq!(chair(90.0, 0.01), Vec::<String>::new());
}

#[test]
fn texture_coordinates_may_be_fractions_and_transformed() {
    let mut model = yard();
    let uv: Vec<u8> =
        [[0u16, 0], [65535, 0], [65535, 65535], [0, 65535]].iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
    let fractions = model.accessor(&uv, SHORT, "VEC2", 4);
    model.json["accessors"][fractions]["normalized"] = json!(true);
    model.json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_1"] = json!(fractions);
    let transform = json!({"offset": [0.25, 0.0], "scale": [8.0, 4.0], "texCoord": 1});
    let info = &mut model.json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"];
    info["extensions"] = json!({"KHR_texture_transform": transform});
    model.json["extensionsRequired"] = json!(["KHR_texture_transform"]);
    let scene = model.scene();
    let floor = parts(&scene, object(&scene, "floor"))[0];
    let uv: Vec<[f32; 2]> = floor.vertices.iter().map(|v| v.uv.to_array()).collect();
    assert_eq!(uv, [[0.25, 0.0], [8.25, 0.0], [8.25, 4.0], [0.25, 4.0]]);
}

#[test]
fn sparse_accessors_move_corners() {
    let mut model = block(json!({"name": "block"}));
    let places = model.view(&[3, 7]);
    let values: Vec<u8> = [[1.0f32, 9.0, -2.0], [1.0, 9.0, 2.0]].iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
    let values = model.view(&values);
    model.json["accessors"][0]["sparse"] = json!({
        "count": 2, "indices": {"bufferView": places, "componentType": BYTE}, "values": {"bufferView": values}
    });
    assert_eq!(extent(object(&model.scene(), "block"))[5], 9.0);
}

#[test]
fn files_may_lie_beside_the_scene() {
    let folder = tempfile::tempdir().unwrap();
    let mut model = yard();
    fs::create_dir(folder.path().join("parts of it")).unwrap();
    fs::write(folder.path().join("parts of it/all.bin"), &model.bin).unwrap();
    model.json["buffers"][0]["uri"] = json!("parts%20of%20it/all.bin");
    fs::write(folder.path().join("stone.png"), png(1, 1, |_, _| [9, 9, 9, 255])).unwrap();
    model.json["images"][0] = json!({"uri": "stone.png"});
    let path = folder.path().join("yard.gltf");
    fs::write(&path, model.json.to_string()).unwrap();
    let scene = Scene::load(path.to_str().unwrap()).unwrap();
    assert_eq!((scene.objects.len(), scene.name.as_str(), scene.geometry.textures[0].size()), (5, "yard", (1, 1)));
    // The same from data URIs, without a folder.
    use base64::Engine;
    let data = base64::engine::general_purpose::STANDARD.encode(&model.bin);
    model.json["buffers"][0]["uri"] = json!(format!("data:application/octet-stream;base64,{data}"));
    let png = base64::engine::general_purpose::STANDARD.encode(png(1, 1, |_, _| [9, 9, 9, 255]));
    model.json["images"][0] = json!({"uri": format!("data:image/png;base64,{png}")});
    let again = Scene::parse_model(model.json.to_string().as_bytes(), "yard.gltf").unwrap();
    assert_eq!(again.objects, scene.objects);
}

#[test]
fn loading_twice_gives_the_same_bits() {
    let (a, b) = (yard().scene(), yard().scene());
    assert_eq!((&a.objects, a.start), (&b.objects, b.start));
    assert!(a.geometry.textures == b.geometry.textures && a.geometry.materials == b.geometry.materials);
    for (p, q) in a.geometry.parts.iter().zip(&b.geometry.parts) {
        assert!(p.vertices == q.vertices && p.triangles == q.triangles && p.material == q.material);
    }
}

//! Damaged, oversized or hostile glTF files: each is rejected with a reason, and none panics.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

use std::fs;

use proptest::prelude::*;
use serde_json::json;
use spf_scene::{Scene, SceneError};

use crate::model::{FLOAT, Model, SHORT, WORD, png, yard};

/// A file with one block.
fn block() -> Model {
    let mut model = Model::new();
    let mesh = model.block(2.0, 1.0, 4.0);
    model.node(json!({"name": "block", "mesh": mesh}));
    model
}

fn refused(change: impl FnOnce(&mut Model)) -> String {
    let mut model = block();
    change(&mut model);
    model.refusal()
}

/// Places the block by these attributes, which have different numbers of values.
fn instanced(model: &mut Model, attributes: &[&str]) {
    let mut given = serde_json::Map::new();
    for (number, attribute) in attributes.iter().enumerate() {
        given.insert((*attribute).to_owned(), json!(model.floats(&vec![[1.0; 3]; 2 + number])));
    }
    model.json["nodes"][0]["extensions"] = json!({"EXT_mesh_gpu_instancing": {"attributes": given}});
}

fn of_bytes(bytes: &[u8]) -> String {
    Scene::parse_model(bytes, "test.glb").unwrap_err().to_string()
}

#[test]
fn refusals_name_the_file_the_place_and_the_remedy() {
    type Change = fn(&mut Model);
    let cases: &[(Change, &str, &str)] = &[
        (|m| m.json["asset"]["version"] = json!("1.0"), "unsupported glTF version 1.0", "export it as glTF 2.0"),
        (|m| m.json["accessors"][0]["count"] = json!(9), "accessor 0 exceeds its buffer view", ""),
        (|m| m.json["accessors"][0]["byteOffset"] = json!(u64::MAX), "accessor 0 exceeds its buffer view", ""),
        (|m| m.json["accessors"][0]["count"] = json!(u64::MAX), "accessor 0 has 18446744073709551615 elements", "simplify"),
        (|m| m.json["accessors"][0]["componentType"] = json!(SHORT), "accessor 0 has Vec3 of U16", "32-bit floats"),
        (|m| m.json["accessors"][1]["componentType"] = json!(FLOAT), "accessor 1 is not a valid index list", ""),
        (|m| m.json["accessors"][0]["type"] = json!("VEC2"), "accessor 0 has Vec2", ""),
        (|m| m.json["bufferViews"][0]["byteLength"] = json!(1 << 30), "buffer view 0 exceeds its buffer", ""),
        (|m| m.json["bufferViews"][0]["byteOffset"] = json!(u64::MAX), "buffer view 0 exceeds its buffer", ""),
        (|m| m.json["bufferViews"][0]["byteStride"] = json!(4), "accessor 0 exceeds its buffer view", ""),
        (|m| m.json["buffers"][0]["byteLength"] = json!(1 << 30), "buffer 0 is truncated", "download or export"),
        (
            |m| m.json["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = json!(77),
            "positions of mesh 0 are not in the file",
            "",
        ),
        (|m| m.json["meshes"][0]["primitives"][0]["attributes"] = json!({}), "mesh 0 has no positions", ""),
        (
            |m| m.json["meshes"][0]["primitives"][0]["indices"] = json!(77),
            "primitives[0].indices: index out of bounds",
            "Validator",
        ),
        (|m| m.json["meshes"][0]["primitives"][0]["material"] = json!(0), "primitives[0].material: index out of bounds", ""),
        (|m| m.json["nodes"][0]["mesh"] = json!(4), "nodes[0].mesh: index out of bounds", ""),
        (|m| m.json["nodes"][0]["children"] = json!([0]), "node 0 is its own descendant", "form a tree"),
        (|m| m.json["nodes"][0]["translation"] = json!([0.0, 1e30, 0.0]), "mesh 0 of `block` extends 1", "to the origin"),
        (
            |m| m.json["nodes"][0]["translation"] = json!([0.0, 0.0, 3398.0]),
            "mesh 0 of `block` extends 3396 m",
            "if its lengths are in centimetres (34.0 m), set `scale = 0.01` under [gltf] of a scene file, or `spf_scale`",
        ),
        (
            |m| m.json["nodes"][0]["scale"] = json!([1e6, 1e6, 1e6]),
            "mesh 0 of `block` extends 2000000 m",
            "if its lengths are in millimetres (2000.0 m), set `scale = 0.001`",
        ),
        (
            |m| {
                m.json["nodes"][0]["translation"] = json!([0.0, 0.0, 3398.0]);
                m.json["scenes"][0]["extras"] = json!({"spf_scale": 2.0});
            },
            "extends 6792 m",
            "scale it down: its `scale` is 2",
        ),
        (|m| instanced(m, &["TRANSLATION", "SCALE"]), "the instances of node 0 `block`", "export each instance as a node"),
        (|m| instanced(m, &[]), "(`EXT_mesh_gpu_instancing`): they have no attributes", ""),
        (
            |m| {
                let place = json!({"bufferView": 1, "componentType": WORD});
                let sparse = json!({"count": 1, "indices": place, "values": {"bufferView": 0}});
                let many = json!({"componentType": FLOAT, "type": "VEC3", "count": 50_001, "sparse": sparse});
                let many = m.push("accessors", many);
                let attributes = json!({"attributes": {"TRANSLATION": many}});
                m.json["nodes"][0]["extensions"] = json!({"EXT_mesh_gpu_instancing": attributes});
            },
            "more than 50000 nodes or instances",
            "join meshes",
        ),
        (|m| m.bin[..4].copy_from_slice(&f32::NAN.to_le_bytes()), "a vertex that is not finite", "export"),
        (|m| m.json["nodes"][0]["scale"] = json!([0.0, 0.0, 0.0]), "it has no triangles", "export its meshes"),
        (|m| m.json["meshes"][0]["primitives"][0]["mode"] = json!(0), "it has no triangles", "points and lines"),
        (|m| m.json["meshes"][0]["primitives"][0]["mode"] = json!(9), "invalid glTF 2.0", ""),
        (|m| m.json["scenes"][0]["nodes"] = json!([]), "it has no triangles", ""),
        (
            |m| m.json["extensionsRequired"] = json!(["KHR_draco_mesh_compression"]),
            "`KHR_draco_mesh_compression`",
            "without compression",
        ),
        (
            |m| m.json["extensionsRequired"] = json!(["EXT_meshopt_compression"]),
            "`EXT_meshopt_compression`",
            "without compression",
        ),
        (|m| m.json["extensionsRequired"] = json!(["KHR_mesh_quantization"]), "`KHR_mesh_quantization`", "32-bit floats"),
        (|m| m.json["extensionsRequired"] = json!(["ACME_odd"]), "unsupported extension `ACME_odd`", "without it"),
        (
            |m| m.json["nodes"][0]["extras"] = json!({"spf_nmaes": "x"}),
            "extras of node 0 `block`: unknown field `nmaes`",
            "`names`?",
        ),
        (|m| m.json["nodes"][0]["extras"] = json!({"spf_names": "x".repeat(99)}), "the tag `xxxx", "at most 80 characters"),
        (
            |m| m.json["nodes"][0]["extras"] = json!({"spf_opening": 1, "spf_opening_of": "x"}),
            "unknown object `x` in `spf_opening_of`",
            "",
        ),
        (|m| m.json["scenes"][0]["extras"] = json!({"spf_start": "here"}), "invalid pose `here`", "east,north,up,heading_deg"),
        (|m| m.json["scenes"][0]["extras"] = json!({"spf_scale": 0}), "`scale` must be from 0.0001 to 10000", ""),
        (|m| m.json["scenes"][0]["extras"] = json!({"spf_near_m": 99}), "`near_m` must be from 0.1 to 50", ""),
    ];
    for (change, message, hint) in cases {
        let error = refused(change);
        assert!(error.starts_with("test.glb: "), "{error}");
        assert!(error.contains(message) && error.contains(hint), "{error}\nshould say: {message} / {hint}");
    }
}

#[test]
fn containers_that_are_cut_or_none_are_refused() {
    let whole = block().glb();
    for (bytes, says) in [
        (&whole[..6], "truncated in its header"),
        (&whole[..200], "cannot read"),
        (b"glTF\x02\0\0\0\x03\0\0\0", "truncated in its header"),
        (b"glTF\x01\0\0\0\x0c\0\0\0", "unsupported version"),
        (b"", "cannot parse"),
        (b"PK\x03\x04 a zip file", "cannot parse"),
        (b"{}", "missing field `asset`"),
        (b"{\"asset\": {\"version\": \"2.0\"}}", "no triangles"),
    ] {
        let error = of_bytes(bytes);
        assert!(error.starts_with("test.glb: ") && error.contains(says), "{error}");
    }
}

#[test]
fn small_files_do_not_become_large_ones() {
    // Each instance is counted before it is created.
    let mut model = Model::new();
    let positions = model.floats(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]);
    let indices = model.indices(&[0, 1, 2].repeat(100_000));
    let mesh = model.mesh(json!({"attributes": {"POSITION": positions}, "indices": indices}));
    for _ in 0..21 {
        model.node(json!({"mesh": mesh}));
    }
    assert!(model.refusal().contains("more than 2000000 triangles"), "{}", model.refusal());
    // A sparse accessor without a base.
    let error = refused(|m| {
        m.json["accessors"][0] = json!({
            "componentType": FLOAT, "type": "VEC3", "count": 7_000_000,
            "sparse": {"count": 1, "indices": {"bufferView": 0, "componentType": WORD}, "values": {"bufferView": 0}}
        });
    });
    assert!(error.contains("at most 6000000 are supported"), "{error}");
    let error = refused(|m| {
        m.json["accessors"][0]["sparse"] =
            json!({"count": 9, "indices": {"bufferView": 0, "componentType": WORD}, "values": {"bufferView": 0}});
    });
    assert!(error.contains("accessor 0 exceeds"), "{error}");
    // Many deep nodes, and a description of countless values.
    let error = refused(|m| {
        for i in 1..300 {
            m.json["nodes"][i - 1]["children"] = json!([i]);
            m.push("nodes", json!({}));
        }
    });
    assert!(error.contains("deeper than 200"), "{error}");
    let error = refused(|m| m.json["extras"] = json!(vec![0; 500_001]));
    assert!(error.contains("more than 500000 values"), "{error}");
    let error = refused(|m| {
        for _ in 0..4000 {
            m.node(json!({"mesh": 0}));
        }
    });
    assert!(error.contains("4001 objects; at most 3999"), "{error}");
}

/// A PNG that claims these sides, with almost no content.
fn hollow_png(width: u32, height: u32) -> Vec<u8> {
    let mut file = png(1, 1, |_, _| [0; 4]);
    file[16..20].copy_from_slice(&width.to_be_bytes());
    file[20..24].copy_from_slice(&height.to_be_bytes());
    let crc = crc32(&file[12..29]);
    file[29..33].copy_from_slice(&crc.to_be_bytes());
    file
}

/// The checksum of PNG chunks (ISO 3309), bit by bit.
fn crc32(bytes: &[u8]) -> u32 {
    let step = |crc: u32, _| if crc & 1 == 1 { (crc >> 1) ^ 0xedb8_8320 } else { crc >> 1 };
    !bytes.iter().fold(u32::MAX, |crc, byte| (0..8).fold(crc ^ u32::from(*byte), step))
}

#[test]
fn images_are_measured_before_they_are_decoded() {
    let with = |image: &[u8]| {
        let mut model = Model::new();
        let material = model.image(image);
        let floor = model.floor(4.0, 1.0, Some(material));
        model.node(json!({"mesh": floor}));
        model.refusal()
    };
    assert!(with(&hollow_png(60_000, 60_000)).contains("at most 8192 per side"), "{}", with(&hollow_png(60_000, 60_000)));
    assert!(with(&hollow_png(4000, 4000)).contains("cannot read image 0"));
    assert!(with(&png(4, 4, |_, _| [1; 4])[..50]).contains("cannot read image 0"));
    // Many images of the permitted size.
    let mut model = Model::new();
    let image = hollow_png(8192, 8192);
    for _ in 0..9 {
        let material = model.image(&image);
        let floor = model.floor(4.0, 1.0, Some(material));
        model.node(json!({"mesh": floor}));
    }
    assert!(model.refusal().contains("exceed 512 million pixels"), "{}", model.refusal());
}

#[test]
fn other_files_stay_in_the_folder() {
    let outer = tempfile::tempdir().unwrap();
    let folder = outer.path().join("scene");
    fs::create_dir_all(folder.join("sub")).unwrap();
    let model = block();
    fs::write(outer.path().join("secret.bin"), &model.bin).unwrap();
    fs::write(folder.join("short.bin"), &model.bin[..20]).unwrap();
    let load = |uri: &str| {
        let mut model = model.clone();
        model.json["buffers"][0]["uri"] = json!(uri);
        fs::write(folder.join("scene.gltf"), model.json.to_string()).unwrap();
        match Scene::load(folder.join("scene.gltf").to_str().unwrap()) {
            Err(e @ SceneError::Model { .. }) => e.to_string(),
            other => panic!("{uri}: {other:?}"),
        }
    };
    let absolute = outer.path().join("secret.bin").to_str().unwrap().to_owned();
    for uri in [
        "../secret.bin",
        "sub/../../secret.bin",
        "%2e%2e/secret.bin",
        "..\\secret.bin",
        &absolute,
        "http://example.org/a.bin",
        "",
    ] {
        let error = load(uri);
        assert!(error.contains("not a file in its folder") && error.contains("copy it next to"), "{uri}: {error}");
    }
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink(outer.path().join("secret.bin"), folder.join("link.bin")).unwrap();
        assert!(load("link.bin").contains("not a file in its folder"));
    }
    assert!(load("nowhere.bin").contains("cannot read the referenced file `nowhere.bin`"));
    assert!(load("sub").contains("the referenced `sub` is not a file"));
    assert!(load("short.bin").contains("buffer 0 is truncated: 20 of"));
    assert!(load("data:text/plain,hello").contains("a data URI that is not base64"));
    assert!(load("data:;base64,????").contains("a data URI that is not base64"));
    // Without a folder no file is read at all.
    let mut alone = model.clone();
    alone.json["buffers"][0]["uri"] = json!("short.bin");
    assert!(of_bytes(alone.json.to_string().as_bytes()).contains("not a file in its folder"));
    let error = Scene::load(folder.join("missing.glb").to_str().unwrap()).unwrap_err();
    assert!(matches!(error, SceneError::Read { .. }), "{error}");
}

/// The yard with everything that extensions add to it.
fn extended() -> Model {
    let mut model = yard();
    let moved = model.floats(&[[0.0, 0.0, 0.0], [3.0, 0.0, -2.0]]);
    let turned = model.floats(&[[0.0, 0.0, 0.0, 1.0], [0.0, 0.7, 0.0, 0.7]]);
    let attributes = json!({"TRANSLATION": moved, "ROTATION": turned, "SCALE": moved});
    model.json["nodes"][1]["extensions"] = json!({"EXT_mesh_gpu_instancing": {"attributes": attributes}});
    let image = json!({"index": 0});
    let other = json!({"diffuseFactor": [0.5, 0.1, 0.1, 1.0], "glossinessFactor": 0.7, "diffuseTexture": image});
    model.json["materials"][1]["extensions"] = json!({"KHR_materials_pbrSpecularGlossiness": other});
    model.push("textures", json!({"extensions": {"KHR_texture_basisu": {"source": 0}}}));
    model.json["materials"][0]["emissiveTexture"] = json!({"index": 1});
    model
}

/// Requirements for a loaded scene.
fn sound(scene: &Scene) -> Result<(), TestCaseError> {
    prop_assert!(scene.bounds.contains(scene.start.position));
    for part in &scene.geometry.parts {
        prop_assert!(part.triangles.iter().flatten().all(|&i| (i as usize) < part.vertices.len()));
        for vertex in &part.vertices {
            prop_assert!(vertex.position.is_finite() && vertex.position.abs().max_element() <= 2100.0 && vertex.uv.is_finite());
            prop_assert!((vertex.normal.length() - 1.0).abs() < 1e-3, "{vertex:?}");
        }
        prop_assert!(usize::from(part.material) < scene.geometry.materials.len());
        prop_assert!(scene.object(part.object).is_some());
    }
    Ok(())
}

fn judge(bytes: &[u8]) -> Result<(), TestCaseError> {
    match Scene::parse_model(bytes, "test.glb") {
        Ok(scene) => sound(&scene),
        Err(error) => {
            prop_assert!(error.to_string().starts_with("test.glb: "));
            Ok(())
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    #[test]
    fn arbitrary_bytes_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        judge(&bytes)?;
    }

    #[test]
    fn changed_bytes_never_panic(changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..12)) {
        let mut bytes = extended().glb();
        for (at, byte) in changes {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        judge(&bytes)?;
    }

    #[test]
    fn changed_numbers_never_panic(
        changes in prop::collection::vec((any::<prop::sample::Index>(), prop_oneof![
            Just("0".to_owned()), Just("-1".to_owned()), Just("1e39".to_owned()), Just("18446744073709551615".to_owned()),
            (0u32..40).prop_map(|v| v.to_string()), (-9.0..9.0f32).prop_map(|v| v.to_string()),
        ]), 1..4),
    ) {
        let model = extended();
        let mut text = model.json.to_string();
        for (at, number) in changes {
            let numbers: Vec<_> = text.match_indices(|c: char| c.is_ascii_digit()).map(|(i, _)| i).collect();
            let at = numbers[at.index(numbers.len())];
            let end = text[at..].find(|c: char| !c.is_ascii_digit()).map_or(text.len(), |n| at + n);
            text.replace_range(at..end, &number);
        }
        let Ok(json) = serde_json::from_str(&text) else { return Ok(()) };
        judge(&Model { json, ..model }.glb())?;
    }

    #[test]
    fn a_cut_file_is_refused(at in any::<prop::sample::Index>()) {
        let whole = yard().glb();
        prop_assert!(Scene::parse_model(&whole[..at.index(whole.len())], "test.glb").is_err());
    }
}

#[test]
fn reads_are_counted_at_each_placement() {
    // One triangle that names three of a million corners: a read of 12 MB each time that it is placed, with 1 kB of file.
    let mut model = Model::new();
    let (places, values) = (model.view(&[1, 0, 0, 0]), model.view(&[0; 12]));
    let indices = model.indices(&[0, 1, 2]);
    let sparse = json!({
        "count": 1, "indices": {"bufferView": places, "componentType": WORD}, "values": {"bufferView": values}
    });
    let positions =
        model.push("accessors", json!({"componentType": FLOAT, "type": "VEC3", "count": 1_000_000, "sparse": sparse}));
    let mesh = model.mesh(json!({"attributes": {"POSITION": positions}, "indices": indices}));
    for _ in 0..7 {
        model.node(json!({"mesh": mesh}));
    }
    assert!(model.refusal().contains("or 6000000 vertices"), "{}", model.refusal());
    // Points and lines make no triangles, and a mesh without corners nothing at all; each placement counts all the same.
    let mut model = Model::new();
    let none = model.floats::<3>(&[]);
    let primitives: Vec<_> = (0..2000).map(|_| json!({"attributes": {"POSITION": none}, "mode": 0})).collect();
    model.push("meshes", json!({"primitives": primitives}));
    for _ in 0..3900 {
        model.node(json!({"mesh": 0}));
    }
    assert!(model.refusal().contains("or 6000000 vertices"), "{}", model.refusal());
}

/// A pipe would be waited for without end, and a device read without end.
#[cfg(unix)]
#[test]
fn pipes_and_devices_are_no_models_and_no_parts_of_one() {
    let outer = tempfile::tempdir().unwrap();
    let folder = outer.path();
    let pipe = |name: &str| assert!(std::process::Command::new("mkfifo").arg(folder.join(name)).status().unwrap().success());
    for name in ["scene.glb", "scene.gltf", "scene.toml"] {
        pipe(name);
        let error = Scene::load(folder.join(name).to_str().unwrap()).unwrap_err();
        assert!(matches!(error, SceneError::Read { .. } | SceneError::Model { .. }), "{name}: {error:?}");
        fs::remove_file(folder.join(name)).unwrap();
        std::os::unix::fs::symlink("/dev/zero", folder.join(name)).unwrap();
        assert!(Scene::load(folder.join(name).to_str().unwrap()).is_err(), "{name} as a device");
        fs::remove_file(folder.join(name)).unwrap();
    }
    pipe("part");
    for (list, kind) in [("buffers", "buffer"), ("images", "image")] {
        let mut model = block();
        let material = model.image(&png(4, 4, |_, _| [1; 4]));
        let floor = model.floor(4.0, 1.0, Some(material));
        model.node(json!({"mesh": floor}));
        model.json[list][0] = match list {
            "images" => json!({"uri": "part"}),
            _ => json!({"uri": "part", "byteLength": 4}),
        };
        if list == "images" {
            fs::write(folder.join("own.bin"), &model.bin).unwrap();
            model.json["buffers"][0]["uri"] = json!("own.bin");
        }
        fs::write(folder.join("scene.gltf"), model.json.to_string()).unwrap();
        let error = Scene::load(folder.join("scene.gltf").to_str().unwrap()).unwrap_err();
        assert!(error.to_string().contains("the referenced `part` is not a file"), "{kind}: {error}");
    }
}

//! glTF models as objects of a scene file.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

use std::fs;
use std::path::Path;

use serde_json::json;
use spf_core::geometry::EnuPosition;
use spf_scene::collide::Collider;
use spf_scene::geometry::{Pattern, Role};
use spf_scene::{Scene, SceneError};
use tempfile::TempDir;

use crate::model::{Model, object, png, yard};

const HEAD: &str = r#"format = 1
name = "test"
craft = "tello"
start = "0,0,0,0"
success_radius_m = 1.0
near_m = 0.8
bounds = { east = [-20, 20], north = [-20, 20], up = [0, 15] }

[templates.crate]
mesh = { kind = "model", file = "models/crate.glb" }
names = ["crate", "box"]
kind = "thing"
colour = "green"

[[objects]]
id = "floor"
position = [0.0, 0.0]
mesh = { kind = "slab", size = [60.0, 60.0], thickness = 0.1 }
names = ["floor"]
kind = "floor"
"#;

const CRATE: &str = "\n[[objects]]\nid = \"crate\"\nlike = \"crate\"\nposition = [4.0, 8.0, 1.0]\n";

/// A box 2 m wide, 1 m high, 4 m deep that stands on its origin, with an image on it.
fn crate_model() -> Model {
    let mut model = Model::new();
    let boards = model.image(&png(2, 2, |x, _| [100 + 50 * x as u8, 80, 40, 255]));
    let mesh = model.block(2.0, 1.0, 4.0);
    model.json["meshes"][mesh]["primitives"][0]["material"] = json!(boards);
    model.node(json!({"name": "Red Barrel", "mesh": mesh}));
    model
}

/// A folder with `scene.toml` and `models/crate.glb`.
fn folder(objects: &str, model: &[u8]) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("models")).unwrap();
    fs::write(folder.path().join("models/crate.glb"), model).unwrap();
    fs::write(folder.path().join("scene.toml"), format!("{HEAD}{objects}")).unwrap();
    folder
}

fn load(folder: &Path) -> Result<Scene, SceneError> {
    Scene::load(&folder.join("scene.toml").to_string_lossy())
}

#[test]
fn a_model_stands_where_the_scene_puts_it_with_the_tags_of_the_scene() {
    let turned = CRATE.replace("id = \"crate\"", "id = \"big\"").replace("[4.0, 8.0, 1.0]", "[-6.0, 0.0]");
    let folder = folder(&format!("{CRATE}{turned}scale = 2.0\nheading_deg = 90.0\n"), &crate_model().glb());
    let scene = load(folder.path()).unwrap();
    let (small, big) = (object(&scene, "crate"), object(&scene, "big"));
    assert_eq!((small.mesh, small.opening, small.id, big.id), ("model", false, 2, 3));
    assert_eq!(
        (small.tags.names[0].as_str(), small.tags.colour.as_deref(), small.tags.kind.as_str()),
        ("crate", Some("green"), "thing")
    );
    let extent = |o: &spf_scene::Object| {
        let (min, max) = (o.bounds.min, o.bounds.max);
        [min.east, min.north, min.up, max.east, max.north, max.up].map(|v| (v * 1000.0).round() / 1000.0)
    };
    assert_eq!(extent(small), [3.0, 6.0, 1.0, 5.0, 10.0, 2.0]);
    // Twice as large, with its depth along the east.
    assert_eq!(extent(big), [-10.0, -2.0, 0.0, -2.0, 2.0, 2.0]);
    // Visible parts are solid.
    let collider = Collider::new(&scene.geometry).unwrap();
    let beside = EnuPosition { east: 6.0, north: 8.0, up: 1.5 };
    assert!((collider.distance_to(small.id, beside).unwrap() - 1.0).abs() < 1e-5);
    // One model, one image, however often it is placed; and the image repeats as often on the larger one.
    assert_eq!(scene.geometry.textures.len(), 1);
    let part = |id: u16| scene.geometry.parts.iter().find(|part| part.object == id).unwrap();
    assert_eq!(part(2).material, part(3).material);
    let material = &scene.geometry.materials[usize::from(part(2).material)];
    assert!(matches!(material.pattern, Pattern::Image { texture: 0, .. }), "{material:?}");
    assert!(part(2).vertices.iter().zip(&part(3).vertices).all(|(a, b)| a.uv == b.uv));
    assert!(!Scene::mesh_kinds().contains(&"model"));
}

#[test]
fn a_model_of_many_parts_is_one_object_without_its_openings() {
    let folder = folder(CRATE, &yard().glb());
    let scene = load(folder.path()).unwrap();
    assert_eq!(scene.objects.len(), 2);
    let parts: Vec<_> = scene.geometry.parts.iter().filter(|part| part.object == 2).collect();
    assert!(parts.len() > 4 && parts.iter().all(|part| part.role == Role::Solid), "{}", parts.len());
    // The scene's own materials are unchanged.
    let floor = scene.geometry.parts.iter().find(|part| part.object == 1).unwrap();
    assert!(parts.iter().all(|part| part.material != floor.material));
}

#[test]
fn a_model_with_a_file_beside_it_is_whole() {
    let mut model = crate_model();
    model.json["buffers"][0]["uri"] = json!("crate.bin");
    let folder = folder(
        &CRATE.replace("position", "mesh = { kind = \"model\", file = \"models/crate.gltf\", up = \"y\" }\nposition"),
        b"",
    );
    fs::write(folder.path().join("models/crate.gltf"), model.json.to_string()).unwrap();
    fs::write(folder.path().join("models/crate.bin"), &model.bin).unwrap();
    assert_eq!(load(folder.path()).unwrap().objects.len(), 2);
}

/// Why a scene with this object is rejected; the error names the file, the line, and the hint.
fn refusal(objects: &str) -> String {
    let folder = folder(objects, &crate_model().glb());
    let error = load(folder.path()).unwrap_err();
    assert!(matches!(error, SceneError::Invalid { .. }), "{error:?}");
    error.to_string()
}

#[test]
fn errors_state_a_remedy() {
    let with = |mesh: &str| refusal(&CRATE.replace("position", &format!("mesh = {{ kind = \"model\", {mesh} }}\nposition")));
    for (mesh, message) in [
        ("file = \"models/chair.glb\"", "scene.toml:25: the model `models/chair.glb`: cannot read it: No such file"),
        ("file = \"../crate.glb\"", "the model `../crate.glb`: it is not a file in the scene's folder"),
        ("file = \"/etc/crate.glb\"", "copy it next to the scene file and use a relative path"),
        ("file = \"models/crate.obj\"", "`models/crate.obj` does not end in `.glb` or `.gltf`"),
        ("fiel = \"models/crate.glb\"", "mesh `model`: unknown field `fiel`"),
        ("up = \"z\"", "missing field `file`"),
        ("file = \"models/crate.glb\", up = \"x\"", "unknown variant `x`"),
    ] {
        let error = with(mesh);
        assert!(error.contains(message), "{mesh}: {error}");
    }
    let materials = refusal(&format!("{CRATE}materials = {{ body = \"red_paint\" }}\n"));
    assert!(materials.contains("a model has its own materials"), "{materials}");
    let walks = CRATE.replace("position = [4.0, 8.0, 1.0]", "walk = { path = [[0, 1], [0, 9]], speed_m_s = 1.0 }");
    assert!(refusal(&walks).contains("a model cannot move"));
    // Built-in scenes and texts have no folder.
    let error = Scene::parse(&format!("{HEAD}{CRATE}"), "test.toml").unwrap_err().to_string();
    assert!(error.contains("must be loaded from its path"), "{error}");
}

#[test]
fn models_that_are_broken_or_too_large_are_refused() {
    let refused = |model: &[u8]| load(folder(CRATE, model).path()).unwrap_err().to_string();
    assert!(refused(b"glTF").contains("the model `models/crate.glb`: "), "{}", refused(b"glTF"));
    assert!(refused(&Model::new().glb()).contains("it has no triangles"));
    let folder = folder(CRATE, b"");
    fs::File::create(folder.path().join("models/crate.glb")).unwrap().set_len(257 << 20).unwrap();
    let large = load(folder.path()).unwrap_err().to_string();
    assert!(
        large.contains("the file has 257 MiB; at most 256 MiB is supported") && large.contains("hint: reduce the textures"),
        "{large}"
    );
}

#[cfg(unix)]
#[test]
fn a_link_does_not_lead_out_of_the_folder() {
    let (outer, folder) = (tempfile::tempdir().unwrap(), folder(CRATE, b""));
    fs::write(outer.path().join("crate.glb"), crate_model().glb()).unwrap();
    fs::remove_file(folder.path().join("models/crate.glb")).unwrap();
    std::os::unix::fs::symlink(outer.path().join("crate.glb"), folder.path().join("models/crate.glb")).unwrap();
    let error = load(folder.path()).unwrap_err().to_string();
    assert!(error.contains("it is not a file in the scene's folder"), "{error}");
}

#[test]
fn a_model_has_its_place_in_variants() {
    let rows = "\n[[objects]]\nid = \"row\"\nlike = \"crate\"\nplaces = [[-8.0, 8.0], [8.0, -8.0], [-8.0, -8.0]]\n";
    let vary = "\n[[vary.jitter]]\nobjects = [\"row\"]\ndistance_m = 1.0\nturn_deg = 20.0\n";
    let folder = folder(&format!("{rows}{vary}"), &crate_model().glb());
    let path = folder.path().join("scene.toml");
    let at = |seed: u64| Scene::load(&format!("{}@{seed}", path.display())).unwrap().by_key("row_1").unwrap().bounds;
    assert_ne!(at(1), at(2));
    assert_eq!(at(1), at(1));
}

#[test]
fn what_of_a_model_is_not_drawn_is_said_once() {
    let mut model = crate_model();
    model.json["textures"][0] = json!({"extensions": {"EXT_texture_webp": {"source": 0}}});
    let twice = CRATE.replace("id = \"crate\"", "id = \"other\"");
    let folder = folder(&format!("{CRATE}{twice}"), &model.glb());
    let scene = load(folder.path()).unwrap();
    let [warning] = &scene.warnings[..] else { panic!("{:?}", scene.warnings) };
    assert!(warning.starts_with("the model `models/crate.glb`: texture 0 needs `EXT_texture_webp`"), "{warning}");
}

#[test]
fn the_nodes_of_a_model_are_its_parts_and_the_scene_says_which_is_the_main_one() {
    let mut model = crate_model();
    let mesh = model.block(0.5, 3.0, 0.5);
    model.node(json!({"name": "Lid_Handle.001", "mesh": mesh}));
    let parts = |objects: &str| {
        let folder = folder(objects, &model.glb());
        load(folder.path()).map(|scene| {
            let id = object(&scene, "crate").id;
            let named = scene.pieces.iter().filter(|piece| piece.object == id);
            let triangles = scene.meshes().filter(|part| part.object == id).map(|part| part.pieces.clone());
            (named.map(|piece| (piece.name.clone(), piece.main)).collect::<Vec<_>>(), triangles.collect::<Vec<_>>())
        })
    };
    let (named, triangles) = parts(CRATE).unwrap();
    assert_eq!(named, [("red barrel".to_owned(), false), ("lid handle".to_owned(), false)]);
    assert_eq!(triangles, [vec![1; 12], vec![2; 12]]);
    let (named, _) = parts(&format!("{CRATE}main_part = \"lid handle\"\n")).unwrap();
    assert_eq!(named[1], ("lid handle".to_owned(), true));
    let error = parts(&format!("{CRATE}main_part = \"lid handel\"\n")).unwrap_err().to_string();
    assert!(error.contains("`crate` has no part `lid handel`") && error.contains("did you mean `lid handle`?"), "{error}");
}

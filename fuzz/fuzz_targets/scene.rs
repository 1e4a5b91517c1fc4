//! Any text as a scene and as a variant of one: parsed or rejected with its position; a parsed scene is usable and its
//! ids are within range.
#![no_main]

use libfuzzer_sys::fuzz_target;
use spf_scene::{Scene, SceneError};

fuzz_target!(|text: &str| {
    look_at(Scene::parse(text, "fuzz.toml"));
    look_at(Scene::parse_variant(text, "fuzz.toml", text.len() as u64));
});

fn look_at(read: Result<Scene, SceneError>) {
    match read {
        Ok(scene) => {
            assert!(scene.objects.len() <= usize::from(u16::MAX));
            let start = scene.start.position;
            assert!([start.east, start.north, start.up, scene.success_radius].into_iter().all(f64::is_finite));
        }
        Err(error) => assert!(error.to_string().starts_with("fuzz.toml:"), "{error}"),
    }
}

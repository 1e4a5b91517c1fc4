//! Any bytes as a model: parsed or rejected, and collisions in a parsed one can be computed.
#![no_main]

use libfuzzer_sys::fuzz_target;
use spf_scene::Scene;
use spf_scene::collide::Collider;

fuzz_target!(|bytes: &[u8]| {
    match Scene::parse_model(bytes, "fuzz.glb") {
        Ok(scene) => {
            assert!(scene.bounds.contains(scene.start.position));
            assert!(Collider::new(&scene.geometry).is_ok());
            let corners = scene.geometry.parts.iter().flat_map(|part| &part.vertices);
            assert!(corners.into_iter().all(|v| v.position.is_finite() && v.uv.is_finite()));
        }
        Err(error) => assert!(error.to_string().starts_with("fuzz.glb: "), "{error}"),
    }
});

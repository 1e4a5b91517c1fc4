//! The unit of a file's lengths: glTF has metres, but many programs write centimetres or millimetres.

use glam::Vec3;
use spf_core::coco;

use super::problem::Problem;
use crate::world::Object;

/// Farthest vertex from the origin along each axis, metres.
pub(super) const FARTHEST: f32 = 2000.0;

/// How many times as tall as usual a thing is that was written in centimetres or in millimetres, at least and at most.
const CENTIMETRES: std::ops::Range<f64> = 30.0..300.0;
const MILLIMETRES: std::ops::Range<f64> = 300.0..3000.0;

/// How to set the scale.
fn set(scale: f64) -> String {
    format!("`scale = {scale}` under [gltf] of a scene file, or `spf_scale` in the extras of the model's scene")
}

/// The error for a mesh with a vertex too far from the origin, metres; `scale` is that of the file, `of` names the mesh.
pub(super) fn too_far(vertex: Vec3, scale: f64, of: &str) -> Problem {
    let reach = f64::from(vertex.abs().max_element());
    let message = format!("{of} extends {reach:.0} m from the origin; at most {FARTHEST} m is supported");
    let (hundredth, thousandth) = (0.01 * reach, 0.001 * reach);
    let moved = "if they are in metres, move the model to the origin, or scale it down";
    Problem::new(message).hint(if scale != 1.0 {
        format!("scale it down: its `scale` is {scale}; or move the model to the origin")
    } else if hundredth <= f64::from(FARTHEST) {
        format!(
            "if its lengths are in centimetres ({hundredth:.1} m), set {}; in millimetres ({thousandth:.1} m), 0.001; {moved}",
            set(0.01)
        )
    } else if thousandth <= f64::from(FARTHEST) {
        format!("if its lengths are in millimetres ({thousandth:.1} m), set {}; {moved}", set(0.001))
    } else {
        "move the model to the origin: places on a map's grid are too far away".to_owned()
    })
}

/// A warning if most things whose name tells about how tall they are (people, cars, chairs) are a hundred or a thousand
/// times as tall.
pub(super) fn doubt(objects: &[Object], scale: f64) -> Option<String> {
    let height = |object: &Object| object.bounds.max.up - object.bounds.min.up;
    let usual = |object: &Object| object.tags.names.iter().find_map(|name| coco::height(coco::class_of(name)?));
    let known = objects.iter().filter_map(|object| Some((object, height(object) / usual(object)?)));
    let known: Vec<(&Object, f64)> = known.collect();
    let doubtful = |unit: &str, factor: f64, times: &std::ops::Range<f64>| {
        let such: Vec<_> = known.iter().filter(|(_, tall)| times.contains(tall)).collect();
        let (first, _) = such.first().filter(|_| 2 * such.len() > known.len())?;
        Some(format!(
            "`{}` is {:.0} m tall: if the lengths of the file are in {unit}, set {}",
            first.key,
            height(first),
            set(factor * scale)
        ))
    };
    doubtful("centimetres", 0.01, &CENTIMETRES).or_else(|| doubtful("millimetres", 0.001, &MILLIMETRES))
}

//! The city for other renderers, and our own renderer on the same camera path; used by `docs/bench/peers.py`.
//!
//! `peer export FOLDER` writes one OBJ file per material and `scene.json` (colours, sun, camera, path). `peer time
//! WIDTH FRAMES` renders images along the path and prints one line of JSON.

#![allow(clippy::print_stdout, clippy::disallowed_methods, reason = "an example's output, and what it measures is time")]

#[path = "../tests/it/streets/mod.rs"]
mod streets;

use std::collections::BTreeMap;
use std::error::Error;
use std::fmt::Write as _;
use std::path::Path;
use std::time::Instant;

use serde_json::json;
use spf_core::camera::Camera;
use spf_core::geometry::{Attitude, EnuPosition, Pose};
use spf_render::{Channels, RenderedImage, Renderer};
use spf_scene::Scene;
use spf_scene::geometry::{Part, Role};

use streets::STREETS;

/// Number of images on the path.
const FRAMES: usize = 240;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["export", folder] => export(Path::new(folder)),
        ["time", width, frames] => time(width.parse()?, frames.parse()?),
        _ => Err("peer export FOLDER, or peer time WIDTH FRAMES".into()),
    }
}

/// The poses of the path.
fn path() -> Vec<Pose> {
    let legs = STREETS.len() - 1;
    let at = |i: usize| {
        let along = i as f64 * legs as f64 / FRAMES as f64;
        let (leg, fraction) = (along as usize, along.fract());
        let [east, north, up, heading] =
            core::array::from_fn(|k| STREETS[leg][k] + (STREETS[leg + 1][k] - STREETS[leg][k]) * fraction);
        let attitude = Attitude { heading: heading.to_radians(), ..Attitude::default() };
        Pose { position: EnuPosition { east, north, up }, attitude }
    };
    (0..FRAMES).map(at).collect()
}

fn camera(width: u32) -> Camera {
    Camera::quad().resized(width, width * 3 / 4)
}

fn export(folder: &Path) -> Result<(), Box<dyn Error>> {
    let scene = Scene::load("city")?;
    std::fs::create_dir_all(folder)?;
    let mut parts: BTreeMap<u16, Vec<&Part>> = BTreeMap::new();
    for part in scene.geometry.parts.iter().filter(|part| part.role != Role::Opening) {
        parts.entry(part.material).or_default().push(part);
    }
    let mut materials = Vec::new();
    let mut triangles = 0;
    for (material, parts) in &parts {
        let file = format!("m{material}.obj");
        std::fs::write(folder.join(&file), obj(parts)?)?;
        let count: usize = parts.iter().map(|part| part.triangles.len()).sum();
        triangles += count;
        let colour = scene.geometry.materials[usize::from(*material)].colour;
        // Linear light to the display's transfer curve.
        let srgb = colour.to_array().map(|c| if c <= 0.003_130_8 { 12.92 * c } else { 1.055 * libm::powf(c, 1.0 / 2.4) - 0.055 });
        materials.push(json!({"file": file, "colour": srgb, "triangles": count}));
    }
    let camera = Camera::quad();
    let (_, half) = camera.half_fov();
    let look = |pose: &Pose| {
        let EnuPosition { east, north, up } = pose.position;
        // The lens looks down by its tilt.
        let (heading, down) = (pose.attitude.heading, camera.tilt);
        let ahead = [libm::sin(heading) * libm::cos(down), libm::cos(heading) * libm::cos(down), -libm::sin(down)];
        json!({"eye": [east, north, up], "ahead": ahead})
    };
    let description = json!({
        "triangles": triangles,
        "materials": materials,
        "to_sun": scene.geometry.light.to_sun.to_array(),
        "vertical_fov_deg": (2.0 * half).to_degrees(),
        "path": path().iter().map(look).collect::<Vec<_>>(),
    });
    std::fs::write(folder.join("scene.json"), description.to_string())?;
    println!("{triangles} triangles in {} materials", parts.len());
    Ok(())
}

fn obj(parts: &[&Part]) -> Result<String, std::fmt::Error> {
    let mut text = String::new();
    let mut base = 1;
    for part in parts {
        for vertex in &part.vertices {
            let (p, n) = (vertex.position, vertex.normal);
            writeln!(text, "v {} {} {}\nvn {} {} {}", p.x, p.y, p.z, n.x, n.y, n.z)?;
        }
        for corners in &part.triangles {
            let [a, b, c] = corners.map(|corner| corner + base);
            writeln!(text, "f {a}//{a} {b}//{b} {c}//{c}")?;
        }
        base += part.vertices.len() as u32;
    }
    Ok(text)
}

/// CPU time on all cores that this process has used, seconds.
fn on_cores() -> Result<f64, Box<dyn Error>> {
    let text = std::fs::read_to_string("/proc/self/stat")?;
    // After the name in brackets come state and numbers; user and system time are the twelfth and thirteenth, in hundredths.
    let fields: Vec<&str> = text.rsplit_once(") ").ok_or("no name in brackets")?.1.split(' ').collect();
    let ticks = |index: usize| fields.get(index).ok_or("too few fields")?.parse::<f64>().map_err(|_| "no number");
    Ok((ticks(11)? + ticks(12)?) / 100.0)
}

fn time(width: u32, frames: usize) -> Result<(), Box<dyn Error>> {
    let scene = Scene::load("city")?;
    let renderer = Renderer::new(&scene.geometry);
    let (camera, path) = (camera(width), path());
    let mut image = RenderedImage::default();
    let mut covered = 0;
    for pose in &path {
        renderer.render_into(&camera, pose, Channels { ids: true, ..Channels::RGB }, &[], &mut image);
        covered += image.ids.iter().flatten().filter(|id| **id != 0).count();
    }
    let pixels = path.len() * camera.width as usize * camera.height as usize;
    let (started, busy) = (Instant::now(), on_cores()?);
    for pose in path.iter().step_by(FRAMES.div_ceil(frames.max(1)).max(1)).cycle().take(frames) {
        renderer.render_into(&camera, pose, Channels::RGB, &[], &mut image);
    }
    let (wall, busy) = (started.elapsed().as_secs_f64(), on_cores()? - busy);
    let covered = covered as f64 / pixels as f64;
    println!(
        "{}",
        json!({"frames": frames, "wall_s": wall, "cpu_s": busy, "triangles": renderer.triangles(), "covered": covered})
    );
    Ok(())
}

//! Images per second on a fixed path through the city at street height, and the growth of the cost with triangles and
//! with pixels.
//!
//! `cargo run --release -p spf-render --features figures --example frame_rate [path | triangles | pixels …]`; all three without an
//! argument. After `path` the names of presets (`full`, `live`, `"ids and depth"`) select those. Wall time is measured,
//! so the machine must be idle; the CPU time of all cores is printed as well (Linux only) and is less affected by other
//! programs.

#![allow(clippy::print_stdout, clippy::disallowed_methods, reason = "an example prints, and this one measures time on the wall")]

#[path = "../tests/it/streets/mod.rs"]
mod streets;
#[path = "../tests/it/yard/mod.rs"]
mod yard;

use std::error::Error;
use std::time::Instant;

use spf_core::camera::Camera;
use spf_core::geometry::{Attitude, EnuPosition, Pose};
use spf_render::{Channels, Quality, RenderedImage, Renderer};
use spf_scene::Scene;

use streets::STREETS;

type Failure = Box<dyn Error + Send + Sync>;

/// Number of images on the path.
const FRAMES: usize = 240;
/// Minimum fraction of the pixels of every image of the path that shows more than sky.
const COVERED: f64 = 0.6;

const FULL: Channels = Channels::RGB;
const LIVE: Channels = Channels { quality: Quality::Live, ..Channels::RGB };
const TRUTH: Channels = Channels { rgb: false, depth: true, ids: true, openings: false, pieces: false, quality: Quality::Full };
const PRESETS: [(&str, Channels); 3] = [("full", FULL), ("live", LIVE), ("ids and depth", TRUTH)];

fn camera(width: u32) -> Camera {
    Camera::from_fov(width, width * 3 / 4, 90.0_f64.to_radians(), 73.7_f64.to_radians(), 5.0_f64.to_radians())
}

fn pose([east, north, up, heading]: [f64; 4]) -> Pose {
    let attitude = Attitude { heading: heading.to_radians(), ..Attitude::default() };
    Pose { position: EnuPosition { east, north, up }, attitude }
}

/// The poses of the path.
fn path() -> Vec<Pose> {
    let legs = STREETS.len() - 1;
    let at = |i: usize| {
        let along = i as f64 * legs as f64 / FRAMES as f64;
        let (leg, fraction) = (along as usize, along.fract());
        pose(core::array::from_fn(|k| STREETS[leg][k] + (STREETS[leg + 1][k] - STREETS[leg][k]) * fraction))
    };
    (0..FRAMES).map(at).collect()
}

/// CPU time of the threads of this process, milliseconds.
fn on_cores() -> Result<f64, Failure> {
    let mut sum = 0.0;
    for task in std::fs::read_dir("/proc/self/task")? {
        let text = std::fs::read_to_string(task?.path().join("schedstat"))?;
        sum += text.split(' ').next().unwrap_or_default().parse::<f64>()? * 1e-6;
    }
    Ok(sum)
}

/// Rendering times.
struct Took {
    /// Wall time of each image, milliseconds, sorted.
    wall: Vec<f64>,
    /// Mean CPU time of all cores together, milliseconds.
    cores: f64,
}

impl Took {
    /// Time in milliseconds that this fraction of the images does not exceed.
    fn within(&self, fraction: f64) -> f64 {
        self.wall[((self.wall.len() - 1) as f64 * fraction) as usize]
    }
}

fn fly(renderer: &Renderer, camera: &Camera, poses: &[Pose], channels: Channels, threads: usize) -> Result<Took, Failure> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build()?;
    pool.install(|| {
        let mut image = RenderedImage::default();
        for pose in poses.iter().step_by(8) {
            renderer.render_into(camera, pose, channels, &[], &mut image);
        }
        let (start, mut wall) = (on_cores()?, Vec::with_capacity(poses.len()));
        for pose in poses {
            let start = Instant::now();
            renderer.render_into(camera, pose, channels, &[], &mut image);
            wall.push(start.elapsed().as_secs_f64() * 1e3);
        }
        wall.sort_by(f64::total_cmp);
        Ok(Took { wall, cores: (on_cores()? - start) / poses.len() as f64 })
    })
}

fn report_path(presets: &[(&str, Channels)]) -> Result<(), Failure> {
    let renderer = Renderer::new(&Scene::load("city")?.geometry);
    let poses = path();
    let mut fractions = Vec::new();
    for pose in &poses {
        let ids = renderer.render(&camera(320), pose, Channels { ids: true, ..Channels::default() }).ids.unwrap_or_default();
        fractions.push(ids.iter().filter(|&&id| id != 0).count() as f64 / ids.len() as f64);
    }
    let (least, mean) = (fractions.iter().copied().fold(1.0, f64::min), fractions.iter().sum::<f64>() / fractions.len() as f64);
    println!(
        "city, {} triangles, {FRAMES} frames; covered: {:.0} % on average, {:.0} % at least",
        renderer.triangles(),
        mean * 100.0,
        least * 100.0
    );
    if least < COVERED {
        return Err(format!("the path looks at the sky: {:.0} % of a frame is covered", least * 100.0).into());
    }
    println!("| size | cores | preset | median | worst 5 % | CPU time per frame |\n|---|---|---|---|---|---|");
    for (width, threads) in [(960, 2), (960, 1), (640, 2), (640, 1)] {
        for &(name, channels) in presets {
            let took = fly(&renderer, &camera(width), &poses, channels, threads)?;
            let (median, worst) = (1e3 / took.within(0.5), 1e3 / took.within(0.95));
            println!(
                "| {width}×{} | {threads} | {name} | {median:.0} /s | {worst:.0} /s | {:.1} ms |",
                width * 3 / 4,
                took.cores
            );
        }
    }
    Ok(())
}

/// A walk along a street of a town, the same for every size of town.
fn street() -> Vec<Pose> {
    (0..60).map(|i| pose([0.5, -40.0 + f64::from(i), 2.0, f64::from(i * 3 % 50) - 25.0])).collect()
}

fn report_triangles() -> Result<(), Failure> {
    println!("| triangles | full | live | ids and depth |\n|---|---|---|---|");
    for blocks in [3, 12, 27] {
        let renderer = Renderer::new(&yard::town_of(blocks).geometry);
        print!("| {} ", renderer.triangles());
        for (_, channels) in PRESETS {
            print!("| {:.1} ms ", fly(&renderer, &camera(960), &street(), channels, 1)?.cores);
        }
        println!("|");
    }
    Ok(())
}

fn report_pixels() -> Result<(), Failure> {
    let renderer = Renderer::new(&Scene::load("city")?.geometry);
    let poses: Vec<Pose> = path().into_iter().step_by(4).collect();
    println!("| size | full | live | ids and depth |\n|---|---|---|---|");
    for width in [320, 640, 960, 1280, 1920] {
        print!("| {width}×{} ", width * 3 / 4);
        for (_, channels) in PRESETS {
            print!("| {:.1} ms ", fly(&renderer, &camera(width), &poses, channels, 1)?.cores);
        }
        println!("|");
    }
    Ok(())
}

fn main() -> Result<(), Failure> {
    let requested: Vec<String> = std::env::args().skip(1).collect();
    let wanted = |what: &str| requested.is_empty() || requested.iter().any(|a| a == what);
    let named = |name: &str| requested.iter().any(|a| a == name);
    if wanted("path") {
        let presets: Vec<_> =
            PRESETS.into_iter().filter(|(name, _)| named(name) || !PRESETS.iter().any(|(n, _)| named(n))).collect();
        report_path(&presets)?;
    }
    if wanted("triangles") {
        println!("\nCPU time of a frame of 960×720 in a town, one core:");
        report_triangles()?;
    }
    if wanted("pixels") {
        println!("\nCPU time of a frame of the city, one core:");
        report_pixels()?;
    }
    Ok(())
}

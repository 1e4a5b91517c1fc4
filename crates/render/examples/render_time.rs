//! CPU time of an image of the city on one core, over eight poses: `cargo run -p spf-render --features figures --example
//! render_time`.
//! Linux only: it reads the thread's CPU time, which other programs affect less than wall time.

#![allow(clippy::print_stdout, reason = "an example's output")]

use std::error::Error;

use spf_core::camera::Camera;
use spf_core::geometry::{Attitude, EnuPosition, Pose};
use spf_render::{Channels, RenderedImage, Renderer};
use spf_scene::Scene;

/// East, north, up (metres), heading, pitch (degrees): plaza, avenue, park, car park, above the roofs, straight down, canal, site.
const EYES: [[f64; 5]; 8] = [
    [0.0, 0.0, 1.5, 0.0, 0.0],
    [0.0, 30.0, 3.0, 40.0, 0.0],
    [-20.0, -40.0, 12.0, 20.0, 0.0],
    [40.0, 20.0, 6.0, 200.0, 0.0],
    [0.0, -60.0, 40.0, 10.0, -20.0],
    [0.0, 30.0, 60.0, 0.0, -88.0],
    [-60.0, 60.0, 4.0, 90.0, 0.0],
    [20.0, 100.0, 5.0, 300.0, 5.0],
];
/// Images per pose; the fastest counts.
const REPEATS: usize = 10;

/// CPU time of this thread, milliseconds.
fn on_core() -> Result<f64, Box<dyn Error + Send + Sync>> {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat")?;
    Ok(text.split(' ').next().unwrap_or_default().parse::<f64>()? * 1e-6)
}

fn main() -> Result<(), Box<dyn Error + Send + Sync>> {
    let scene = Scene::load("city")?;
    let renderer = Renderer::new(&scene.geometry);
    rayon::ThreadPoolBuilder::new().num_threads(1).build()?.install(|| {
        for width in [640, 960] {
            let camera = Camera::from_fov(width, width * 3 / 4, 90.0_f64.to_radians(), 73.7_f64.to_radians(), 0.087);
            for (name, channels) in [("rgb", Channels::RGB), ("ids, depth and openings", Channels::TRUTH)] {
                let mut sum = 0.0;
                for [east, north, up, heading, pitch] in EYES {
                    let attitude = Attitude { heading: heading.to_radians(), pitch: pitch.to_radians(), ..Attitude::default() };
                    let pose = Pose { position: EnuPosition { east, north, up }, attitude };
                    let (mut image, mut least) = (RenderedImage::default(), f64::INFINITY);
                    renderer.render_into(&camera, &pose, channels, &[], &mut image);
                    for _ in 0..REPEATS {
                        let start = on_core()?;
                        renderer.render_into(&camera, &pose, channels, &[], &mut image);
                        least = least.min(on_core()? - start);
                    }
                    sum += least;
                }
                println!("{width}x{}: {name}: {:.1} ms", width * 3 / 4, sum / EYES.len() as f64);
            }
        }
        Ok(())
    })
}

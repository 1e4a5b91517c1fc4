//! Time to render an image of a town of some 50,000 triangles at 960×720 on all cores: `cargo bench -p spf-render
//! --bench render`.

#[path = "../tests/it/yard/mod.rs"]
mod yard;

use divan::{Bencher, black_box};
use spf_core::camera::Camera;
use spf_core::geometry::{Attitude, EnuPosition, Pose};
use spf_render::{Channels, RenderedImage, Renderer};

fn main() {
    divan::main();
}

/// From low in a street and from above the roofs.
const EYES: [f64; 2] = [3.0, 40.0];

fn image(bencher: Bencher<'_, '_>, up: f64, channels: Channels) {
    let renderer = Renderer::new(&yard::town().geometry);
    let attitude = Attitude { heading: 0.2, ..Attitude::default() };
    let pose = Pose { position: EnuPosition { east: 0.0, north: -100.0, up }, attitude };
    let mut image = RenderedImage::default();
    renderer.render_into(&Camera::quad(), &pose, channels, &[], &mut image);
    bencher.bench_local(|| renderer.render_into(&Camera::quad(), black_box(&pose), channels, &[], &mut image));
}

#[divan::bench(args = EYES)]
fn truth(bencher: Bencher<'_, '_>, up: f64) {
    image(bencher, up, Channels::TRUTH);
}

#[divan::bench(args = EYES)]
fn rgb(bencher: Bencher<'_, '_>, up: f64) {
    image(bencher, up, Channels::RGB);
}

#[divan::bench(sample_count = 5)]
fn prepare() -> Renderer {
    Renderer::new(&yard::town().geometry)
}

/// Scene, sun's map, sky light and one small image.
#[divan::bench(sample_count = 3)]
fn first_colour() -> RenderedImage {
    let renderer = Renderer::new(&yard::town().geometry);
    renderer.render(&Camera::from_fov(64, 64, 1.0, 1.0, 0.0), &Pose::default(), Channels::RGB)
}

//! Cost of each camera effect for an image of 960×720, without rendering the scene.
//!
//! `cargo bench -p spf-render --bench effects`. With `blur` an image is also rendered several times.

use divan::Bencher;
use spf_core::camera::Camera;
use spf_core::geometry::Pose;
use spf_core::time::Time;
use spf_render::effects::{Shot, SimCamera};
use spf_render::{Channels, RenderedImage, Renderer};
use spf_scene::Scene;

fn main() {
    divan::main();
}

/// The city as a camera sees it, rendered once.
fn city(camera: &Camera, channels: Channels) -> RenderedImage {
    let scene = Scene::load("city").expect("a built-in scene is sound");
    let mut pose = scene.start;
    pose.position.up += 3.0;
    Renderer::new(&scene.geometry).render(camera, &pose, channels)
}

#[divan::bench(args = ["none", "lens", "exposure", "noise", "compression=jpeg:50", "compression=h264:30", "all"])]
fn photograph(bencher: Bencher<'_, '_>, effects: &str) {
    let eye = SimCamera::new(Camera::quad(), effects.parse().expect("these are effects"), 1);
    let shot = Shot::still(Time::ZERO, Pose::default());
    // The lens needs a larger image; both are rendered before the measurement.
    let mut drawn: Option<RenderedImage> = None;
    bencher.bench_local(|| {
        eye.photograph(&shot, None, |camera, _, image| {
            let city = drawn.get_or_insert_with(|| city(camera, Channels::RGB));
            image.clone_from(city);
        })
    });
}

#[divan::bench]
fn truth_through_a_lens(bencher: Bencher<'_, '_>) {
    let eye = SimCamera::new(Camera::quad(), "lens".parse().expect("these are effects"), 1);
    let mut drawn: Option<RenderedImage> = None;
    let mut seen = RenderedImage::default();
    bencher.bench_local(|| {
        eye.look(eye.camera(), &mut seen, |camera, image| {
            let city = drawn.get_or_insert_with(|| city(camera, Channels::TRUTH));
            image.clone_from(city);
        });
    });
}

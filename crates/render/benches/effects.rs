//! What each camera effect costs a picture of 960×720, the drawing of the scene left out.
//!
//! `cargo bench -p spf-render --bench effects`. With `blur` a picture is drawn several times besides.

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

/// The city as a camera sees it, drawn once.
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
    // The lens asks for a larger picture; both are drawn before the time is taken.
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

//! Speed of the steps that run once per recorded frame.

use divan::{Bencher, black_box};
use spf_core::query::ImagePoint;
use spf_core::time::Time;
use spf_media::h264::{Encoder, EncoderSettings};
use spf_media::marks::{Colour, Hud, draw_hud, draw_waypoint};
use spf_media::track::TrackImage;
use spf_media::{Jpeg, resize};

mod scene;

use scene::scene;

fn main() {
    divan::main();
}

#[divan::bench(args = [(480, 360), (640, 480), (960, 720)])]
fn encode_h264(bencher: Bencher<'_, '_>, (width, height): (u32, u32)) {
    let images: Vec<_> = (0..20).map(|shift| scene(width, height, shift)).collect();
    let mut encoder = Encoder::new(EncoderSettings::for_size(width, height, 10.0)).expect("the size is valid");
    let mut count = 0_u64;
    bencher.bench_local(|| {
        count += 1;
        encoder.encode(Time::from_millis(count * 100), &images[count as usize % 20]).expect("the codec encodes")
    });
}

#[divan::bench(args = [(480, 360), (640, 480)])]
fn resize_from_960x720(bencher: Bencher<'_, '_>, (width, height): (u32, u32)) {
    let image = scene(960, 720, 0);
    bencher.bench(|| resize(black_box(&image), width, height));
}

#[divan::bench(args = [(480, 360), (640, 480), (960, 720)])]
fn annotate(bencher: Bencher<'_, '_>, (width, height): (u32, u32)) {
    let mut image = scene(width, height, 0);
    bencher.bench_local(|| {
        draw_waypoint(&mut image, ImagePoint { u: 0.4, v: 0.4 }, "depth 7: red tower crane", Colour::WAYPOINT);
        let lines = ["#5 red tower crane  depth 7  step 5.3 m", "yaw +12°  forward 5.1 m  climb +0.8 m"];
        draw_hud(
            &mut image,
            &Hud { title: "Take off and fly to the red crane", status: "12.40 s  flying", lines: &lines, ..Hud::default() },
        );
    });
}

#[divan::bench(args = [(768, 576, 70), (960, 720, 70), (960, 720, 80), (960, 720, 90)])]
fn encode_jpeg(bencher: Bencher<'_, '_>, (width, height, quality): (u32, u32, u8)) {
    let image = scene(width, height, 0);
    bencher.bench(|| Jpeg::encode(black_box(&image), quality));
}

#[divan::bench]
fn track_image_from_480x360(bencher: Bencher<'_, '_>) {
    let image = scene(480, 360, 0);
    bencher.bench(|| TrackImage::of(black_box(&image)));
}

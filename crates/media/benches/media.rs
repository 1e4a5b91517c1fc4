//! Speed of the steps that run once per recorded frame.

use divan::{Bencher, black_box};
use spf_core::query::ImagePoint;
use spf_core::time::Time;
use spf_media::h264::{Encoder, EncoderSettings};
use spf_media::marks::{Colour, Hud, draw_hud, draw_waypoint};
use spf_media::track::TrackImage;
use spf_media::{Jpeg, Rgb, resize};

fn main() {
    divan::main();
}

/// A city-like image: blocks with window grids that shift a little from frame to frame.
fn scene(width: u32, height: u32, shift: u32) -> Rgb {
    let mut image = Rgb::new(width, height);
    for y in 0..height {
        for x in 0..width {
            let (u, v) = ((x + shift * 2) * 960 / width, y * 720 / height);
            let roof = 200 + (u / 97 * 61) % 240;
            let window = u % 24 < 9 && v % 30 < 14;
            let colour = match (v > roof, window) {
                (false, _) => [120, 160, (255 - v / 6) as u8],
                (true, true) => [40, 50, (70 + u % 13) as u8],
                (true, false) => [(150 + u / 97 * 13 % 80) as u8, 140, (120 + (u * 7 + v * 3) % 11) as u8],
            };
            image.set_pixel(x, y, colour);
        }
    }
    image
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

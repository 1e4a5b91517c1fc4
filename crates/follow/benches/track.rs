//! Speed of the tracker, one image at a time, on one core. `cargo bench -p spf-follow`

use divan::Bencher;
use spf_follow::track::{Quality, Tracker};
use spf_media::Rgb;
use spf_media::track::{PixelBox, TrackImage};

#[path = "../../media/benches/scene/mod.rs"]
mod scene;

use scene::scene;

fn main() {
    divan::main();
}

/// Images in which the scene moves by a few pixels each, there and back.
fn moving_images() -> Vec<TrackImage> {
    (0..20_u32).map(|number| TrackImage::of(&scene(480, 360, number.min(20 - number)))).collect()
}

/// A box that is held: side in pixels.
#[divan::bench(args = [24, 64, 160])]
fn track_480x360(bencher: Bencher<'_, '_>, side: u32) {
    let images = moving_images();
    let side = f64::from(side);
    let area = PixelBox { left: 240.0 - side / 2.0, top: 230.0 - side, right: 240.0 + side / 2.0, bottom: 230.0 };
    let mut tracker = Tracker::start(&images[0], area);
    let mut count = 0;
    bencher.bench_local(|| {
        count += 1;
        let track = tracker.next(&images[count % 20], None);
        assert!(track.quality != Quality::TooSmall);
        track
    });
}

/// A box whose target is gone and is searched for in every image: side in pixels.
#[divan::bench(args = [24, 64, 160])]
fn search_480x360(bencher: Bencher<'_, '_>, side: u32) {
    let images = moving_images();
    let side = f64::from(side);
    let area = PixelBox { left: 240.0 - side / 2.0, top: 230.0 - side, right: 240.0 + side / 2.0, bottom: 230.0 };
    let mut tracker = Tracker::start(&images[0], area);
    let empty = TrackImage::of(&Rgb::filled(480, 360, [120; 3]));
    for _ in 0..30 {
        tracker.next(&empty, None);
    }
    bencher.bench_local(|| tracker.next(&empty, None));
}

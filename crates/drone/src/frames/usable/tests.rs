//! Images with and without content.

use spf_core::time::Time;

use super::*;
use crate::frames::{FrameStore, Frames as _};

/// Noise of a sensor, about normal with this standard deviation, from the index of a pixel and a seed.
fn noise(index: usize, seed: u32, deviation: f64) -> f64 {
    let mut state = (index as u32).wrapping_mul(2_654_435_761) ^ seed.wrapping_mul(0x9e37_79b9);
    let mut uniform = || {
        state ^= state << 13;
        state ^= state >> 17;
        state ^= state << 5;
        f64::from(state) / f64::from(u32::MAX) - 0.5
    };
    (0..12).map(|_| uniform()).sum::<f64>() * deviation
}

/// An image of 960 × 720 with this grey level at each pixel, and noise.
fn image(deviation: f64, level: impl Fn(f64, f64) -> f64) -> Rgb {
    let mut image = Rgb::new(960, 720);
    for (index, pixel) in image.data_mut().chunks_exact_mut(3).enumerate() {
        let (x, y) = ((index % 960) as f64 / 960.0, (index / 960) as f64 / 720.0);
        pixel.fill((level(x, y) + noise(index + 7, 3, deviation)).clamp(0.0, 255.0) as u8);
    }
    image
}

/// A room: wall, floor and a cupboard with a pattern, this bright.
fn room(deviation: f64, bright: f64) -> Rgb {
    image(deviation, |x, y| {
        let cupboard = (0.3..0.7).contains(&x) && (0.3..0.8).contains(&y);
        let pattern = if (x * 40.0) as u32 % 2 == (y * 30.0) as u32 % 2 { 0.3 } else { 0.7 };
        bright * if cupboard { pattern } else { 0.9 - 0.4 * y }
    })
}

#[test]
fn a_covered_lens_is_unusable() {
    for (what, image) in [
        ("black", Rgb::filled(960, 720, [0; 3])),
        ("black as video has it", Rgb::filled(960, 720, [16; 3])),
        ("dark with noise", image(8.0, |_, _| 6.0)),
        ("light through a finger", image(4.0, |x, y| 12.0 + 18.0 * x * (1.0 - y))),
    ] {
        assert_eq!(why_unusable(&image), Some(Unusable::Covered), "{what}: {:?}", statistics(&image));
    }
    let frames = FrameStore::default();
    frames.receive(Time::ZERO, Time::from_millis(150), image(8.0, |_, _| 6.0));
    assert_eq!(frames.take_new_frame().unwrap().unusable, Some(Unusable::Covered));
    assert_eq!(frames.tally().unusable, 1);
}

#[test]
fn a_single_colour_is_unusable() {
    for image in [Rgb::filled(960, 720, [255; 3]), Rgb::filled(64, 48, [90, 30, 160]), image(3.0, |_, _| 120.0), Rgb::new(0, 0)] {
        assert_eq!(why_unusable(&image), Some(Unusable::Blank), "{:?}", statistics(&image));
    }
}

#[test]
fn smeared_and_missing_parts_are_unusable() {
    let whole = room(3.0, 200.0);
    assert_eq!(why_unusable(&whole), None);
    // From here on each row repeats the one above it; then the same with columns.
    let smeared = |down: bool| {
        let mut image = whole.clone();
        for y in 0..720 {
            for x in 0..960 {
                let (u, v) = if down { (x, y.min(430)) } else { (x.min(500), y) };
                image.set_pixel(x, y, whole.pixel(u, v).unwrap());
            }
        }
        image
    };
    for down in [true, false] {
        assert_eq!(why_unusable(&smeared(down)), Some(Unusable::Smeared), "{:?}", statistics(&smeared(down)));
    }
    for fill in MISSING {
        let mut image = whole.clone();
        (0..960 * 300).for_each(|index| image.set_pixel(index % 960, 719 - index / 960, fill));
        assert_eq!(why_unusable(&image), Some(Unusable::Damaged), "{:?}", statistics(&image));
    }
}

#[test]
fn a_dark_room_and_a_white_wall_are_images() {
    for (what, image) in [
        ("dark room", room(8.0, 25.0)),
        ("lamp in the dark", image(8.0, |x, y| if f64::hypot(x - 0.4, y - 0.3) < 0.03 { 200.0 } else { 5.0 })),
        ("white wall", image(2.0, |x, y| 235.0 - 12.0 * f64::hypot(x - 0.5, y - 0.5))),
        ("fence", image(3.0, |x, _| if ((x * 60.0) as u32).is_multiple_of(2) { 60.0 } else { 180.0 })),
        ("small", room(0.0, 200.0)),
    ] {
        assert_eq!(why_unusable(&image), None, "{what}: {:?}", statistics(&image));
    }
}

//! Any bytes as a photo and as a video: an image of bounded size, or an error.
#![no_main]

use libfuzzer_sys::fuzz_target;
use spf_bench::ground::photo::{decode, frames};

fuzz_target!(|bytes: &[u8]| {
    if let Ok(image) = decode(bytes) {
        assert!((1..=2576).contains(&image.width()) && (1..=2576).contains(&image.height()));
    }
    if let Ok(frames) = frames(bytes, 0.5, 4) {
        assert!(frames.len() <= 4);
    }
});

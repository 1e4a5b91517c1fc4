//! Streams for the tests of this crate.

use std::collections::BTreeMap;
use std::sync::Mutex;

use spf_core::time::Time;
use spf_media::Rgb;
use spf_media::h264::{AccessUnit, Encoder, EncoderSettings};

/// An image with structure that differs from number to number.
pub(crate) fn image(width: u32, height: u32, number: u32) -> Rgb {
    let mut image = Rgb::new(width, height);
    for (index, byte) in image.data_mut().iter_mut().enumerate() {
        *byte = ((index as u32 / 48).wrapping_mul(2_654_435_761) >> 24) as u8 / 2 + (number * 5 % 120) as u8;
    }
    image
}

/// Encoded images, ten a second, with a key frame every `key_interval` seconds. Encoded once for all tests.
pub(crate) fn units(width: u32, height: u32, count: u32, key_interval: f64) -> Vec<AccessUnit> {
    type Made = BTreeMap<(u32, u32, u32, u64), Vec<AccessUnit>>;
    static MADE: Mutex<Made> = Mutex::new(BTreeMap::new());
    let key = (width, height, count, (1000.0 * key_interval) as u64);
    MADE.lock().unwrap().entry(key).or_insert_with(|| encode(width, height, count, key_interval)).clone()
}

fn encode(width: u32, height: u32, count: u32, key_interval: f64) -> Vec<AccessUnit> {
    let settings = EncoderSettings { key_interval, quantiser: 24, ..EncoderSettings::for_size(width, height, 10.0) };
    let mut encoder = Encoder::new(settings).unwrap();
    (0..count).map(|n| encoder.encode(Time::from_millis(100 * u64::from(n)), &image(width, height, n)).unwrap()).collect()
}

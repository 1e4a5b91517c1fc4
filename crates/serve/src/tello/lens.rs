//! Faults of the camera: images that show nothing.

use spf_core::rng::RandomStream;
use spf_core::time::Time;
use spf_media::Rgb;

use crate::fault::{CraftFault, FaultMachine};

/// Brightness of the images of a covered lens, and the standard deviation of their noise, of 255 levels.
const COVERED: (f64, f64) = (8.0, 4.0);
/// Number of different noise values: they repeat over an image in an order that no row and no column shares.
const NOISE: usize = 4096;
const NOISE_STRIDE: usize = 2039;
/// The colour of an image in a single colour.
const UNIFORM: [u8; 3] = [128, 118, 108];

/// Applies the camera's faults at `at` to an image captured then.
pub fn disturb(image: &mut Rgb, faults: &FaultMachine, at: Time) {
    if faults.has_fault(at, CraftFault::VideoUniform) {
        image.data_mut().as_chunks_mut::<3>().0.fill(UNIFORM);
    }
    if faults.has_fault(at, CraftFault::VideoBlack) {
        image.data_mut().fill(0);
    }
    if faults.has_fault(at, CraftFault::LensCovered) {
        let mut rng = RandomStream::new(0, "covered lens", &[at.as_nanos()]);
        let noise: Vec<u8> = (0..NOISE).map(|_| (COVERED.0 + COVERED.1 * rng.normal()).clamp(0.0, 255.0) as u8).collect();
        for (index, pixel) in image.data_mut().as_chunks_mut::<3>().0.iter_mut().enumerate() {
            pixel.fill(noise[index * NOISE_STRIDE % NOISE]);
        }
    }
}

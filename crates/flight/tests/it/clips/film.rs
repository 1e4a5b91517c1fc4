//! The images of a clip, with the effects of a camera and its link.

use spf_core::time::Time;
use spf_flight::sim::WorldSnapshot;
use spf_media::Rgb;
use spf_media::h264::{Decoder, Encoder, EncoderSettings};
use spf_render::Channels;
use spf_render::effects::SimCamera;

use super::flight::{Flight, INTERVAL, camera};
use super::kinds::{Condition, Number};
use super::stage::Stage;

/// Rate of a Tello's video at 960×720 and 30 images a second, bits per second. A quarter of the pixels get a quarter of it, and
/// ten images a second a third: coarser than a Tello's, whose images differ less from one to the next.
const TELLO_BITS_PER_S: f64 = 2.0e6;
const BITS_PER_S: f64 = TELLO_BITS_PER_S / 4.0 / 3.0;
const FPS: f64 = 10.0;
/// Quantisers to choose from, the finest first.
const QUANTISERS: [u8; 5] = [22, 26, 30, 34, 38];

/// The images of a clip.
pub(super) struct Film {
    pub(super) images: Vec<Rgb>,
    /// The quantiser of a video.
    pub(super) quantiser: Option<u8>,
}

impl Film {
    pub(super) fn of(stage: &Stage, flight: &Flight, number: &Number) -> Self {
        let effects = number.condition.effects().parse().unwrap();
        let sim_camera = SimCamera::new(camera(), effects, number.index as u64);
        let photo = |seconds: f64| {
            let shot = sim_camera.shot(flight.time(seconds), |at| flight.at(stage, at)).unwrap();
            sim_camera.photograph(&shot, None, |camera, snapshot: &WorldSnapshot, image| {
                stage.loaded.render_into(camera, snapshot, Channels::RGB, image);
            })
        };
        let images: Vec<Rgb> = (0..number.images).map(|image| photo(0.1 * image as f64)).collect();
        if number.condition != Condition::H264 {
            return Self { images, quantiser: None };
        }
        // Coarser is smaller: the finest that fits is found by halving.
        let (mut from, mut to) = (0, QUANTISERS.len() - 1);
        while from < to {
            let middle = (from + to) / 2;
            if encoded(&images, QUANTISERS[middle]).1 <= BITS_PER_S { to = middle } else { from = middle + 1 }
        }
        let mut decoder = Decoder::new().unwrap();
        let units = encoded(&images, QUANTISERS[to]).0;
        let images = units.iter().map(|unit| decoder.decode(unit).unwrap().unwrap()).collect();
        Self { images, quantiser: Some(QUANTISERS[to]) }
    }
}

/// A video with a key frame every second, and its rate in bits per second.
fn encoded(images: &[Rgb], quantiser: u8) -> (Vec<Vec<u8>>, f64) {
    let size = EncoderSettings::for_size(images[0].width(), images[0].height(), FPS);
    let mut encoder = Encoder::new(EncoderSettings { quantiser, key_interval: 1.0, ..size }).unwrap();
    let time = |index: usize| Time::ZERO + INTERVAL * index as u32;
    let units: Vec<Vec<u8>> =
        images.iter().enumerate().map(|(index, image)| encoder.encode(time(index), image).unwrap().annex_b).collect();
    let bits = 8.0 * units.iter().map(|unit| unit.len() as f64).sum::<f64>();
    let rate = bits / (images.len() as f64 / FPS);
    (units, rate)
}

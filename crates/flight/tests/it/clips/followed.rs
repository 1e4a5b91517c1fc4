//! A clip that was followed, by the tracker and by its stand-in.

use std::time::Instant;

use spf_core::geometry::Attitude;
use spf_core::lift::seen_after_turn;
use spf_core::query::{ImageBox, ImagePoint};
use spf_core::track::TrackQuality;
use spf_flight::sim::{TargetSeen, TrackErrors};
use spf_media::Rgb;
use spf_media::track::{PixelBox, Quality, Shift, TrackImage, Tracker};

use super::clip::{Clip, Moment};
use super::flight::{INTERVAL, camera};
use super::kinds::Number;
use super::stage::Sight;

/// A report on one image.
#[derive(Clone, Copy, Debug)]
pub(super) struct Report {
    pub(super) area: PixelBox,
    pub(super) scale: f64,
    pub(super) quality: TrackQuality,
}

impl Report {
    pub(super) fn is_good(&self) -> bool {
        self.quality == TrackQuality::Good
    }
}

/// An image, with what is to be seen, and what was reported.
#[derive(Clone, Copy, Debug)]
pub(super) struct Image {
    pub(super) sight: Sight,
    /// The target's size divided by that in the first image, by the distances.
    pub(super) growth: f64,
    pub(super) pixels: Report,
    pub(super) model: Report,
}

/// A clip after the trackers have followed its target.
pub(super) struct Followed {
    pub(super) number: Number,
    /// The target's key in the scene.
    pub(super) target: String,
    /// Whether there was something to track.
    pub(super) accepted: bool,
    /// The second to the last image.
    pub(super) images: Vec<Image>,
    /// Milliseconds that the tracker took per image.
    pub(super) millis: f64,
    pub(super) quantiser: Option<u8>,
}

impl Followed {
    /// Follows a clip's target through its images; `None` if its box was never seen.
    pub(super) fn new(clip: &Clip, show: impl Fn(&Self, &[Rgb])) -> Option<Self> {
        let (number, moments, images) = (clip.number, &clip.moments, &clip.images);
        let whole = moments[0].sight.visible?;
        let mut tracker = Tracker::start_in_middle(&TrackImage::of(&images[0]), whole);
        let mut errors = TrackErrors::new(number.seed, number.index as u64, fraction(&whole), clip.is_person);
        let mut followed = Self {
            number,
            target: clip.target.clone(),
            accepted: tracker.track().quality == Quality::Good,
            images: Vec::new(),
            millis: 0.0,
            quantiser: clip.quantiser,
        };
        let begun = Instant::now();
        let tracks: Vec<_> = (1..number.images)
            .map(|image| {
                let shift = shift(tracker.track().area.centre(), moments[image - 1].attitude, moments[image].attitude);
                tracker.next(&TrackImage::of(&images[image]), shift)
            })
            .collect();
        followed.millis = 1000.0 * begun.elapsed().as_secs_f64() / (number.images - 1) as f64;
        for (image, track) in (1..number.images).zip(tracks) {
            let Moment { sight, range, .. } = moments[image];
            let growth = moments[0].range / range;
            let seen = sight.visible.map(|area| TargetSeen { area: fraction(&area), growth: Some(growth) });
            errors.next(image as u64, INTERVAL.as_secs_f64(), seen);
            let quality = match track.quality {
                Quality::Good => TrackQuality::Good,
                Quality::Coasting => TrackQuality::Coasting,
                Quality::TooSmall => TrackQuality::TooSmall,
                _ => TrackQuality::Lost,
            };
            let pixels = Report { area: track.area, scale: track.scale, quality };
            let ImageBox { left, top, right, bottom } = errors.area();
            let area = PixelBox { left, top, right, bottom }.in_image_scaled(480.0, 360.0);
            let model = Report { area, scale: errors.scale(), quality: errors.quality() };
            followed.images.push(Image { sight, growth, pixels, model });
        }
        show(&followed, images);
        Some(followed)
    }
}

/// A box as a fraction of the image, at the stand-in's resolution: 240 pixels across.
fn fraction(area: &PixelBox) -> ImageBox {
    let low = |value: f64, of: f64| libm::floor(value / 2.0) * 2.0 / of;
    let high = |value: f64, of: f64| libm::ceil(value / 2.0) * 2.0 / of;
    ImageBox {
        left: low(area.left, 480.0),
        top: low(area.top, 360.0),
        right: high(area.right, 480.0),
        bottom: high(area.bottom, 360.0),
    }
}

/// How far the turning of the camera moves a place, as the craft's attitude tells.
fn shift((x, y): (f64, f64), before: Attitude, after: Attitude) -> Option<Shift> {
    let camera = camera();
    let (width, height) = (f64::from(camera.width), f64::from(camera.height));
    let place = seen_after_turn(ImagePoint { u: x / width, v: y / height }, &camera, before, after)?;
    Some(Shift { x: place.u * width - x, y: place.v * height - y })
}

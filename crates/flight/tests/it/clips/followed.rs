//! A clip whose target the tracker has followed.

use std::time::Instant;

use spf_core::geometry::Attitude;
use spf_core::lift::seen_after_turn;
use spf_core::query::ImagePoint;
use spf_core::track::TrackQuality;
use spf_follow::track::{Quality, Tracker};
use spf_media::Rgb;
use spf_media::track::{PixelBox, Shift, TrackImage};

use super::clip::{Clip, Moment};
use super::flight::camera;
use super::kinds::Number;
use super::stage::Sight;

/// A report on one image.
#[derive(Clone, Copy, Debug)]
pub(super) struct Report {
    pub(super) area: PixelBox,
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
    pub(super) report: Report,
}

/// A clip after the tracker has followed its target.
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
            let Moment { sight, .. } = moments[image];
            let quality = match track.quality {
                Quality::Good => TrackQuality::Good,
                Quality::Coasting => TrackQuality::Coasting,
                Quality::TooSmall => TrackQuality::TooSmall,
                _ => TrackQuality::Lost,
            };
            followed.images.push(Image { sight, report: Report { area: track.area, quality } });
        }
        show(&followed, images);
        Some(followed)
    }
}

/// How far the turning of the camera moves a place, as the craft's attitude tells.
fn shift((x, y): (f64, f64), before: Attitude, after: Attitude) -> Option<Shift> {
    let camera = camera();
    let (width, height) = (f64::from(camera.width), f64::from(camera.height));
    let place = seen_after_turn(ImagePoint { u: x / width, v: y / height }, &camera, before, after)?;
    Some(Shift { x: place.u * width - x, y: place.v * height - y })
}

//! The frames of the last seconds, from which a track can begin.

use std::collections::VecDeque;
use std::sync::Arc;

use spf_core::frame::{FrameId, FrameMeta};
use spf_core::time::{Duration, Time};
use spf_drone::frames::Photo;
use spf_media::Scaler;
use spf_media::track::TrackImage;

use super::{ASKED, INTERVAL, Image, KEPT};

/// A camera's clock is not exact: a frame may come this much too early.
const SLACK: Duration = Duration::from_millis(10);
/// Frames whose capture times are kept: those of [`KEPT`] at 60 Hz.
const MOST: usize = 480;

/// A frame that is kept.
struct Kept {
    meta: FrameMeta,
    /// `None` for a frame between those that are tracked in.
    picture: Option<Picture>,
}

/// The image of a frame: not needed yet, or converted.
#[derive(Clone)]
enum Picture {
    Photo(Photo),
    Converted(Image),
}

/// Frames in the order of their capture, and those about which queries were sent.
pub(super) struct Ring {
    /// Size of the images, pixels.
    size: (u32, u32),
    frames: VecDeque<Kept>,
    asked: VecDeque<(FrameMeta, Picture)>,
    scaler: Scaler,
}

impl Ring {
    pub(super) fn new(size: (u32, u32)) -> Self {
        Self { size, frames: VecDeque::new(), asked: VecDeque::new(), scaler: Scaler::default() }
    }

    /// Adds a frame, and says whether it is one that is tracked in.
    pub(super) fn add(&mut self, meta: FrameMeta, photo: impl FnOnce() -> Option<Photo>) -> bool {
        let last = self.frames.back().map(|last| last.meta);
        let repeats = last.is_some_and(|last| meta.captured <= last.captured || meta.capture_counter == last.capture_counter);
        if meta.unusable.is_some() || repeats {
            return false;
        }
        let tracked = self.frames.iter().rev().find(|kept| kept.picture.is_some()).map(|kept| kept.meta.captured);
        let due = tracked.is_none_or(|last| meta.captured.since(last) + SLACK >= INTERVAL);
        let picture = if due { photo().map(Picture::Photo) } else { None };
        let is_kept = picture.is_some();
        self.frames.push_back(Kept { meta, picture });
        while self.frames.len() > MOST || self.frames.front().is_some_and(|old| meta.captured.since(old.meta.captured) > KEPT) {
            self.frames.pop_front();
        }
        is_kept
    }

    /// Keeps a frame, whose image is given if it can still be had, until eight later ones were held.
    pub(super) fn hold(&mut self, frame: FrameId, photo: Option<Photo>) {
        let Some(kept) = self.frames.iter().rev().find(|kept| kept.meta.id == frame) else { return };
        let picture = kept.picture.clone().or_else(|| photo.map(Picture::Photo));
        if let Some(picture) = picture
            && !self.asked.iter().any(|(meta, _)| meta.id == frame)
        {
            self.asked.push_back((kept.meta, picture));
            if self.asked.len() > ASKED {
                self.asked.pop_front();
            }
        }
    }

    /// Converts all images that are not.
    pub(super) fn convert(&mut self) {
        let Self { size, frames, asked, scaler } = self;
        let pictures = frames.iter_mut().filter_map(|kept| kept.picture.as_mut());
        for picture in pictures.chain(asked.iter_mut().map(|(_, picture)| picture)) {
            picture.converted(*size, scaler);
        }
    }

    /// A frame and its image; `None` if it is no longer kept.
    pub(super) fn image(&mut self, id: FrameId) -> Option<(FrameMeta, Image)> {
        let Self { size, frames, asked, scaler } = self;
        let kept = frames.iter_mut().find(|kept| kept.meta.id == id).and_then(|kept| Some((kept.meta, kept.picture.as_mut()?)));
        let (meta, picture) = kept.or_else(|| asked.iter_mut().find(|(meta, _)| meta.id == id).map(|(meta, of)| (*meta, of)))?;
        Some((meta, picture.converted(*size, scaler)))
    }

    /// The newest frame that is tracked in.
    pub(super) fn newest(&self) -> Option<FrameMeta> {
        self.frames.iter().rev().find(|kept| kept.picture.is_some()).map(|kept| kept.meta)
    }

    /// Whether there is a frame to be tracked in that was captured later than this.
    pub(super) fn has_after(&self, captured: Time) -> bool {
        self.newest().is_some_and(|newest| newest.captured > captured)
    }

    /// The frame that is `stride` frames after this time among those that are tracked in, or the newest one if there are fewer, and
    /// its image. `None` if there is none after it.
    pub(super) fn after(&mut self, captured: Time, stride: usize) -> Option<(FrameMeta, Image)> {
        let later = self.frames.iter().filter(|kept| kept.picture.is_some() && kept.meta.captured > captured);
        let next = later.take(stride).last()?.meta.id;
        self.image(next)
    }
}

impl Picture {
    /// The image to track in, which is kept in place of the photo.
    fn converted(&mut self, (width, height): (u32, u32), scaler: &mut Scaler) -> Image {
        match self {
            Self::Converted(image) => image.clone(),
            Self::Photo(photo) => {
                let colours = photo.at((width, height), scaler);
                let image = Arc::new(TrackImage::of(&colours));
                scaler.reuse(colours);
                *self = Self::Converted(image.clone());
                image
            }
        }
    }
}

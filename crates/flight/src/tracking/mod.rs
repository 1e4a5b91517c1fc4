//! Tracks the target's box in the camera's frames (`docs/guide/track.md`).
//!
//! The box of a reply belongs to a frame that is seconds old by then. `Tracking` therefore keeps the frames of the last
//! `KEPT`, starts the tracker on the reply's own frame, and runs it through all later ones to the newest. From then on each
//! frame gives one report.
//!
//! Pure given frames and telemetry: the times are those of the frames. A `Photo` that is rendered on demand is rendered only if
//! the tracker needs it.

pub(crate) mod attitudes;
mod ring;
mod thread;
mod virtual_time;

pub(crate) use thread::TrackingThread;
pub(crate) use virtual_time::VirtualTracker;

use std::sync::Arc;

use spf_core::camera::Camera;
use spf_core::frame::{FrameId, FrameMeta};
use spf_core::query::ImageBox;
use spf_core::telemetry::Telemetry;
use spf_core::time::{Duration, Time};
use spf_core::track::{TrackQuality, TrackReport, TrackStart};
use spf_drone::frames::Photo;
use spf_follow::track::{Quality, Tracker};
use spf_media::track::{PixelBox, TrackImage};

use attitudes::Attitudes;
use ring::Ring;

/// How long frames are kept: the longest age of a reply's frame, by default.
const KEPT: Duration = Duration::from_secs(8);
/// Time between two frames that are tracked in.
pub(crate) const INTERVAL: Duration = Duration::from_millis(100);
/// Frames of queries that are kept: as many as there can be open queries.
const ASKED: usize = 8;
/// Width of the images, pixels.
const WIDTH: u32 = 480;
/// Number of frames that may arrive while a tracker catches up, before it skips every other one; twice as many, and it takes every
/// third one; and so on, so that it arrives in any case.
const PATIENCE: u64 = 10;

/// A camera at the size of the images in which it is tracked.
pub(crate) fn camera_of_images(camera: &Camera) -> Camera {
    let width = camera.width.clamp(1, WIDTH);
    let height = (f64::from(width) * f64::from(camera.height) / f64::from(camera.width.max(1))).round().max(1.0);
    camera.resized(width, height as u32)
}

/// An image that is kept.
type Image = Arc<TrackImage>;

/// What one step gave.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Progress {
    /// There is nothing to do until another frame arrives.
    Idle,
    /// An image was tracked in, and newer ones are waiting.
    Behind,
    /// The target in the newest frame.
    Report(TrackReport),
}

/// Keeps the frames of the last seconds, and tracks one box through them.
pub(crate) struct Tracking {
    /// The camera at the size of the images.
    camera: Camera,
    ring: Ring,
    attitudes: Attitudes,
    task: Option<Task>,
}

/// The track that was asked for.
struct Task {
    start: TrackStart,
    state: State,
    /// The last frame that was tracked in.
    at: FrameMeta,
    /// Whether the newest frame has been reached since the start.
    caught_up: bool,
    /// Number of frames that have arrived since the start.
    arrived: u64,
}

enum State {
    /// Nothing was done yet.
    New,
    Running(Box<Tracker>),
    /// Nothing will be reported any more.
    Over,
}

impl Tracking {
    /// Nothing to track yet.
    pub(crate) fn new(camera: &Camera) -> Self {
        let camera = camera_of_images(camera);
        let ring = Ring::new((camera.width, camera.height));
        Self { camera, ring, attitudes: Attitudes::default(), task: None }
    }

    /// Notes the attitude, from which the turning of the camera follows.
    pub(crate) fn telemetry(&mut self, telemetry: &Telemetry) {
        self.attitudes.add(telemetry.time, telemetry.attitude);
    }

    /// Adds a frame. `photo` is used, if at all, only for one of those that are tracked in, every [`INTERVAL`]; frames that are
    /// unusable or repeat another are left out.
    pub(crate) fn frame(&mut self, meta: FrameMeta, photo: impl FnOnce() -> Option<Photo>) {
        if self.ring.add(meta, photo)
            && let Some(task) = &mut self.task
        {
            task.arrived += 1;
        }
    }

    /// Keeps a frame about which a query was sent, because its reply may begin a track there.
    pub(crate) fn asked(&mut self, frame: FrameId, photo: Option<Photo>) {
        self.ring.hold(frame, photo);
    }

    /// Converts what has arrived as pixels now, so that the colour images can be dropped.
    pub(crate) fn convert(&mut self) {
        self.ring.convert();
    }

    /// Tracks this box from now on, instead of any other.
    pub(crate) fn start(&mut self, start: TrackStart) {
        // Until the frame is looked up, the newest one stands for it in a report that it is gone.
        let at = self.ring.newest().unwrap_or(FrameMeta {
            id: start.frame,
            captured: Time::ZERO,
            received: Time::ZERO,
            capture_counter: 0,
            width: 0,
            height: 0,
            unusable: None,
        });
        self.task = Some(Task { start, state: State::New, at, caught_up: false, arrived: 0 });
    }

    /// Tracks nothing any more.
    pub(crate) fn stop(&mut self) {
        self.task = None;
    }

    /// Tracks the box in one further image.
    pub(crate) fn step(&mut self) -> Progress {
        let Some(task) = &mut self.task else { return Progress::Idle };
        match &mut task.state {
            State::Over => Progress::Idle,
            State::New => {
                let Some((meta, image)) = self.ring.image(task.start.frame) else {
                    task.state = State::Over;
                    return Progress::Report(task.report(task.start.area, 1.0, TrackQuality::Lost));
                };
                let tracker = Tracker::start_in_middle(&image, pixels(&task.start.area, image.size()));
                task.at = meta;
                task.state = State::Running(Box::new(tracker));
                self.progress()
            }
            State::Running(tracker) => {
                // Once the newest frame has been reached, only the newest one counts. Until then, the tracker goes forward by more
                // than one frame only if they arrive faster than it follows.
                let stride = if task.caught_up { u64::MAX } else { 1 + task.arrived / PATIENCE };
                let next = self.ring.after(task.at.captured, usize::try_from(stride).unwrap_or(usize::MAX));
                let Some((meta, image)) = next else { return Progress::Idle };
                let centre = tracker.track().area.centre();
                let turned = self.attitudes.shift(&self.camera, centre, task.at.captured, meta.captured);
                tracker.next(&image, turned);
                task.at = meta;
                self.progress()
            }
        }
    }

    /// The report on the newest frame, if that is the one that was tracked in last.
    fn progress(&mut self) -> Progress {
        let size = (self.camera.width, self.camera.height);
        let Some(task) = &mut self.task else { return Progress::Idle };
        let State::Running(tracker) = &task.state else { return Progress::Idle };
        let over = tracker.is_over();
        if !over && self.ring.has_after(task.at.captured) {
            return Progress::Behind;
        }
        let track = tracker.track();
        if over {
            task.state = State::Over;
        }
        task.caught_up = true;
        Progress::Report(task.report(fraction(&track.area, size), track.scale, quality(track.quality)))
    }
}

impl Task {
    fn report(&self, area: ImageBox, scale: f64, quality: TrackQuality) -> TrackReport {
        TrackReport { id: self.start.id, frame: self.at.id, captured: self.at.captured, area, scale, quality }
    }
}

fn quality(quality: Quality) -> TrackQuality {
    match quality {
        Quality::Good => TrackQuality::Good,
        Quality::Coasting => TrackQuality::Coasting,
        Quality::TooSmall => TrackQuality::TooSmall,
        // Whatever else there may be one day is no place to fly to.
        _ => TrackQuality::Lost,
    }
}

/// A box in pixels of an image of this size.
fn pixels(area: &ImageBox, (width, height): (u32, u32)) -> PixelBox {
    let whole = PixelBox { left: area.left, top: area.top, right: area.right, bottom: area.bottom };
    whole.in_image_scaled(f64::from(width), f64::from(height))
}

/// A box as a fraction of an image of this size.
fn fraction(area: &PixelBox, (width, height): (u32, u32)) -> ImageBox {
    let PixelBox { left, top, right, bottom } = area.in_image_scaled(1.0 / f64::from(width), 1.0 / f64::from(height));
    ImageBox { left, top, right, bottom }
}

#[cfg(test)]
mod tests;

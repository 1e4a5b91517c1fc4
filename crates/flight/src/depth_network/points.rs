//! Follows points through the frames, for the scale by parallax.

use spf_core::camera::Camera;
use spf_core::frame::FrameMeta;
use spf_core::query::ImagePoint;
use spf_core::time::Time;
use spf_detect::triangulation::PointReport;
use spf_drone::frames::Photo;
use spf_media::Scaler;
use spf_media::points::Points;
use spf_media::track::TrackImage;

use crate::tracking::attitudes::Attitudes;
use crate::tracking::camera_of_images;

/// Points, and the frame that they were last followed into.
pub(super) struct PointFollower {
    /// The camera at the size of the images.
    camera: Camera,
    points: Points,
    at: Option<Time>,
    scaler: Scaler,
}

impl PointFollower {
    pub(super) fn new(camera: &Camera) -> Self {
        Self { camera: camera_of_images(camera), points: Points::default(), at: None, scaler: Scaler::default() }
    }

    /// Follows the points into a frame that is newer than those before.
    pub(super) fn follow(&mut self, meta: &FrameMeta, photo: &Photo, attitudes: &Attitudes) -> PointReport {
        let (width, height) = (self.camera.width, self.camera.height);
        let colours = photo.at((width, height), &mut self.scaler);
        let image = TrackImage::of(&colours);
        self.scaler.reuse(colours);
        let before = self.at.replace(meta.captured);
        let shift = |at| attitudes.shift(&self.camera, at, before?, meta.captured);
        // A pixel's place is that of its centre.
        let place = |x: f64, y: f64| ImagePoint { u: (x + 0.5) / f64::from(width), v: (y + 0.5) / f64::from(height) };
        let points = self.points.next(&image, shift).iter().map(|point| (point.id, place(point.x, point.y))).collect();
        PointReport { captured: meta.captured, points }
    }
}

//! Follows points through the frames that are kept.

use spf_core::camera::Camera;
use spf_core::points::{PointReport, TrackedPoint};
use spf_core::query::ImagePoint;
use spf_core::time::Time;
use spf_media::points::Points;

use super::attitudes::Attitudes;
use super::ring::Ring;

/// Points, and the frame that they were last followed into.
#[derive(Default)]
pub(super) struct PointFollower {
    points: Points,
    at: Option<Time>,
}

impl PointFollower {
    /// Follows the points into the newest frame; `None` if that was done.
    pub(super) fn step(&mut self, ring: &mut Ring, attitudes: &Attitudes, camera: &Camera) -> Option<PointReport> {
        let (meta, image) = ring.after(self.at.unwrap_or(Time::ZERO), usize::MAX)?;
        let before = self.at.replace(meta.captured);
        let shift = |at| attitudes.shift(camera, at, before?, meta.captured);
        let (width, height) = (f64::from(image.size().0), f64::from(image.size().1));
        let points = self.points.next(&image, shift).iter();
        // A pixel's place is that of its centre.
        let place = |x: f64, y: f64| ImagePoint { u: (x + 0.5) / width, v: (y + 0.5) / height };
        let points = points.filter_map(|point| TrackedPoint::new(point.id, place(point.x, point.y))).collect();
        Some(PointReport { frame: meta.id, captured: meta.captured, points })
    }
}

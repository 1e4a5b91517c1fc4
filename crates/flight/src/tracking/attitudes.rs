//! Which way the camera has turned between two frames, and what that does to the image.

use std::collections::VecDeque;

use spf_core::camera::Camera;
use spf_core::geometry::{Attitude, wrap_angle};
use spf_core::lift::seen_after_turn;
use spf_core::query::ImagePoint;
use spf_core::time::{Duration, Time};
use spf_media::track::Shift;

use super::KEPT;

/// How long before the first or after the last report an attitude still counts.
const STALE: Duration = Duration::from_millis(300);
/// Reports that are kept at most: those of [`KEPT`] and a second, at 100 Hz.
const MOST: usize = 900;

/// Attitudes of the last seconds, oldest first.
#[derive(Clone, Debug, Default)]
pub(crate) struct Attitudes(VecDeque<(Time, Attitude)>);

impl Attitudes {
    /// Adds what a telemetry report has measured; one that is not newer, or no number, is left out.
    pub(crate) fn add(&mut self, at: Time, attitude: Attitude) {
        let is_number = [attitude.heading, attitude.pitch, attitude.roll].iter().all(|angle| angle.is_finite());
        if !is_number || self.0.back().is_some_and(|(last, _)| *last >= at) {
            return;
        }
        self.0.push_back((at, attitude));
        let keep = KEPT + Duration::from_secs(1);
        while self.0.len() > MOST || self.0.front().is_some_and(|(first, _)| at.since(*first) > keep) {
            self.0.pop_front();
        }
    }

    /// The attitude at a time, interpolated between two reports.
    fn at(&self, at: Time) -> Option<Attitude> {
        let next = self.0.partition_point(|(time, _)| *time < at);
        let (before, after) = (next.checked_sub(1).and_then(|index| self.0.get(index)), self.0.get(next));
        match (before, after) {
            (Some((earlier, a)), Some((later, b))) => {
                let part = at.since(*earlier).as_secs_f64() / later.since(*earlier).as_secs_f64();
                Some(Attitude {
                    heading: wrap_angle(a.heading + wrap_angle(b.heading - a.heading) * part),
                    pitch: a.pitch + (b.pitch - a.pitch) * part,
                    roll: a.roll + (b.roll - a.roll) * part,
                })
            }
            (Some((time, only)), None) => (at.since(*time) <= STALE).then_some(*only),
            (None, Some((time, only))) => (time.since(at) <= STALE).then_some(*only),
            (None, None) => None,
        }
    }

    /// How far the turning of the camera from one time to another moves a place in its image, pixels. `None` if the attitude is
    /// not known, or the place leaves the half of space before the lens.
    pub(crate) fn shift(&self, camera: &Camera, (x, y): (f64, f64), from: Time, to: Time) -> Option<Shift> {
        let (before, after) = (self.at(from)?, self.at(to)?);
        let (width, height) = (f64::from(camera.width), f64::from(camera.height));
        let place = seen_after_turn(ImagePoint { u: x / width, v: y / height }, camera, before, after)?;
        Some(Shift { x: place.u * width - x, y: place.v * height - y })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn heading(degrees: f64) -> Attitude {
        Attitude { heading: degrees.to_radians(), ..Attitude::default() }
    }

    #[test]
    fn a_turn_moves_the_image_by_the_tangent_of_the_angle() {
        let camera = Camera::from_fov(480, 360, 90.0_f64.to_radians(), 73.7_f64.to_radians(), 0.0);
        let mut attitudes = Attitudes::default();
        attitudes.add(Time::from_millis(0), heading(175.0));
        attitudes.add(Time::from_millis(100), heading(-175.0));
        let shift = attitudes.shift(&camera, (240.0, 180.0), Time::ZERO, Time::from_millis(100)).unwrap();
        // 10° to the right, over north-south: 240 × tan 10° = 42.3 pixels to the left.
        assert!((shift.x + 42.3).abs() < 0.1 && shift.y.abs() < 1e-9, "{shift:?}");
        // Half of it after half of the time: 240 × tan 5° = 21.0.
        let half = attitudes.shift(&camera, (240.0, 180.0), Time::ZERO, Time::from_millis(50)).unwrap();
        assert!((half.x + 21.0).abs() < 0.1, "{half:?}");
    }

    #[test]
    fn a_nose_that_rises_moves_the_image_down_also_with_a_tilted_lens() {
        let camera = Camera::from_fov(480, 360, 90.0_f64.to_radians(), 73.7_f64.to_radians(), 0.1);
        let mut attitudes = Attitudes::default();
        attitudes.add(Time::from_millis(0), Attitude::default());
        attitudes.add(Time::from_millis(100), Attitude { pitch: 0.1, ..Attitude::default() });
        let shift = attitudes.shift(&camera, (240.0, 180.0), Time::ZERO, Time::from_millis(100)).unwrap();
        // 240.1 × tan 0.1 = 24.1.
        assert!(shift.x.abs() < 1e-9 && (shift.y - 24.1).abs() < 0.1, "{shift:?}");
    }

    #[test]
    fn without_reports_nothing_is_predicted() {
        let camera = Camera::quad();
        let mut attitudes = Attitudes::default();
        let shift = |attitudes: &Attitudes, to| attitudes.shift(&camera, (9.0, 9.0), Time::ZERO, Time::from_millis(to));
        assert_eq!(shift(&attitudes, 100), None);
        attitudes.add(Time::ZERO, heading(f64::NAN));
        assert_eq!(shift(&attitudes, 100), None);
        attitudes.add(Time::ZERO, heading(3.0));
        assert!(shift(&attitudes, 300).is_some() && shift(&attitudes, 301).is_none());
    }
}

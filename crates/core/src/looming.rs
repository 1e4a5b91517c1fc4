//! Looming: how far ahead the thing is that the craft flies at, from how fast points around the direction of flight move apart
//! (`docs/explanation/between-answers.md`).
//!
//! Whatever lies straight ahead has no parallax, so it cannot be triangulated ([`triangulation`](crate::triangulation)). But its image
//! grows: between two frames, b metres apart, the angle between two of its points grows by the factor s = (r + b)/r, with the distance
//! r that is left (Lee 1976, "A theory of visual control of braking based on information about time-to-collision"). Angles between
//! rays do not depend on where the camera has turned, so neither heading nor its errors count. A wall without a pattern is found by
//! what is at its edges: the window around the direction of flight widens until enough points tell the same.

use std::collections::{BTreeMap, VecDeque};

use glam::DVec3;

use crate::camera::Camera;
use crate::depth::CameraAxes;
use crate::geometry::{EnuPosition, Pose};
use crate::points::PointReport;
use crate::time::{Duration, Time};

/// Frames that are compared are at most this far apart, and after a longer gap the points are others.
const KEPT: Duration = Duration::from_millis(2500);
const GAP: Duration = Duration::from_secs(1);
/// The distances flown between two frames, metres. The newest frame is compared with the last one before each of them, and the surest
/// reading counts: the corners of near things soon leave the image, and far ones hardly grow over a short way.
const BASES: [f64; 4] = [0.2, 0.4, 0.8, 1.6];
/// Half the angle of the window about the direction of flight, radians: 8°, 14°, 20°.
const WINDOWS: [f64; 3] = [0.14, 0.24, 0.35];
/// Points that must have moved apart by as much as the reading says: the nearest thing counts, but not the corners that slide.
const AGREEING: usize = 3;
/// Angles between two points, radians: 2° and 14°. Less is no more than their errors, more is hardly one thing.
const PAIRS: core::ops::Range<f64> = 0.035..0.25;
/// Three pairs of a point agree if their growths differ by less than this part, more than the errors of one surface's.
const ALIKE: f64 = 0.07;
/// Standard deviation of the natural logarithm of s, and of the distance flown as a fraction of it. Fitted to flights
/// (`crates/render/tests/it/looming.rs`).
const SCALE_SD: f64 = 0.045;
const FLOWN_SD: f64 = 0.05;
/// The largest standard deviation of the logarithm of a distance that counts, and the largest distance, metres.
const SURE: f64 = 0.45;
const FARTHEST: f64 = 8.0;

/// Something that the craft flies at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ahead {
    /// Where the direction of flight meets it, according to the motion estimate.
    pub place: EnuPosition,
    /// Distance from the camera along the direction of flight, metres.
    pub range: f64,
    /// Standard deviation of the range's natural logarithm.
    pub log_sd: f64,
}

/// A frame: where it was taken, and the rays of its points, unit vectors: right, forward, up.
#[derive(Clone, Debug)]
struct View {
    at: Time,
    from: EnuPosition,
    rays: BTreeMap<u32, DVec3>,
}

/// Compares the newest frame with earlier ones. See the [module](self).
#[derive(Clone, Debug, Default)]
pub struct Looming {
    views: VecDeque<View>,
}

impl Looming {
    /// Forgets everything.
    pub fn clear(&mut self) {
        self.views.clear();
    }

    /// Takes the points of a frame that `camera` took at `pose`, and returns what the craft flies at; `None` if there is nothing near, or
    /// nothing to tell by. Frames that are not newer than the last one, and poses that are not numbers, are ignored.
    pub fn observe(&mut self, report: &PointReport, camera: &Camera, pose: Pose) -> Option<Ahead> {
        let (place, attitude) = (pose.position, pose.attitude);
        let numbers = [place.east, place.north, place.up, attitude.heading, attitude.pitch, attitude.roll];
        let last = self.views.back().map(|view| view.at);
        if last.is_some_and(|last| report.captured <= last) || !numbers.iter().all(|x| x.is_finite()) {
            return None;
        }
        if last.is_some_and(|last| report.captured.since(last) > GAP) {
            self.clear();
        }
        let ray = |ray: crate::camera::Ray| DVec3::new(ray.right, 1.0, ray.up).try_normalize();
        let rays = report.points.iter().filter_map(|point| Some((point.id(), ray(camera.ray(point.at()))?))).collect();
        let now = View { at: report.captured, from: place, rays };
        while self.views.front().is_some_and(|view| now.at.since(view.at) > KEPT) {
            self.views.pop_front();
        }
        let axes = CameraAxes::new(camera, pose);
        let before = |base: f64| self.views.iter().rev().find(|view| view.from.distance(now.from) >= base);
        let readings = BASES.iter().filter_map(|base| compare(before(*base)?, &now, &axes));
        let ahead = readings.min_by(|a, b| a.log_sd.total_cmp(&b.log_sd));
        self.views.push_back(now);
        ahead
    }
}

/// What two frames say of the thing ahead.
fn compare(before: &View, now: &View, axes: &CameraAxes) -> Option<Ahead> {
    let base = before.from.distance(now.from);
    // Straight on: as far ahead as it has come.
    let look = axes.look(before.from.towards(now.from, 2.0));
    let course = DVec3::new(look.right, look.forward, look.up).try_normalize().filter(|course| course.y > 0.0)?;
    let both = || now.rays.iter().filter_map(|(id, ray)| before.rays.get(id).map(|before| (*ray, *before)));
    let growth = WINDOWS.iter().find_map(|half| {
        let points: Vec<(DVec3, DVec3)> = both().filter(|(ray, _)| angle(*ray, course) < *half).collect();
        let mut growths: Vec<f64> = (0..points.len()).filter_map(|of| growth(&points, of)).collect();
        growths.sort_by(|a, b| b.total_cmp(a));
        growths.get(AGREEING - 1).copied()
    })?;
    let more = growth - 1.0;
    let log_sd = libm::hypot(SCALE_SD * growth / more, FLOWN_SD);
    let range = base / more;
    let is_sure = more > 0.0 && log_sd < SURE && range < FARTHEST;
    is_sure.then(|| Ahead { place: before.from.towards(now.from, 1.0 + range / base), range, log_sd })
}

fn angle(a: DVec3, b: DVec3) -> f64 {
    libm::atan2(a.cross(b).length(), a.dot(b))
}

/// The largest factor by which a point and three others have moved apart alike. Those of its own surface do; one far behind it moves
/// apart from it by any factor.
fn growth(points: &[(DVec3, DVec3)], of: usize) -> Option<f64> {
    let (now, before) = points[of];
    let others = points.iter().enumerate().filter(|(index, _)| *index != of).map(|(_, pair)| pair);
    let ratio = |(other, then): &(DVec3, DVec3)| {
        let (wide, narrow) = (angle(now, *other), angle(before, *then));
        (PAIRS.contains(&wide) && narrow > 0.5 * PAIRS.start).then(|| libm::tan(wide) / libm::tan(narrow))
    };
    let mut ratios: Vec<f64> = others.filter_map(ratio).collect();
    ratios.sort_by(|a, b| b.total_cmp(a));
    ratios.windows(3).find(|three| three[2] >= (1.0 - ALIKE) * three[0]).map(|three| three[1])
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::frame::FrameId;
    use crate::geometry::Attitude;
    use crate::points::TrackedPoint;

    fn pose(north: f64, heading: f64) -> Pose {
        Pose {
            position: EnuPosition { north, up: 1.5, ..EnuPosition::default() },
            attitude: Attitude { heading, ..Attitude::default() },
        }
    }

    /// What a camera sees of these places.
    fn report(number: u64, camera: &Camera, pose: Pose, places: &[[f64; 3]]) -> PointReport {
        let axes = CameraAxes::new(camera, pose);
        let seen = |(id, [east, north, up]): (usize, &[f64; 3])| {
            let at = axes.look(EnuPosition { east: *east, north: *north, up: *up });
            TrackedPoint::new(id as u32, camera.project(at.right, at.forward, at.up)?)
        };
        let points = places.iter().enumerate().filter_map(seen).collect();
        PointReport { frame: FrameId(number), captured: Time::ZERO + Duration::from_millis(100 * number), points }
    }

    /// A flight to the north at 1 m/s, whose nose swings; the telemetry is off by 3°. What was said last, and how often anything was.
    fn flown(places: &[[f64; 3]], to: u64) -> (Option<Ahead>, u32) {
        let camera = Camera::quad();
        let (mut looming, mut last, mut count) = (Looming::default(), None, 0);
        for number in 0..to {
            let heading = 0.1 * libm::sin(0.3 * number as f64);
            let north = 0.1 * number as f64;
            let report = report(number, &camera, pose(north, heading), places);
            last = looming.observe(&report, &camera, pose(north, heading + 0.05));
            count += u32::from(last.is_some());
        }
        (last, count)
    }

    fn wall(north: f64) -> Vec<[f64; 3]> {
        (0..30).map(|n| [0.35 * f64::from(n % 6) - 0.9, north, 1.0 + 0.25 * f64::from(n / 6)]).collect()
    }

    #[test]
    fn a_wall_ahead_is_as_far_as_its_growth_says() {
        let (ahead, _) = flown(&wall(6.0), 30);
        let ahead = ahead.unwrap();
        assert!((ahead.range / 3.1).ln().abs() < 2.0 * ahead.log_sd && ahead.log_sd < 0.2, "{ahead:?}");
        assert!((ahead.place.north - 6.0).abs() < 0.4 && ahead.place.east.abs() < 0.4, "{ahead:?}");
    }

    #[test]
    fn a_plain_wall_is_found_by_what_is_around_it() {
        // Corners only at its edges, beyond the narrow window.
        let frame: Vec<[f64; 3]> =
            wall(4.0).into_iter().filter(|[east, _, up]| east.abs() > 0.5 || (up - 1.5).abs() > 0.4).collect();
        let (ahead, _) = flown(&frame, 20);
        assert!((ahead.unwrap().place.north - 4.0).abs() < 0.4, "{ahead:?}");
    }

    #[test]
    fn what_is_near_before_a_far_wall_counts() {
        let post = (0..16).map(|n| [0.12 * f64::from(n % 2), 5.0, 1.0 + 0.12 * f64::from(n / 2)]);
        let all: Vec<[f64; 3]> =
            wall(30.0).into_iter().map(|[east, north, up]| [6.0 * east, north, 6.0 * up - 7.5]).chain(post).collect();
        let (ahead, _) = flown(&all, 30);
        assert!((ahead.unwrap().place.north - 5.0).abs() < 0.4, "{ahead:?}");
    }

    #[test]
    fn far_walls_and_craft_that_hover_say_nothing() {
        assert_eq!(flown(&wall(40.0), 40).1, 0);
        let camera = Camera::quad();
        let mut looming = Looming::default();
        for number in 0..40 {
            let pose = pose(0.0, 0.02 * number as f64);
            assert_eq!(looming.observe(&report(number, &camera, pose, &wall(3.0)), &camera, pose), None);
        }
    }

    proptest! {
        /// Whatever is reported, a reading is a place ahead at a positive, finite distance, and no more frames are kept than there are
        /// in the time.
        #[test]
        fn any_reports_are_survived(
            frames in prop::collection::vec(
                (0..4000_u64, prop::collection::vec((0..9_u32, any::<u16>(), any::<u16>()), 0..12),
                 prop_oneof![8 => -3.0..3.0_f64, 1 => Just(f64::NAN), 1 => Just(1e300)], -4.0..4.0_f64),
                0..40,
            )
        ) {
            let camera = Camera::tello();
            let mut looming = Looming::default();
            let mut at = Time::ZERO;
            for (number, (step, points, north, heading)) in frames.into_iter().enumerate() {
                at += Duration::from_millis(step / 10);
                let points = points.into_iter().map(|(id, u, v)| TrackedPoint(id, u, v)).collect();
                let report = PointReport { frame: FrameId(number as u64), captured: at, points };
                if let Some(ahead) = looming.observe(&report, &camera, pose(north, heading)) {
                    prop_assert!(ahead.range > 0.0 && ahead.range < FARTHEST && ahead.log_sd.is_finite());
                    prop_assert!([ahead.place.east, ahead.place.north, ahead.place.up].iter().all(|x| x.is_finite()));
                }
            }
            prop_assert!(looming.views.len() <= 40);
        }
    }
}

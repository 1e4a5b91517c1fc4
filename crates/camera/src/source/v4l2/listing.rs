//! The modes that a camera lists.

use rscam::{IntervalInfo, ResolutionInfo};

use super::{early_failure, not_a_camera};
use crate::address::LocalCamera;
use crate::failure::SourceError;
use crate::modes::Mode;

/// Sizes that are tried of a camera which can have any within limits.
const SIZES: [(u32, u32); 5] = [(1920, 1080), (1280, 720), (800, 600), (640, 480), (320, 240)];
/// Intervals that are tried of a camera which does not list any, or which can have any within limits.
const INTERVALS: [(u32, u32); 5] = [(1, 30), (1, 25), (1, 15), (1, 10), (1, 5)];
/// The modes that a camera lists. The library asks a driver that always has another one without end.
pub(super) fn modes(camera: &rscam::Camera, wanted: &LocalCamera) -> Result<Vec<Mode>, SourceError> {
    let mut modes = Vec::new();
    // A kernel driver lists some formats, each with some sizes and intervals.
    for info in camera.formats().take(64) {
        let code = info.map_err(|error| early_failure(wanted, &error))?.format;
        for size in sizes(camera, code, wanted.size).into_iter().take(256) {
            let listed = intervals(camera.intervals(&code, size).ok(), wanted.rate);
            modes.extend(listed.into_iter().take(64).map(|interval| Mode { code, size, interval }));
        }
    }
    // The second device of a webcam, which tells about its images, lists none.
    if modes.is_empty() { Err(not_a_camera(wanted)) } else { Ok(modes) }
}

fn sizes(camera: &rscam::Camera, code: [u8; 4], wanted: Option<(u32, u32)>) -> Vec<(u32, u32)> {
    let mut sizes = match camera.resolutions(&code) {
        Ok(ResolutionInfo::Discretes(sizes)) => sizes,
        Ok(ResolutionInfo::Stepwise { min, max, step }) => {
            let on = |value: u32, min: u32, max: u32, step: u32| {
                (min..=max).contains(&value) && (value - min).is_multiple_of(step.max(1))
            };
            let tried = wanted.into_iter().chain(SIZES).chain([max]);
            tried.filter(|(w, h)| on(*w, min.0, max.0, step.0) && on(*h, min.1, max.1, step.1)).collect()
        }
        Err(_) => Vec::new(),
    };
    sizes.retain(|(width, height)| *width > 0 && *height > 0);
    sizes
}

/// The intervals that a camera lists, the usual ones if it lists none, and those that lie nearest to the usual ones if it can have any
/// within limits.
fn intervals(listed: Option<IntervalInfo>, rate: Option<u32>) -> Vec<(u32, u32)> {
    let tried = || rate.map(|rate| (1, rate)).into_iter().chain(INTERVALS);
    let mut intervals: Vec<(u32, u32)> = match listed {
        Some(IntervalInfo::Discretes(listed)) if listed.iter().any(is_valid) => listed,
        Some(IntervalInfo::Stepwise { min, max, .. }) if is_valid(&min) && is_valid(&max) => tried()
            .map(|interval| {
                if less(interval, min) {
                    min
                } else if less(max, interval) {
                    max
                } else {
                    interval
                }
            })
            .collect(),
        _ => tried().collect(),
    };
    intervals.retain(is_valid);
    intervals.dedup();
    intervals
}

/// The library multiplies the numbers of an interval with those of another one, in 32 bits.
fn is_valid(interval: &(u32, u32)) -> bool {
    interval.0 > 0 && interval.1 > 0 && interval.0.checked_mul(interval.1).is_some()
}

fn less(a: (u32, u32), b: (u32, u32)) -> bool {
    u64::from(a.0) * u64::from(b.1) < u64::from(b.0) * u64::from(a.1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intervals_lie_within_the_limits_of_the_camera() {
        let any = |min, max| Some(IntervalInfo::Stepwise { min, max, step: (1, 1) });
        assert_eq!(intervals(any((1, 20), (1, 8)), None), [(1, 20), (1, 15), (1, 10), (1, 8)]);
        assert_eq!(intervals(any((1, 60), (1, 1)), Some(50))[..2], [(1, 50), (1, 30)]);
        // Limits that are none.
        assert_eq!(intervals(any((0, 0), (0, 0)), None), INTERVALS);
        assert_eq!(intervals(Some(IntervalInfo::Discretes(vec![(0, 0)])), None), INTERVALS);
        assert_eq!(intervals(Some(IntervalInfo::Discretes(vec![(1, 30), (0, 1), (1_000_000, 30_000_000)])), None), [(1, 30)]);
        assert_eq!(intervals(None, None), INTERVALS);
    }
}

//! Range of a target that stands still, from how much its track has grown over the metres flown.

use super::RangeReading;
use super::estimate::direction;
use crate::geometry::{EnuDirection, EnuPosition};

/// Growth from which a range is read: before, the error of the scale is most of it.
const GROWN: f64 = 1.2;
/// Standard deviation of the natural logarithm of a track's scale between two frames, fitted to 388 ranges of 89 flights
/// (`crates/bench/tests/all/track_range.rs`).
const SCALE_SD: f64 = 0.05;
/// Standard deviation of the distance flown, as a fraction of it.
const FLOWN_SD: f64 = 0.05;

/// What a track's scale is compared with.
#[derive(Clone, Copy, Debug)]
pub struct Growth {
    from: EnuPosition,
    scale: f64,
}

impl Growth {
    /// A track that has this scale in a frame taken at `from`.
    #[must_use]
    pub const fn new(from: EnuPosition, scale: f64) -> Self {
        Self { from, scale }
    }

    /// The range from `from`, where the target is in this direction at this scale; `None` until it has grown by a fifth since the
    /// last one. Each reading is compared with the one before, so that their errors are nearly independent.
    ///
    /// With the displacement b since then, the unit vector u towards the target and the growth g, the range r fulfils
    /// |b + r·u| = g·r.
    pub fn reading(&mut self, from: EnuPosition, towards: EnuDirection, scale: f64) -> Option<RangeReading> {
        let growth = scale / self.scale;
        if !(growth.is_finite() && growth >= GROWN) {
            return None;
        }
        let before = core::mem::replace(self, Self::new(from, scale));
        let b = from.vector() - before.from.vector();
        let along = b.dot(direction(towards));
        // One that has grown though the craft has not come nearer does not stand still.
        if along <= 0.0 {
            return None;
        }
        let more = growth * growth - 1.0;
        let range = (along + libm::sqrt(along * along + more * b.length_squared())) / more;
        let sigma = libm::hypot(SCALE_SD * growth / (growth - 1.0), FLOWN_SD);
        (range > 0.0).then(|| RangeReading { ln_range: libm::log(range), sigma })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(north: f64, east: f64) -> EnuPosition {
        EnuPosition { north, east, ..EnuPosition::default() }
    }

    fn towards(from: EnuPosition, target: EnuPosition) -> (EnuDirection, f64) {
        let ahead = EnuPosition { east: target.east - from.east, north: target.north - from.north, up: target.up - from.up };
        (EnuDirection::towards(ahead), from.distance(target))
    }

    #[test]
    fn the_growth_over_the_metres_flown_is_the_range() {
        let target = EnuPosition { north: 20.0, east: 3.0, up: 2.0 };
        let (_, first) = towards(at(0.0, 0.0), target);
        let mut growth = Growth::new(at(0.0, 0.0), 1.0);
        // Straight at it, aside, and again: each compared with the one before.
        for (north, east, is_read) in [(2.0, 0.0, false), (6.0, 1.0, true), (8.0, 0.5, false), (11.0, -2.0, true)] {
            let here = at(north, east);
            let (direction, range) = towards(here, target);
            let reading = growth.reading(here, direction, first / range);
            assert_eq!(reading.is_some(), is_read, "{north}");
            if let Some(RangeReading { ln_range, sigma }) = reading {
                assert!((libm::exp(ln_range) - range).abs() < 1e-9, "{north}: {}", libm::exp(ln_range));
                assert!((0.1..0.31).contains(&sigma), "{sigma}");
            }
        }
    }

    #[test]
    fn who_comes_nearer_himself_has_no_range() {
        let (direction, _) = towards(at(0.0, 0.0), at(10.0, 0.0));
        let mut growth = Growth::new(at(0.0, 0.0), 1.0);
        assert_eq!(growth.reading(at(-0.1, 0.0), direction, 1.3), None);
        assert_eq!(growth.reading(at(0.0, 0.0), direction, f64::NAN), None);
    }
}

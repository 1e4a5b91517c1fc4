//! The headings that a search has observed.

use core::f64::consts::TAU;

use libm::{floor, remainder, round};

/// Resolution: one bin per degree.
const BINS: usize = 360;

/// Headings covered by looks, to one degree.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Coverage {
    bins: [bool; BINS],
    /// Half of the angle that a look covers, radians.
    half: f64,
}

impl Coverage {
    /// Nothing covered yet; each look covers `angle`, radians, about its heading.
    pub(super) fn new(angle: f64) -> Self {
        Self { bins: [false; BINS], half: 0.5 * angle }
    }

    /// Marks the headings around a look at `heading`, radians, as covered.
    pub(super) fn look(&mut self, heading: f64) {
        let width = floor(2.0 * self.half.to_degrees()).clamp(1.0, BINS as f64) as usize;
        let first = bin(heading - self.half);
        (0..width).for_each(|n| self.bins[(first + n) % BINS] = true);
    }

    /// Whether this heading is covered.
    pub(super) fn contains(&self, heading: f64) -> bool {
        self.bins[bin(heading)]
    }

    /// Whether every heading is covered.
    pub(super) fn is_full(&self) -> bool {
        self.bins.iter().all(|covered| *covered)
    }

    /// The turn from `heading`, radians, clockwise positive, to the nearest look that covers something new: just inside the
    /// nearest gap. Zero if there is no gap.
    pub(super) fn towards_gap(&self, heading: f64) -> f64 {
        let here = bin(heading);
        let open = |offset: usize, sign: usize| !self.bins[(here + sign * offset) % BINS];
        // Counter-clockwise is clockwise by almost a full turn.
        (0..BINS)
            .find_map(|offset| {
                // A degree inside, so that rounding leaves no gap of one bin.
                let angle = (offset as f64 - 1.0).to_radians() + self.half;
                if open(offset, 1) {
                    Some(angle)
                } else if open(offset, BINS - 1) {
                    Some(-angle)
                } else {
                    None
                }
            })
            .map_or(0.0, |angle| remainder(angle, TAU))
    }
}

fn bin(heading: f64) -> usize {
    let degrees = round(heading.to_degrees());
    // A heading that is not a number covers what a heading of zero does.
    if degrees.is_finite() { libm::fmod(libm::fmod(degrees, 360.0) + 360.0, 360.0) as usize % BINS } else { 0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn after(headings: &[f64]) -> Coverage {
        let mut coverage = Coverage::new(81.0_f64.to_radians());
        headings.iter().for_each(|heading| coverage.look(heading.to_radians()));
        coverage
    }

    #[test]
    fn five_looks_of_a_ninety_degree_camera_cover_the_circle() {
        assert!(!after(&[72.0, 144.0, 216.0, 288.0]).is_full());
        assert!(after(&[72.0, 144.0, 216.0, 288.0, 360.0]).is_full());
        assert!(after(&[-72.0, -144.0, -216.0, -288.0, -360.0]).is_full());
        // Turns miss by a few degrees.
        assert!(after(&[70.0, 145.0, 214.0, 290.0, 363.0]).is_full());
    }

    #[test]
    fn the_same_heading_twice_covers_nothing_new() {
        let (once, twice) = (after(&[180.0, 0.0]), after(&[180.0, 0.0, 180.0, 0.0]));
        assert_eq!(once, twice);
        assert!(!twice.is_full() && twice.contains(0.6) && !twice.contains(90.0_f64.to_radians()));
    }

    #[test]
    fn gaps_are_filled_from_any_heading_even_one_that_does_not_change() {
        for degrees in 0..360 {
            let (mut coverage, heading) = (after(&[f64::from(degrees)]), 0.3 * f64::from(degrees));
            let looks = (0..).take_while(|_| {
                let turn = coverage.towards_gap(heading);
                coverage.look(heading + turn);
                !coverage.is_full()
            });
            assert!(looks.take(20).count() < 10, "{degrees}");
        }
    }

    #[test]
    fn the_nearest_gap_is_turned_to() {
        let coverage = after(&[0.0, 72.0]);
        let turn = coverage.towards_gap(0.0);
        assert!(turn < 0.0 && !coverage.contains(turn), "{}", turn.to_degrees());
        assert_eq!(after(&[0.0, 72.0, 144.0, 216.0, 288.0]).towards_gap(1.0), 0.0);
        assert!(after(&[f64::NAN, f64::INFINITY, 1e300]).contains(0.0));
    }
}

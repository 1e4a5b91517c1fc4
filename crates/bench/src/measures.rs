//! The measures by which papers on vision-and-language navigation compare flights: success rate (SR), oracle success rate
//! (OSR), navigation error (NE), success weighted by path length (SPL: Anderson et al. 2018, arXiv 1807.06757), normalised
//! dynamic time warping and the same weighted by success (nDTW, SDTW: Ilharco et al. 2019, arXiv 1907.05446), and the
//! collision rate. AerialVLN (Liu et al. 2023, arXiv 2308.06735) reports SR, OSR, NE and SDTW.
//!
//! World ENU, metres. Paths are polylines; both sides of a comparison are resampled to points [`SPACING`] apart, since
//! nDTW depends on the number of points, and a flight is sampled by time.

use spf_core::geometry::EnuPosition;

use crate::stats::Rate;

/// Point spacing of resampled paths, metres.
pub const SPACING: f64 = 1.0;

/// What a flight is measured against.
#[derive(Clone, Debug, PartialEq)]
pub struct Course {
    /// The path to be flown, from the start.
    pub reference: Vec<EnuPosition>,
    /// Length of the shortest path to success, metres. Here always of straight lines: a lower bound, since obstacles are
    /// ignored.
    pub shortest_m: f64,
    /// Success radius, metres: also the distance by which nDTW is normalised.
    pub radius_m: f64,
}

/// The measures of one flight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Navigation {
    /// SR: the flight succeeded.
    pub success: bool,
    /// OSR: it was at some instant within the success radius of the goal.
    pub oracle_success: bool,
    /// NE: distance to the goal at the end, metres; `None` if it was not flown.
    pub error_m: Option<f64>,
    /// SPL: shortest path length over the greater of it and the flown length, 0 without success.
    pub spl: f64,
    /// nDTW: similarity of the flown path to the reference, 0 to 1.
    pub ndtw: f64,
    /// SDTW: nDTW, 0 without success.
    pub sdtw: f64,
    /// It touched something.
    pub collided: bool,
}

/// Distance to the goal during a flight, metres; `None` where nothing was flown.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GoalDistance {
    /// The smallest.
    pub least_m: Option<f64>,
    /// That at the end.
    pub final_m: Option<f64>,
}

impl Course {
    /// Measures a flight along `flown`, sampled densely enough that it is straight between its positions.
    #[must_use]
    pub fn measure(&self, flown: &[EnuPosition], distance: GoalDistance, success: bool, collided: bool) -> Navigation {
        let ndtw = ndtw(&self.reference, flown, self.radius_m);
        let earned = |value: f64| if success { value } else { 0.0 };
        Navigation {
            success,
            oracle_success: distance.least_m.is_some_and(|least| least <= self.radius_m),
            error_m: distance.final_m,
            spl: earned(spl(self.shortest_m, length(flown))),
            ndtw,
            sdtw: earned(ndtw),
            collided,
        }
    }
}

/// The measures of several flights.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Means {
    /// SR.
    pub success: Rate,
    /// OSR.
    pub oracle_success: Rate,
    /// CR: flights with a collision.
    pub collided: Rate,
    /// Mean NE of the flights that have one, metres; `None` without any.
    pub error_m: Option<f64>,
    /// Mean SPL; `None` without flights.
    pub spl: Option<f64>,
    /// Mean nDTW; `None` without flights.
    pub ndtw: Option<f64>,
    /// Mean SDTW; `None` without flights.
    pub sdtw: Option<f64>,
}

impl Means {
    /// The means over some flights.
    #[must_use]
    pub fn of(flights: &[Navigation]) -> Self {
        let rate = |hit: fn(&Navigation) -> bool| flights.iter().map(hit).collect();
        let mean = |value: fn(&Navigation) -> f64| mean(flights.iter().map(value));
        Self {
            success: rate(|flight| flight.success),
            oracle_success: rate(|flight| flight.oracle_success),
            collided: rate(|flight| flight.collided),
            error_m: self::mean(flights.iter().filter_map(|flight| flight.error_m)),
            spl: mean(|flight| flight.spl),
            ndtw: mean(|flight| flight.ndtw),
            sdtw: mean(|flight| flight.sdtw),
        }
    }
}

fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, count) = values.fold((0.0, 0_u32), |(sum, count), value| (sum + value, count + 1));
    (count > 0).then(|| sum / f64::from(count))
}

/// Length of a polyline, metres.
#[must_use]
pub fn length(path: &[EnuPosition]) -> f64 {
    path.windows(2).map(|pair| pair[0].distance(pair[1])).sum()
}

/// Minimum path length: past the corners, up to `radius` before the last, metres.
pub(crate) fn shortest(path: &[EnuPosition], radius: f64) -> f64 {
    (length(path) - radius).max(0.0)
}

/// `shortest / max(flown, shortest)`, metres both; 1 if there is no distance to fly.
fn spl(shortest: f64, flown: f64) -> f64 {
    let longer = shortest.max(flown);
    if longer > 0.0 { shortest / longer } else { 1.0 }
}

/// Points along a path, at most [`SPACING`] apart, evenly between its corners.
pub(crate) fn spread(path: &[EnuPosition]) -> Vec<EnuPosition> {
    let mut points: Vec<EnuPosition> = path.first().copied().into_iter().collect();
    for pair in path.windows(2) {
        let (from, to) = (pair[0], pair[1]);
        let steps = libm::ceil(from.distance(to) / SPACING).max(1.0);
        for i in 1..=steps as usize {
            let fraction = i as f64 / steps;
            let mix = |a: f64, b: f64| a + (b - a) * fraction;
            points.push(EnuPosition { east: mix(from.east, to.east), north: mix(from.north, to.north), up: mix(from.up, to.up) });
        }
    }
    points
}

/// Points of a time-sampled path, at least [`SPACING`] apart along the path, with the first and the last: otherwise
/// hovering would count for every sample.
fn thinned(path: &[EnuPosition]) -> Vec<EnuPosition> {
    let mut kept: Vec<EnuPosition> = path.first().copied().into_iter().collect();
    let mut since = 0.0;
    for (i, pair) in path.windows(2).enumerate() {
        since += pair[0].distance(pair[1]);
        if since >= SPACING || (i + 2 == path.len() && since > 0.0) {
            kept.push(pair[1]);
            since = 0.0;
        }
    }
    kept
}

/// Normalised dynamic time warping of a flown path to a reference, 0..=1: `exp(−DTW / (N·radius))`, with N points in
/// the reference; 0 if either has none.
fn ndtw(reference: &[EnuPosition], flown: &[EnuPosition], radius: f64) -> f64 {
    let (reference, flown) = (spread(reference), thinned(flown));
    let (Some(_), Some(_)) = (reference.first(), flown.first()) else { return 0.0 };
    libm::exp(-dtw(&reference, &flown) / (reference.len() as f64 * radius))
}

/// Dynamic time warping distance, metres: the least sum of distances of pairs that go on in either path or in both.
fn dtw(reference: &[EnuPosition], flown: &[EnuPosition]) -> f64 {
    let mut row = vec![f64::INFINITY; flown.len() + 1];
    row[0] = 0.0;
    for point in reference {
        // `diagonal` is the row above, one to the left.
        let mut diagonal = core::mem::replace(&mut row[0], f64::INFINITY);
        for (i, place) in flown.iter().enumerate() {
            let above = row[i + 1];
            row[i + 1] = point.distance(*place) + above.min(row[i]).min(diagonal);
            diagonal = above;
        }
    }
    row[flown.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn path(norths: &[f64]) -> Vec<EnuPosition> {
        norths.iter().map(|&north| EnuPosition { north, ..EnuPosition::default() }).collect()
    }

    #[test]
    fn a_path_like_its_reference_scores_one_and_a_far_one_nothing() {
        let reference = path(&[0.0, 4.0]);
        assert_eq!(ndtw(&reference, &path(&[0.0, 1.0, 2.0, 3.0, 4.0]), 1.0), 1.0);
        // Five reference points, each one metre off the path.
        let aside: Vec<EnuPosition> = spread(&reference).iter().map(|p| EnuPosition { east: 1.0, ..*p }).collect();
        assert!((ndtw(&reference, &aside, 1.0) - libm::exp(-1.0)).abs() < 1e-12);
        assert_eq!(ndtw(&reference, &[], 1.0), 0.0);
    }

    #[test]
    fn warping_is_the_cheapest_way_through_the_table() {
        // Distances of reference 0, 1, 2 (rows) to flown 0, 2, 2 (columns), summed along the cheapest way:
        //   0 2 2     0 2 4
        //   1 1 1  →  1 1 2
        //   2 0 0     3 1 1
        assert_eq!(dtw(&path(&[0.0, 1.0, 2.0]), &path(&[0.0, 2.0, 2.0])), 1.0);
        // One flown point is compared with every reference point: 0 + 1 + 2.
        assert_eq!(dtw(&path(&[0.0, 1.0, 2.0]), &path(&[0.0])), 3.0);
    }

    #[test]
    fn a_path_flown_slowly_with_rests_is_the_same_path() {
        let reference = path(&[0.0, 4.0]);
        // Steps of 5 cm, then a hundred samples of hovering.
        let slow: Vec<f64> = (0..=80).map(|i| f64::from(i) * 0.05).chain([4.0; 100]).collect();
        assert!(ndtw(&reference, &path(&slow), 1.0) > 0.9, "{}", ndtw(&reference, &path(&slow), 1.0));
    }

    #[test]
    fn the_shortest_path_ends_at_the_radius() {
        assert_eq!(shortest(&path(&[0.0, 10.0, 4.0]), 5.0), 11.0);
        assert_eq!(shortest(&path(&[0.0, 3.0]), 5.0), 0.0);
        assert_eq!((spl(10.0, 20.0), spl(10.0, 5.0), spl(0.0, 0.0)), (0.5, 1.0, 1.0));
    }

    /// A flight 4 m north along its reference and 2 m back: the goal at 4 m was passed, the end is 2 m away.
    fn overshot(success: bool) -> Navigation {
        let course = Course { reference: path(&[0.0, 4.0]), shortest_m: 4.0, radius_m: 2.0 };
        let flown = path(&[0.0, 1.0, 2.0, 3.0, 4.0, 3.0, 2.0]);
        course.measure(&flown, GoalDistance { least_m: Some(0.0), final_m: Some(2.0) }, success, false)
    }

    #[test]
    fn a_flight_is_measured_as_by_hand() {
        let measured = overshot(true);
        assert_eq!((measured.success, measured.oracle_success, measured.error_m), (true, true, Some(2.0)));
        // 4 m shortest, 4 + 2 = 6 m flown.
        assert!((measured.spl - 4.0 / 6.0).abs() < 1e-12);
        // Five reference points 0 to 4 lie on the way there; the points 3 and 2 of the way back warp to the last, 4: DTW = 1 + 2.
        let by_hand = libm::exp(-3.0 / (5.0 * 2.0));
        assert!((measured.ndtw - by_hand).abs() < 1e-12 && measured.sdtw == measured.ndtw, "{measured:?}");
        // Without success the weighted measures are 0, the others as before.
        let failed = overshot(false);
        assert_eq!((failed.spl, failed.sdtw, failed.oracle_success), (0.0, 0.0, true));
        assert_eq!(failed.ndtw, measured.ndtw);
    }

    #[test]
    fn oracle_success_counts_up_to_the_radius() {
        let course = Course { reference: path(&[0.0, 4.0]), shortest_m: 4.0, radius_m: 2.0 };
        let at = |least_m| course.measure(&[], GoalDistance { least_m, final_m: None }, false, false).oracle_success;
        assert_eq!([Some(2.0), Some(2.01), None].map(at), [true, false, false]);
    }

    #[test]
    fn means_are_those_of_the_flights() {
        let unflown =
            Navigation { success: false, oracle_success: false, error_m: None, spl: 0.0, ndtw: 0.0, sdtw: 0.0, collided: false };
        let hit = Navigation { collided: true, error_m: Some(5.0), oracle_success: true, ..unflown };
        let means = Means::of(&[overshot(true), hit, unflown]);
        assert_eq!((means.success, means.oracle_success), (Rate { hits: 1, of: 3 }, Rate { hits: 2, of: 3 }));
        assert_eq!(means.collided, Rate { hits: 1, of: 3 });
        // (2 + 5) / 2: what was not flown has no error. SPL is (4/6 + 0 + 0) / 3.
        assert_eq!(means.error_m, Some(3.5));
        assert!((means.spl.unwrap() - 4.0 / 18.0).abs() < 1e-12);
        assert_eq!((Means::of(&[]).spl, Means::of(&[]).error_m), (None, None));
    }
}

//! Path measures: SPL (Anderson et al. 2018, arXiv 1807.06757), nDTW (Ilharco et al. 2019, arXiv 1907.05446).

use spf_core::geometry::EnuPosition;

/// Point spacing of a reference path, metres.
const SPACING: f64 = 1.0;

/// Length of a polyline, metres.
pub(super) fn length(path: &[EnuPosition]) -> f64 {
    path.windows(2).map(|pair| pair[0].distance(pair[1])).sum()
}

/// Minimum path length: past the corners, up to `radius` before the last, metres.
pub(super) fn shortest(path: &[EnuPosition], radius: f64) -> f64 {
    (length(path) - radius).max(0.0)
}

/// Success weighted by path length: `shortest / max(flown, shortest)`; 1 if there is no distance to fly.
pub(super) fn spl(shortest: f64, flown: f64) -> f64 {
    let longer = shortest.max(flown);
    if longer > 0.0 { shortest / longer } else { 1.0 }
}

/// Points along a path, [`SPACING`] apart.
fn spread(path: &[EnuPosition]) -> Vec<EnuPosition> {
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
/// the reference.
pub(super) fn ndtw(reference: &[EnuPosition], flown: &[EnuPosition], radius: f64) -> f64 {
    let (reference, flown) = (spread(reference), thinned(flown));
    let (Some(_), Some(_)) = (reference.first(), flown.first()) else { return 0.0 };
    let mut row = vec![f64::INFINITY; flown.len() + 1];
    row[0] = 0.0;
    for point in &reference {
        // `diagonal` is the row above, one to the left.
        let mut diagonal = core::mem::replace(&mut row[0], f64::INFINITY);
        for (i, place) in flown.iter().enumerate() {
            let above = row[i + 1];
            row[i + 1] = point.distance(*place) + above.min(row[i]).min(diagonal);
            diagonal = above;
        }
    }
    libm::exp(-row[flown.len()] / (reference.len() as f64 * radius))
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
}

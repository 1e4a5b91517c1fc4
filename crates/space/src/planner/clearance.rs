//! Squared distances to the nearest obstacle, exact up to a limit, one axis after the other (Felzenszwalb and Huttenlocher's
//! decomposition).

use crate::obstacle_map::{CELLS, SIZE};

/// Obstacles farther away than this along an axis have no effect, cells: 1.75 m.
const REACH: usize = 7;
/// Squared distance assigned to everything farther away.
const FAR: u8 = 255;

/// Squared distances in cells; vertical ones are weighted.
#[derive(Clone, Debug, Default)]
pub(super) struct Clearance {
    squared: Vec<u8>,
    scratch: Vec<u8>,
}

/// Weight of a squared vertical distance for a body that needs `around` metres horizontally and `above` metres vertically.
pub(super) fn weight(around: f64, above: f64) -> u8 {
    let ratio = around / above.max(0.05);
    libm::round(ratio * ratio).clamp(1.0, 5.0) as u8
}

impl Clearance {
    /// Squared distance of each cell, east fastest; 255 for 16 cells and more.
    pub(super) fn squared(&self) -> &[u8] {
        &self.squared
    }

    pub(super) fn measure(&mut self, occupied: &[bool], vertical: u8) {
        let [width, depth, height] = SIZE;
        self.squared.clear();
        self.squared.resize(CELLS, FAR);
        self.scratch.clear();
        self.scratch.resize(CELLS, FAR);
        for (row, out) in occupied.chunks_exact(width).zip(self.scratch.chunks_exact_mut(width)) {
            along(row, out);
        }
        // Along north, then up: each row is the minimum of its neighbours' rows, each increased by the square of its
        // offset.
        for z in 0..height {
            let layer = z * depth * width..(z + 1) * depth * width;
            let (from, to) = (&self.scratch[layer.clone()], &mut self.squared[layer]);
            for y in 0..depth {
                let out = &mut to[y * width..(y + 1) * width];
                for other in y.saturating_sub(REACH)..(y + REACH + 1).min(depth) {
                    lower(out, &from[other * width..(other + 1) * width], square(y.abs_diff(other), 1));
                }
            }
        }
        core::mem::swap(&mut self.squared, &mut self.scratch);
        self.squared.fill(FAR);
        let layer = depth * width;
        for z in 0..height {
            for other in z.saturating_sub(REACH)..(z + REACH + 1).min(height) {
                let add = square(z.abs_diff(other), vertical);
                lower(&mut self.squared[z * layer..(z + 1) * layer], &self.scratch[other * layer..(other + 1) * layer], add);
            }
        }
    }
}

fn square(offset: usize, weight: u8) -> u8 {
    u8::try_from(offset * offset * usize::from(weight)).unwrap_or(FAR)
}

fn lower(out: &mut [u8], from: &[u8], add: u8) {
    for (out, &from) in out.iter_mut().zip(from) {
        *out = (*out).min(from.saturating_add(add));
    }
}

/// Squared distances within a row.
fn along(row: &[bool], out: &mut [u8]) {
    let mut since = REACH + 1;
    for (out, &occupied) in out.iter_mut().zip(row) {
        since = if occupied { 0 } else { (since + 1).min(REACH + 1) };
        *out = if since <= REACH { square(since, 1) } else { FAR };
    }
    since = REACH + 1;
    for (out, &occupied) in out.iter_mut().zip(row).rev() {
        since = if occupied { 0 } else { (since + 1).min(REACH + 1) };
        if since <= REACH {
            *out = (*out).min(square(since, 1));
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn distances_are_those_to_the_nearest_obstacle(
            solids in prop::collection::vec((0..SIZE[0], 0..SIZE[1], 0..SIZE[2]), 1..20),
            probes in prop::collection::vec((0..SIZE[0], 0..SIZE[1], 0..SIZE[2]), 50),
            weight in 1..3_u8,
        ) {
            let index = |(x, y, z): (usize, usize, usize)| (z * SIZE[1] + y) * SIZE[0] + x;
            let mut occupied = vec![false; CELLS];
            solids.iter().for_each(|&at| occupied[index(at)] = true);
            let mut clearance = Clearance::default();
            clearance.measure(&occupied, weight);
            // Positions near the obstacles, where distances matter, and anywhere else.
            let near = solids.iter().flat_map(|&(x, y, z)| (0..6).map(move |d| ((x + d) % SIZE[0], y, (z + d / 2) % SIZE[2])));
            for at in probes.into_iter().chain(near) {
                let squared = |&(x, y, z): &(usize, usize, usize)| {
                    let d = [at.0.abs_diff(x), at.1.abs_diff(y), at.2.abs_diff(z)];
                    (d.iter().all(|&d| d <= REACH)).then(|| d[0] * d[0] + d[1] * d[1] + usize::from(weight) * d[2] * d[2])
                };
                let expected = solids.iter().filter_map(squared).min().map_or(255, |squared| squared.min(255));
                prop_assert_eq!(usize::from(clearance.squared()[index(at)]), expected);
            }
        }
    }
}

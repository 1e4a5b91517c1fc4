//! The cheapest path in the grid: A* with a queue of buckets, in integers.

use crate::obstacle_map::{CELLS, SIZE};

use super::OPEN;

/// Cost of a move to a free cell in tenths: straight, diagonal, vertical.
const STRAIGHT: u32 = 10;
const DIAGONAL: u32 = 14;
const VERTICAL: u32 = 15;
/// More than any move can raise the estimate: a diagonal move into a solid, plus the heuristic of one move.
const BUCKETS: usize = 4096;
const NONE: u8 = u8::MAX;

/// Moves: east, north, up, cost.
const MOVES: [(i32, i32, i32, u32); 10] = [
    (1, 0, 0, STRAIGHT),
    (-1, 0, 0, STRAIGHT),
    (0, 1, 0, STRAIGHT),
    (0, -1, 0, STRAIGHT),
    (1, 1, 0, DIAGONAL),
    (1, -1, 0, DIAGONAL),
    (-1, 1, 0, DIAGONAL),
    (-1, -1, 0, DIAGONAL),
    (0, 0, 1, VERTICAL),
    (0, 0, -1, VERTICAL),
];

/// The memory of the search.
#[derive(Clone, Debug, Default)]
pub(super) struct Search {
    cost: Vec<u32>,
    /// The move by which a cell was reached.
    by: Vec<u8>,
    /// Cells by estimate, modulo the number of buckets.
    buckets: Vec<Vec<u32>>,
}

impl Search {
    /// The cheapest path from `start` to within `radius` cells of `goal` (local coordinates, in the grid), as indices,
    /// and its cost. Every cell can be entered at its cost factor, so there is always a path. `None` for a goal outside
    /// the grid.
    pub(super) fn path(&mut self, factors: &[u16], start: usize, goal: [i32; 3], radius: i32) -> Option<(Vec<u32>, u32)> {
        if (0..3).any(|i| goal[i] < 0 || goal[i] >= SIZE[i] as i32) {
            return None;
        }
        self.cost.clear();
        self.cost.resize(CELLS, u32::MAX);
        self.by.clear();
        self.by.resize(CELLS, NONE);
        self.buckets.resize(BUCKETS, Vec::new());
        self.buckets.iter_mut().for_each(Vec::clear);

        // Maximum cost of the moves within the radius: √(10² + 4² + 15²) = 18.5 per cell.
        let slack = u32::try_from(radius.max(0)).unwrap_or(0) * 19;
        // Within the radius nothing remains; outside it, at least the moves minus those within the radius.
        let heuristic = |x: i32, y: i32, z: i32| {
            let (dx, dy) = ((x - goal[0]).unsigned_abs(), (y - goal[1]).unsigned_abs());
            let level = STRAIGHT * dx.max(dy) + (DIAGONAL - STRAIGHT) * dx.min(dy);
            u32::from(OPEN) * (level + VERTICAL * (z - goal[2]).unsigned_abs()).saturating_sub(slack)
        };
        let squared = i64::from(radius.max(0)) * i64::from(radius.max(0));
        let arrived = |x: i32, y: i32, z: i32| {
            let d = [x - goal[0], y - goal[1], z - goal[2]].map(i64::from);
            d[0] * d[0] + d[1] * d[1] + d[2] * d[2] <= squared
        };
        let (x, y, z) = coordinates(start);
        self.cost[start] = 0;
        let mut estimate = heuristic(x, y, z) as usize;
        self.buckets[estimate % BUCKETS].push(start as u32);
        let mut queued = 1_usize;
        while queued > 0 {
            let Some(index) = self.buckets[estimate % BUCKETS].pop() else {
                estimate += 1;
                continue;
            };
            queued -= 1;
            let index = index as usize;
            let (x, y, z) = coordinates(index);
            let cost = self.cost[index];
            // A cheaper path was found since it was queued.
            if (cost + heuristic(x, y, z)) as usize != estimate {
                continue;
            }
            if arrived(x, y, z) {
                return Some((self.back(index), cost));
            }
            for (number, &(dx, dy, dz, length)) in MOVES.iter().enumerate() {
                let (x, y, z) = (x + dx, y + dy, z + dz);
                if x < 0 || y < 0 || z < 0 || x >= SIZE[0] as i32 || y >= SIZE[1] as i32 || z >= SIZE[2] as i32 {
                    continue;
                }
                let next = (z as usize * SIZE[1] + y as usize) * SIZE[0] + x as usize;
                let through = cost + length * u32::from(factors[next]);
                if through < self.cost[next] {
                    self.cost[next] = through;
                    self.by[next] = number as u8;
                    self.buckets[(through + heuristic(x, y, z)) as usize % BUCKETS].push(next as u32);
                    queued += 1;
                }
            }
        }
        None
    }

    /// Cost of the move between neighbouring cells, per unit of the cost factor.
    pub(super) fn length(from: u32, to: u32) -> u32 {
        let (a, b) = (coordinates(from as usize), coordinates(to as usize));
        match (a.2 != b.2, a.0 != b.0 && a.1 != b.1) {
            (true, _) => VERTICAL,
            (false, true) => DIAGONAL,
            (false, false) => STRAIGHT,
        }
    }

    /// The path that led to a cell.
    fn back(&self, mut index: usize) -> Vec<u32> {
        let mut path = vec![index as u32];
        while let Some(&(dx, dy, dz, _)) = MOVES.get(usize::from(self.by[index])) {
            let (x, y, z) = coordinates(index);
            index = ((z - dz) as usize * SIZE[1] + (y - dy) as usize) * SIZE[0] + (x - dx) as usize;
            path.push(index as u32);
        }
        path.reverse();
        path
    }
}

fn coordinates(index: usize) -> (i32, i32, i32) {
    let (x, rest) = (index % SIZE[0], index / SIZE[0]);
    (x as i32, (rest % SIZE[1]) as i32, (rest / SIZE[1]) as i32)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn index(x: usize, y: usize, z: usize) -> usize {
        (z * SIZE[1] + y) * SIZE[0] + x
    }

    /// By hand: three diagonal and two straight moves in the open, 4·(3·14 + 2·10) = 248; and one vertical, 4·15 = 60.
    #[test]
    fn the_cost_of_an_open_way_by_hand() {
        let open = vec![OPEN; CELLS];
        let mut search = Search::default();
        let (path, cost) = search.path(&open, index(10, 10, 5), [15, 13, 5], 0).unwrap();
        assert_eq!((path.len(), cost), (6, 248));
        let (path, cost) = search.path(&open, index(10, 10, 5), [10, 10, 6], 0).unwrap();
        assert_eq!((path.len(), cost), (2, 60));
        assert!(search.path(&open, 0, [-1, 0, 0], 0).is_none());
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(16))]
        /// The cost is that of Dijkstra's algorithm without a heuristic, and the path is connected and has that cost.
        #[test]
        fn the_path_is_the_cheapest(
            walls in prop::collection::vec((0..30_usize, 0..30_usize, 0..6_usize, 0..3_usize), 0..60),
            goal in (0..30_i32, 0..30_i32, 0..6_i32),
            radius in 0..4_i32,
        ) {
            let mut factors = vec![OPEN; CELLS];
            for &(x, y, z, kind) in &walls {
                for d in 0..6 {
                    factors[index((x + d) % 30, y, z)] = [12, 80, 240][kind];
                }
            }
            let (start, goal) = (index(3, 4, 2), [goal.0, goal.1, goal.2]);
            let mut search = Search::default();
            let (path, cost) = search.path(&factors, start, goal, radius).unwrap();

            let mut best = vec![u32::MAX; CELLS];
            let mut queue = std::collections::BTreeSet::from([(0, start)]);
            best[start] = 0;
            let expected = loop {
                let (cost, at) = queue.pop_first().unwrap();
                let (x, y, z) = coordinates(at);
                let d = [x - goal[0], y - goal[1], z - goal[2]];
                if d[0] * d[0] + d[1] * d[1] + d[2] * d[2] <= radius * radius {
                    break cost;
                }
                for (dx, dy, dz, length) in MOVES {
                    let (x, y, z) = (x + dx, y + dy, z + dz);
                    if x >= 0 && y >= 0 && z >= 0 && x < 80 && y < 80 && z < 32 {
                        let next = index(x as usize, y as usize, z as usize);
                        let through = cost + length * u32::from(factors[next]);
                        if through < best[next] {
                            best[next] = through;
                            queue.insert((through, next));
                        }
                    }
                }
            };
            prop_assert_eq!(cost, expected);
            let mut sum = 0;
            for pair in path.windows(2) {
                let (a, b) = (coordinates(pair[0] as usize), coordinates(pair[1] as usize));
                let step = MOVES.iter().find(|m| (m.0, m.1, m.2) == (b.0 - a.0, b.1 - a.1, b.2 - a.2));
                prop_assert!(step.is_some());
                sum += step.unwrap().3 * u32::from(factors[pair[1] as usize]);
            }
            prop_assert_eq!(sum, cost);
        }
    }
}

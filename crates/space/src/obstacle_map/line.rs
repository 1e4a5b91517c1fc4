//! The cells of a straight line, in integers (Bresenham's algorithm in three dimensions).

use super::Cell;

/// The cells from one to another, both included; one for each step along the longest axis.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Line {
    at: [i32; 3],
    step: [i32; 3],
    /// Twice the absolute extents.
    extent: [i32; 3],
    error: [i32; 3],
    longest: usize,
    left: i32,
}

impl Line {
    pub(crate) fn new(from: Cell, to: Cell) -> Self {
        let away = [to.east - from.east, to.north - from.north, to.up - from.up];
        let extent = away.map(|d| 2 * d.abs());
        let longest = (0..3).max_by_key(|&i| (extent[i], core::cmp::Reverse(i))).unwrap_or(0);
        Self {
            at: [from.east, from.north, from.up],
            step: away.map(i32::signum),
            extent,
            error: extent.map(|e| e - extent[longest] / 2),
            longest,
            left: extent[longest] / 2 + 1,
        }
    }
}

impl Iterator for Line {
    type Item = Cell;

    fn next(&mut self) -> Option<Cell> {
        if self.left == 0 {
            return None;
        }
        let [east, north, up] = self.at;
        self.left -= 1;
        for i in 0..3 {
            if i == self.longest {
                self.at[i] += self.step[i];
                continue;
            }
            if self.error[i] > 0 {
                self.at[i] += self.step[i];
                self.error[i] -= self.extent[self.longest];
            }
            self.error[i] += self.extent[i];
        }
        Some(Cell { east, north, up })
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn cell(east: i32, north: i32, up: i32) -> Cell {
        Cell { east, north, up }
    }

    /// By hand: slope ½ in the plane, and straight up.
    #[test]
    fn a_line_by_hand() {
        let line: Vec<_> = Line::new(cell(0, 0, 0), cell(4, 2, 0)).collect();
        assert_eq!(line, [cell(0, 0, 0), cell(1, 0, 0), cell(2, 1, 0), cell(3, 1, 0), cell(4, 2, 0)]);
        let up: Vec<_> = Line::new(cell(1, 1, 0), cell(1, 1, -2)).collect();
        assert_eq!(up, [cell(1, 1, 0), cell(1, 1, -1), cell(1, 1, -2)]);
        assert_eq!(Line::new(cell(3, 3, 3), cell(3, 3, 3)).collect::<Vec<_>>(), [cell(3, 3, 3)]);
    }

    proptest! {
        #[test]
        fn a_line_is_connected_and_ends_where_it_should(a in prop::array::uniform3(-90..90), b in prop::array::uniform3(-90..90)) {
            let (from, to) = (cell(a[0], a[1], a[2]), cell(b[0], b[1], b[2]));
            let cells: Vec<_> = Line::new(from, to).collect();
            prop_assert_eq!((cells[0], cells[cells.len() - 1]), (from, to));
            let span = (0..3).map(|i| (b[i] - a[i]).abs()).max().unwrap_or(0);
            prop_assert_eq!(cells.len() as i32, span + 1);
            for pair in cells.windows(2) {
                let gap = [pair[1].east - pair[0].east, pair[1].north - pair[0].north, pair[1].up - pair[0].up];
                prop_assert_eq!(gap.map(i32::abs).into_iter().max(), Some(1));
            }
            // Never farther than a cell from the true line.
            for (i, at) in cells.iter().enumerate() {
                let t = i as f64 / f64::from(span.max(1));
                let off = |a: i32, b: i32, at: i32| (f64::from(a) + t * f64::from(b - a) - f64::from(at)).abs();
                prop_assert!(off(a[0], b[0], at.east).max(off(a[1], b[1], at.north)).max(off(a[2], b[2], at.up)) <= 0.5 + 1e-9);
            }
        }
    }
}

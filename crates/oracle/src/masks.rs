//! Masks of an id image in one pass: area, bounds, edges that cut it, and the deepest pixel.
//!
//! The *deepest* pixel is the centre of the largest square in the mask (chessboard distance to the nearest pixel
//! outside the mask or the image); among equal squares the one nearest to the mask's centroid. The centroid itself may
//! be outside of a lattice-like mask.

use spf_core::reply::Look;

/// The visible pixels of one object.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mask {
    /// The object.
    pub id: u16,
    /// Pixels.
    pub area: u64,
    /// First column.
    pub left: usize,
    /// Last column.
    pub right: usize,
    /// First row.
    pub top: usize,
    /// Last row.
    pub bottom: usize,
    /// Column and row of the deepest pixel.
    pub deepest: (usize, usize),
    /// Number of mask pixels on the left, right, upper and lower edges of the image.
    edges: [u64; 4],
    /// Sums of columns and rows, for the centroid.
    sums: (u64, u64),
    /// Side of the largest square, pixels.
    side: u16,
}

impl Mask {
    /// The edge of the image with the most mask pixels.
    pub(super) fn cut(&self, width: usize, height: usize) -> Option<Look> {
        // As a fraction of the edge length, so that longer edges are not favoured.
        let fraction = |i: usize| self.edges[i] as f64 / if i < 2 { height as f64 } else { width as f64 };
        let looks = [Look::Left, Look::Right, Look::Up, Look::Down];
        (0..4)
            .filter(|&i| self.edges[i] > 0)
            .fold(None, |best: Option<usize>, i| match best {
                Some(b) if fraction(b) >= fraction(i) => Some(b),
                _ => Some(i),
            })
            .map(|i| looks[i])
    }
}

/// A run of one id in a row.
struct Run {
    slot: u32,
    row: u32,
    first: u32,
    /// End column, exclusive.
    end: u32,
    /// Largest square that ends in this run.
    side: u16,
}

/// All masks of an id image in ascending order of id; id 0 is empty. `ids` consists of complete rows of `width`, at
/// most 65535 per side.
#[must_use]
pub fn masks(ids: &[u16], width: usize) -> Vec<Mask> {
    placed(ids, width, |side| side)
}

/// The same, with a pixel near the middle of each mask in place of the deepest one: the centre of a square at least half as large as
/// the largest, the one nearest to the centroid. It moves little from image to image, where the largest squares of a lattice are
/// anywhere.
pub(super) fn central(ids: &[u16], width: usize) -> Vec<Mask> {
    placed(ids, width, |side| side.div_ceil(2))
}

/// Masks with the centre of a square of at least the side that is `enough` for the largest one.
fn placed(ids: &[u16], width: usize, enough: impl Fn(u16) -> u16) -> Vec<Mask> {
    if width == 0 || ids.iter().all(|&id| id == 0) {
        return Vec::new();
    }
    let height = ids.len() / width;
    let mut slots = vec![u32::MAX; usize::from(u16::MAX) + 1];
    let mut found: Vec<Mask> = Vec::new();
    let mut runs: Vec<Run> = Vec::new();
    // Side of the largest square whose lower right corner is at each pixel, of two rows.
    let (mut above, mut side) = (vec![0_u16; width], vec![0_u16; width]);
    // Row −1: an id that never matches a rendered one.
    let nothing = vec![0_u16; width];
    for row in 0..height {
        let line = &ids[row * width..(row + 1) * width];
        let line_above = if row == 0 { &nothing[..] } else { &ids[(row - 1) * width..row * width] };
        let mut first = 0;
        while first < width {
            let id = line[first];
            let end = end_of_run(line, first);
            if id != 0 {
                let largest = squares(id, &line_above[first..end], &above[first..end], &mut side[first..end]);
                let slot = &mut slots[usize::from(id)];
                if *slot == u32::MAX {
                    *slot = found.len() as u32;
                    found.push(Mask {
                        id,
                        area: 0,
                        left: first,
                        right: first,
                        top: row,
                        bottom: row,
                        deepest: (first, row),
                        edges: [0; 4],
                        sums: (0, 0),
                        side: 0,
                    });
                }
                let mask = &mut found[*slot as usize];
                mask.take(row, first, end, width, height, largest);
                runs.push(Run { slot: *slot, row: row as u32, first: first as u32, end: end as u32, side: largest });
            } else {
                side[first..end].fill(0);
            }
            first = end;
        }
        core::mem::swap(&mut above, &mut side);
    }
    place(ids, width, &mut found, &runs, enough);
    found.sort_by_key(|mask| mask.id);
    found
}

/// The end of the run that starts at `first`.
pub(super) fn end_of_run(line: &[u16], first: usize) -> usize {
    let id = line[first];
    // Groups without a branch per pixel, so that they are compared with vector instructions.
    let same = |group: &&[u16; 16]| group.iter().fold(0, |differ, other| differ | (other ^ id)) == 0;
    let from = first + 16 * line[first..].as_chunks::<16>().0.iter().take_while(same).count();
    line[from..].iter().position(|&other| other != id).map_or(line.len(), |n| from + n)
}

/// Sides of the largest squares that end at each pixel of a run; pixels to the left of the run have another id.
fn squares(id: u16, ids_above: &[u16], above: &[u16], side: &mut [u16]) -> u16 {
    let (mut left, mut corner, mut largest) = (0, 0, 0);
    for ((&id_above, &side_above), out) in ids_above.iter().zip(above).zip(side) {
        let up = if id_above == id { side_above } else { 0 };
        left = 1 + left.min(up).min(corner);
        corner = up;
        *out = left;
        largest = largest.max(left);
    }
    largest
}

impl Mask {
    /// Adds a run of a row.
    fn take(&mut self, row: usize, first: usize, end: usize, width: usize, height: usize, largest: u16) {
        let length = (end - first) as u64;
        self.area += length;
        self.left = self.left.min(first);
        self.right = self.right.max(end - 1);
        self.bottom = row;
        self.sums.0 += (first + end - 1) as u64 * length / 2;
        self.sums.1 += row as u64 * length;
        self.edges[0] += u64::from(first == 0);
        self.edges[1] += u64::from(end == width);
        self.edges[2] += if row == 0 { length } else { 0 };
        self.edges[3] += if row + 1 == height { length } else { 0 };
        self.side = self.side.max(largest);
    }
}

/// Determines the centre of a square of each mask: among the runs in which one of enough size ends, it selects the one nearest
/// to the centroid's row, and there the square nearest to the centroid's column.
fn place(ids: &[u16], width: usize, found: &mut [Mask], runs: &[Run], enough: impl Fn(u16) -> u16) {
    let mut best: Vec<Option<(u64, usize)>> = vec![None; found.len()];
    for (index, run) in runs.iter().enumerate() {
        let mask = &found[run.slot as usize];
        let side = enough(mask.side);
        if run.side >= side {
            let middle = u64::from(run.row) - u64::from(side - 1) / 2;
            let away = middle.abs_diff(mask.sums.1 / mask.area);
            let best = &mut best[run.slot as usize];
            if best.is_none_or(|(least, _)| away < least) {
                *best = Some((away, index));
            }
        }
    }
    for (mask, best) in found.iter_mut().zip(best) {
        let Some((_, index)) = best else { continue };
        let run = &runs[index];
        let (row, side) = (run.row as usize, enough(mask.side));
        let half = usize::from(side - 1) / 2;
        let centroid = (mask.sums.0 / mask.area) as usize;
        let ends = ends_of_squares(ids, width, row, run.first as usize, run.end as usize, side);
        if let Some(column) = ends.into_iter().map(|end| end - half).min_by_key(|x| x.abs_diff(centroid)) {
            mask.deepest = (column, row - half);
        }
    }
}

/// Columns of the run `first..end` of `row` at which a square of side `side` of the same id ends. Recomputed here for a
/// few runs, since storing the sides for the whole image would cost more.
fn ends_of_squares(ids: &[u16], width: usize, row: usize, first: usize, end: usize, side: u16) -> Vec<usize> {
    let side = usize::from(side);
    let id = ids[row * width + first];
    let (mut streak, mut out) = (0, Vec::new());
    for column in first..end {
        let whole = (row + 1 - side..=row).all(|r| ids[r * width + column] == id);
        streak = if whole { streak + 1 } else { 0 };
        if streak >= side {
            out.push(column);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(rows: &[&str]) -> (Vec<u16>, usize) {
        (rows.iter().flat_map(|row| row.bytes().map(|b| u16::from(b - b'0'))).collect(), rows[0].len())
    }

    #[test]
    fn deepest_is_inside_a_lattice() {
        // A square frame of two pixels' width: its centroid is air.
        let (ids, width) = image(&["111111", "111111", "110011", "110011", "111111", "111111"]);
        let found = masks(&ids, width);
        assert_eq!(found.len(), 1);
        let (x, y) = found[0].deepest;
        assert_eq!(ids[y * width + x], 1);
        assert_eq!(found[0].area, 32);
    }

    #[test]
    fn deepest_is_the_middle_of_the_largest_square() {
        let (ids, width) = image(&["0000000", "0111110", "0111110", "0111110", "0111110", "0111110", "0022220"]);
        let found = masks(&ids, width);
        assert_eq!(found[0].deepest, (3, 3));
        assert_eq!((found[0].left, found[0].right, found[0].top, found[0].bottom), (1, 5, 1, 5));
        assert_eq!((found[1].id, found[1].area, found[1].cut(7, 7)), (2, 4, Some(Look::Down)));
    }

    #[test]
    fn equal_squares_go_to_the_centroid() {
        let (ids, width) = image(&["010", "010", "010", "010", "010"]);
        assert_eq!(masks(&ids, width)[0].deepest, (1, 2));
    }

    #[test]
    fn a_central_pixel_is_in_the_middle_of_a_mast_that_widens_at_its_foot() {
        let (ids, width) = image(&["0110", "0110", "0110", "0110", "0110", "0110", "0110", "0110", "1111", "1111", "1111"]);
        assert_eq!(masks(&ids, width)[0].deepest.1, 9);
        assert_eq!(central(&ids, width)[0].deepest, (2, 5));
    }

    #[test]
    fn edges_are_reported() {
        let (ids, width) = image(&["1000", "1002", "1002", "0000"]);
        let found = masks(&ids, width);
        assert_eq!(found[0].cut(4, 4), Some(Look::Left));
        assert_eq!(found[1].cut(4, 4), Some(Look::Right));
    }
}

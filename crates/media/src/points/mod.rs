//! Follows corners all over the image from frame to frame, each under a number of its own.
//!
//! Corners are those of Shi and Tomasi (1994), at most one in each cell of a grid, so that they are spread over the image. The
//! pyramidal method of Lucas and Kanade (Bouguet 2001) follows them there and back; those that do not come back are dropped, and
//! the emptied cells get new corners.
//!
//! Pure given the images, with the arithmetic of [`track`](crate::track): equal images give equal bits on every machine.

mod flow;

use crate::track::grey::Pyramid;
use crate::track::{Shift, TrackImage};
use flow::{WEAKEST, cornerness, follow_and_return};

/// Cells of the grid, across and down.
const COLUMNS: usize = 15;
const ROWS: usize = 10;
/// The largest number of points.
pub const MOST: usize = COLUMNS * ROWS;
/// How far a point may end from its start after the way there and back, pixels. Less than for a box, whose median forgives.
const ROUND_TRIP: f64 = 0.4;
/// The coarsest level at which a point is followed: with its own motion as a guess, little is left to be found.
const TOP: usize = 2;
/// A point this near to an edge is dropped, pixels: half of its window is missing.
const MARGIN: f64 = 6.0;
/// Every how many pixels a corner is looked for.
const STRIDE: usize = 2;

/// A point in the last image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Its number: never used for another point.
    pub id: u32,
    /// Pixels from the centre of the leftmost column.
    pub x: f64,
    /// Pixels from the centre of the uppermost row.
    pub y: f64,
    /// Its last motion besides what was predicted, pixels.
    moved: Shift,
}

/// Follows corners through the images of a video.
#[derive(Clone, Debug, Default)]
pub struct Points {
    before: Option<Pyramid>,
    /// In the order of their numbers.
    points: Vec<Point>,
    next_id: u32,
}

impl Points {
    /// The points in the last image, in the order of their numbers.
    #[must_use]
    pub fn points(&self) -> &[Point] {
        &self.points
    }

    /// Follows all points into the next image, and adds corners where there are none. `predicted` gives the shift of a place that
    /// comes from the turning of the camera, if it is known. An image of another size begins anew.
    pub fn next(&mut self, image: &TrackImage, predicted: impl Fn((f64, f64)) -> Option<Shift>) -> &[Point] {
        let now = Pyramid::of(&image.grey);
        match self.before.take().filter(|before| before.size() == now.size()) {
            Some(before) => self.follow(&before, &now, predicted),
            None => self.points.clear(),
        }
        self.refill(&now);
        self.before = Some(now);
        &self.points
    }

    fn follow(&mut self, before: &Pyramid, now: &Pyramid, predicted: impl Fn((f64, f64)) -> Option<Shift>) {
        let (width, height) = now.size();
        let (right, bottom) = (f64::from(width) - 1.0 - MARGIN, f64::from(height) - 1.0 - MARGIN);
        let mut taken = [false; MOST];
        self.points.retain_mut(|point| {
            let turned = predicted((point.x, point.y)).filter(|shift| shift.x.is_finite() && shift.y.is_finite());
            let turned = turned.unwrap_or_default();
            let guess = Shift { x: turned.x + point.moved.x, y: turned.y + point.moved.y };
            let top = TOP.min(now.top());
            let Some((x, y)) = follow_and_return(before, now, (point.x, point.y), guess, top, ROUND_TRIP) else { return false };
            point.moved = Shift { x: x - point.x - turned.x, y: y - point.y - turned.y };
            (point.x, point.y) = (x, y);
            if !(x >= MARGIN && y >= MARGIN && x <= right && y <= bottom) {
                return false;
            }
            // Of two in one cell, the older one stays: its way is longer.
            !core::mem::replace(&mut taken[cell_of(now.size(), point)], true)
        });
    }

    /// Adds the best corner of each cell without a point.
    fn refill(&mut self, now: &Pyramid) {
        let grey = now.level(0);
        let (width, height) = (grey.size().0 as usize, grey.size().1 as usize);
        let edge = MARGIN as usize;
        let mut taken = [false; MOST];
        for point in &self.points {
            taken[cell_of(now.size(), point)] = true;
        }
        for (cell, _) in taken.iter().enumerate().filter(|(_, taken)| !**taken) {
            let (column, row) = (cell % COLUMNS, cell / COLUMNS);
            let (left, right) =
                ((column * width / COLUMNS).max(edge), ((column + 1) * width / COLUMNS).min(width.saturating_sub(edge)));
            let (top, bottom) = ((row * height / ROWS).max(edge), ((row + 1) * height / ROWS).min(height.saturating_sub(edge)));
            let mut best = (WEAKEST, None);
            for y in (top..bottom).step_by(STRIDE) {
                for x in (left..right).step_by(STRIDE) {
                    let score = cornerness(grey.data(), width, (x, y));
                    if score > best.0 {
                        best = (score, Some((x as f64, y as f64)));
                    }
                }
            }
            if let (_, Some((x, y))) = best {
                self.points.push(Point { id: self.next_id, x, y, moved: Shift::default() });
                self.next_id = self.next_id.wrapping_add(1);
            }
        }
    }
}

/// The cell of a point in an image of this size.
fn cell_of((width, height): (u32, u32), point: &Point) -> usize {
    let along = |x: f64, length: u32, cells: usize| ((x.max(0.0) as usize) * cells / length.max(1) as usize).min(cells - 1);
    along(point.y, height, ROWS) * COLUMNS + along(point.x, width, COLUMNS)
}

#[cfg(test)]
mod tests;

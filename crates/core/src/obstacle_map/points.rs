//! Adds triangulated points to the map: a hit each, and a free line before it.

use super::{Cell, Line, ObstacleMap, passed, struck};
use crate::geometry::EnuPosition;

/// A point seen from somewhere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MapPoint {
    /// Where it is.
    pub place: EnuPosition,
    /// The part of the way to it that is free for sure, 0 to 1.
    pub free: f64,
}

impl ObstacleMap {
    /// Adds points seen from a place. None is cleared by another one's line: those of a frame are at different ranges, each with
    /// an error of its own. Points outside the grid, and those that are no places, are left out.
    pub fn points(&mut self, from: EnuPosition, points: &[MapPoint]) {
        let is_place = |at: EnuPosition| [at.east, at.north, at.up].iter().all(|x| x.is_finite());
        let inside = |point: &&MapPoint| is_place(point.place) && self.index(Cell::of(point.place)).is_some();
        let points: Vec<MapPoint> = points.iter().filter(inside).filter(|_| is_place(from)).copied().collect();
        let Some(origin) = Some(Cell::of(from)).filter(|origin| self.index(*origin).is_some()) else { return };
        for point in &points {
            // Not `clamp`, which passes NaN through.
            let free = if point.free > 0.0 { point.free.min(1.0) } else { continue };
            for cell in Line::new(origin, Cell::of(from.towards(point.place, free))) {
                if let Some(index) = self.index(cell)
                    && self.marks[index] == 0
                {
                    self.marks[index] = 1;
                    self.touched.push(index as u32);
                    self.odds[index] = passed(self.odds[index]);
                }
            }
        }
        for &index in &self.touched {
            self.marks[index as usize] = 0;
        }
        self.touched.clear();
        for point in &points {
            if let Some(index) = self.index(Cell::of(point.place)) {
                self.odds[index] = struck(self.odds[index]);
            }
        }
        self.changed += 1;
    }
}

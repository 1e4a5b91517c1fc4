//! Adds depth grids to the map: one ray for each cell in which rays end.

use super::{CELL, CELLS, Cell, Line, ObstacleMap, SIZE, passed, struck};
use spf_core::depth::{CameraAxes, DepthGrid, DepthSource};
use spf_core::geometry::{EnuPosition, Pose};

/// Marks of one insertion.
const PASSED: u8 = 1;
const ENDED: u8 = 2;
const STRUCK: u8 = 4;
/// The part of the way to what a network has estimated that counts as free: its depth is off by a factor of e^0.35 (one standard
/// deviation) at most, and what it overestimates must not clear what is known.
const FREE_TO_ESTIMATE: f64 = 0.5;

impl ObstacleMap {
    /// Adds a depth grid, measured at `pose`. Pixels without a value carry no information. An invalid grid is ignored.
    pub fn depth(&mut self, grid: &DepthGrid, pose: Pose) {
        if grid.check().is_err() {
            return;
        }
        let axes = CameraAxes::new(&grid.camera, pose);
        let ends = grid.points().map(|(_, at)| axes.place(at.right, at.forward, at.up));
        let free = match grid.source {
            DepthSource::Sensor => None,
            DepthSource::Network => Some(FREE_TO_ESTIMATE),
        };
        self.cast(axes.origin, ends, free);
    }

    /// Adds rays, which are free up to their ends or up to this part of their lengths.
    fn cast(&mut self, from: EnuPosition, ends: impl Iterator<Item = EnuPosition>, free_to: Option<f64>) {
        let Some(corner) = self.corner else { return };
        self.changed += 1;
        let origin = Cell::of(from);
        // The grid's box, shrunk a little, so that a clipped end stays inside.
        let low = [corner.east, corner.north, corner.up].map(|i| f64::from(i) * CELL + 1e-6);
        let high = [0, 1, 2].map(|i| low[i] + SIZE[i] as f64 * CELL - 2e-6);
        for end in ends {
            let hit = self.index(Cell::of(end));
            let free = match free_to {
                None => hit.or_else(|| self.index(Cell::of(clip(from, end, low, high)))),
                Some(part) => self.index(Cell::of(clip(from, from.towards(end, part), low, high))),
            };
            for (index, mark) in [(free, ENDED), (hit, STRUCK)] {
                let Some(index) = index else { continue };
                if self.marks[index] == 0 {
                    self.touched.push(index as u32);
                }
                self.marks[index] |= mark;
            }
        }
        let ends = self.touched.len();
        for i in 0..ends {
            let index = self.touched[i] as usize;
            let Some(end) = self.cell(index).filter(|_| self.marks[index] & ENDED != 0) else { continue };
            for cell in Line::new(origin, end) {
                let Some(index) = self.index(cell) else { continue };
                if self.marks[index] == 0 {
                    self.marks[index] = PASSED;
                    self.touched.push(index as u32);
                }
            }
        }
        for &index in &self.touched {
            let index = index as usize;
            let mark = core::mem::take(&mut self.marks[index]);
            let odds = &mut self.odds[index];
            // Where one ray has ended, others that pass carry less weight: otherwise a grazing view of a floor would
            // clear it.
            *odds = if mark & STRUCK != 0 { struck(*odds) } else { passed(*odds) };
        }
        self.touched.clear();
        debug_assert_eq!(self.marks.len(), CELLS);
    }
}

/// Where a ray that starts inside a box leaves it.
fn clip(from: EnuPosition, to: EnuPosition, low: [f64; 3], high: [f64; 3]) -> EnuPosition {
    let (a, b) = ([from.east, from.north, from.up], [to.east, to.north, to.up]);
    let mut fraction = 1.0_f64;
    for i in 0..3 {
        let bound = if b[i] > high[i] {
            high[i]
        } else if b[i] < low[i] {
            low[i]
        } else {
            continue;
        };
        fraction = fraction.min(((bound - a[i]) / (b[i] - a[i])).max(0.0));
    }
    from.towards(to, fraction)
}

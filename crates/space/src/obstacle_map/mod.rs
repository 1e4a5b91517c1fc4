//! The obstacle map: what the craft's senses have shown around it (`docs/explanation/between-answers.md`).
//!
//! A grid of 20×20×8 m in cells of 0.25 m moves with the craft by whole cells, aligned with the world. Each cell stores
//! the log-odds of being occupied as an integer: a hit marks it at once, rays that pass through clear it, and without
//! confirmation it fades to unknown within 20 s. In addition, the map stores the views of the last seconds: which
//! places a usable frame has shown, and which a reply has implied to be free. Every source feeds the same map: depth
//! grids, boxes, single ranges.
//!
//! Positions are converted to integer cells before any decision, so that the map is the same on every machine.

mod boxes;
mod depth;
mod line;
mod ranges;
mod views;

use std::collections::VecDeque;

pub use self::boxes::Mobility;
pub(crate) use self::line::Line;
use self::views::Views;
use spf_core::camera::Camera;
use spf_core::geometry::{EnuPosition, Pose};
use spf_core::time::{Duration, Time};

/// Edge of a cell, metres.
pub const CELL: f64 = 0.25;
/// Cells east, north and up: 20×20×8 m.
pub const SIZE: [usize; 3] = [80, 80, 32];
/// Number of cells.
pub const CELLS: usize = SIZE[0] * SIZE[1] * SIZE[2];

/// Log-odds in tenths: of one hit, of one ray that passes through, and their limits.
const HIT: i8 = 12;
const MISS: i8 = 4;
const SURE: i8 = 35;
const FREE: i8 = -20;
/// From this value on a cell counts as occupied: one hit suffices, unless a ray has passed through since.
const OCCUPIED: i8 = 9;
/// Down from this value it counts as free: one ray suffices.
const CLEAR: i8 = -4;
/// Interval at which cells fade by 1, so that a certain obstacle is unknown after 17.5 s and a certain free cell after
/// 20 s.
const FADE_OCCUPIED: Duration = Duration::from_millis(500);
const FADE_FREE: Duration = Duration::from_secs(1);
/// The grid moves when the craft is this many cells away from its middle.
const OFF_MIDDLE: i32 = 4;

/// A cell of the world: metres divided by [`CELL`], rounded down.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Cell {
    /// East.
    pub east: i32,
    /// North.
    pub north: i32,
    /// Up.
    pub up: i32,
}

impl Cell {
    /// The cell that contains a position. Positions beyond ±500 km, and values that are not numbers, give the outermost
    /// cells or 0.
    #[must_use]
    pub fn of(at: EnuPosition) -> Self {
        let along = |x: f64| libm::floor(x / CELL).clamp(-2e6, 2e6) as i32;
        Self { east: along(at.east), north: along(at.north), up: along(at.up) }
    }

    /// The middle of the cell.
    #[must_use]
    pub fn middle(self) -> EnuPosition {
        let along = |i: i32| (f64::from(i) + 0.5) * CELL;
        EnuPosition { east: along(self.east), north: along(self.north), up: along(self.up) }
    }
}

/// What is known about a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CellState {
    /// It is occupied.
    Occupied,
    /// A ray has passed through.
    Free,
    /// Nothing is known, or no longer.
    Unknown,
}

/// The map of the craft's surroundings. See the [module](self).
#[derive(Clone, Debug)]
pub struct ObstacleMap {
    /// The cell of the grid's lowest corner; `None` until the craft's position is known.
    corner: Option<Cell>,
    /// Log-odds in tenths, east fastest.
    odds: Vec<i8>,
    /// Cells that the operator has marked, and which cells of the grid are among them; empty without any. They do not fade, and no
    /// measurement clears them.
    kept_out: Vec<Cell>,
    is_kept_out: Vec<bool>,
    /// Marks of the current insertion.
    marks: Vec<u8>,
    touched: Vec<u32>,
    faded_occupied: Time,
    faded_free: Time,
    views: Views,
    named: VecDeque<boxes::Named>,
    changed: u64,
}

impl Default for ObstacleMap {
    fn default() -> Self {
        Self::new()
    }
}

impl ObstacleMap {
    /// A map in which nothing is known.
    #[must_use]
    pub fn new() -> Self {
        Self {
            corner: None,
            odds: vec![0; CELLS],
            kept_out: Vec::new(),
            is_kept_out: Vec::new(),
            marks: vec![0; CELLS],
            touched: Vec::new(),
            faded_occupied: Time::ZERO,
            faded_free: Time::ZERO,
            views: Views::default(),
            named: VecDeque::new(),
            changed: 0,
        }
    }

    /// Number of insertions so far: a plan made at an equal count is not outdated by the map.
    #[must_use]
    pub fn changes(&self) -> u64 {
        self.changed
    }

    /// Moves the grid along with a craft at `at`, and fades old cells. Call it before each insertion.
    pub fn advance(&mut self, now: Time, at: EnuPosition) {
        self.recentre(Cell::of(at));
        while self.faded_occupied + FADE_OCCUPIED <= now {
            self.faded_occupied += FADE_OCCUPIED;
            // After a long silence everything is unknown; the rest of the steps change nothing.
            if now.since(self.faded_occupied) > Duration::from_secs(30) {
                self.faded_occupied = now;
            }
            self.odds.iter_mut().for_each(|odds| *odds -= i8::from(*odds > 0));
        }
        while self.faded_free + FADE_FREE <= now {
            self.faded_free += FADE_FREE;
            if now.since(self.faded_free) > Duration::from_secs(30) {
                self.faded_free = now;
            }
            self.odds.iter_mut().for_each(|odds| *odds += i8::from(*odds < 0));
        }
        self.views.forget(now);
        self.named.retain(|named| named.until >= now);
    }

    /// Counts these cells as occupied until the next call, whatever is measured there: places that the operator has marked. No
    /// obstacle is left where the last ones were.
    pub fn keep_out(&mut self, cells: impl IntoIterator<Item = Cell>) {
        self.kept_out = cells.into_iter().collect();
        self.kept_out.sort_unstable();
        self.kept_out.dedup();
        self.show_kept_out();
        self.changed += 1;
    }

    fn show_kept_out(&mut self) {
        self.is_kept_out.clear();
        if !self.kept_out.is_empty() {
            self.is_kept_out.resize(CELLS, false);
            for i in 0..self.kept_out.len() {
                if let Some(index) = self.index(self.kept_out[i]) {
                    self.is_kept_out[index] = true;
                }
            }
        }
    }

    fn keeps_out(&self, index: usize) -> bool {
        self.is_kept_out.get(index).is_some_and(|is| *is)
    }

    /// Forgets everything, after the position was lost.
    pub fn clear(&mut self) {
        let changed = self.changed + 1;
        *self = Self { faded_occupied: self.faded_occupied, faded_free: self.faded_free, changed, ..Self::new() };
    }

    /// What is known about a cell; unknown outside the grid.
    #[must_use]
    pub fn known(&self, cell: Cell) -> CellState {
        let index = self.index(cell);
        if index.is_some_and(|index| self.keeps_out(index)) {
            return CellState::Occupied;
        }
        match index.map(|index| self.odds[index]) {
            Some(odds) if odds >= OCCUPIED => CellState::Occupied,
            Some(odds) if odds <= CLEAR => CellState::Free,
            _ => CellState::Unknown,
        }
    }

    /// Whether a cell is known to be occupied.
    #[must_use]
    pub fn is_occupied(&self, cell: Cell) -> bool {
        self.known(cell) == CellState::Occupied
    }

    /// All occupied cells, starting at the lowest, southernmost, westernmost one.
    pub fn occupied(&self) -> impl Iterator<Item = Cell> {
        let occupied = self.odds.iter().enumerate().filter(|&(index, &odds)| odds >= OCCUPIED || self.keeps_out(index));
        occupied.filter_map(|(index, _)| self.cell(index))
    }

    /// The cell of the grid's lowest corner; `None` until the craft's position is known.
    #[must_use]
    pub fn corner(&self) -> Option<Cell> {
        self.corner
    }

    /// The grid's occupied cells as flags, east fastest. For the planner.
    pub(crate) fn flags(&self, out: &mut Vec<bool>) {
        out.clear();
        out.extend(self.odds.iter().map(|&odds| odds >= OCCUPIED));
        out.iter_mut().zip(&self.is_kept_out).for_each(|(occupied, kept_out)| *occupied |= *kept_out);
    }

    /// Index of a cell in the grid.
    pub(crate) fn index(&self, cell: Cell) -> Option<usize> {
        let corner = self.corner?;
        let (x, y, z) = (cell.east - corner.east, cell.north - corner.north, cell.up - corner.up);
        let within = |i: i32, size: usize| i >= 0 && (i as usize) < size;
        (within(x, SIZE[0]) && within(y, SIZE[1]) && within(z, SIZE[2]))
            .then(|| (z as usize * SIZE[1] + y as usize) * SIZE[0] + x as usize)
    }

    /// The cell of an index.
    pub(crate) fn cell(&self, index: usize) -> Option<Cell> {
        let corner = self.corner?;
        let (x, rest) = (index % SIZE[0], index / SIZE[0]);
        let (y, z) = (rest % SIZE[1], rest / SIZE[1]);
        Some(Cell { east: corner.east + x as i32, north: corner.north + y as i32, up: corner.up + z as i32 })
    }

    /// Marks a place as occupied, with the highest certainty: an obstacle known to the operator or a test.
    pub fn mark(&mut self, cell: Cell) {
        if let Some(index) = self.index(cell) {
            self.odds[index] = SURE;
            self.changed += 1;
        }
    }

    /// Adds one measured range: from a position to `end`, where there is an obstacle if `hit`; in either case the line up to
    /// there is free.
    pub fn ray(&mut self, from: EnuPosition, end: EnuPosition, hit: bool) {
        let (from, end) = (Cell::of(from), Cell::of(end));
        for cell in Line::new(from, end) {
            if let Some(index) = self.index(cell) {
                let odds = &mut self.odds[index];
                *odds = if hit && cell == end { struck(*odds) } else { passed(*odds) };
            }
        }
        self.changed += 1;
    }

    /// Adds a usable frame.
    pub fn frame(&mut self, captured: Time, camera: &Camera, pose: Pose) {
        self.views.frame(captured, camera, pose);
    }

    /// Adds what a reply that arrived at `now` implies: its frame's view is free up to `range` metres, until 5 s from
    /// now.
    pub fn implied_free(&mut self, now: Time, camera: &Camera, pose: Pose, range: f64) {
        if range.is_finite() && range > 0.0 {
            self.views.implied_free(now, camera, pose, range);
            self.changed += 1;
        }
    }

    /// Whether a usable frame of the last 3 s has shown a place, with no known obstacle in between, or the craft has
    /// been there.
    #[must_use]
    pub fn is_seen(&self, now: Time, at: EnuPosition) -> bool {
        self.views.has_seen(now, at, |from| self.is_line_free(from, at))
    }

    /// Whether a place is free: a ray has passed through; or a reply has implied it and no obstacle is known; or the
    /// craft has been there within 3 s.
    #[must_use]
    pub fn is_free(&self, now: Time, at: EnuPosition) -> bool {
        match self.known(Cell::of(at)) {
            CellState::Occupied => false,
            CellState::Free => true,
            CellState::Unknown => self.views.is_free(now, at),
        }
    }

    /// Whether no obstacle is known on the line between two places.
    #[must_use]
    pub fn is_clear(&self, from: EnuPosition, to: EnuPosition) -> bool {
        self.first_obstacle(from, to).is_none()
    }

    /// Whether no obstacle is known within `radius` metres horizontally of the column from `at` over `climb` metres (negative:
    /// downwards). A forward camera does not see straight up or down; what it has seen beside the column may reach into it.
    #[must_use]
    pub fn is_column_clear(&self, at: EnuPosition, climb: f64, radius: f64) -> bool {
        let (low, high) = (at.up + climb.min(0.0), at.up + climb.max(0.0));
        let near = |cell: &Cell| {
            let middle = cell.middle();
            (low..=high).contains(&middle.up) && middle.horizontal_distance(at) <= radius
        };
        !self.occupied().any(|cell| near(&cell))
    }

    /// The first occupied cell on the line from one place to another.
    #[must_use]
    pub fn first_obstacle(&self, from: EnuPosition, to: EnuPosition) -> Option<Cell> {
        Line::new(Cell::of(from), Cell::of(to)).find(|cell| self.is_occupied(*cell))
    }

    /// Whether no obstacle is known on the line between two places, except in the last cell.
    fn is_line_free(&self, from: EnuPosition, to: EnuPosition) -> bool {
        let end = Cell::of(to);
        Line::new(Cell::of(from), end).all(|cell| cell == end || !self.is_occupied(cell))
    }

    /// Moves the grid so that `middle` is near its middle.
    fn recentre(&mut self, middle: Cell) {
        let half = |i: usize| SIZE[i] as i32 / 2;
        let wanted = Cell { east: middle.east - half(0), north: middle.north - half(1), up: middle.up - half(2) };
        let Some(corner) = self.corner else {
            self.corner = Some(wanted);
            self.show_kept_out();
            return;
        };
        let shift = [wanted.east - corner.east, wanted.north - corner.north, wanted.up - corner.up];
        if shift.iter().all(|s| s.abs() < OFF_MIDDLE) {
            return;
        }
        self.corner = Some(wanted);
        self.changed += 1;
        let mut moved = vec![0; CELLS];
        // Row by row along east: what was at x + shift is now at x.
        let from = |i: usize, s: i32, size: usize| usize::try_from(i as i32 + s).ok().filter(|&i| i < size);
        let first = usize::try_from((-shift[0]).max(0)).unwrap_or(0).min(SIZE[0]);
        let last = usize::try_from(SIZE[0] as i32 - shift[0].max(0)).unwrap_or(0);
        for z in 0..SIZE[2] {
            for y in 0..SIZE[1] {
                let (Some(z0), Some(y0)) = (from(z, shift[2], SIZE[2]), from(y, shift[1], SIZE[1])) else { continue };
                if first >= last {
                    continue;
                }
                let (to, at) = ((z * SIZE[1] + y) * SIZE[0], (z0 * SIZE[1] + y0) * SIZE[0]);
                let start = (at as i32 + first as i32 + shift[0]) as usize;
                moved[to + first..to + last].copy_from_slice(&self.odds[start..start + (last - first)]);
            }
        }
        self.odds = moved;
        self.show_kept_out();
    }
}

/// Log-odds after a hit. A cell that counted as free is occupied at once: one pixel of a wire marks it.
fn struck(odds: i8) -> i8 {
    (odds.max(0) + HIT).min(SURE)
}

/// Log-odds after a ray has passed through.
fn passed(odds: i8) -> i8 {
    (odds - MISS).max(FREE)
}

#[cfg(test)]
mod tests;

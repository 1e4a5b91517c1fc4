//! Frontiers: where free space that has been seen borders on space that has not (Yamauchi 1997, "A frontier-based approach
//! for autonomous exploration"): doorways and corners behind which a target may be.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{BLOCKED, Body, Destination, Planner};
use crate::geometry::EnuPosition;
use crate::obstacle_map::{CELL, Cell, CellState, ObstacleMap};

/// Minimum width of a frontier, metres.
const MIN_WIDTH: f64 = 1.0;
/// Width beyond which a frontier does not become more attractive, metres: that of a double door.
const WIDE: f64 = 2.0;
/// Added to the length of every path, metres: of two frontiers nearby the wider one counts, not the nearer one.
const NEARBY: f64 = 3.0;
/// A frontier nearer than this shows nothing new, metres.
const NEAREST: f64 = 1.5;
/// Around a place from which the surroundings have been searched, this far, nothing new is seen, metres. The map itself forgets
/// within 20 s what no measurement confirms.
const SEARCHED: f64 = 4.0;
/// Cost of a move in hundredths of a cell.
const STRAIGHT: u32 = 100;
const DIAGONAL: u32 = 141;
/// Moves within a layer: east, north, cost.
const MOVES: [(i32, i32, u32); 8] = [
    (1, 0, STRAIGHT),
    (-1, 0, STRAIGHT),
    (0, 1, STRAIGHT),
    (0, -1, STRAIGHT),
    (1, 1, DIAGONAL),
    (1, -1, DIAGONAL),
    (-1, 1, DIAGONAL),
    (-1, -1, DIAGONAL),
];

/// A frontier that can be reached.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Frontier {
    /// Its middle, in free space at the craft's height.
    pub position: EnuPosition,
    /// Its width, metres.
    pub width: f64,
    /// Length of the path there, metres.
    pub path: f64,
}

impl Planner {
    /// The best frontier for a craft at `at`: wide and near. Only paths through space known to be free count, at the craft's
    /// height. Frontiers near the places in `searched` are left out. `None` if there is none.
    pub fn frontier(&mut self, map: &ObstacleMap, at: EnuPosition, body: &Body, searched: &[EnuPosition]) -> Option<Frontier> {
        let here = Cell::of(at);
        let start = map.index(here)?;
        self.weigh(map, body, &Destination::place(at, 0.0));
        let cost = self.reachable(map, here, start);
        let is_unknown = |cell: Cell| map.index(cell).is_some() && map.known(cell) == CellState::Unknown;
        // The thin shadow of a post, and the gap that it leaves in the wall behind, lead nowhere.
        let is_deep =
            |cell: Cell| is_unknown(cell) && MOVES.iter().all(|&(east, north, _)| is_unknown(beside(cell, east, north)));
        let borders = |cell: Cell| {
            let leads = |&(east, north, _): &(i32, i32, u32)| {
                is_unknown(beside(cell, east, north)) && is_deep(beside(cell, 2 * east, 2 * north))
            };
            MOVES[..4].iter().any(leads)
        };
        // In the order of their indices, so that the result does not depend on anything else.
        let edge: Vec<bool> = cost.iter().enumerate().map(|(i, c)| *c < u32::MAX && map.cell(i).is_some_and(borders)).collect();
        let mut grouped = vec![false; edge.len()];
        let mut best: Option<(f64, Frontier)> = None;
        for first in (0..edge.len()).filter(|&i| edge[i]) {
            let cells = group(map, &edge, &mut grouped, first);
            let Some(frontier) = of_cells(map, &cells, &cost, at.up) else { continue };
            let is_new = searched.iter().all(|old| old.horizontal_distance(frontier.position) > SEARCHED);
            if frontier.width < MIN_WIDTH || frontier.path < NEAREST || !is_new {
                continue;
            }
            let worth = frontier.width.min(WIDE) / (NEARBY + frontier.path);
            if best.is_none_or(|(most, _)| worth > most) {
                best = Some((worth, frontier));
            }
        }
        best.map(|(_, frontier)| frontier)
    }

    /// Costs of the paths through known free space in the layer of `here`; `u32::MAX` where there is none.
    fn reachable(&self, map: &ObstacleMap, here: Cell, start: usize) -> Vec<u32> {
        let mut cost = vec![u32::MAX; self.factors.len()];
        cost[start] = 0;
        let mut queue = BinaryHeap::from([Reverse((0, start))]);
        while let Some(Reverse((through, index))) = queue.pop() {
            let Some(cell) = map.cell(index).filter(|_| through == cost[index]) else { continue };
            for (east, north, length) in MOVES {
                let next = beside(cell, east, north);
                let Some(to) = map.index(next).filter(|_| next.up == here.up) else { continue };
                if self.factors[to] < BLOCKED && map.known(next) == CellState::Free && through + length < cost[to] {
                    cost[to] = through + length;
                    queue.push(Reverse((through + length, to)));
                }
            }
        }
        cost
    }
}

/// The cells of a frontier that are connected with `first`, which are marked in `grouped`.
fn group(map: &ObstacleMap, edge: &[bool], grouped: &mut [bool], first: usize) -> Vec<usize> {
    if core::mem::replace(&mut grouped[first], true) {
        return Vec::new();
    }
    let (mut cells, mut next) = (vec![first], 0);
    while let Some(&index) = cells.get(next) {
        next += 1;
        let Some(cell) = map.cell(index) else { continue };
        for (east, north, _) in MOVES {
            if let Some(to) = map.index(beside(cell, east, north)).filter(|&to| edge[to] && !grouped[to]) {
                grouped[to] = true;
                cells.push(to);
            }
        }
    }
    cells
}

/// The frontier made of these cells: its position is that of the cell nearest to their middle.
fn of_cells(map: &ObstacleMap, cells: &[usize], cost: &[u32], up: f64) -> Option<Frontier> {
    let places: Vec<(usize, EnuPosition)> = cells.iter().filter_map(|&i| Some((i, map.cell(i)?.middle()))).collect();
    let count = places.len() as f64;
    let sum = |of: fn(&EnuPosition) -> f64| places.iter().map(|(_, place)| of(place)).sum::<f64>() / count;
    let middle = EnuPosition { east: sum(|p| p.east), north: sum(|p| p.north), up };
    let near = |place: &EnuPosition| place.horizontal_distance(middle);
    let (index, place) = places.iter().min_by(|a, b| near(&a.1).total_cmp(&near(&b.1)))?;
    let path = f64::from(cost[*index]) * CELL / f64::from(STRAIGHT);
    Some(Frontier { position: EnuPosition { up, ..*place }, width: count * CELL, path })
}

fn beside(cell: Cell, east: i32, north: i32) -> Cell {
    Cell { east: cell.east + east, north: cell.north + north, ..cell }
}

//! The local planner: from the obstacle map and a goal to the next place to fly to, the heading and the speed
//! (`docs/explanation/between-answers.md`).
//!
//! The path is the cheapest in the map's grid: cells near obstacles cost more, vertical moves cost half as much again,
//! and cells in which the body would touch something cost twenty times as much, so that an unreachable goal is
//! approached along the path that leads nearest to it and not along the straight line. Unknown cells count as free for
//! the path and as blocked for the speed. The craft faces its target as long as its camera shows the path as well, else it
//! turns towards the path as far as it must, and it never flies into space that no frame has shown within 3 s: it turns
//! first. Of paths of nearly equal cost it keeps the one of the last plan.
//!
//! Search and costs are integers, so that a plan is the same on every machine.

mod clearance;
mod search;
mod stuck;

use self::clearance::Clearance;
use self::search::Search;
pub use self::stuck::{Escape, Progress, escape};
use crate::obstacle_map::{CELL, CELLS, Cell, Line, ObstacleMap, SIZE};
use spf_core::geometry::{EnuPosition, wrap_angle};
use spf_core::time::Time;

/// Cost factors in quarters of that of free space.
const OPEN: u16 = 4;
/// Maximum cost of nearness.
const NEAR: u16 = 12;
/// Where the body would touch an obstacle, or leave the altitude limits.
const BLOCKED: u16 = 80;
/// Inside an obstacle.
const SOLID: u16 = 240;
/// Obstacles within this distance of the goal, metres, plus one standard deviation of its place, are the target itself.
const TARGET: f64 = 1.0;
/// Maximum size of the target, metres around the goal.
const TARGET_MOST: f64 = 2.0;
/// A goal outside the grid is approached to within this distance of the point where the path leaves the grid, metres.
const OUTSIDE: f64 = 2.0;
/// Distance ahead up to which free space is checked, metres.
const SPEED_SIGHT: f64 = 8.0;
/// Where only frames have shown that space is free, the craft must be able to stop within this distance, metres.
const CAREFUL: f64 = 0.7;
/// Added to the cost factor of cells that are not near the path of the last plan, whose goal was no farther away than
/// this, metres: obstacles that come and go must not make the craft change sides.
const OTHER: u16 = 1;
const SAME_GOAL: f64 = 2.0;
/// A cell and those beside it.
const NEIGHBOURS: [(i32, i32, i32); 11] = [
    (0, 0, 0),
    (1, 0, 0),
    (-1, 0, 0),
    (0, 1, 0),
    (0, -1, 0),
    (1, 1, 0),
    (1, -1, 0),
    (-1, 1, 0),
    (-1, -1, 0),
    (0, 0, 1),
    (0, 0, -1),
];
/// The next part of a path stays this far inside the camera's field of view, radians: 10°.
const VIEW_EDGE: f64 = 10.0 / 180.0 * core::f64::consts::PI;
/// Length of the next part of a path that a frame must have shown before it is flown, metres.
const SHOWN: f64 = 1.0;

/// Margins of the planner, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlannerSettings {
    /// Horizontal clearance around the body.
    pub margin: f64,
    /// Clearance above and below the body.
    pub vertical_margin: f64,
    /// Distance beyond the margin up to which nearness adds cost.
    pub near: f64,
    /// Maximum distance of the next place to fly to along the path.
    pub look_ahead: f64,
}

impl Default for PlannerSettings {
    fn default() -> Self {
        Self { margin: 0.3, vertical_margin: 0.15, near: 0.75, look_ahead: 4.0 }
    }
}

/// The state of the craft, as used by the planner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Body {
    /// Radius, metres.
    pub radius: f64,
    /// Standard deviation of the position relative to the map's contents, metres.
    pub position_sigma: f64,
    /// Deceleration used for planning, m/s².
    pub braking: f64,
    /// Time until it brakes, s.
    pub delay: f64,
    /// Preset speed, m/s.
    pub cruise_speed: f64,
    /// Lowest and highest world altitude to plan at, metres.
    pub altitudes: (f64, f64),
    /// Half of the camera's horizontal and vertical field of view, radians.
    pub half_view: (f64, f64),
}

impl Body {
    /// Maximum speed from which the body stops within `room` metres, m/s: `v·delay + v²/2a = room`.
    #[must_use]
    pub fn speed_within(&self, room: f64) -> f64 {
        if room.is_nan() || room <= 0.0 {
            return 0.0;
        }
        let a = self.braking.max(0.01);
        let speed = 2.0 * room / (self.delay + libm::sqrt(self.delay * self.delay + 2.0 * room / a));
        speed.min(self.cruise_speed)
    }
}

/// Where to fly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Destination {
    /// The target's most likely place.
    pub position: EnuPosition,
    /// Distance from it at which the craft has arrived, metres.
    pub stop: f64,
    /// Obstacles this near to it are the target itself, metres; 0 for a place in free space.
    pub target_radius: f64,
    /// Where to look, radians clockwise from north; `None` to look at the place itself, whose direction means nothing to a
    /// craft that is nearly there.
    pub heading: Option<f64>,
}

impl Destination {
    /// A target whose place is known with a standard deviation of `sigma` metres.
    #[must_use]
    pub fn target(position: EnuPosition, stop: f64, sigma: f64) -> Self {
        Self { position, stop, target_radius: (TARGET + sigma).min(TARGET_MOST), heading: None }
    }

    /// A place in free space, to be reached to within `stop` metres.
    #[must_use]
    pub fn place(position: EnuPosition, stop: f64) -> Self {
        Self { position, stop, target_radius: 0.0, heading: None }
    }
}

/// What a plan leads to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Reach {
    /// The craft has arrived.
    Arrived,
    /// The goal.
    Goal,
    /// The edge of the grid on the path to it.
    Edge,
    /// The nearest reachable place along a path: beyond it there is an obstacle.
    Blocked {
        /// Where.
        at: Cell,
        /// The obstacle's name, if a box has given one.
        by: Option<String>,
    },
}

/// The next motion.
#[derive(Clone, Debug, PartialEq)]
pub struct Guide {
    /// The place to fly to in a straight line.
    pub waypoint: EnuPosition,
    /// The heading there, radians clockwise from north.
    pub heading: f64,
    /// Maximum speed, m/s; zero to hold.
    pub speed: f64,
    /// True if the path there has not been seen: first turn to the heading on the spot.
    pub turn_first: bool,
    /// What the path leads to.
    pub reach: Reach,
    /// Cost of the path to the goal, including blocked cells, as metres of free space; beyond the grid, of the straight line.
    pub remaining: f64,
    /// The cells of the path, from the craft on.
    pub path: Vec<Cell>,
}

/// Plans paths; reuses its memory from one plan to the next.
#[derive(Clone, Debug, Default)]
pub struct Planner {
    settings: PlannerSettings,
    flags: Vec<bool>,
    clearance: Clearance,
    factors: Vec<u16>,
    search: Search,
    /// The path of the last plan, and its goal.
    last: Option<(EnuPosition, Vec<Cell>)>,
    /// Cells near that path.
    kept: Vec<bool>,
}

impl Planner {
    /// A planner with these margins.
    #[must_use]
    pub fn new(settings: PlannerSettings) -> Self {
        Self { settings, ..Self::default() }
    }

    /// Plans from `at`, heading `heading`, to a destination. `None` if `at` is outside the map.
    pub fn plan(
        &mut self,
        map: &ObstacleMap,
        now: Time,
        at: EnuPosition,
        heading: f64,
        body: &Body,
        goal: &Destination,
    ) -> Option<Guide> {
        let here = Cell::of(at);
        let start = map.index(here)?;
        let corner = map.corner()?;
        self.weigh(map, body, goal);
        self.weigh_other_paths(map, goal.position);

        let (place, stop) = within_grid(corner, at, goal);
        let outside = place != goal.position;
        let towards = match goal.heading {
            Some(heading) => heading,
            None if horizontal(at, goal.position) > CELL => at.bearing_to(goal.position),
            None => heading,
        };
        let end = Cell::of(place);
        let local = [end.east - corner.east, end.north - corner.north, end.up - corner.up];
        let (indices, cost) = self.search.path(&self.factors, start, local, libm::floor(stop / CELL) as i32)?;
        let cost = cost - self.cost_of_others(&indices);
        if !outside && (indices.len() == 1 || at.distance(goal.position) <= goal.stop) {
            let (waypoint, reach, path) = (at, Reach::Arrived, vec![here]);
            return Some(Guide { waypoint, heading: towards, speed: 0.0, turn_first: false, reach, remaining: 0.0, path });
        }

        // Where the craft stands too near to an obstacle, the path out is part of the path.
        let out = indices.iter().position(|&i| self.factors[i as usize] < BLOCKED).unwrap_or(indices.len());
        let blocked = (1..indices.len()).find(|&k| {
            let factor = self.factors[indices[k] as usize];
            factor >= SOLID || (factor >= BLOCKED && (k > out || out == indices.len()))
        });
        let usable = &indices[..blocked.unwrap_or(indices.len())];
        let path: Vec<Cell> = usable.iter().filter_map(|&i| map.cell(i as usize)).collect();
        let reach = match blocked.and_then(|k| map.cell(indices[k] as usize)) {
            Some(at) => Reach::Blocked { at, by: name(map, here, end, &indices[blocked.unwrap_or(0)..]) },
            None if outside => Reach::Edge,
            None => Reach::Goal,
        };

        let waypoint = if self.is_open(map, here, end) {
            // The order of a path's level and vertical moves is arbitrary; through open space the craft flies straight.
            at.towards(place, (self.settings.look_ahead / at.distance(place).max(1e-6)).min(1.0))
        } else {
            match self.look_ahead(map, here, &path, out) {
                ahead if ahead == here => at,
                ahead => ahead.middle(),
            }
        };
        let waypoint = if waypoint == at { at } else { self.within_view(map, here, at, waypoint, body.half_view.1) };
        let way = at.distance(waypoint);
        let heading =
            if horizontal(at, waypoint) > CELL { facing(at.bearing_to(waypoint), towards, body.half_view.0) } else { towards };
        let (shown, free) = if way > 0.0 { self.open_way(map, now, at, waypoint) } else { (0.0, 0.0) };
        let turn_first = way > 0.0 && shown < way.min(SHOWN);
        let room = |length: f64| length - body.radius - self.settings.margin;
        // Space that a frame has shown, and in which no obstacle is known, is entered slowly even if no source has
        // reported it as free: a depth sensor gets no return from open space, and no reply arrives while the craft
        // flies around an obstacle.
        let careful = body.speed_within(room(shown).min(CAREFUL));
        let speed = if turn_first || way == 0.0 { 0.0 } else { body.speed_within(room(free)).max(careful) };
        // Of a goal outside, the straight rest counts too: the grid moves with the craft, and the path to its edge does not
        // get shorter.
        let beyond = if outside { place.distance(goal.position) } else { 0.0 };
        let remaining = f64::from(cost) * CELL / f64::from(10 * OPEN) + beyond;
        self.last = Some((goal.position, path.clone()));
        Some(Guide { waypoint, heading, speed, turn_first, reach, remaining, path })
    }

    /// Cost factors of all cells.
    fn weigh(&mut self, map: &ObstacleMap, body: &Body, goal: &Destination) {
        let settings = self.settings;
        map.flags(&mut self.flags);
        self.factors.clear();
        self.factors.extend(self.flags.iter().map(|&solid| if solid { SOLID } else { OPEN }));
        // The target itself needs no clearance.
        if goal.target_radius > 0.0 {
            self.each_around(map, goal.position, goal.target_radius, |flags, index| flags[index] = false);
        }
        let around = body.radius + settings.margin + 2.0 * body.position_sigma;
        let above = body.radius + settings.vertical_margin + 2.0 * body.position_sigma;
        self.clearance.measure(&self.flags, clearance::weight(around, above));
        let table = factors(around, settings.near);
        for (factor, &squared) in self.factors.iter_mut().zip(self.clearance.squared()) {
            *factor = (*factor).max(table[usize::from(squared)]);
        }
        let Some(corner) = map.corner() else { return };
        let (low, high) = body.altitudes;
        for (z, layer) in self.factors.chunks_mut(SIZE[0] * SIZE[1]).enumerate() {
            let middle = Cell { up: corner.up + z as i32, ..corner }.middle().up;
            if middle < low || middle > high {
                layer.iter_mut().for_each(|factor| *factor = (*factor).max(BLOCKED));
            }
        }
    }

    /// Adds a little to the cost of all cells that are not near the path of the last plan to the same goal.
    fn weigh_other_paths(&mut self, map: &ObstacleMap, goal: EnuPosition) {
        self.kept.clear();
        let Some((_, path)) = self.last.as_ref().filter(|(last, path)| last.distance(goal) <= SAME_GOAL && path.len() > 1) else {
            return;
        };
        self.kept.resize(CELLS, false);
        for cell in path {
            for (east, north, up) in NEIGHBOURS {
                let near = Cell { east: cell.east + east, north: cell.north + north, up: cell.up + up };
                if let Some(index) = map.index(near) {
                    self.kept[index] = true;
                }
            }
        }
        for (factor, kept) in self.factors.iter_mut().zip(&self.kept) {
            *factor += if *kept || *factor >= BLOCKED - OTHER { 0 } else { OTHER };
        }
    }

    /// What a path has cost because it is not the last one.
    fn cost_of_others(&self, path: &[u32]) -> u32 {
        if self.kept.is_empty() {
            return 0;
        }
        let other = |index: u32| !self.kept[index as usize] && self.factors[index as usize] < BLOCKED;
        path.windows(2).filter(|pair| other(pair[1])).map(|pair| u32::from(OTHER) * Search::length(pair[0], pair[1])).sum()
    }

    fn each_around(&mut self, map: &ObstacleMap, middle: EnuPosition, radius: f64, mut act: impl FnMut(&mut [bool], usize)) {
        let reach = libm::ceil(radius / CELL) as i32;
        let centre = Cell::of(middle);
        for up in centre.up - reach..=centre.up + reach {
            for north in centre.north - reach..=centre.north + reach {
                for east in centre.east - reach..=centre.east + reach {
                    let cell = Cell { east, north, up };
                    if let Some(index) = map.index(cell).filter(|_| cell.middle().distance(middle) <= radius) {
                        act(&mut self.flags, index);
                    }
                }
            }
        }
    }

    /// The farthest cell of the path within the look-ahead to which the straight line is not blocked. While the craft
    /// is leaving a place too near to an obstacle, the next cell of the path.
    fn look_ahead(&self, map: &ObstacleMap, here: Cell, path: &[Cell], out: usize) -> Cell {
        let (Some(&first), Some(&last)) = (path.get(1), path.last()) else { return here };
        if out > 0 {
            return path.get(out).copied().unwrap_or(last);
        }
        let most = libm::floor(self.settings.look_ahead / CELL) as i64;
        let within = |cell: &Cell| {
            let d = [cell.east - here.east, cell.north - here.north, cell.up - here.up].map(i64::from);
            d[0] * d[0] + d[1] * d[1] + d[2] * d[2] <= most * most
        };
        let clear =
            |cell: &Cell| Line::new(here, *cell).all(|cell| map.index(cell).is_some_and(|index| self.factors[index] < BLOCKED));
        path.iter().rev().filter(|cell| within(cell)).find(|cell| clear(cell)).copied().unwrap_or(first)
    }

    /// Whether the straight line between two cells keeps its distance from every obstacle.
    fn is_open(&self, map: &ObstacleMap, here: Cell, end: Cell) -> bool {
        let open = |cell: Cell| map.index(cell).is_some_and(|index| self.factors[index] <= OPEN + OTHER);
        Line::new(here, end).all(open)
    }

    /// A waypoint that is steeper above or below the craft than its camera shows is approached on the steepest line that the
    /// camera does show, if that is not blocked.
    fn within_view(&self, map: &ObstacleMap, here: Cell, at: EnuPosition, waypoint: EnuPosition, half_view: f64) -> EnuPosition {
        let most = horizontal(at, waypoint) * libm::tan((half_view - VIEW_EDGE).max(0.0));
        let climb = waypoint.up - at.up;
        if horizontal(at, waypoint) < 2.0 * CELL || climb.abs() <= most {
            return waypoint;
        }
        let shallow = EnuPosition { up: at.up + most.copysign(climb), ..waypoint };
        let is_clear = |cell| map.index(cell).is_some_and(|index| self.factors[index] < BLOCKED);
        if Line::new(here, Cell::of(shallow)).all(is_clear) { shallow } else { waypoint }
    }

    /// How much of the path from `at` through `waypoint` frames have shown without a known obstacle, at most 2 m or to
    /// the waypoint, and how much of it is free, metres.
    fn open_way(&self, map: &ObstacleMap, now: Time, at: EnuPosition, waypoint: EnuPosition) -> (f64, f64) {
        let way = at.distance(waypoint);
        let step = 0.5 * CELL;
        let most = way.max(2.0 * SHOWN);
        let (mut shown, mut free) = (None, None);
        let count = libm::floor(SPEED_SIGHT / step) as u32;
        for k in 1..=count {
            let along = f64::from(k) * step;
            let place = at.towards(waypoint, along / way);
            let open = map.index(Cell::of(place)).is_some_and(|index| self.factors[index] < SOLID);
            if shown.is_none() && along <= most && !(open && map.is_seen(now, place)) {
                shown = Some(along - step);
            }
            if free.is_none() && !(open && map.is_free(now, place)) {
                free = Some(along - step);
            }
            if free.is_some() && (shown.is_some() || along > most) {
                break;
            }
        }
        (shown.unwrap_or(most), free.unwrap_or(SPEED_SIGHT))
    }
}

/// The name of the obstacle on the rest of the path, else on the straight line.
fn name(map: &ObstacleMap, here: Cell, end: Cell, rest: &[u32]) -> Option<String> {
    let path = rest.iter().filter_map(|&index| map.cell(index as usize));
    path.chain(Line::new(here, end)).find_map(|cell| map.name_at(cell.middle())).map(ToOwned::to_owned)
}

/// Cost factors by the squared distance to the nearest obstacle in cells.
fn factors(around: f64, near: f64) -> [u16; 256] {
    core::array::from_fn(|squared| {
        let distance = CELL * libm::sqrt(squared as f64);
        if distance < around {
            return BLOCKED;
        }
        let nearness = 1.0 - (distance - around) / near.max(CELL);
        OPEN + libm::floor(nearness.max(0.0) * f64::from(NEAR - OPEN)) as u16
    })
}

/// The goal, or the point where the straight path to it leaves the grid; and the distance at which it counts as
/// reached.
fn within_grid(corner: Cell, at: EnuPosition, goal: &Destination) -> (EnuPosition, f64) {
    let (a, b) = ([at.east, at.north, at.up], [goal.position.east, goal.position.north, goal.position.up]);
    let low = [corner.east, corner.north, corner.up].map(|i| (f64::from(i) + 1.0) * CELL);
    let mut fraction = 1.0_f64;
    for i in 0..3 {
        let high = low[i] + (SIZE[i] as f64 - 2.0) * CELL;
        if b[i] > high {
            fraction = fraction.min(((high - a[i]) / (b[i] - a[i])).max(0.0));
        } else if b[i] < low[i] {
            fraction = fraction.min(((low[i] - a[i]) / (b[i] - a[i])).max(0.0));
        }
    }
    if fraction < 1.0 { (at.towards(goal.position, fraction), OUTSIDE) } else { (goal.position, goal.stop) }
}

/// The heading nearest to `target` that keeps a path in the direction `path` in view.
fn facing(path: f64, target: f64, half_view: f64) -> f64 {
    let most = (half_view - VIEW_EDGE).max(0.0);
    let off = wrap_angle(target - path);
    wrap_angle(path + off.clamp(-most, most))
}

fn horizontal(a: EnuPosition, b: EnuPosition) -> f64 {
    a.horizontal_distance(b)
}

#[cfg(test)]
mod tests;

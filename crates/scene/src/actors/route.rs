//! A path prepared for motion: rounded corners, length, ground height, speed limits in bends.

use glam::DVec2;
use spf_core::geometry::EnuPosition;

use super::{Motion, PathEnd};
use crate::collide::Collider;

/// Maximum spacing of knots on straight segments, metres; the ground height is sampled at each.
const SPACING: f64 = 0.5;
/// Maximum angle between knots on an arc, radians.
const ARC_STEP: f64 = 0.17;
/// Sharper corners than this are not rounded, radians (150°).
const SHARPEST: f64 = 2.618;
/// Maximum rise of the ground from one knot to the next, metres.
const STEP_UP: f64 = 0.6;
/// The ground is searched from this height above the first corner, metres.
const HEAD: f64 = 1.0;

/// A measured path.
#[derive(Clone, Debug)]
pub(crate) struct Route {
    /// In order; for a closed path the first one is repeated at the end.
    knots: Vec<Knot>,
    closed: bool,
}

#[derive(Clone, Copy, Debug)]
struct Knot {
    at: DVec2,
    up: f64,
    /// Metres from the first knot.
    along: f64,
    /// Unit vector, the mean of the segments before and after.
    direction: DVec2,
    /// Maximum speed there, in both directions, m/s.
    limit: [f64; 2],
}

/// A point of a route.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spot {
    pub(crate) at: DVec2,
    pub(crate) up: f64,
    /// Unit vector towards the route's end.
    pub(crate) direction: DVec2,
}

impl Spot {
    /// Unit vector to the right of the direction.
    pub(crate) fn right(&self) -> DVec2 {
        DVec2::new(self.direction.y, -self.direction.x)
    }
}

impl Route {
    /// Measures a path. `lateral` and `braking`, m/s², determine the speed in bends and before them.
    pub(crate) fn new(motion: &Motion, lateral: f64, braking: f64, ground: Option<&Collider>) -> Self {
        let closed = motion.round == PathEnd::Circle;
        let heights = motion.heights.clone().unwrap_or_else(|| vec![0.0; motion.path.len()]);
        let corners: Vec<Corner> =
            motion.path.iter().zip(heights).map(|(&[east, north], up)| Corner { at: DVec2::new(east, north), up }).collect();
        let mut route = Self { knots: measured(&rounded(&corners, closed, motion.turn_radius), closed), closed };
        if let (Some(ground), None) = (ground, &motion.heights) {
            route.settle(ground);
        }
        route.limit_speed(motion.speed, lateral, braking);
        route
    }

    /// Metres from one end to the other, or around the loop.
    pub(crate) fn length(&self) -> f64 {
        self.knots.last().map_or(0.0, |knot| knot.along)
    }

    /// Its points, in order.
    pub(crate) fn points(&self) -> Vec<DVec2> {
        self.knots.iter().map(|knot| knot.at).collect()
    }

    /// Whether it is closed.
    pub(crate) fn closed(&self) -> bool {
        self.closed
    }

    /// The point `along` metres from the start. A closed route wraps around; an open one is extended straight beyond
    /// its ends.
    pub(crate) fn at(&self, along: f64) -> Spot {
        let along = self.wrapped(along);
        let [before, after] = self.around(along);
        let length = after.along - before.along;
        let fraction = if length > 0.0 { (along - before.along) / length } else { 0.0 };
        let within = fraction.clamp(0.0, 1.0);
        let direction = before.direction.lerp(after.direction, within).normalize_or(before.direction);
        let up = before.up + (after.up - before.up) * within;
        Spot { at: before.at.lerp(after.at, fraction), up, direction }
    }

    /// Maximum speed at a point, m/s.
    pub(crate) fn speed_limit(&self, along: f64, back: bool) -> f64 {
        let side = usize::from(back);
        let [before, after] = self.around(self.wrapped(along));
        before.limit[side].min(after.limit[side])
    }

    /// `along` reduced to one lap.
    pub(crate) fn wrapped(&self, along: f64) -> f64 {
        if !self.closed || (0.0..=self.length()).contains(&along) {
            return along;
        }
        along - libm::floor(along / self.length()) * self.length()
    }

    fn around(&self, along: f64) -> [&Knot; 2] {
        let after = self.knots.partition_point(|knot| knot.along <= along).clamp(1, self.knots.len() - 1);
        [&self.knots[after - 1], &self.knots[after]]
    }

    fn settle(&mut self, ground: &Collider) {
        let mut from = self.knots.first().map_or(0.0, |knot| knot.up) + HEAD;
        for knot in &mut self.knots {
            let above = EnuPosition { east: knot.at.x, north: knot.at.y, up: from };
            knot.up = ground.ground_below(above).map_or(from - STEP_UP, |ground| ground.up);
            from = knot.up + STEP_UP;
        }
    }

    fn limit_speed(&mut self, cruise: f64, lateral: f64, braking: f64) {
        let knots = &mut self.knots;
        let last = knots.len() - 1;
        for i in 0..=last {
            let before = if i > 0 { Some(i - 1) } else { self.closed.then(|| last - 1) };
            let after = if i < last { Some(i + 1) } else { self.closed.then_some(1) };
            let (Some(before), Some(after)) = (before, after) else {
                knots[i].limit = [cruise; 2];
                continue;
            };
            let (a, b, c) = (knots[before].at, knots[i].at, knots[after].at);
            let turn = libm::fabs((b - a).angle_to(c - b));
            let bend = 2.0 * turn / ((b - a).length() + (c - b).length()).max(1e-6);
            let greatest = if bend > 1e-6 { libm::sqrt(lateral / bend) } else { cruise };
            knots[i].limit = [greatest.max(0.2).min(cruise); 2];
        }
        // Slow enough before each bend to brake in time; two passes, for a bend at the start of a closed route.
        let slowed = |next: f64, gap: f64| libm::sqrt(next * next + 2.0 * braking * gap);
        for _ in 0..2 {
            for i in (0..last).rev() {
                let gap = knots[i + 1].along - knots[i].along;
                knots[i].limit[0] = knots[i].limit[0].min(slowed(knots[i + 1].limit[0], gap));
            }
            for i in 1..=last {
                let gap = knots[i].along - knots[i - 1].along;
                knots[i].limit[1] = knots[i].limit[1].min(slowed(knots[i - 1].limit[1], gap));
            }
            if self.closed {
                knots[last].limit[0] = knots[0].limit[0];
                knots[0].limit[1] = knots[last].limit[1];
            }
        }
    }
}

#[derive(Clone, Copy, Debug)]
struct Corner {
    at: DVec2,
    up: f64,
}

impl Corner {
    fn towards(self, other: Self, fraction: f64) -> Self {
        Self { at: self.at.lerp(other.at, fraction), up: self.up + (other.up - self.up) * fraction }
    }
}

/// The path with arcs instead of corners, and knots at sufficient density; a closed one ends on its first knot.
fn rounded(corners: &[Corner], closed: bool, radius: f64) -> Vec<Corner> {
    let n = corners.len();
    let mut turns: Vec<Corner> = Vec::new();
    for (i, &corner) in corners.iter().enumerate() {
        if !closed && (i == 0 || i == n - 1) {
            turns.push(corner);
        } else {
            turns.extend(arc(corners[(i + n - 1) % n], corner, corners[(i + 1) % n], radius));
        }
    }
    if closed {
        turns.push(turns[0]);
    }
    let mut knots = vec![turns[0]];
    for pair in turns.windows(2) {
        let pieces = (pair[0].at.distance(pair[1].at) / SPACING).ceil().max(1.0);
        knots.extend((1..=pieces as u32).map(|k| pair[0].towards(pair[1], f64::from(k) / pieces)));
    }
    knots
}

/// The arc that rounds a corner, tangent to both segments; of smaller radius where they are short.
fn arc(from: Corner, corner: Corner, to: Corner, radius: f64) -> Vec<Corner> {
    let (arriving, leaving) = (corner.at - from.at, to.at - corner.at);
    let (into, out) = (arriving.normalize_or_zero(), leaving.normalize_or_zero());
    let turn = libm::atan2(into.perp_dot(out), into.dot(out));
    // Straight on; or almost back, where an arc would begin far from its corner.
    if !(1e-3..SHARPEST).contains(&libm::fabs(turn)) {
        return vec![corner];
    }
    let half = libm::tan(0.5 * libm::fabs(turn));
    let reach = (radius * half).min(0.45 * arriving.length()).min(0.45 * leaving.length());
    let radius = reach / half;
    let begin = corner.at - into * reach;
    let side = if turn > 0.0 { DVec2::new(-into.y, into.x) } else { DVec2::new(into.y, -into.x) };
    let centre = begin + side * radius;
    // Segments that are not divided further: the bends of a route are those of its knots.
    let steps = (libm::fabs(turn) / ARC_STEP).max(libm::fabs(turn) * radius / SPACING).ceil().max(1.0) as u32;
    let fraction = reach / arriving.length();
    let (low, high) = (corner.towards(from, fraction).up, corner.towards(to, reach / leaving.length()).up);
    (0..=steps)
        .map(|k| {
            let fraction = f64::from(k) / f64::from(steps);
            let (sin, cos) = (libm::sin(turn * fraction), libm::cos(turn * fraction));
            let spoke = -side * radius;
            let turned = DVec2::new(spoke.x * cos - spoke.y * sin, spoke.x * sin + spoke.y * cos);
            Corner { at: centre + turned, up: low + (high - low) * fraction }
        })
        .collect()
}

/// Knots with their lengths and directions.
fn measured(points: &[Corner], closed: bool) -> Vec<Knot> {
    let last = points.len() - 1;
    let piece = |i: usize| (points[i + 1].at - points[i].at).normalize_or_zero();
    let mut along = 0.0;
    let knot = |(i, point): (usize, &Corner)| {
        if i > 0 {
            along += points[i - 1].at.distance(point.at);
        }
        let before = if i > 0 {
            piece(i - 1)
        } else if closed {
            piece(last - 1)
        } else {
            piece(0)
        };
        let after = if i < last {
            piece(i)
        } else if closed {
            piece(0)
        } else {
            piece(last - 1)
        };
        let direction = (before + after).normalize_or(after);
        Knot { at: point.at, up: point.up, along, direction, limit: [0.0; 2] }
    };
    points.iter().enumerate().map(knot).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::actors::Gait;

    fn motion(path: &[[f64; 2]], round: PathEnd, turn_radius: f64) -> Motion {
        Motion {
            gait: Gait::Drive,
            path: path.to_vec(),
            heights: None,
            round,
            speed: 10.0,
            wait: 0.0,
            start: 0.0,
            turn_radius,
            aside: 0.0,
        }
    }

    #[test]
    fn a_corner_is_an_arc_of_its_radius() {
        let route = Route::new(&motion(&[[0.0, 0.0], [0.0, 20.0], [20.0, 20.0]], PathEnd::Once, 4.0), 2.0, 2.0, None);
        // 16 m straight, a quarter circle of 4 m (polygonal: a little shorter), 16 m straight.
        assert!((route.length() - (32.0 + 2.0 * core::f64::consts::PI)).abs() < 0.01, "{}", route.length());
        let middle = route.at(0.5 * route.length());
        assert!((middle.at.distance(DVec2::new(4.0, 16.0)) - 4.0).abs() < 0.02);
        assert!((middle.direction - DVec2::new(0.5, 0.5).normalize()).length() < 0.01);
        // √(2 m/s² · 4 m) in the bend; 10 m/s where there is room to brake: 16 m of straight before the bend allow √(8 + 64).
        assert!((route.speed_limit(0.5 * route.length(), false) - libm::sqrt(8.0)).abs() < 0.1);
        assert!((route.speed_limit(0.0, false) - libm::sqrt(72.0)).abs() < 0.2);
        assert!((route.speed_limit(route.length(), false) - 10.0).abs() < 1e-9);
    }

    #[test]
    fn a_closed_route_goes_round() {
        let square = [[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]];
        let route = Route::new(&motion(&square, PathEnd::Circle, 1.0), 2.0, 2.0, None);
        let length = route.length();
        for along in [0.0, 3.7, 17.0, 39.0] {
            let (once, again) = (route.at(along), route.at(along + 3.0 * length));
            assert!(once.at.distance(again.at) < 1e-9 && (once.direction - again.direction).length() < 1e-9);
        }
        let seam = route.at(length - 1e-9).at.distance(route.at(0.0).at);
        assert!(seam < 1e-6, "{seam}");
    }
}

//! The obstacle map from above, in a corner of the video: what is known at the craft's height, the path, the target.

use spf_core::geometry::{BodyDisplacement, EnuPosition, Pose};
use spf_media::frame::Rgb;
use spf_media::marks::{Canvas, Colour, Point};
use spf_pilot::Pilot;
use spf_space::obstacle_map::{Cell, CellState, ObstacleMap};

/// Side of the image, pixels, and of the square that it shows, metres.
pub(super) const SIDE: u32 = 132;
const SHOWN: f64 = 16.0;
/// Cells this many layers above and below the craft count: 0.5 m.
const LAYERS: i32 = 2;

const UNKNOWN: [u8; 3] = [58, 62, 70];
const FREE: [u8; 3] = [206, 214, 222];
const OCCUPIED: [u8; 3] = [214, 84, 48];
const PATH: Colour = Colour::rgb(0, 110, 70);

/// The map around a craft, forward up; `None` without a map.
pub(super) fn draw(pilot: &Pilot, known: Pose) -> Option<Rgb> {
    let map = pilot.obstacle_map()?;
    let mut image = Rgb::new(SIDE, SIDE);
    for y in 0..SIDE {
        for x in 0..SIDE {
            let colour = match column(map, place(known, x, y)) {
                CellState::Occupied => OCCUPIED,
                CellState::Free => FREE,
                CellState::Unknown => UNKNOWN,
            };
            image.set_pixel(x, y, colour);
        }
    }
    let mut canvas = Canvas::new(&mut image);
    let path: Vec<EnuPosition> =
        pilot.guide().map_or_else(Vec::new, |guide| guide.path.iter().map(|cell| cell.middle()).collect());
    for ends in path.windows(2) {
        canvas.line(pixel(known, ends[0]), pixel(known, ends[1]), 2.5, PATH);
    }
    if let Some(target) = pilot.anchor() {
        let at = at_edge(pixel(known, target.position()));
        for (width, colour) in [(4.0, Colour::INK), (2.0, Colour::WAYPOINT)] {
            canvas.ring(at, 5.0, width, colour);
        }
    }
    let middle = f64::from(SIDE) / 2.0;
    let corner = |x: f64, y: f64| Point::new(middle + x, middle + y);
    canvas.triangle([corner(0.0, -9.0), corner(-6.5, 7.0), corner(6.5, 7.0)], Colour::INK);
    canvas.triangle([corner(0.0, -6.0), corner(-4.0, 5.0), corner(4.0, 5.0)], Colour::WHITE);
    Some(image)
}

/// What is known at a place, at about the craft's height.
fn column(map: &ObstacleMap, at: EnuPosition) -> CellState {
    let middle = Cell::of(at);
    let occupied = (-LAYERS..=LAYERS).any(|up| map.is_occupied(Cell { up: middle.up + up, ..middle }));
    if occupied { CellState::Occupied } else { map.known(middle) }
}

/// The place that a pixel shows, at the craft's height.
fn place(known: Pose, x: u32, y: u32) -> EnuPosition {
    let metres = |pixel: u32| (f64::from(pixel) + 0.5) * SHOWN / f64::from(SIDE) - 0.5 * SHOWN;
    known.position.displaced(BodyDisplacement { right: metres(x), forward: -metres(y), up: 0.0 }, known.attitude.heading)
}

/// Where a place is drawn.
fn pixel(known: Pose, at: EnuPosition) -> Point {
    let ahead = known.position.displacement_to(at, known.attitude.heading);
    let along = |metres: f64| (metres / SHOWN + 0.5) * f64::from(SIDE);
    Point::new(along(ahead.right), along(-ahead.forward))
}

/// A point outside the image is moved to its edge, in the same direction from the middle.
fn at_edge(at: Point) -> Point {
    let middle = f64::from(SIDE) / 2.0;
    let (x, y) = (at.x - middle, at.y - middle);
    let most = x.abs().max(y.abs());
    let shrink = ((middle - 6.0) / most.max(1e-9)).min(1.0);
    Point::new(middle + shrink * x, middle + shrink * y)
}

#[cfg(test)]
mod tests {
    use spf_core::geometry::Attitude;

    use super::*;

    #[test]
    fn a_place_is_drawn_where_its_pixel_shows_it() {
        let position = EnuPosition { east: 3.0, north: -2.0, up: 5.0 };
        let known = Pose { position, attitude: Attitude { heading: 1.2, ..Attitude::default() } };
        for (x, y) in [(0, 0), (10, 120), (66, 66), (131, 5)] {
            let back = pixel(known, place(known, x, y));
            assert!((back.x - f64::from(x) - 0.5).abs() < 1e-9 && (back.y - f64::from(y) - 0.5).abs() < 1e-9);
        }
    }

    #[test]
    fn a_target_outside_is_drawn_at_the_edge_in_its_direction() {
        let far = at_edge(Point::new(66.0, -500.0));
        assert_eq!((far.x, far.y), (66.0, 6.0));
        let near = at_edge(Point::new(70.0, 60.0));
        assert_eq!((near.x, near.y), (70.0, 60.0));
    }

    #[test]
    fn an_obstacle_above_counts_within_half_a_metre() {
        let mut map = ObstacleMap::new();
        let at = EnuPosition { east: 0.1, north: 0.1, up: 2.1 };
        map.advance(spf_core::time::Time::ZERO, at);
        map.mark(Cell::of(EnuPosition { up: 2.6, ..at }));
        assert_eq!(column(&map, at), CellState::Occupied);
        assert_eq!(column(&map, EnuPosition { up: 1.6, ..at }), CellState::Unknown);
    }
}

use proptest::prelude::*;

use super::*;
use spf_core::camera::Camera;
use spf_core::depth::{CameraAxes, DepthGrid, DepthSource};
use spf_core::geometry::{Attitude, Pose};
use spf_core::query::ImageBox;
use spf_core::reply::ObstacleBox;
use spf_core::rng::RandomStream;

fn at(east: f64, north: f64, up: f64) -> EnuPosition {
    EnuPosition { east, north, up }
}

fn cell(east: f64, north: f64, up: f64) -> Cell {
    Cell::of(at(east, north, up))
}

/// Level and facing north.
fn pose(east: f64, north: f64, up: f64) -> Pose {
    Pose { position: at(east, north, up), attitude: Attitude::default() }
}

fn camera() -> Camera {
    Camera::from_fov(160, 120, 90.0_f64.to_radians(), 73.7_f64.to_radians(), 0.0)
}

fn grid(cm: impl Fn(u32, u32) -> u16) -> DepthGrid {
    let camera = camera();
    let cm = (0..camera.height).flat_map(|y| (0..camera.width).map(move |x| (x, y))).map(|(x, y)| cm(x, y)).collect();
    DepthGrid { captured: Time::ZERO, counter: 0, camera, cm, source: DepthSource::Sensor }
}

fn map() -> ObstacleMap {
    let mut map = ObstacleMap::new();
    map.advance(Time::ZERO, at(0.1, 0.1, 3.1));
    map
}

/// By hand: 5.1 m north of 0.1 m is 5.2 m, the 21st cell.
#[test]
fn a_wall_ahead_is_occupied_the_way_to_it_free_and_what_lies_behind_unknown() {
    let mut map = map();
    map.depth(&grid(|_, _| 510), pose(0.1, 0.1, 3.1));
    assert_eq!(cell(0.1, 5.2, 3.1).north, 20);
    for east in [-4.0, 0.1, 4.0] {
        assert_eq!(map.known(cell(east, 5.2, 3.1)), CellState::Occupied, "{east}");
        assert_eq!(map.known(cell(east, 5.6, 3.1)), CellState::Unknown, "{east}");
    }
    assert_eq!(map.known(cell(0.1, 2.5, 3.1)), CellState::Free);
    assert_eq!(map.known(cell(4.0, 0.5, 3.1)), CellState::Unknown, "outside the field");
    assert!(map.occupied().all(|cell| cell.north == 20));
}

/// A wall that a network puts 5.1 m away may stand at half of that.
#[test]
fn an_estimated_depth_frees_the_nearer_half_of_the_way() {
    let mut map = map();
    let estimated = DepthGrid { source: DepthSource::Network, ..grid(|_, _| 510) };
    map.depth(&estimated, pose(0.1, 0.1, 3.1));
    assert_eq!(map.known(cell(0.1, 2.2, 3.1)), CellState::Free);
    assert_eq!(map.known(cell(0.1, 3.5, 3.1)), CellState::Unknown);
    assert_eq!(map.known(cell(0.1, 5.2, 3.1)), CellState::Occupied);
    // What is known beyond the half is not cleared by a later, farther estimate.
    map.depth(&DepthGrid { source: DepthSource::Network, ..grid(|_, _| 800) }, pose(0.1, 0.1, 3.1));
    assert_eq!(map.known(cell(0.1, 5.2, 3.1)), CellState::Occupied);
}

#[test]
fn a_hole_says_nothing_and_one_pixel_marks_a_wire_that_the_next_grids_clear() {
    let mut map = map();
    map.depth(&grid(|_, _| 0), pose(0.1, 0.1, 3.1));
    assert_eq!(map.known(cell(0.1, 2.0, 3.1)), CellState::Unknown);
    // Free so far, then one pixel of an obstacle: it is occupied at once.
    for _ in 0..5 {
        map.depth(&grid(|_, _| 800), pose(0.1, 0.1, 3.1));
    }
    assert_eq!(map.known(cell(0.1, 3.1, 3.1)), CellState::Free);
    map.depth(&grid(|x, y| if (x, y) == (80, 60) { 300 } else { 800 }), pose(0.1, 0.1, 3.1));
    assert_eq!(map.known(cell(0.1, 3.1, 3.1)), CellState::Occupied);
    map.depth(&grid(|_, _| 800), pose(0.1, 0.1, 3.1));
    assert_ne!(map.known(cell(0.1, 3.1, 3.1)), CellState::Occupied);
}

/// 35 tenths fade by one every half second, to less than 9 after 13.5 s; −4 by one a second, to unknown after 1 s.
#[test]
fn what_nothing_confirms_fades() {
    let mut map = map();
    map.mark(cell(2.0, 2.0, 3.0));
    map.ray(at(0.1, 0.1, 3.1), at(-3.0, 0.1, 3.1), false);
    let after = |map: &mut ObstacleMap, secs: f64| {
        map.advance(Time::from_secs_f64(secs), at(0.1, 0.1, 3.1));
        (map.known(cell(2.0, 2.0, 3.0)), map.known(cell(-2.0, 0.1, 3.1)))
    };
    assert_eq!(after(&mut map, 0.9), (CellState::Occupied, CellState::Free));
    assert_eq!(after(&mut map, 1.1), (CellState::Occupied, CellState::Unknown));
    assert_eq!(after(&mut map, 12.9), (CellState::Occupied, CellState::Unknown));
    assert_eq!(after(&mut map, 13.6), (CellState::Unknown, CellState::Unknown));
    // A silence of an hour does not take an hour.
    assert_eq!(after(&mut map, 3600.0), (CellState::Unknown, CellState::Unknown));
}

/// Label 4 begins at 10^(2.5/4.5) = 3.59 m; the box is 0.2 of 2 m/m wide: 1.44 m, and as deep.
#[test]
fn a_box_is_a_solid_as_deep_as_wide_and_has_a_name() {
    let mut map = map();
    let area = ImageBox { left: 0.4, top: 0.3, right: 0.6, bottom: 0.7 };
    let tree = ObstacleBox { area, depth: 4, name: "tree".to_owned() };
    map.solid(Time::ZERO, &camera(), pose(0.1, 0.1, 3.1), &tree, Mobility::Fixed);
    for (north, known) in
        [(3.4, CellState::Unknown), (3.8, CellState::Occupied), (5.0, CellState::Occupied), (5.6, CellState::Unknown)]
    {
        assert_eq!(map.known(cell(0.1, north, 3.1)), known, "{north}");
    }
    assert!(map.is_occupied(cell(0.6, 3.8, 3.1)) && !map.is_occupied(cell(1.6, 3.8, 3.1)));
    assert_eq!((map.name_at(at(0.1, 3.8, 3.1)), map.name_at(at(5.0, 3.8, 3.1))), (Some("tree"), None));
    assert!((ObstacleMap::free_up_to(&[tree]).unwrap() - 3.59).abs() < 0.01 && ObstacleMap::free_up_to(&[]).is_none());

    let walker = ObstacleBox { area: ImageBox { left: 0.1, right: 0.2, ..area }, depth: 4, name: "person".to_owned() };
    map.solid(Time::ZERO, &camera(), pose(0.1, 0.1, 3.1), &walker, Mobility::Moving);
    // Off the axis the label's range is 2.94 m along it.
    let there = cell(0.1 - 0.7 * 3.2, 0.1 + 3.2, 3.1);
    assert!(map.is_occupied(there));
    map.advance(Time::from_millis(3000), at(0.1, 0.1, 3.1));
    assert!(!map.is_occupied(there) && map.is_occupied(cell(0.1, 3.8, 3.1)));
}

#[test]
fn a_place_is_seen_for_3_s_by_a_frame_that_shows_it_and_by_no_other() {
    let mut map = map();
    let now = Time::from_millis(1000);
    map.frame(now, &camera(), pose(0.1, 0.1, 3.1));
    let seen = |map: &ObstacleMap, ms: u64, east, north, up| map.is_seen(Time::from_millis(ms), at(east, north, up));
    assert!(seen(&map, 1000, 0.0, 8.0, 3.0) && seen(&map, 4000, 0.0, 8.0, 3.0) && !seen(&map, 4001, 0.0, 8.0, 3.0));
    assert!(!seen(&map, 1000, 8.0, 0.0, 3.0) && !seen(&map, 1000, 0.0, -8.0, 3.0) && !seen(&map, 1000, 0.0, 2.0, 6.0));
    assert!(seen(&map, 1000, 0.1, -0.2, 3.1), "where the craft is");
    map.mark(cell(0.1, 4.0, 3.1));
    assert!(!seen(&map, 1000, 0.0, 8.0, 3.0), "behind something");
}

#[test]
fn a_reply_makes_its_view_free_for_5_s_up_to_a_range() {
    let mut map = map();
    let now = Time::from_millis(2000);
    map.implied_free(now, &camera(), pose(0.1, 0.1, 3.1), 6.0);
    let free = |map: &ObstacleMap, ms: u64, east, north| map.is_free(Time::from_millis(ms), at(east, north, 3.1));
    assert!(free(&map, 2000, 0.0, 5.0) && free(&map, 7000, 0.0, 5.0) && !free(&map, 7001, 0.0, 5.0));
    assert!(!free(&map, 2000, 0.0, 6.5) && !free(&map, 2000, 5.0, 1.0) && !free(&map, 2000, 0.0, -1.0));
    map.mark(cell(0.0, 5.0, 3.1));
    assert!(!free(&map, 2000, 0.0, 5.0), "what is known there counts more");
    map.implied_free(now, &camera(), pose(0.0, 0.0, 3.0), f64::NAN);
}

/// A beam 1.5 m above the craft and 0.6 m ahead.
#[test]
fn a_column_is_clear_only_without_anything_beside_it() {
    let mut map = map();
    map.mark(cell(0.1, 0.7, 4.5));
    let from = at(0.1, 0.1, 3.0);
    assert!(!map.is_column_clear(from, 2.0, 0.8), "on its way up");
    assert!(map.is_column_clear(from, 1.0, 0.8), "it ends below the beam");
    assert!(map.is_column_clear(from, 2.0, 0.4), "it passes beside the beam");
    assert!(map.is_column_clear(from, -2.0, 0.8), "the beam is above");
}

#[test]
fn an_invalid_grid_changes_nothing() {
    let mut map = map();
    let mut bad = grid(|_, _| 300);
    bad.cm.pop();
    map.depth(&bad, pose(0.1, 0.1, 3.1));
    assert_eq!((map.occupied().count(), map.changes()), (0, 0));
}

/// A digest of a map that all sources have filled from random poses: the same on every machine.
#[test]
fn the_map_is_the_same_bits_everywhere() {
    let mut map = ObstacleMap::new();
    let mut rng = RandomStream::new(5, "map", &[]);
    for step in 0..20 {
        let now = Time::from_millis(200 * step);
        let attitude = Attitude { heading: 6.0 * rng.uniform(), pitch: 0.2 * rng.normal(), roll: 0.2 * rng.normal() };
        let position = at(0.4 * step as f64, 2.0 * rng.uniform(), 3.0 + rng.uniform());
        let pose = Pose { position, attitude };
        map.advance(now, position);
        let depths: Vec<u16> = (0..160 * 120).map(|_| (100.0 + 900.0 * rng.uniform()) as u16).collect();
        map.depth(&grid(|x, y| depths[(y * 160 + x) as usize]), pose);
        let area = ImageBox { left: 0.3, top: 0.3, right: 0.4 + 0.2 * rng.uniform(), bottom: 0.6 };
        map.solid(now, &camera(), pose, &ObstacleBox { area, depth: 4, name: String::new() }, Mobility::Fixed);
    }
    let digest =
        map.odds.iter().fold(0xcbf2_9ce4_8422_2325_u64, |hash, &odds| (hash ^ odds as u8 as u64).wrapping_mul(0x100_0000_01b3));
    assert_eq!(digest, 5_094_422_119_065_412_032);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]
    /// The grid moves by whole cells: cells that stay inside are unchanged, new ones are unknown.
    #[test]
    fn the_grid_moves_and_the_world_does_not(
        marks in prop::collection::vec(prop::array::uniform3(-40..40_i32), 1..60),
        moves in prop::collection::vec(prop::array::uniform3(-6.0..6.0_f64), 1..6),
    ) {
        let mut map = ObstacleMap::new();
        map.advance(Time::ZERO, at(0.0, 0.0, 0.0));
        let mut marked: Vec<Cell> =
            marks.iter().map(|m| Cell { east: m[0], north: m[1], up: m[2] / 4 }).collect();
        marked.iter().for_each(|&cell| map.mark(cell));
        marked.retain(|&cell| map.index(cell).is_some());
        let mut position = at(0.0, 0.0, 0.0);
        for m in moves {
            position = at(position.east + m[0], position.north + m[1], position.up + 0.2 * m[2]);
            map.advance(Time::ZERO, position);
            prop_assert!(map.index(Cell::of(position)).is_some());
            // Cells that have left are forgotten, even if they return.
            marked.retain(|&cell| map.index(cell).is_some());
            let mut expected = marked.clone();
            expected.sort_by_key(|cell| (cell.up, cell.north, cell.east));
            expected.dedup();
            prop_assert_eq!(map.occupied().collect::<Vec<_>>(), expected);
        }
    }

    /// Whatever a grid contains, no cell in which a ray ends is free, and none beyond the nearest return is.
    #[test]
    fn no_depth_clears_what_it_has_hit(seed in 0..1000_u64, heading in -3.0..3.0_f64, pitch in -0.4..0.4_f64) {
        let mut rng = RandomStream::new(seed, "depths", &[]);
        let depths: Vec<u16> = (0..160 * 120).map(|_| if rng.chance(0.1) { 0 } else { (30.0 + 970.0 * rng.uniform()) as u16 }).collect();
        let grid = grid(|x, y| depths[(y * 160 + x) as usize]);
        let pose = Pose { position: at(0.1, 0.1, 3.1), attitude: Attitude { heading, pitch, roll: 0.1 } };
        let mut map = map();
        for _ in 0..3 {
            map.depth(&grid, pose);
        }
        let axes = CameraAxes::new(&grid.camera, pose);
        for (_, p) in grid.points() {
            let end = Cell::of(axes.place(p.right, p.forward, p.up));
            prop_assert!(map.index(end).is_none() || map.is_occupied(end));
        }
    }
}

/// The grid's box is shrunk by a micrometre for clipping: a return in that margin must not count as one beyond the grid.
#[test]
fn a_return_at_the_very_end_of_the_grid_is_an_obstacle() {
    let mut map = map();
    let top = map.corner().unwrap().up + SIZE[2] as i32;
    let end = f64::from(top) * CELL - 5e-7;
    let level = grid(|x, y| if (x, y) == (80, 0) { 300 } else { 0 });
    let ray = CameraAxes::new(&level.camera, pose(0.1, 0.1, 0.0));
    let (_, p) = level.points().next().unwrap();
    let up = end - ray.place(p.right, p.forward, p.up).up;
    let from = pose(0.1, 0.1, up);
    map.depth(&level, from);
    let at = CameraAxes::new(&level.camera, from).place(p.right, p.forward, p.up);
    assert!((at.up - end).abs() < 1e-7 && map.is_occupied(Cell::of(at)), "{at:?}");
}

/// What the operator has marked is occupied for the planner and for lines of sight, moves with no grid, and leaves nothing behind.
#[test]
fn cells_that_are_kept_out_of_are_laid_over_what_is_measured() {
    let mut map = map();
    let wall = [cell(0.1, 4.1, 3.1), cell(0.4, 4.1, 3.1), cell(90.0, 4.1, 3.1)];
    map.keep_out(wall);
    for _ in 0..30 {
        map.depth(&grid(|_, _| 800), pose(0.1, 0.1, 3.1));
    }
    let flags = |map: &ObstacleMap, cell| {
        let mut flags = Vec::new();
        map.flags(&mut flags);
        flags[map.index(cell).unwrap()]
    };
    assert!(map.is_occupied(wall[0]) && flags(&map, wall[1]) && !map.is_clear(at(0.1, 0.1, 3.1), at(0.1, 6.0, 3.1)));
    map.advance(Time::from_millis(30_000), at(88.0, 0.1, 3.1));
    assert_eq!(map.occupied().collect::<Vec<_>>(), wall[2..], "the grid has moved to the one far away");
    map.advance(Time::from_millis(30_100), at(0.1, 0.1, 3.1));
    map.depth(&grid(|_, _| 800), pose(0.1, 0.1, 3.1));
    map.keep_out([]);
    assert_eq!((map.known(wall[0]), flags(&map, wall[0])), (CellState::Free, false));
}

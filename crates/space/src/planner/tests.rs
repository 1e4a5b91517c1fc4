use proptest::prelude::*;

use super::*;
use spf_core::camera::Camera;
use spf_core::depth::{CameraAxes, DepthGrid, DepthSource};
use spf_core::geometry::{Attitude, Pose, wrap_angle};
use spf_core::query::ImageBox;
use spf_core::reply::ObstacleBox;
use spf_core::time::duration_from_secs;

fn at(east: f64, north: f64, up: f64) -> EnuPosition {
    EnuPosition { east, north, up }
}

fn body() -> Body {
    Body {
        radius: 0.3,
        position_sigma: 0.0,
        braking: 2.0,
        delay: 0.5,
        cruise_speed: 3.0,
        altitudes: (0.3, 20.0),
        half_view: (0.785, 0.643),
    }
}

fn to(east: f64, north: f64, up: f64) -> Destination {
    Destination::target(at(east, north, up), 1.0, 0.3)
}

/// A coarse depth camera, 90° wide.
fn camera() -> Camera {
    Camera::from_fov(64, 48, 90.0_f64.to_radians(), 73.7_f64.to_radians(), 0.0)
}

fn pose(position: EnuPosition, heading: f64) -> Pose {
    Pose { position, attitude: Attitude { heading, ..Attitude::default() } }
}

/// Solid boxes: minimum and maximum east, north and up.
#[derive(Clone, Debug)]
struct World(Vec<([f64; 3], [f64; 3])>);

impl World {
    /// The fraction of the path from `from` to `to` at which it intersects something; infinite if it does not.
    fn hit(&self, from: EnuPosition, to: EnuPosition) -> f64 {
        let (a, b) = ([from.east, from.north, from.up], [to.east, to.north, to.up]);
        let enters = |(low, high): &([f64; 3], [f64; 3])| {
            let (mut near, mut far) = (0.0_f64, f64::INFINITY);
            for i in 0..3 {
                let d = b[i] - a[i];
                if d.abs() < 1e-12 {
                    if a[i] < low[i] || a[i] > high[i] {
                        return f64::INFINITY;
                    }
                    continue;
                }
                let (p, q) = ((low[i] - a[i]) / d, (high[i] - a[i]) / d);
                (near, far) = (near.max(p.min(q)), far.min(p.max(q)));
            }
            if near <= far { near } else { f64::INFINITY }
        };
        self.0.iter().map(enters).fold(f64::INFINITY, f64::min)
    }

    /// Distance from the nearest solid.
    fn clearance(&self, p: EnuPosition) -> f64 {
        let x = [p.east, p.north, p.up];
        let distance = |(low, high): &([f64; 3], [f64; 3])| {
            let d = [0, 1, 2].map(|i| (low[i] - x[i]).max(x[i] - high[i]).max(0.0));
            (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt()
        };
        self.0.iter().map(distance).fold(f64::INFINITY, f64::min)
    }

    /// Measurements of a depth sensor with a range of 0.3 to 10 m.
    fn depth(&self, pose: Pose) -> DepthGrid {
        let camera = camera();
        let axes = CameraAxes::new(&camera, pose);
        let mut cm = Vec::new();
        for y in 0..camera.height {
            for x in 0..camera.width {
                let right = (f64::from(x) + 0.5 - camera.cx) / camera.fx;
                let up = (camera.cy - f64::from(y) - 0.5) / camera.fy;
                let depth = 100.0 * self.hit(pose.position, axes.place(right, 1.0, up));
                cm.push(if (30.0..=1000.0).contains(&depth) { depth as u16 } else { 0 });
            }
        }
        DepthGrid { captured: Time::ZERO, counter: 0, camera, cm, source: DepthSource::Sensor }
    }
}

/// A map around `position` in which the last frame looked along `heading`, and only what `world` shows is known.
fn seen(world: &World, position: EnuPosition, heading: f64) -> ObstacleMap {
    let mut map = ObstacleMap::new();
    map.advance(Time::ZERO, position);
    map.frame(Time::ZERO, &camera(), pose(position, heading));
    map.depth(&world.depth(pose(position, heading)), pose(position, heading));
    map
}

/// A floor 3 m below, and a wall 9 m ahead that makes everything in front of it known.
fn hall() -> World {
    World(vec![([-30.0, -30.0, -1.0], [30.0, 30.0, 0.0]), ([-30.0, 9.0, 0.0], [30.0, 10.0, 8.0])])
}

fn plan(map: &ObstacleMap, from: EnuPosition, heading: f64, goal: &Destination) -> Guide {
    Planner::default().plan(map, Time::ZERO, from, heading, &body(), goal).unwrap()
}

#[test]
fn through_open_space_the_craft_flies_straight() {
    let from = at(0.0, 0.0, 3.0);
    let goal = at(1.5, 6.0, 5.0);
    let guide = plan(&seen(&hall(), from, 0.0), from, 0.0, &Destination::place(goal, 0.3));
    assert!(guide.waypoint.distance(from.towards(goal, 4.0 / from.distance(goal))) < 1e-9, "{:?}", guide.waypoint);
    assert!(!guide.turn_first && guide.speed > 0.0);
}

#[test]
fn a_goal_steeper_than_the_camera_shows_is_approached_on_a_line_that_it_shows() {
    let from = at(0.0, 0.0, 3.0);
    let guide = plan(&seen(&hall(), from, 0.0), from, 0.0, &Destination::place(at(0.0, 3.0, 6.0), 0.3));
    let slope = (guide.waypoint.up - from.up) / guide.waypoint.north;
    assert!((slope - (0.643 - VIEW_EDGE).tan()).abs() < 1e-9, "{:?}", guide.waypoint);
    assert!(!guide.turn_first && guide.speed > 0.0);
}

#[test]
fn near_a_place_the_craft_keeps_the_heading_of_its_motion() {
    let from = at(0.0, 0.0, 3.0);
    let map = seen(&hall(), from, 0.0);
    let place = Destination::place(at(-0.2, 0.4, 3.0), 0.3);
    assert!((plan(&map, from, 0.0, &place).heading - wrap_angle(-0.2_f64.atan2(0.4))).abs() < 1e-9);
    let guide = plan(&map, from, 0.0, &Destination { heading: Some(0.1), ..place });
    assert!((guide.heading - 0.1).abs() < 1e-9, "{}", guide.heading);
}

/// By hand: 4 m ahead in the open; the wall 9 m ahead leaves 8 m of free space, 7.4 m without body and margin: 0.5·v +
/// v²/4 = 7.4 is 4.5 m/s, capped at 3 m/s.
#[test]
fn an_open_way_is_flown_straight_at_full_speed() {
    let from = at(0.1, 0.1, 3.1);
    let guide = plan(&seen(&hall(), from, 0.0), from, 0.0, &to(0.1, 7.0, 3.1));
    assert_eq!(guide.reach, Reach::Goal);
    assert!((guide.waypoint.north - 4.1).abs() <= CELL && (guide.waypoint.east - 0.1).abs() < CELL, "{:?}", guide.waypoint);
    assert!(guide.heading.abs() < 0.1 && !guide.turn_first && guide.speed == 3.0, "{guide:?}");
    assert!((guide.remaining - 5.9).abs() < 0.6, "{}", guide.remaining);
}

/// 2 m of free space less 0.6 m: 0.5·v + v²/4 = 1.4 is v = √(1 + 5.6) − 1 = 1.57 m/s.
#[test]
fn the_speed_stops_within_what_is_known_to_be_free() {
    let from = at(0.1, 0.1, 3.1);
    let mut map = ObstacleMap::new();
    map.advance(Time::ZERO, from);
    map.frame(Time::ZERO, &camera(), pose(from, 0.0));
    let goal = to(0.1, 7.0, 3.1);
    // A frame has shown it, but no source has reported it as free: 0.5·v + v²/4 = 0.7 is v = √(1 + 2.8) − 1.
    let blind = plan(&map, from, 0.0, &goal);
    assert!((blind.speed - 0.949).abs() < 1e-3 && !blind.turn_first, "{blind:?}");
    map.implied_free(Time::ZERO, &camera(), pose(from, 0.0), 2.0);
    let guide = plan(&map, from, 0.0, &goal);
    assert!((guide.speed - 1.57).abs() < 0.15, "{}", guide.speed);
    assert!((body().speed_within(1.4) - 1.569).abs() < 1e-3);
}

#[test]
fn nothing_is_flown_into_that_no_frame_has_shown() {
    let from = at(0.1, 0.1, 3.1);
    let guide = plan(&seen(&hall(), from, 0.0), from, 0.0, &to(0.1, -7.0, 3.1));
    assert!(guide.turn_first && guide.speed == 0.0);
    assert!(wrap_angle(guide.heading - core::f64::consts::PI).abs() < 0.3, "{}", guide.heading);
}

#[test]
fn a_pillar_is_gone_around_with_the_margin() {
    let mut world = hall();
    world.0.push(([-0.3, 3.0, 0.0], [0.3, 3.6, 8.0]));
    let from = at(0.1, 0.1, 3.1);
    let guide = plan(&seen(&world, from, 0.0), from, 0.0, &to(0.1, 7.0, 3.1));
    assert_eq!(guide.reach, Reach::Goal);
    for cell in &guide.path {
        assert!(world.clearance(cell.middle()) >= 0.45, "{cell:?}");
    }
    assert!(guide.waypoint.east.abs() > 0.4 && guide.speed > 0.5, "{guide:?}");
}

/// A wall across the grid with a gap of 1.5 m off to the right; the straight line is blocked by a named wall.
#[test]
fn what_blocks_every_way_is_named_and_approached_along_a_path() {
    let from = at(0.1, 0.1, 3.1);
    let mut map = ObstacleMap::new();
    map.advance(Time::ZERO, from);
    for east in -45..45 {
        for up in -20..40 {
            map.mark(Cell { east, north: 16, up });
        }
    }
    let wall = ObstacleBox { area: ImageBox { left: 0.3, top: 0.2, right: 0.7, bottom: 0.8 }, depth: 4, name: "wall".to_owned() };
    map.solid(Time::ZERO, &camera(), pose(from, 0.0), &wall, crate::obstacle_map::Mobility::Fixed);
    let guide = plan(&map, from, 0.0, &to(0.1, 8.0, 3.1));
    let Reach::Blocked { by, .. } = &guide.reach else { panic!("{:?}", guide.reach) };
    assert_eq!(by.as_deref(), Some("wall"));
    let end = guide.path.last().unwrap().middle();
    assert!(end.north < 3.6, "{end:?}");
    // A gap, 6 m to the right: the path goes there although it leads away from the goal at first.
    let mut open = ObstacleMap::new();
    open.advance(Time::ZERO, from);
    for east in (-45..45).filter(|east| !(24..32).contains(east)) {
        for up in -20..40 {
            open.mark(Cell { east, north: 16, up });
        }
    }
    let guide = plan(&open, from, 0.0, &to(0.1, 8.0, 3.1));
    assert_eq!(guide.reach, Reach::Goal);
    assert!(guide.path.iter().any(|cell| cell.north == 16 && (24..32).contains(&cell.east)));
}

#[test]
fn the_target_is_not_its_own_obstacle_and_is_never_entered() {
    let from = at(0.1, 0.1, 3.1);
    let mut world = hall();
    world.0.push(([-0.5, 5.0, 0.0], [0.5, 6.0, 8.0]));
    let map = seen(&world, from, 0.0);
    let guide = plan(&map, from, 0.0, &to(0.0, 5.0, 3.1));
    assert_eq!(guide.reach, Reach::Goal);
    assert!(guide.path.iter().all(|cell| !map.is_occupied(*cell)));
    // Behind another obstacle within the margin of the goal there is no path.
    assert!(guide.path.last().unwrap().middle().distance(at(0.0, 5.0, 3.1)) <= 1.25);
    let there = at(0.0, 4.2, 3.1);
    assert_eq!(plan(&map, there, 0.0, &to(0.0, 5.0, 3.1)).reach, Reach::Arrived);
}

#[test]
fn altitude_limits_are_walls_and_far_goals_lie_at_the_edge() {
    let from = at(0.1, 0.1, 3.1);
    let map = seen(&hall(), from, 0.0);
    let low = Body { altitudes: (2.0, 4.0), ..body() };
    let guide = Planner::default().plan(&map, Time::ZERO, from, 0.0, &low, &to(0.1, 7.0, 3.1)).unwrap();
    assert!(guide.path.iter().all(|cell| (2.0..=4.0).contains(&cell.middle().up)));
    let guide = plan(&map, from, 0.0, &to(60.0, 2.0, 3.1));
    assert_eq!(guide.reach, Reach::Edge);
    assert!((guide.path.last().unwrap().middle().east - 10.0).abs() < 2.6, "{:?}", guide.path.last());
    assert!(Planner::default().plan(&map, Time::ZERO, at(99.0, 0.0, 3.0), 0.0, &body(), &to(0.0, 0.0, 3.0)).is_none());
}

#[test]
fn no_progress_for_4_s_of_motion_is_stuck() {
    let mut progress = Progress::default();
    let secs = |s: f64| Time::from_secs_f64(s);
    assert!(!progress.is_stuck(secs(0.0), true, 10.0));
    assert!(!progress.is_stuck(secs(3.0), true, 9.8) && !progress.is_stuck(secs(3.5), true, 9.6), "0.4 m nearer");
    assert!(!progress.is_stuck(secs(6.0), true, 9.5) && !progress.is_stuck(secs(9.0), false, 9.5), "it did not move");
    assert!(!progress.is_stuck(secs(10.4), true, 9.4) && progress.is_stuck(secs(10.6), true, 9.4));
    assert!(!progress.is_stuck(secs(11.0), true, 9.4), "it starts over");
}

#[test]
fn a_stuck_craft_takes_the_side_seen_free_else_up_else_asks() {
    let from = at(0.1, 0.1, 3.1);
    // Open in front: the goal lies to the left of the view.
    let map = seen(&hall(), from, 0.0);
    let Escape::Side(side) = escape(&map, Time::ZERO, from, -0.8, &body()) else { panic!("no side") };
    assert!(side.north > 2.0, "{side:?}");
    // Nothing seen.
    let mut blind = ObstacleMap::new();
    blind.advance(Time::ZERO, from);
    assert_eq!(escape(&blind, Time::ZERO, from, 0.0, &body()), Escape::Ask);
    // Only the space above has been seen: the camera looks up.
    let up = Camera { tilt: -1.4, ..camera() };
    blind.frame(Time::ZERO, &up, pose(from, 0.0));
    blind.implied_free(Time::ZERO, &up, pose(from, 0.0), 3.0);
    let Escape::Up(above) = escape(&blind, Time::ZERO, from, 0.0, &body()) else { panic!("not up") };
    assert!((above.up - 4.85).abs() < 1e-9 && (above.north - 0.1).abs() < 1e-9);
}

/// The end of a flight through a world.
#[derive(Debug)]
struct Flown {
    arrived: bool,
    /// Minimum distance of the craft's middle from anything solid.
    clearance: f64,
}

/// A craft that follows the planner through `world`: depth and plans at 5 Hz, 95 °/s, 2 m/s², with no delay but the
/// planner's.
fn fly(world: &World, goal: &Destination, limit: f64) -> Flown {
    let (mut position, mut heading, mut speed) = (at(0.1, 0.1, 1.6), 0.0, 0.0_f64);
    let (mut map, mut planner) = (ObstacleMap::new(), Planner::default());
    let mut guide: Option<Guide> = None;
    let mut clearance = f64::INFINITY;
    let tick = 0.1;
    let mut now = Time::ZERO;
    for step in 0.. {
        let secs = f64::from(step) * tick;
        if secs > limit {
            break;
        }
        map.advance(now, position);
        map.frame(now, &camera(), pose(position, heading));
        if step % 2 == 0 {
            map.depth(&world.depth(pose(position, heading)), pose(position, heading));
            guide = planner.plan(&map, now, position, heading, &body(), goal);
        }
        let Some(guide) = &guide else { break };
        if guide.reach == Reach::Arrived {
            return Flown { arrived: true, clearance };
        }
        let turn = wrap_angle(guide.heading - heading);
        heading = wrap_angle(heading + turn.clamp(-0.166, 0.166));
        speed += (guide.speed - speed).clamp(-0.2, 0.2);
        let way = position.distance(guide.waypoint);
        if way > 1e-6 {
            position = position.towards(guide.waypoint, (speed * tick / way).min(1.0));
        }
        clearance = clearance.min(world.clearance(position));
        now += duration_from_secs(tick);
    }
    Flown { arrived: false, clearance }
}

/// A pocket 5 m deep and 6 m wide, open towards the craft, with the goal behind it.
#[test]
fn a_pocket_is_left() {
    let mut world = World(vec![([-30.0, -30.0, -1.0], [30.0, 30.0, 0.0])]);
    world.0.push(([-3.0, 6.0, 0.0], [3.0, 6.4, 9.0]));
    world.0.push(([-3.4, 2.0, 0.0], [-3.0, 6.4, 9.0]));
    world.0.push(([3.0, 2.0, 0.0], [3.4, 6.4, 9.0]));
    let flown = fly(&world, &Destination::target(at(0.0, 9.0, 1.6), 0.8, 0.1), 60.0);
    assert!(flown.arrived && flown.clearance > 0.3, "{flown:?}");
}

fn pillars() -> impl Strategy<Value = World> {
    let pillar = (-4.0..4.0_f64, 2.0..12.0_f64, 0.1..0.8_f64, 0.3..9.0_f64);
    prop::collection::vec(pillar, 0..9).prop_map(|pillars| {
        let mut solids = vec![([-40.0, -40.0, -1.0], [40.0, 40.0, 0.0])];
        solids.extend(
            pillars.iter().map(|&(east, north, half, top)| ([east - half, north - half, 0.0], [east + half, north + half, top])),
        );
        World(solids)
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4))]
    /// Among pillars the craft touches nothing, wherever they stand.
    #[test]
    fn a_flight_among_pillars_touches_nothing(world in pillars()) {
        let goal = Destination::target(at(0.0, 14.5, 1.6), 1.0, 0.1);
        let flown = fly(&world, &goal, 25.0);
        prop_assert!(flown.clearance > 0.3, "{flown:?}");
    }

    /// Whatever is known, a plan leads neither into occupied cells nor, at a speed above zero, into unseen space.
    #[test]
    fn no_plan_leads_into_anything(
        marks in prop::collection::vec(prop::array::uniform3(-30..30_i32), 0..200),
        goal in prop::array::uniform3(-12.0..12.0_f64),
        heading in -3.0..3.0_f64,
    ) {
        let from = at(0.1, 0.1, 3.1);
        let mut map = seen(&hall(), from, heading);
        marks.iter().for_each(|m| map.mark(Cell { east: m[0], north: m[1], up: 12 + m[2] / 4 }));
        let here = Cell::of(from);
        let guide = plan(&map, from, heading, &to(goal[0], goal[1], 3.0 + 0.3 * goal[2]));
        let occupied = |cell: &&Cell| **cell != here && map.is_occupied(**cell);
        prop_assert_eq!(guide.path.iter().find(occupied), None);
        if guide.speed > 0.0 {
            let way = from.distance(guide.waypoint);
            prop_assert!(way > 0.0);
            let ahead = from.towards(guide.waypoint, (0.5 / way).min(1.0));
            prop_assert!(map.is_seen(Time::ZERO, ahead) && (guide.speed < 0.95 || map.is_free(Time::ZERO, ahead)));
        }
    }
}

#[test]
fn a_craft_too_near_to_something_leaves_it_first() {
    let from = at(0.1, 0.1, 3.1);
    let mut map = ObstacleMap::new();
    map.advance(Time::ZERO, from);
    map.frame(Time::ZERO, &camera(), pose(from, 0.0));
    map.implied_free(Time::ZERO, &camera(), pose(from, 0.0), 8.0);
    map.mark(Cell { east: -2, north: 0, up: 12 });
    let guide = plan(&map, from, 0.0, &to(0.1, 7.0, 3.1));
    assert_eq!(guide.reach, Reach::Goal);
    assert!(guide.waypoint.distance(at(-0.4, 0.1, 3.1)) > 0.5, "{guide:?}");
}

/// By hand, for a camera of ±45°: the path may be 35° off the heading.
#[test]
fn the_craft_faces_its_target_while_the_path_stays_in_view() {
    let half = core::f64::consts::FRAC_PI_4;
    let deg = |path: f64, target: f64| facing(path.to_radians(), target.to_radians(), half).to_degrees();
    assert!((deg(30.0, 0.0) - 0.0).abs() < 1e-9);
    assert!((deg(50.0, 0.0) - 15.0).abs() < 1e-9);
    assert!((deg(-50.0, 0.0) + 15.0).abs() < 1e-9);
    assert!((deg(170.0, -170.0) + 170.0).abs() < 1e-9);
    assert!((deg(0.0, 179.0) - 35.0).abs() < 1e-9);
}

/// Two gaps in a wall, equally far to the left and right. The side of the first plan is kept although the craft then
/// stands a cell nearer to the other.
#[test]
fn of_two_equal_sides_the_first_one_is_kept() {
    let from = at(0.125, 0.125, 3.1);
    let mut open = ObstacleMap::new();
    open.advance(Time::ZERO, from);
    for east in (-45..45_i32).filter(|east| !(14..20).contains(east) && !(-20..-14).contains(east)) {
        for up in -20..40 {
            open.mark(Cell { east, north: 16, up });
        }
    }
    let goal = to(0.125, 8.0, 3.1);
    let side = |planner: &mut Planner, from: EnuPosition| {
        let guide = planner.plan(&open, Time::ZERO, from, 0.0, &body(), &goal).unwrap();
        guide.path.iter().find(|cell| cell.north == 16).map(|cell| cell.east > 0)
    };
    let mut planner = Planner::default();
    let first = side(&mut planner, from).unwrap();
    let nearer_to_the_other = at(if first { -0.4 } else { 0.4 }, 0.125, 3.1);
    assert_eq!(side(&mut Planner::default(), nearer_to_the_other), Some(!first));
    assert_eq!(side(&mut planner, nearer_to_the_other), Some(first));
}

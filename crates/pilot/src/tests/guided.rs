//! Flights guided between two answers by anchor, map and planner.

use super::*;
use crate::method::{Measured, Method};
use crate::target::may_overhang;
use spf_core::depth::{DepthGrid, DepthSource};
use spf_core::lift::label_of_range;
use spf_core::reply::ObstacleBox;
use spf_space::obstacle_map::{CELL, Cell};

fn guided(anchor: bool, map: bool) -> Setup {
    let mut setup = Setup::preset(Preset::Default);
    setup.settings.method = match (anchor, map) {
        (_, true) => Method::Depth(Measured::View),
        (true, false) => Method::Boxes,
        (false, false) => Method::Paper,
    };
    setup.settings.avoid = map;
    setup
}

/// Radius of the ball that stands in the way, metres.
const BALL: f64 = 0.8;

/// As [`perfect`], with the box of a ball in the way, which hides nothing.
fn with_ball(goal: EnuPosition, ball: EnuPosition, latency: f64) -> impl FnMut(&Query, &Seen) -> Answer {
    move |_, seen| {
        let mut reply = spf_core::reply::parse_reply(&points_at(goal, seen), &GroundingProfile::default(), false).unwrap();
        let away = seen.pose.position.displacement_to(ball, seen.pose.attitude.heading);
        let range = seen.pose.position.distance(ball) - BALL;
        if let Some(at) = project_displacement(away, &Camera::quad(), seen.pose.attitude, Lifting::Levelled)
            && range > 0.0
            && reply.status != Status::Done
        {
            let half = BALL / (range + BALL);
            let (wide, high) = (half * 0.5, half * 0.67);
            let area = ImageBox {
                left: (at.u - wide).clamp(0.0, 1.0),
                right: (at.u + wide).clamp(0.0, 1.0),
                top: (at.v - high).clamp(0.0, 1.0),
                bottom: (at.v + high).clamp(0.0, 1.0),
            };
            if area.left < area.right && area.top < area.bottom {
                reply.boxes.push(ObstacleBox { area, depth: label_of_range(range), name: "ball".to_owned() });
            }
        }
        Answer::After(secs(latency), reply.to_json(&GroundingProfile::default(), true))
    }
}

/// Least distance of the craft's middle from a place during a flight, metres.
fn least_distance(flight: &Flight, from: EnuPosition) -> f64 {
    flight.frames.iter().map(|seen| seen.pose.position.distance(from)).fold(f64::INFINITY, f64::min)
}

#[test]
fn an_anchored_flight_reaches_its_target_and_reports_where_it_is() {
    let goal = target(3.0, 40.0, 4.0);
    let mut flight = guided(true, false).fly(perfect(goal, 1.5));
    assert_eq!(flight.end(), Outcome::Reached);
    let reports: Vec<_> = flight.decisions().filter_map(|decision| decision.anchor).collect();
    let last = reports.last().unwrap();
    assert!(last.hits > 5 && last.sight.position.distance(goal) < 3.0 * last.sight.range_sd.max(0.5), "{last:?}");
    // Without the parts the row has no such column.
    let mut flight = Setup::preset(Preset::Default).fly(perfect(goal, 1.5));
    assert_eq!(flight.end(), Outcome::Reached);
    assert!(flight.decisions().all(|decision| decision.anchor.is_none()));
}

/// What is flown leads to the place that all answers give, and not to the point of the last one, beside which nothing may be.
#[test]
fn the_way_to_where_all_answers_have_the_target_is_what_must_be_clear() {
    let (low, high, ball) = (target(0.0, 40.0, 3.0), target(0.0, 40.0, 14.0), target(0.2, 14.0, 3.0));
    let mut setup = guided(true, false);
    setup.settings.avoid = true;
    // It points at the foot of a tower, then higher, past the ball.
    let (mut at_foot, mut higher, mut asked) = (with_ball(low, ball, 1.5), with_ball(high, ball, 1.5), 0);
    let mut flight = setup.fly(move |query, seen| {
        asked += 1;
        if asked <= 2 { at_foot(query, seen) } else { higher(query, seen) }
    });
    flight.at(Time::from_secs_f64(20.0));
    assert!(least_distance(&flight, ball) > BALL + 0.3, "{}", least_distance(&flight, ball));
    assert!(flight.decisions().filter(|decision| decision.anchor.is_some()).count() > 4);
}

#[test]
fn a_mapped_flight_goes_around_what_an_answer_has_named_and_never_touches_it() {
    let (goal, ball) = (target(0.0, 26.0, 3.0), target(0.2, 11.0, 3.0));
    // Straight on it would hit the ball.
    let mut straight = guided(true, false).fly(perfect(goal, 1.5));
    straight.end();
    assert!(least_distance(&straight, ball) < BALL + 0.3, "{}", least_distance(&straight, ball));

    let mut flight = guided(true, true).fly(with_ball(goal, ball, 1.5));
    assert_eq!(flight.end(), Outcome::Reached);
    assert!(least_distance(&flight, ball) > BALL + 0.3, "{}", least_distance(&flight, ball));
}

/// The VLM is gone in mid-flight: what the last answer permits is flown to its end, and no further.
#[test]
fn without_answers_a_guided_craft_flies_no_farther_than_its_last_answer_permits() {
    let goal = target(0.0, 60.0, 3.0);
    let mut setup = guided(true, true);
    setup.settings.reply_timeout = Duration::from_secs(40);
    let mut answer = with_ball(goal, target(50.0, 0.0, 3.0), 1.0);
    let mut asked = 0;
    let mut flight = setup.fly(move |query, seen| {
        asked += 1;
        if asked > 4 { Answer::Never } else { answer(query, seen) }
    });
    flight.until_asked(5);
    flight.pass(15.0);
    let permitted = flight.decisions().last().unwrap().goal.unwrap().position;
    assert!(flight.model.position.distance(permitted) < 1.5, "{:?} {permitted:?}", flight.model.position);
    assert!(flight.model.velocity.speed() < 0.1 && flight.setpoint().is_hold());
    let held = flight.model.position;
    flight.pass(15.0);
    assert!(flight.model.position.distance(held) < 0.2);
}

/// A target that was passed is not flown back to.
#[test]
fn nothing_flies_back_to_a_place_that_was_passed() {
    let goal = target(0.0, 30.0, 3.0);
    let mut flight = guided(true, true).fly(with_ball(goal, target(50.0, 0.0, 3.0), 3.0));
    assert_eq!(flight.end(), Outcome::Reached);
    let north: Vec<f64> = flight.frames.iter().map(|seen| seen.pose.position.north).collect();
    let back = north.windows(2).map(|pair| pair[0] - pair[1]).fold(0.0, f64::max);
    assert!(back < 0.05, "{back}");
}

/// A depth sensor at 3 m above level ground.
#[derive(Clone, Copy, PartialEq)]
enum Sensor {
    None,
    /// Nothing is within the map, but the ground is in range.
    Works,
    /// No values, although the ground is in range.
    Black,
    /// The same values again and again, stamped new.
    Frozen,
}

/// Where a depth sensor works, a box is no obstacle of the map, except people and what such sensors do not see.
#[test]
fn a_working_depth_sensor_overrules_boxes() {
    let occupied = |name: &'static str, sensor: Sensor| {
        let goal = target(0.0, 60.0, 3.0);
        let mut flight = guided(true, true).fly(move |_, seen| {
            let mut reply = spf_core::reply::parse_reply(&points_at(goal, seen), &GroundingProfile::default(), false).unwrap();
            let area = ImageBox { left: 0.0, top: 0.5, right: 0.3, bottom: 1.0 };
            reply.boxes.push(ObstacleBox { area, depth: 4, name: name.to_owned() });
            Answer::After(secs(2.0), reply.to_json(&GroundingProfile::default(), true))
        });
        flight.until_asked(1);
        for counter in 0..25_u16 {
            flight.pass(0.1);
            let cm = match sensor {
                Sensor::None => continue,
                Sensor::Works => 1500 + counter,
                Sensor::Black => 0,
                Sensor::Frozen => 1500,
            };
            let camera = Camera::from_fov(16, 12, 90.0_f64.to_radians(), 73.7_f64.to_radians(), 0.0);
            let (captured, counter, cm) = (flight.now, counter.into(), vec![cm; 16 * 12]);
            let grid = DepthGrid { captured, counter, camera, cm, source: DepthSource::Sensor };
            flight.tell(Event::Depth(Box::new(grid)));
        }
        assert!(flight.decisions().count() > 0);
        flight.pilot.obstacle_map().unwrap().occupied().count()
    };
    assert_eq!(occupied("quay", Sensor::Works), 0);
    assert!(occupied("person", Sensor::Works) > 0 && occupied("glass door", Sensor::Works) > 0);
    for sensor in [Sensor::None, Sensor::Black, Sensor::Frozen] {
        assert!(occupied("quay", sensor) > 0);
    }
}

/// A frozen sensor shows the air that it last saw, wherever the craft is by then: the map does not believe it.
#[test]
fn a_frozen_depth_sensor_does_not_clear_the_map() {
    let occupied = |is_frozen: bool| {
        let goal = target(0.0, 60.0, 3.0);
        let mut flight = guided(true, true).fly(perfect(goal, 60.0));
        flight.until_asked(1);
        let at = flight.model.position;
        // Its middle pixel looks straight ahead.
        let camera = Camera::from_fov(17, 13, 90.0_f64.to_radians(), 73.7_f64.to_radians(), 0.0);
        let grid = |flight: &Flight, counter: u64, cm: u16| {
            let (captured, cm) = (flight.now, vec![cm; 17 * 13]);
            Event::Depth(Box::new(DepthGrid { captured, counter, camera, cm, source: DepthSource::Sensor }))
        };
        // Clear air; then something else tells of an obstacle.
        for counter in 0..5 {
            flight.pass(0.1);
            let event = grid(&flight, counter, if is_frozen { 1500 } else { 1500 + counter as u16 });
            flight.tell(event);
        }
        let map = &mut flight.pilot.space.mapped.as_mut().unwrap().map;
        map.ray(at, EnuPosition { north: at.north + 3.0, ..at }, true);
        for counter in 5..20 {
            flight.pass(0.1);
            let event = grid(&flight, counter, if is_frozen { 1500 } else { 1500 + counter as u16 });
            flight.tell(event);
        }
        flight.pilot.obstacle_map().unwrap().occupied().count()
    };
    assert_eq!(occupied(false), 0, "a sensor that works clears what is gone");
    assert!(occupied(true) > 0);
}

/// A tower's platform or a tree's crown reaches farther over a craft than a bottle on a desk reaches under it.
#[test]
fn a_lost_target_above_bars_a_climb_from_farther_away_than_one_below_bars_a_descent() {
    let barred = |up: f64, away: f64, climb: f64| may_overhang(target(0.0, away, up), target(0.0, 0.0, 10.0), climb);
    assert!(barred(12.0, 2.9, 1.0) && barred(9.6, 2.9, 1.0), "a climb under a target at its height or above");
    assert!(!barred(9.4, 2.9, 1.0) && !barred(12.0, 3.1, 1.0), "a climb above a target, or far from it");
    assert!(!barred(8.0, 1.6, -1.0) && !barred(12.0, 1.6, -1.0), "looking down at what is in front");
    assert!(barred(8.0, 1.4, -1.0), "a descent onto what may be right below");
}

/// The reply that points at a goal, with a box twice `half` of the image high.
fn pointed(goal: EnuPosition, seen: &Seen, half: f64, latency: f64) -> Answer {
    let profile = GroundingProfile::default();
    let mut reply = spf_core::reply::parse_reply(&points_at(goal, seen), &profile, false).unwrap();
    if let (Some(area), Some(point)) = (reply.target_box.as_mut(), reply.point) {
        (area.top, area.bottom) = ((point.v - half).max(0.0), (point.v + half).min(1.0));
    }
    Answer::After(secs(latency), reply.to_json(&profile, false))
}

/// Each answer may mean another part of a tall target: its box widens the sighting, and its place is kept all the same.
#[test]
fn a_tall_target_has_an_anchor_too() {
    let anchored = |half: f64, latency: f64, method: Method| {
        let mut setup = Setup::preset(Preset::Default);
        setup.settings.method = method;
        let goal = target(0.0, 60.0, 3.0);
        let mut flight = setup.fly(move |_: &Query, seen: &Seen| pointed(goal, seen, half, latency));
        flight.until_asked(8);
        flight.decisions().map(|decision| decision.anchor.is_some()).collect::<Vec<_>>()
    };
    // Of 2 m and of 11 m, whether answers take 1 s or 4 s.
    for (half, latency) in [(0.02, 1.0), (0.1, 1.0), (0.1, 4.0)] {
        assert!(anchored(half, latency, Method::Boxes).iter().all(|&anchored| anchored), "{half} {latency}");
        assert!(anchored(half, latency, Method::Paper).iter().all(|&anchored| !anchored), "{half} {latency}");
    }
}

#[test]
fn a_place_that_the_operator_marks_in_flight_is_flown_around() {
    let goal = target(0.0, 26.0, 3.0);
    for (anchored, mapped) in [(false, false), (true, true)] {
        let mut flight = guided(anchored, mapped).fly(with_ball(goal, target(50.0, 0.0, 3.0), 1.5));
        flight.until_moving();
        // 12.9 m ahead in the middle of the image, 3 m wide.
        let pose = flight.frames.last().unwrap().pose;
        let area = ImageBox { left: 0.44, top: 0.3, right: 0.56, bottom: 0.7 };
        let place = KeepOut::new(1, &Camera::quad(), pose, area, 6).unwrap();
        flight.operator(OperatorEvent::KeepOut(vec![place]));
        flight.end();
        let least = place.points(CELL).map(|at| least_distance(&flight, at)).fold(f64::INFINITY, f64::min);
        assert!(least > 0.3, "{anchored} {mapped}: {least}");
        assert!(flight.frames.iter().any(|seen| seen.pose.position.north > 16.0), "{anchored} {mapped}: it gets past it");
    }
}

/// 12.9 m ahead in the middle of the image, 3 m wide.
fn mark(flight: &mut Flight, id: u32) -> KeepOut {
    let pose = flight.frames.last().unwrap().pose;
    let area = ImageBox { left: 0.44, top: 0.3, right: 0.56, bottom: 0.7 };
    let place = KeepOut::new(id, &Camera::quad(), pose, area, 6).unwrap();
    flight.operator(OperatorEvent::KeepOut(vec![place]));
    place
}

/// The craft's own estimator is reset: 8 m east, 3 m south and 2 m up in one report, at full speed, with a way planned and a query open.
#[test]
fn a_jump_of_the_position_moves_no_place() {
    let goal = target(0.0, 40.0, 3.0);
    for (anchored, mapped) in [(false, false), (true, true)] {
        let mut flight = guided(anchored, mapped).fly(with_ball(goal, target(50.0, 0.0, 3.0), 1.5));
        flight.until_moving();
        mark(&mut flight, 4);
        flight.pass(0.5);
        let before = flight.pilot.known_pose(flight.now).position;
        flight.reports = |telemetry| Telemetry {
            position: telemetry.position.map(|at| EnuPosition { east: at.east + 8.0, north: at.north - 3.0, up: at.up + 2.0 }),
            ..telemetry
        };
        flight.pass(0.1);
        let after = flight.pilot.known_pose(flight.now).position;
        assert!(before.distance(after) < 0.6, "{before:?} {after:?}");
        assert_eq!((flight.pilot.kept_out().len(), flight.pilot.phase()), (1, Phase::Flying));
        let told = |note: &Note| matches!(note, Note::Limited(why) if why.contains("position estimate jumped"));
        assert_eq!(flight.notes.iter().filter(|(_, note)| told(note)).count(), 1);
        // By the reports it would end 8 m aside.
        assert_eq!(flight.end(), Outcome::Reached, "{anchored} {mapped}");
        let ended = flight.model.position;
        assert!(ended.east.abs() < 2.5 && ended.horizontal_distance(goal) < 4.0, "{anchored} {mapped}: {ended:?}");
    }
}

/// The position is another from now on, and no velocity tells whether the craft has flown there.
const ELSEWHERE: fn(Telemetry) -> Telemetry = |telemetry| Telemetry {
    position: telemetry.position.map(|at| EnuPosition { east: at.east + 8.0, ..at }),
    velocity: None,
    ..telemetry
};

#[test]
fn a_position_that_was_lost_ends_the_way_to_a_place_of_before() {
    for (anchored, mapped) in [(false, false), (true, true)] {
        let mut flight = guided(anchored, mapped).fly(with_ball(target(0.0, 40.0, 3.0), target(50.0, 0.0, 3.0), 1.5));
        flight.until_moving();
        flight.pass(0.5);
        let at = flight.now;
        flight.reports = ELSEWHERE;
        flight.pass(1.0);
        // It brakes, and flies no more until a frame taken at rest has been asked about.
        let moving = flight.setpoints_since(at + STOP_RULE).find(|(_, setpoint)| !setpoint.is_hold());
        assert!(moving.is_none(), "{anchored} {mapped}: {moving:?}");
        assert_eq!(flight.pilot.phase(), Phase::Flying);
        assert!(flight.pilot.anchor().is_none() && flight.pilot.guide().is_none());
        let (east, asked) = (flight.model.position.east, flight.queries.len());
        flight.until_asked(asked + 2);
        // Nothing led to where the old places would be now.
        assert!((flight.model.position.east - east).abs() < 1.0, "{anchored} {mapped}: {:?}", flight.model.position);
    }
}

#[test]
fn a_position_that_was_lost_voids_the_marked_places_and_holds() {
    let mut flight = guided(true, true).fly(with_ball(target(0.0, 40.0, 3.0), target(50.0, 0.0, 3.0), 1.5));
    flight.until_moving();
    let place = mark(&mut flight, 4);
    flight.pass(0.5);
    assert_eq!((flight.pilot.kept_out().len(), flight.pilot.phase()), (1, Phase::Flying));
    flight.reports = ELSEWHERE;
    flight.pass(0.5);
    assert_eq!((flight.pilot.kept_out().len(), flight.pilot.phase()), (0, Phase::Held));
    assert!(flight.notes.iter().any(|(_, note)| matches!(note, Note::Limited(why) if why.contains("marked places are void"))));
    // An order that crossed with it brings none of them back.
    flight.operator(OperatorEvent::KeepOut(vec![place]));
    assert_eq!(flight.pilot.kept_out().len(), 0);
    mark(&mut flight, 5);
    assert_eq!(flight.pilot.kept_out().len(), 1);
}

#[test]
fn a_marked_place_is_kept_in_the_map_whatever_a_sensor_measures_there_and_gone_once_it_is_removed() {
    let mut flight = guided(true, true).fly(with_ball(target(0.0, 40.0, 3.0), target(50.0, 0.0, 3.0), 1.5));
    flight.until_moving();
    flight.operator(OperatorEvent::Hold);
    flight.pass(1.0);
    let pose = flight.frames.last().unwrap().pose;
    let area = ImageBox { left: 0.44, top: 0.45, right: 0.56, bottom: 0.55 };
    let place = KeepOut::new(1, &Camera::quad(), pose, area, 4).unwrap();
    let occupied = |flight: &Flight| flight.pilot.obstacle_map().unwrap().occupied().count();
    assert_eq!(occupied(&flight), 0);
    flight.operator(OperatorEvent::KeepOut(vec![place]));
    let marked = occupied(&flight);
    assert!(marked > 10, "{marked}");
    // A depth camera looks right through it: nothing for 9 m.
    let camera = Camera::from_fov(80, 60, 90.0_f64.to_radians(), 73.7_f64.to_radians(), 0.0);
    for counter in 1..=20_u16 {
        let cm = (0..4800_u16).map(|i| 900 + (i + counter) % 7).collect();
        let (captured, counter) = (flight.now, u64::from(counter));
        flight.tell(Event::Depth(Box::new(DepthGrid { captured, counter, camera, cm, source: DepthSource::Sensor })));
        flight.pass(0.1);
    }
    let map = flight.pilot.obstacle_map().unwrap();
    assert!(place.points(CELL).all(|at| map.is_occupied(Cell::of(at))));
    // And for 20 s, in which everything else fades.
    flight.pass(20.0);
    let map = flight.pilot.obstacle_map().unwrap();
    assert!(place.points(CELL).all(|at| map.is_occupied(Cell::of(at))));
    flight.operator(OperatorEvent::KeepOut(Vec::new()));
    let map = flight.pilot.obstacle_map().unwrap();
    assert!(place.points(CELL).all(|at| !map.is_occupied(Cell::of(at))));
}

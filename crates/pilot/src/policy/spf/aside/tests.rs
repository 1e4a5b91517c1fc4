use crate::method::Method;
use crate::policy::spf::Primitives;
use crate::policy::spf::tests::{Rig, told_from, view};
use crate::policy::{Move, PolicyEvent, Step};
use spf_core::geometry::{Attitude, EnuPosition, Pose};

/// A crane in view, and a wall before it that leaves room at the image's left edge only.
const WALL: &str = r#"{"status":"navigating","point":[500,500],"depth":7,"target":"crane",
    "boxes":[{"box":[0,200,1000,1000],"depth":1,"name":"wall"}]}"#;
const OPEN: &str = r#"{"status":"not_visible","look":"right","point":[500,520],"depth":6,"boxes":[]}"#;
const CLOSED: &str = r#"{"status":"not_visible","look":"right","boxes":[]}"#;

struct Flight {
    spf: Rig,
    pose: Pose,
    frames: u64,
}

impl Flight {
    fn begin(method: Method) -> Self {
        Self { spf: Rig::with(true, method), pose: Pose::default(), frames: 0 }
    }

    /// What the craft does on this answer; it is then where the motion leads.
    fn told(&mut self, answer: &str) -> Option<Primitives> {
        self.frames += 1;
        let view = crate::policy::View { pose: self.pose, ..view(self.frames) };
        let (_, step) = told_from(&mut self.spf, &view, answer);
        self.flown(step)
    }

    fn flown(&mut self, step: Step) -> Option<Primitives> {
        let Step::Move(Move { primitives, then_rest: true, .. }) = step else { return None };
        let end = spf_motion::executor::Goal::of_primitives(self.pose, primitives);
        self.pose = Pose { position: end.position, attitude: Attitude { heading: end.heading, ..Attitude::default() } };
        Some(primitives)
    }

    /// The move before the next query.
    fn unasked(&mut self) -> Option<Primitives> {
        self.frames += 1;
        let view = crate::policy::View { pose: self.pose, ..view(self.frames) };
        let step = self.spf.step(PolicyEvent::Frame(&view));
        self.flown(step)
    }
}

fn degrees(primitives: Option<Primitives>) -> f64 {
    primitives.map_or(f64::NAN, |primitives| primitives.yaw.to_degrees())
}

#[test]
fn a_blocked_craft_goes_around_the_side_that_has_room_and_turns_back() {
    let mut flight = Flight::begin(Method::Boxes);
    assert_eq!(flight.told(WALL).unwrap().forward, -0.6, "it holds farther away, since it drifts");
    assert_eq!(flight.told(WALL), None, "and looks again");
    let person = WALL.replace("wall", "person in red");
    assert_ne!(Flight::begin(Method::Boxes).told(&person).map(|step| step.forward), Some(-0.6), "the retreat decides of people");
    let turn = flight.told(WALL);
    assert!((degrees(turn) + 60.0).abs() < 0.1, "to the left: {turn:?}");
    let aside = flight.told(OPEN).unwrap();
    // The wall, which this answer leaves out, is still kept clear of.
    assert!(aside.forward > 1.3 && (-0.5..0.1).contains(&aside.yaw) && aside.climb.abs() < 0.2, "{aside:?}");
    let EnuPosition { east, north, .. } = flight.pose.position;
    assert!(east < -1.3 && north > -0.6, "{:?}", flight.pose);
    // The crane is 21.5 m to the north of where it held.
    let back = flight.unasked();
    let bearing = f64::atan2(-east, 20.9 - north).to_degrees();
    assert!((flight.pose.attitude.heading.to_degrees() - bearing).abs() < 1.0, "{back:?} {:?}", flight.pose);
    // Again in front of a wall, it holds once only.
    assert_eq!(flight.told(WALL), None);
    assert!(degrees(flight.told(WALL)) < -50.0);
}

#[test]
fn it_looks_on_the_other_side_and_then_backs_off_and_holds() {
    let mut flight = Flight::begin(Method::Boxes);
    let mut until_moved = |answer: &str| (0..5).find_map(|_| flight.told(answer));
    assert_eq!(until_moved(WALL).unwrap().forward, -0.6);
    assert!((degrees(until_moved(WALL)) + 60.0).abs() < 0.1);
    assert!((degrees(until_moved(CLOSED)) - 120.0).abs() < 0.1, "at once, without turning back");
    assert!((degrees(until_moved(CLOSED)) + 60.0).abs() < 0.1, "back to the target");
    assert!((degrees(until_moved(WALL)) - 60.0).abs() < 0.1);
    assert!((degrees(until_moved(CLOSED)) + 120.0).abs() < 0.1);
    assert!((degrees(until_moved(CLOSED)) - 60.0).abs() < 0.1);
    assert_eq!(until_moved(WALL).unwrap().forward, -1.0, "backs off");
    assert_eq!(until_moved(WALL), None, "and holds with the target in view");
}

#[test]
fn from_the_side_it_flies_to_a_target_that_is_free() {
    let mut flight = Flight::begin(Method::Boxes);
    for _ in 0..3 {
        flight.told(WALL);
    }
    assert!((flight.pose.attitude.heading.to_degrees() + 60.0).abs() < 0.1);
    let free =
        r#"{"status":"navigating","target_box":[400,800,600,900],"point":[500,850],"depth":5,"target":"crane","boxes":[]}"#;
    flight.frames += 1;
    let view = crate::policy::View { pose: flight.pose, ..view(flight.frames) };
    let (_, step) = told_from(&mut flight.spf, &view, free);
    assert!(matches!(&step, Step::Goto(goto) if goto.motion.primitives.forward > 1.0), "{step:?}");
}

#[test]
fn without_guidance_it_only_climbs_and_turns_as_before() {
    let mut flight = Flight::begin(Method::Paper);
    let moves: Vec<_> = (0..6).filter_map(|_| flight.told(WALL)).collect();
    assert!(moves.len() == 2 && moves.iter().all(|turn| (turn.yaw.to_degrees() - 45.0).abs() < 1.0), "{moves:?}");
}

#[test]
fn no_climb_over_what_stands_before_a_target_below() {
    // The chair ends below the upper edge, so a climb would be clear of it; the bottle stands on a table behind it.
    let chair = r#"{"status":"navigating","point":[700,500],"depth":3,"target":"bottle",
        "boxes":[{"box":[300,0,1000,1000],"depth":1,"name":"chair"}]}"#;
    for (method, climbs) in [(Method::Boxes, false), (Method::Paper, true)] {
        let mut flight = Flight::begin(method);
        let first = (0..5).find_map(|_| flight.told(chair)).unwrap();
        assert_eq!(first.climb > 0.0, climbs, "{method:?} {first:?}");
    }
}

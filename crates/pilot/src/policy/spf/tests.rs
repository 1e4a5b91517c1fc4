//! The policy, decision by decision; whole flights are in the pilot's tests.

use super::*;
use crate::method::Measured;
use crate::policy::{Expected, Move, Reckoned};
use crate::steering::DEFAULT_KEEP;
use spf_core::camera::Camera;
use spf_core::frame::{FrameId, FrameMeta};
use spf_core::geometry::{Attitude, EnuPosition, Pose};
use spf_core::keep_out::KeepOut;
use spf_core::query::{ImageBox, Query, QueryKind, VerticalRoom};
use spf_core::time::{Duration, Time};
use spf_space::avoid::Avoidance;

/// A policy, and what it has read in the last event.
pub(super) struct Rig {
    spf: Spf,
    pub(super) reading: Reading,
}

impl Rig {
    pub(super) fn new(settings: SpfSettings) -> Self {
        Self { spf: Spf::new(settings), reading: Reading::default() }
    }

    /// Started, in obstacle mode or not.
    pub(super) fn with(avoid: bool, method: Method) -> Self {
        started(SpfSettings { method, ..settings(avoid) })
    }

    /// The same with a tracker.
    fn tracking(avoid: bool) -> Self {
        started(SpfSettings { keep_m: Some(DEFAULT_KEEP), ..settings(avoid) })
    }

    pub(super) fn step(&mut self, event: PolicyEvent<'_>) -> Step {
        let Output { step, reading } = self.spf.handle(event);
        self.reading = reading;
        step
    }
}

pub(super) fn policy(avoid: bool) -> Rig {
    started(settings(avoid))
}

fn started(settings: SpfSettings) -> Rig {
    let mut spf = Rig::new(settings);
    assert_eq!(spf.step(PolicyEvent::Instruction("fly to the red crane")), Step::Look);
    spf
}

pub(super) fn settings(avoid: bool) -> SpfSettings {
    SpfSettings {
        step: StepRule::PAPER,
        lifting: Lifting::Levelled,
        shape: PathShape::Straight,
        avoid,
        confirm_done: true,
        grounding: GroundingProfile::default(),
        image_size: Some((640, 480)),
        craft: Craft::quad(),
        depth: DepthAs::Labels,
        near_m: Some(3.0),
        method: Method::Paper,
        keep_m: None,
        close_up: false,
    }
}

/// What the policy asks about a frame, and does when it hears this answer.
fn told(spf: &mut Rig, frame: u64, answer: &str) -> (Query, Step) {
    told_from(spf, &view(frame), answer)
}

pub(super) fn told_from(spf: &mut Rig, view: &View, answer: &str) -> (Query, Step) {
    let query = sent_query(spf.step(PolicyEvent::Frame(view)));
    let step = spf.step(PolicyEvent::Reply { id: query.id, text: answer, arrived: Time::ZERO, pose: view.pose });
    (query, step)
}

pub(super) fn view(id: u64) -> View {
    let frame = FrameMeta {
        id: FrameId(id),
        captured: Time::ZERO,
        received: Time::ZERO,
        capture_counter: id,
        width: 960,
        height: 720,
        unusable: None,
    };
    View {
        frame,
        camera: Camera::quad(),
        pose: Pose::default(),
        at_rest: true,
        room: VerticalRoom::default(),
        expected: Expected::Unknown,
        reckoned: None,
    }
}

pub(super) fn sent_query(step: Step) -> Query {
    let Step::Ask(query) = step else { panic!("{step:?}") };
    *query
}

const CAR_AHEAD: &str = r#"{"box":[400,450,600,550],"depth":4,"name":"car"}"#;

/// What the policy asks about a frame, and does when it hears this answer with these boxes.
fn decided(spf: &mut Rig, frame: u64, boxes: &str, answer: &str) -> (Query, Step) {
    let (query, step) = told(spf, frame, &format!(r#"{},"boxes":[{boxes}]}}"#, answer.strip_suffix('}').unwrap()));
    assert_eq!(query.kind, QueryKind::point(true));
    (query, step)
}

fn ahead(target: &str) -> String {
    format!(r#"{{"status":"navigating","point":[500,500],"depth":9,"target":"{target}"}}"#)
}

#[test]
fn the_target_is_no_obstacle() {
    let mut spf = policy(true);
    // Cut off by the lower edge.
    let car = r#"{"box":[400,100,1000,900],"depth":1,"name":"the black car"}"#;
    decided(&mut spf, 0, car, &ahead("the black car"));
    assert_eq!(spf.reading.avoidance, Some(Avoidance::Clear));
    decided(&mut spf, 1, car, &ahead("red crane"));
    assert!(!matches!(spf.reading.avoidance, Some(Avoidance::Clear)));
}

#[test]
fn a_second_look_has_boxes_too() {
    let mut spf = policy(true);
    let done = r#"{"status":"done"}"#;
    let (first, step) = decided(&mut spf, 0, "", done);
    assert_eq!((first.memory.confirming, step), (false, Step::Look));
    let (second, step) = decided(&mut spf, 1, "", done);
    assert_eq!((second.memory.confirming, step), (true, Step::Done));
}

#[test]
fn a_search_keeps_clear_of_the_boxes_too() {
    let mut spf = policy(true);
    let open = r#"{"status":"not_visible","look":"right","point":[500,500],"depth":9}"#;
    let flown = (0..40).find(|frame| {
        decided(&mut spf, *frame, CAR_AHEAD, open);
        spf.reading.step.is_some()
    });
    assert!(flown.is_some(), "it goes along the way that the answers show");
    assert!(matches!(spf.reading.avoidance, Some(Avoidance::Shifted { .. })), "{:?}", spf.reading.avoidance);
}

/// Half of a path along the image's edge is outside the image, where no box is reported.
#[test]
fn along_the_edge_it_turns_before_it_flies_and_does_so_once() {
    let aside = r#"{"status":"navigating","point":[500,970],"depth":5,"target":"crane"}"#;
    let mut spf = policy(true);
    for _ in 0..2 {
        let (_, step) = decided(&mut spf, 0, "", aside);
        let Step::Move(Move { primitives, then_rest: true, .. }) = step else { panic!("{step:?}") };
        // tan = 0.94 right of the middle: 43.2°.
        assert!((primitives.yaw.to_degrees() - 43.2).abs() < 0.5 && primitives.forward == 0.0, "{primitives:?}");
        assert!(spf.reading.actions[0].starts_with("turns first"), "{:?}", spf.reading.actions);
        // If repeated, it is flown to.
        let (_, step) = decided(&mut spf, 1, "", aside);
        let Step::Move(Move { primitives, then_rest: false, .. }) = step else { panic!("{step:?}") };
        assert!(primitives.forward > 1.0, "{primitives:?}");
    }
    // The other edge counts separately, once; any other step in between resets the count.
    let left = aside.replace("970", "30");
    let forward = |step: Step| matches!(step, Step::Move(Move { primitives, .. }) if primitives.forward > 1.0);
    let mut spf = policy(true);
    for (answer, flies) in [(aside, false), (&left, false), (aside, true)] {
        assert_eq!(forward(decided(&mut spf, 0, "", answer).1), flies, "{answer}");
    }
    assert!(!forward(decided(&mut spf, 0, "", aside).1));
    spf.step(PolicyEvent::MoveEnded { completed: false });
    assert!(!forward(decided(&mut spf, 0, "", aside).1), "the turn was cut short");
    decided(&mut spf, 0, "", r#"{"status":"not_visible","look":"left"}"#);
    assert!(!forward(decided(&mut spf, 0, "", aside).1), "it has turned elsewhere");
    // Outside obstacle mode it flies as in the paper.
    let mut spf = policy(false);
    let query = sent_query(spf.step(PolicyEvent::Frame(&view(0))));
    let step = spf.step(PolicyEvent::Reply { id: query.id, text: aside, arrived: Time::ZERO, pose: Pose::default() });
    assert!(matches!(step, Step::Move(Move { primitives, .. }) if primitives.forward > 1.0), "{step:?}");
}

/// The climbs of a blocked path count towards the 3 m too, until a step is flown; then it turns.
#[test]
fn the_climbs_of_a_blocked_path_count_towards_the_three_metres() {
    let mut spf = Rig::new(settings(true));
    spf.step(PolicyEvent::Instruction("fly to the red crane"));
    let mut number = 0;
    let mut decide = |spf: &mut Rig, boxes: &str| {
        let query = sent_query(spf.step(PolicyEvent::Frame(&view(number))));
        number += 1;
        let text = format!(r#"{{"status":"navigating","point":[500,500],"depth":9,"target":"crane","boxes":[{boxes}]}}"#);
        match spf.step(PolicyEvent::Reply { id: query.id, text: &text, arrived: Time::ZERO, pose: Pose::default() }) {
            Step::Move(Move { primitives, .. }) => Some(primitives),
            _ => None,
        }
    };
    let wall = r#"{"box":[30,0,1000,1000],"depth":1,"name":"wall"}"#;
    let mut moves =
        |spf: &mut Rig| (0..15).filter_map(|_| decide(spf, wall)).map(|p| (p.climb, p.yaw != 0.0)).collect::<Vec<_>>();
    assert_eq!(moves(&mut spf), [(1.0, false), (1.0, false), (1.0, false), (0.0, true), (0.0, true)]);
    assert!(spf.reading.actions.last().unwrap().contains("it has climbed 3 m"), "{:?}", spf.reading.actions);
}

/// What a forward camera has seen overhead hangs there for as long as the craft stays below it.
#[test]
fn nothing_climbs_into_what_was_overhead_until_the_craft_has_flown_on() {
    let climb_after = |seconds: u64, north: f64, name: &str| {
        let mut spf = Rig::new(settings(true));
        spf.step(PolicyEvent::Instruction("fly to the red crane"));
        let at = |seconds: u64, north: f64| {
            let mut view = view(seconds);
            view.frame.captured = Time::ZERO + Duration::from_secs(seconds);
            view.pose.position.north = north;
            view
        };
        let pointing =
            |boxes: &str| format!(r#"{{"status":"navigating","point":[500,500],"depth":9,"target":"crane","boxes":[{boxes}]}}"#);
        told_from(&mut spf, &at(0, 0.0), &pointing(&format!(r#"{{"box":[0,0,300,1000],"depth":1,"name":"{name}"}}"#)));
        let wall = pointing(r#"{"box":[30,0,1000,1000],"depth":1,"name":"wall"}"#);
        (0..3).find_map(|i| match told_from(&mut spf, &at(seconds + i, north), &wall).1 {
            Step::Move(Move { primitives, .. }) => Some(primitives.climb),
            _ => None,
        })
    };
    // In the image it would be listed; above it, it hangs.
    assert_eq!(climb_after(5, 0.0, "parasol"), Some(1.0));
    assert_eq!(climb_after(5, 0.5, "parasol"), Some(0.0));
    assert_eq!(climb_after(60, 0.5, "parasol"), Some(0.0));
    assert_eq!(climb_after(60, 3.0, "parasol"), Some(1.0));
    // Somebody walks on.
    assert_eq!(climb_after(60, 0.5, "woman"), Some(1.0));
}

#[test]
fn who_is_followed_is_flown_to_and_a_turn_is_turned() {
    let mut spf = policy(false);
    let (query, step) = told(&mut spf, 0, r#"{"status":"following","point":[500,500],"depth":5,"target":"man"}"#);
    assert!(query.prompt.contains("in view, its nearest part within 3 m"), "{}", query.prompt);
    assert!(matches!(step, Step::Move(Move { primitives, .. }) if primitives.forward > 2.0), "{step:?}");
    let (_, step) = told(&mut spf, 1, r#"{"status":"navigating","point":null,"turn_deg":-90,"target":"man"}"#);
    let Step::Move(Move { primitives, then_rest: true, .. }) = step else { panic!("{step:?}") };
    assert_eq!(primitives, Primitives { yaw: -90.0_f64.to_radians(), ..Primitives::default() });
}

#[test]
fn a_blocked_way_is_held_before_a_person_and_backed_off_from_otherwise() {
    let blocked = |name: &str, depth| {
        format!(r#"{{"status":"blocked","boxes":[{{"box":[300,400,900,600],"depth":{depth},"name":"{name}"}}]}}"#)
    };
    let mut spf = policy(true);
    assert_eq!(told(&mut spf, 0, &blocked("woman", 2)).1, Step::Look);
    for (name, depth) in [("shelf", 2), ("woman", 8)] {
        let (_, step) = told(&mut policy(true), 1, &blocked(name, depth));
        assert!(matches!(step, Step::Move(Move { primitives, then_rest: true, .. }) if primitives.forward == -1.0), "{step:?}");
    }
    // Nobody says what it is.
    assert_eq!(told(&mut policy(false), 0, r#"{"status":"blocked"}"#).1, Step::Look);
}

#[test]
fn what_was_wrong_is_told_once() {
    let mut spf = policy(true);
    let (first, step) = told(&mut spf, 0, &ahead("red crane"));
    assert!(first.memory.refused.is_none() && matches!(step, Step::Reject(_)), "{step:?}");
    let (second, _) = told(&mut spf, 1, r#"{"status":"not_visible","boxes":[]}"#);
    assert!(second.prompt.contains("\nYour last answer could not be used: it lacked boxes.\n"), "{}", second.prompt);
    let (third, _) = told(&mut spf, 2, r#"{"status":"not_visible","boxes":[]}"#);
    assert!(!third.prompt.contains("could not be used"), "{}", third.prompt);
}

#[test]
fn a_depth_that_is_left_out_by_habit_is_asked_for_once_and_never_guessed_to_be_far() {
    let grounding = GroundingProfile { habit: spf_core::grounding::Habit::List, ..GroundingProfile::default() };
    let bare = r#"[{"point":[500,500],"label":"red crane"}]"#;
    let step = |spf: &mut Rig, view: &View| {
        let (query, step) = told_from(spf, view, bare);
        assert!(matches!(step, Step::Move(_)), "{step:?}");
        (query.memory.refused, spf.reading.step.unwrap())
    };
    let mut spf = started(SpfSettings { grounding, ..settings(false) });
    let smallest = StepRule::PAPER.length_of(1.0);
    assert_eq!(step(&mut spf, &view(0)), (None, smallest));
    assert!(spf.reading.actions.iter().any(|action| action == "the depth is missing: taken to be the smallest"));
    assert_eq!(step(&mut spf, &view(1)), (Some("lacked depth: without it the drone goes little at a time".to_owned()), smallest));
    assert_eq!(step(&mut spf, &view(2)), (None, smallest));
    // Where the target is known to be there, its range counts; beside it, it does not.
    let at = |u: f64| View { expected: Expected::InView { at: ImagePoint { u, v: 0.5 }, range: 20.0 }, ..view(3) };
    let known = StepRule::PAPER.length_of(exact_label_of_range(20.0));
    assert!(known > smallest);
    assert_eq!((step(&mut spf, &at(0.55)).1, step(&mut spf, &at(0.8)).1), (known, smallest));
    // Nobody else may leave it out.
    assert!(matches!(told(&mut policy(false), 0, bare).1, Step::Reject(_)));
}

/// A post whose middle is seen now left, now right of the way: the craft passes it on the side on which it began.
#[test]
fn a_detour_keeps_its_side_from_answer_to_answer() {
    let post = |u: u32| {
        let (left, right) = (u - 40, u + 40);
        format!(
            r#"{{"status":"navigating","point":[500,500],"depth":7,"target":"crane","boxes":[{{"box":[100,{left},900,{right}],"depth":4,"name":"post"}}]}}"#
        )
    };
    let mut spf = policy(true);
    let mut sides = Vec::new();
    for (frame, u) in [490, 510, 480, 520, 490].into_iter().enumerate() {
        told(&mut spf, frame as u64, &post(u));
        let waypoint = spf.reading.waypoint.unwrap();
        assert!(matches!(spf.reading.avoidance, Some(Avoidance::Shifted { .. })), "{:?}", spf.reading.avoidance);
        sides.push(waypoint.u > 0.5);
    }
    assert_eq!(sides, [true; 5]);
    // Twice clear, and the next one is passed where it is nearest.
    for frame in 10..14 {
        told(&mut spf, frame, r#"{"status":"navigating","point":[500,500],"depth":7,"target":"crane","boxes":[]}"#);
    }
    told(&mut spf, 14, &post(520));
    assert!(spf.reading.waypoint.unwrap().u < 0.5);
}

/// The last box was 9.6 px wide, so its region goes along; after an answer without one nothing does.
#[test]
fn a_small_target_goes_along_enlarged_if_wanted() {
    let small = r#"{"status":"navigating","target_box":[495,495,505,505],"point":[500,500],"depth":9,"target":"crane"}"#;
    let mut spf = Rig::new(SpfSettings { close_up: true, ..settings(false) });
    spf.step(PolicyEvent::Instruction("fly to the red crane"));
    let (first, _) = told(&mut spf, 0, small);
    assert_eq!(first.close_up, None);
    let (second, _) = told(&mut spf, 1, r#"{"status":"not_visible"}"#);
    let region = second.close_up.unwrap();
    assert!((region.left - 0.4).abs() < 1e-9 && (region.bottom - 0.6).abs() < 1e-9, "{region:?}");
    assert!(second.prompt.contains("The second image enlarges the part [400, 400, 600, 600]"), "{}", second.prompt);
    let (third, _) = told(&mut spf, 2, small);
    assert_eq!(third.close_up, None);
    let mut spf = policy(false);
    told(&mut spf, 0, small);
    assert_eq!(told(&mut spf, 1, small).0.close_up, None);
}

/// A depth network may be without its scale: only a sensor's map takes the place of the check against the boxes.
#[test]
fn with_a_map_that_no_depth_sensor_fills_each_step_is_checked_against_its_boxes() {
    let wall = r#"{"status":"navigating","point":[500,500],"depth":10,"target":"crane",
        "boxes":[{"box":[0,0,1000,1000],"depth":2,"name":"wall"}]}"#;
    let checked = |sensor: bool| {
        let mut spf = Rig::with(true, Method::Depth(if sensor { Measured::View } else { Measured::Part }));
        told(&mut spf, 0, wall);
        spf.reading.avoidance
    };
    assert!(matches!(checked(false), Some(Avoidance::Shortened { .. } | Avoidance::Hold)), "{:?}", checked(false));
    assert_eq!(checked(true), None);
}

/// An anchored policy.
fn anchored(avoid: bool) -> Rig {
    Rig::with(avoid, Method::Boxes)
}

/// The policy's response to a reply on a frame that is expected to show the target.
fn told_expecting(spf: &mut Rig, frame: u64, expected: Expected, answer: &str) -> Step {
    let query = sent_query(spf.step(PolicyEvent::Frame(&View { expected, ..view(frame) })));
    spf.step(PolicyEvent::Reply { id: query.id, text: answer, arrived: Time::ZERO, pose: Pose::default() })
}

#[test]
fn only_a_point_on_the_boxed_target_is_a_sighting() {
    let reply = |target_box: &str| {
        format!(r#"{{"target":"crane","status":"navigating","stage":1,"target_box":{target_box},"point":[500,500],"depth":8}}"#)
    };
    assert!(matches!(told(&mut anchored(false), 0, &reply("[400,400,600,600]")).1, Step::Goto(_)));
    // Beside it; and straight on, which has no box.
    assert!(matches!(told(&mut anchored(false), 0, &reply("[400,700,600,900]")).1, Step::Move(_)));
    assert!(matches!(told(&mut anchored(false), 0, &reply("null")).1, Step::Move(_)));
    // At the image's edge the box is cut off, and so is what is pointed at.
    let at_edge = reply("[400,0,600,600]").replace("[500,500]", "[500,5]");
    assert!(matches!(told(&mut anchored(false), 0, &at_edge).1, Step::Move(_)));
}

#[test]
fn the_next_query_tells_where_the_target_of_an_ended_stage_is() {
    let mut spf = policy(false);
    let cone = |target: &str, stage: u32| {
        format!(
            r#"{{"target":"{target}","status":"navigating","stage":{stage},"target_box":[400,400,600,600],"point":[500,500],"depth":3}}"#
        )
    };
    told(&mut spf, 0, &cone("orange cone", 1));
    told(&mut spf, 1, &cone("next cone", 2));
    // 1.8 m nearer, and 30° to the right: 1 m away.
    let position = EnuPosition { north: 1.8, ..EnuPosition::default() };
    let turned = |degrees: f64, north: f64| {
        let attitude = Attitude { heading: degrees.to_radians(), ..Attitude::default() };
        View { pose: Pose { position: EnuPosition { north, ..position }, attitude }, ..view(2) }
    };
    let aside = |north: f64, east: f64| View {
        pose: Pose { position: EnuPosition { north, east, up: 0.0 }, ..Pose::default() },
        ..view(2)
    };
    let (query, _) = told_from(&mut spf, &turned(30.0, 1.8), &cone("next cone", 2));
    let place = query.memory.finished[0].place.unwrap();
    assert!((place.range_m - 1.0).abs() < 0.02 && (place.bearing_deg + 30.0).abs() < 0.1, "{place:?}");
    let area = place.area.unwrap();
    assert!(area.left < 0.1 && (0.4..0.6).contains(&area.right), "{area:?}");
    let sentence = r#"target "orange cone". It is now about 1 m away, 30° left."#;
    assert!(query.prompt.contains(sentence), "{}", query.prompt);
    let (query, _) = told_from(&mut spf, &turned(150.0, 1.8), &cone("next cone", 2));
    assert!(query.prompt.contains("about 1 m away, 150° left, outside this image."), "{}", query.prompt);
    // Beside it, the label does not tell whether it is ahead or behind.
    let (query, _) = told_from(&mut spf, &aside(2.5, 0.6), &cone("next cone", 2));
    assert_eq!(query.memory.finished[0].place, None);
    // 40 m there and back are a drift of 2 m or more: too far to tell.
    told_from(&mut spf, &turned(0.0, -18.2), &cone("next cone", 2));
    let (query, _) = told_from(&mut spf, &turned(0.0, 1.8), &cone("next cone", 2));
    assert_eq!(query.memory.finished[0].place, None);
    assert!(query.prompt.contains(r#"target "orange cone"."#), "{}", query.prompt);

    // Of what is within a metre, one label tells too little from 0.4 m further on, but all answers together do.
    let reckoned = |stage: u32| Some(Reckoned { stage, range: 0.9, sd: 0.2 });
    for (reckoned, is_told) in [(None, false), (reckoned(2), false), (reckoned(1), true)] {
        let mut spf = policy(false);
        let expected = Expected::InView { at: ImagePoint { u: 0.5, v: 0.5 }, range: 0.9 };
        told_from(
            &mut spf,
            &View { expected, reckoned, ..view(0) },
            &cone("orange cone", 1).replace(r#""depth":3"#, r#""depth":1"#),
        );
        told(&mut spf, 1, &cone("next cone", 2));
        let (query, _) = told_from(&mut spf, &aside(0.3, 0.3), &cone("next cone", 2));
        let range = query.memory.finished[0].place.map(|place| place.range_m);
        assert_eq!(range.is_some_and(|range| (range - 0.67).abs() < 0.02), is_told, "{range:?}");
    }

    // Somebody may have walked on, and a point beside something is no place of it.
    let beside =
        r#"{"target":"left of it","status":"navigating","stage":1,"target_box":[400,400,600,600],"point":[500,900],"depth":3}"#;
    for first in [cone("man in blue", 1), beside.to_owned()] {
        let mut spf = policy(false);
        told(&mut spf, 0, &first);
        told(&mut spf, 1, &cone("next cone", 2));
        let (query, _) = told(&mut spf, 2, &cone("next cone", 2));
        assert_eq!((query.memory.finished.len(), query.memory.finished[0].place), (1, None));
    }
}

#[test]
fn a_target_that_is_not_seen_is_flown_to_only_in_its_own_stage() {
    let known = Expected::InView { at: ImagePoint { u: 0.5, v: 0.5 }, range: 20.0 };
    let seen = r#"{"target":"tower","status":"navigating","stage":1,"target_box":[400,400,600,600],"point":[500,500],"depth":6}"#;
    let lost = |stage: u32| format!(r#"{{"target":"tower","status":"not_visible","stage":{stage},"look":"left"}}"#);
    let mut spf = anchored(false);
    told(&mut spf, 0, seen);
    assert_eq!(told_expecting(&mut spf, 1, known, &lost(1)), Step::Keep);
    // The place that is known is the first tower's.
    assert!(matches!(told_expecting(&mut spf, 2, known, &lost(2)), Step::Move(_)));
    // A point that is no place of the second one does not make it known either.
    let beside = r#"{"target":"left of it","status":"navigating","stage":3,"target_box":null,"point":[500,900],"depth":6}"#;
    let mut spf = anchored(false);
    told(&mut spf, 0, seen);
    assert!(matches!(told_expecting(&mut spf, 1, known, beside), Step::Move(_)));
    assert!(matches!(told_expecting(&mut spf, 2, known, &lost(3)), Step::Move(_)));
}

/// After one reply without the target the craft flies on if it should be seen, and then waits at rest while a box stands in front
/// of it.
#[test]
fn a_target_behind_a_box_is_waited_for() {
    let known = Expected::InView { at: ImagePoint { u: 0.5, v: 0.5 }, range: 40.0 };
    let seen = r#"{"target":"tower","status":"navigating","stage":1,"target_box":[400,400,600,600],"point":[500,500],"depth":8,"boxes":[]}"#;
    let kept = |boxes: &str| {
        let lost = format!(r#"{{"target":"tower","status":"not_visible","stage":1,"look":"left","boxes":{boxes}}}"#);
        let mut spf = anchored(true);
        told(&mut spf, 0, seen);
        let steps: Vec<Step> = (1..9).map(|frame| told_expecting(&mut spf, frame, known, &lost)).collect();
        let of = |step: Step| steps.iter().filter(|&next| *next == step).count();
        (of(Step::Keep), of(Step::Look))
    };
    assert_eq!(kept("[]"), (1, 0));
    assert_eq!(kept(r#"[{"box":[300,300,700,700],"depth":6,"name":"building"}]"#), (1, 7));
    // Beside it, and behind it.
    assert_eq!(kept(r#"[{"box":[0,0,300,300],"depth":6,"name":"building"}]"#), (1, 0));
    assert_eq!(kept(r#"[{"box":[300,300,700,700],"depth":9,"name":"building"}]"#), (1, 0));
}

#[test]
fn a_turn_that_is_stated_is_made_whatever_place_is_known() {
    let place = ImagePoint { u: 0.5, v: 0.5 };
    for expected in [Expected::Aside, Expected::InView { at: place, range: 4.0 }] {
        let seen = r#"{"target":"man","status":"navigating","stage":1,"target_box":[400,400,600,600],"point":[500,500],"depth":4,"boxes":[]}"#;
        let lost = |turn: &str| format!(r#"{{"target":"man","status":"not_visible","stage":1,"look":"right"{turn},"boxes":[]}}"#);
        let flown = |turn: &str| {
            let mut spf = anchored(true);
            told(&mut spf, 0, seen);
            told_expecting(&mut spf, 1, expected, &lost(turn))
        };
        assert_eq!(flown(""), Step::Keep, "a model misses one in twenty");
        let Step::Move(motion) = flown(r#","turn_deg":55"#) else { panic!("{:?}", flown(r#","turn_deg":55"#)) };
        assert!((motion.primitives.yaw.to_degrees() - 55.0).abs() < 1e-9, "{motion:?}");
    }
}

/// A reply that points at something else, and one that does not show the target, are two that contradict what is known.
#[test]
fn a_reply_that_points_elsewhere_counts_as_one_without_the_target() {
    let known = Expected::InView { at: ImagePoint { u: 0.5, v: 0.5 }, range: 40.0 };
    let at = |left: u32, right: u32| {
        let u = (left + right) / 2;
        format!(
            r#"{{"target":"oak","status":"navigating","stage":1,"target_box":[400,{left},600,{right}],"point":[500,{u}],"depth":8}}"#
        )
    };
    let lost = r#"{"target":"oak","status":"not_visible","stage":1,"look":"left"}"#;
    let mut spf = anchored(false);
    told(&mut spf, 0, &at(400, 600));
    assert!(matches!(told_expecting(&mut spf, 1, known, &at(30, 130)), Step::Goto(_)));
    assert!(matches!(told_expecting(&mut spf, 2, known, lost), Step::Move(_)));
    // The same, where the second reply points at the known place, or its box reaches there.
    for second in [at(450, 600), at(60, 560)] {
        let mut spf = anchored(false);
        told(&mut spf, 0, &at(400, 600));
        assert!(matches!(told_expecting(&mut spf, 1, known, &second), Step::Goto(_)));
        assert_eq!(told_expecting(&mut spf, 2, known, lost), Step::Keep);
    }
}

/// A target of 20 pixels, then of 60, then replies that do not see it: the craft looks twice more for the first before it turns
/// away.
#[test]
fn a_small_target_that_is_missed_is_looked_for_again_before_the_search_turns_away() {
    let missed = r#"{"status":"not_visible","look":"right"}"#;
    let steps = |method: Method, box_: &str| {
        let mut spf = Rig::with(false, method);
        let seen = format!(r#"{{"status":"navigating","point":[500,500],"depth":9,"target":"kite","target_box":{box_}}}"#);
        told(&mut spf, 0, &seen);
        [1, 2, 3].map(|frame| matches!(told(&mut spf, frame, missed).1, Step::Keep))
    };
    assert_eq!(steps(Method::Boxes, "[490,490,510,510]"), [true, true, false]);
    assert_eq!(steps(Method::Boxes, "[460,460,540,540]"), [false; 3]);
    // A craft that holds while it asks has nothing to fly on with.
    assert_eq!(steps(Method::Paper, "[490,490,510,510]"), [false; 3]);
}

#[test]
fn a_step_leads_around_what_the_operator_has_marked_and_the_query_says_so() {
    let view = view(1);
    let area = ImageBox { left: 0.42, top: 0.3, right: 0.58, bottom: 0.7 };
    let place = KeepOut::new(3, &view.camera, view.pose, area, 4).unwrap();
    let answer = r#"{"status":"navigating","point":[500,500],"depth":9,"target":"crane"}"#;
    let waypoint = |marked: bool| {
        let mut spf = Rig::new(settings(false));
        spf.step(PolicyEvent::Instruction("fly to the crane"));
        spf.step(PolicyEvent::KeepOut(if marked { core::slice::from_ref(&place) } else { &[] }));
        let (query, _) = told_from(&mut spf, &view, answer);
        assert_eq!(
            query.prompt.contains("The operator has marked the place in the box [300, 420, 700, 580]"),
            marked,
            "{}",
            query.prompt
        );
        assert_eq!(query.marks.len(), usize::from(marked));
        spf.reading.waypoint.unwrap()
    };
    assert!((waypoint(false).u - 0.5).abs() < 0.01);
    assert!((waypoint(true).u - 0.5).abs() > 0.1, "{:?}", waypoint(true));
    // A new instruction does not unmark it.
    let mut spf = Rig::new(settings(true));
    spf.step(PolicyEvent::KeepOut(&[place]));
    spf.step(PolicyEvent::Instruction("fly to the crane"));
    assert_eq!(told_from(&mut spf, &view, answer).0.marks.len(), 1);
}

/// Something in the way of somebody who is followed by their track keeps the craft where it is; it goes on looking at them.
#[test]
fn something_in_the_way_of_somebody_tracked_ends_no_following() {
    let boxes = r#"[{"box":[300,0,1000,1000],"depth":1,"name":"hedge"}]"#;
    let answer = format!(
        r#"{{"target":"man","status":"following","target_box":[300,400,700,600],"point":[500,500],"depth":4,"boxes":{boxes}}}"#
    );
    let at = ImagePoint { u: 0.5, v: 0.5 };
    let step = |is_tracked: bool| {
        let mut spf = Rig::tracking(true);
        told_expecting(&mut spf, 0, Expected::Followed { at, range: 3.2, is_tracked }, &answer)
    };
    let Step::Follow(goto) = step(true) else { panic!("{:?}", step(true)) };
    assert!(!goto.is_detour && goto.corridor.is_none() && goto.motion.primitives.forward == 0.0, "{goto:?}");
    assert_eq!(step(false), Step::Look);
}

#[test]
fn somebody_who_has_left_the_image_is_looked_for_where_they_went() {
    let lost = r#"{"target":"man","status":"not_visible","look":"right"}"#;
    let yaw = |expected: Expected| {
        let mut spf = Rig::tracking(false);
        let Step::Move(motion) = told_expecting(&mut spf, 0, expected, lost) else { panic!() };
        motion.primitives.yaw
    };
    assert_eq!(yaw(Expected::Left { off: -1.2 }), -1.2);
    assert!(yaw(Expected::Unknown) > 0.0);
}

#[test]
fn blocked_flies_another_way_if_one_is_given_and_says_so_after_two_without() {
    let mut spf = policy(false);
    let (_, step) = told(&mut spf, 0, r#"{"status":"blocked","target":"door","open_way":{"point":[500,200],"depth":5}}"#);
    assert!(matches!(step, Step::Move(Move { primitives, .. }) if primitives.forward > 0.5), "{step:?}");
    let blocked = r#"{"status":"blocked","target":"door"}"#;
    for (frame, counted) in [(1, 0), (2, 1), (3, 2)] {
        let (query, step) = told(&mut spf, frame, blocked);
        assert_eq!((query.memory.blocked, step), (counted, Step::Look));
    }
    let (query, step) = told(&mut spf, 4, r#"{"status":"waiting","target":"door"}"#);
    assert!(query.prompt.contains("You have answered \"blocked\" 3 times in a row."), "{}", query.prompt);
    assert_eq!(step, Step::Look);
    assert_eq!(told(&mut spf, 5, blocked).0.memory.blocked, 0);
}

#[test]
fn the_way_that_blocked_gives_is_held_to_the_boxes() {
    let mut spf = policy(true);
    let wall = r#"{"box":[0,0,1000,1000],"depth":1,"name":"wall"}"#;
    let (_, step) = decided(&mut spf, 0, wall, r#"{"status":"blocked","open_way":{"point":[500,500],"depth":6}}"#);
    assert_eq!(step, Step::Look);
}

#[test]
fn a_new_stage_has_another_target_and_a_turn_has_seen_it() {
    let mut spf = policy(false);
    told(&mut spf, 0, r#"{"status":"navigating","stage":1,"target":"car","point":[500,300],"depth":4}"#);
    told(&mut spf, 1, r#"{"status":"not_visible","stage":2,"target":"bridge","look":"left"}"#);
    let (query, _) = told(&mut spf, 2, r#"{"status":"navigating","stage":2,"target":"bridge","turn_deg":40}"#);
    assert_eq!(query.memory.lost, None, "the car is not what is looked for");
    assert_eq!(query.memory.searched_deg, Some(0.0));
    let (query, _) = told(&mut spf, 3, r#"{"status":"not_visible","stage":2,"target":"bridge","look":"left"}"#);
    assert_eq!(query.memory.searched_deg, None);
    assert!(query.prompt.contains("you saw \"bridge\" and asked for a turn of 40° right;"), "{}", query.prompt);
    // Seen again, and then lost.
    told(&mut spf, 4, r#"{"status":"navigating","stage":2,"target":"bridge","point":[500,900],"depth":8}"#);
    told(&mut spf, 5, r#"{"status":"not_visible","stage":2,"target":"bridge","look":"left"}"#);
    let (query, _) = told(&mut spf, 6, "{}");
    assert_eq!(query.memory.lost.map(|lost| lost.answers_ago), Some(2));
}

/// What was flown after an answer is shown by images of after it alone; and the record says where the horizon is, and that after the last
/// stage there is none.
#[test]
fn the_record_tells_what_the_image_shows() {
    let mut spf = Rig::with(true, Method::Boxes);
    let ahead = |north: f64| Pose { position: EnuPosition { north, ..EnuPosition::default() }, ..Pose::default() };
    let at = |id: u64, captured: Time, pose: Pose| {
        let mut view = view(id);
        (view.frame.captured, view.pose) = (captured, pose);
        view
    };
    let answer = |spf: &mut Rig, view: &View, text: &str| {
        let query = sent_query(spf.step(PolicyEvent::Frame(view)));
        spf.step(PolicyEvent::Reply { id: query.id, text, arrived: Time::from_millis(1500), pose: ahead(4.0) });
        query
    };
    let on = r#"{"status":"navigating","stage":1,"point":[500,500],"depth":7,"target":"crane","boxes":[]}"#;
    answer(&mut spf, &at(1, Time::ZERO, ahead(0.0)), on);
    // The craft flew on while the answer came, and the next image was taken just before it did.
    let query = answer(&mut spf, &at(2, Time::from_millis(1400), ahead(3.7)), on);
    assert_eq!(query.memory.answers[0].motion, None);
    assert!(!query.prompt.contains("so far") && query.prompt.contains("Since your last image: 3.7 m flown."), "{}", query.prompt);
    let done = r#"{"status":"done","stage":2,"boxes":[]}"#;
    let query = answer(&mut spf, &at(3, Time::from_millis(1600), ahead(4.3)), done);
    assert!(query.prompt.contains("; so far 0.3 m flown."), "{}", query.prompt);
    let tipped = Pose { attitude: Attitude { pitch: -0.3, ..Attitude::default() }, ..ahead(4.3) };
    let query = answer(&mut spf, &at(4, Time::from_millis(1700), tipped), on);
    assert!(query.prompt.contains("Stage 1 is being worked on."), "{}", query.prompt);
    let horizon: f64 = query.prompt.split_once("The horizon is at y = ").unwrap().1.split(' ').next().unwrap().parse().unwrap();
    // 17° of nose down and a camera that looks 5° down, of 74°.
    assert!((horizon - 500.0 + 500.0 * (0.3 + 5_f64.to_radians()).tan() / 0.75).abs() < 3.0, "{horizon}");
}

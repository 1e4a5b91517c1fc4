//! What obstacle mode does beside somebody, on dodges and in openings, and what the second look is told.

use crate::method::Method;
use crate::policy::spf::tests::{Rig, told_from, view};
use crate::policy::{Expected, Goto, Move, Reckoned, Step, View};
use spf_core::query::ImagePoint;
use spf_core::time::{Duration, Time};
use spf_space::avoid::Avoidance;

fn at(second: u64) -> View {
    let mut view = view(second);
    view.frame.captured = Time::ZERO + Duration::from_secs(second);
    view
}

/// What is flown on this answer, and the rig after it.
fn flown(spf: &mut Rig, second: u64, answer: &str) -> Option<Move> {
    match told_from(spf, &at(second), answer).1 {
        Step::Move(motion) | Step::Goto(Goto { motion, .. }) => Some(motion),
        _ => None,
    }
}

#[test]
fn a_craft_before_somebody_asks_at_rest() {
    let before = |left: u32, depth: u8, target: &str| {
        let mut spf = Rig::with(true, Method::Boxes);
        let man = format!(r#"{{"box":[300,{left},900,{}],"depth":{depth},"name":"man"}}"#, left + 100);
        let answer = format!(r#"{{"status":"navigating","point":[500,500],"depth":7,"target":"{target}","boxes":[{man}]}}"#);
        flown(&mut spf, 0, &answer);
        spf.reading.is_before_person
    };
    assert!(before(650, 3, "crane") && !before(650, 4, "crane"));
    // At the edge of the image, and the person to whom it flies.
    assert!(!before(900, 3, "crane") && !before(450, 3, "man"));
}

#[test]
fn an_open_way_beside_somebody_is_flown_only_if_a_second_image_shows_it() {
    let way = |u: u32, near: bool| {
        let man = if near { r#"{"box":[300,300,900,420],"depth":2,"name":"man"}"# } else { "" };
        format!(r#"{{"status":"blocked","open_way":{{"point":[500,{u}],"depth":5}},"boxes":[{man}]}}"#)
    };
    let mut spf = Rig::with(true, Method::Boxes);
    assert!(flown(&mut spf, 0, &way(700, false)).is_some(), "nobody is near");
    let mut spf = Rig::with(true, Method::Boxes);
    assert!(flown(&mut spf, 0, &way(700, true)).is_none());
    assert!(spf.reading.actions.iter().any(|action| action.contains("still open")), "{:?}", spf.reading.actions);
    // Now another way is open, and then still that one.
    assert!(flown(&mut spf, 1, &way(950, true)).is_none());
    assert!(flown(&mut spf, 2, &way(930, true)).is_some());
}

#[test]
fn a_dodge_keeps_the_camera_on_the_target() {
    let answer = r#"{"status":"navigating","point":[500,500],"depth":8,"target":"crane",
        "target_box":[300,480,700,520],"boxes":[{"box":[0,430,1000,520],"depth":4,"name":"pole"}]}"#;
    let mut spf = Rig::with(true, Method::Boxes);
    let motion = flown(&mut spf, 0, answer).expect("it flies");
    let Some(Avoidance::Shifted { point }) = spf.reading.avoidance else { panic!("{:?}", spf.reading.avoidance) };
    let primitives = motion.primitives;
    assert!(point.u > 0.52 && primitives.right > 0.5 && primitives.forward > 3.0, "{primitives:?}");
    assert!(primitives.yaw.abs() < 1e-9, "the target is straight ahead: {primitives:?}");
    assert_eq!(spf.reading.because.as_ref().map(|because| because.name.as_str()), Some("pole"));
}

#[test]
fn an_opening_that_is_near_and_centred_is_flown_through_in_one_step() {
    let length = |target: &str, u: u32, boxes: &str| {
        let answer = format!(
            r#"{{"status":"navigating","point":[500,{u}],"depth":3,"target":"{target}","boxes":[{boxes}],
                "target_box":[300,{},700,{}]}}"#,
            u - 100,
            u + 100
        );
        let mut spf = Rig::with(true, Method::Boxes);
        flown(&mut spf, 0, &answer).map_or(0.0, |motion| motion.primitives.forward)
    };
    // 2.8 m, and 1.5 m beyond; the paper's step is 1.1 m.
    assert!((length("opening of the gate", 500, "") - 4.28).abs() < 0.02);
    assert!(length("the gate", 500, "") < 1.2 && length("opening of the gate", 700, "") < 1.5);
    // Its sides stand 0.9 m to the left and right; between posts that leave no room it does not go.
    let posts = |left: u32, right: u32| {
        format!(
            r#"{{"box":[0,{},1000,{left}],"depth":3,"name":"post"}},{{"box":[0,{right},1000,{}],"depth":3,"name":"post"}}"#,
            left - 20,
            right + 20
        )
    };
    assert!(length("opening of the gate", 500, &posts(340, 660)) > 4.0);
    assert!(length("opening of the gate", 500, &posts(440, 560)) < 1.5);
    // 0.43 m to each side are enough, and 0.39 m are not.
    assert!(length("opening of the gate", 500, &posts(400, 600)) > 4.0 && length("gap", 500, &posts(410, 590)) < 1.5);
}

#[test]
fn whoever_points_elsewhere_is_waited_for_anew() {
    let wall = |u: u32| {
        format!(
            r#"{{"status":"navigating","point":[500,{u}],"depth":7,"target":"crane",
            "boxes":[{{"box":[0,0,1000,1000],"depth":1,"name":"wall"}}]}}"#
        )
    };
    let mut spf = Rig::with(true, Method::Boxes);
    let acts = [500, 600, 500, 600, 500, 505, 500].map(|u| (u, flown(&mut spf, u64::from(u), &wall(u)).is_some()));
    // It backs off a little first.
    assert_eq!(acts.map(|(_, acts)| acts), [true, false, false, false, false, false, true]);
}

#[test]
fn the_second_look_is_told_of_a_distance_that_contradicts_it() {
    // What counts is 3 m.
    let told = |range: f64, stage: u32, expected: Expected| {
        let mut spf = Rig::with(true, Method::Boxes);
        told_from(&mut spf, &at(0), r#"{"status":"done","stage":1,"target":"crane","boxes":[]}"#);
        let reckoned = Some(Reckoned { stage, range, sd: 0.5 });
        let (query, step) = told_from(&mut spf, &View { reckoned, expected, ..at(1) }, r#"{"status":"done","boxes":[]}"#);
        assert_eq!(step, Step::Done, "the model has the last word");
        let is_told = query.prompt.contains("By all your answers the target is 4.1 ± 0.5 m away; within 3 m counts.");
        assert_eq!(is_told, query.memory.reckoned.is_some(), "{}", query.prompt);
        is_told
    };
    let in_view = Expected::InView { at: ImagePoint { u: 0.5, v: 0.5 }, range: 4.1 };
    assert!(told(4.1, 1, in_view));
    // Within what is uncertain, of another stage, and what was passed.
    assert!(!told(3.4, 1, in_view) && !told(4.1, 2, in_view) && !told(4.1, 1, Expected::Aside));
}

//! Backing off from persons, and waiting for those who come.

use crate::method::Method;
use crate::policy::spf::tests::{Rig, sent_query, told_from, view};
use crate::policy::{Move, PolicyEvent, Step};
use spf_core::geometry::EnuPosition;
use spf_core::lift::label_of_range;
use spf_core::time::{Duration, Time};
use spf_space::avoid::Avoidance;

/// A person at a label per answer, a second apart, in front of the crane or beside the way.
fn persons(labels: &[u8], left: u32, target: &str) -> Vec<bool> {
    let toward = format!(r#""status":"navigating","point":[500,500],"depth":7,"target":"{target}""#);
    persons_while(&toward, labels, left)
}

fn persons_while(status: &str, labels: &[u8], left: u32) -> Vec<bool> {
    guided_persons_while(Method::Paper, status, labels, left, [0; 2])
}

/// The same with guidance, and with a box that grows and goes to the right from answer to answer, in thousandths of the image.
fn guided_persons_while(method: Method, status: &str, labels: &[u8], left: u32, [grows, crosses]: [u32; 2]) -> Vec<bool> {
    let mut spf = Rig::with(true, method);
    let mut backs_off = |(frame, depth): (usize, &u8)| {
        let (more, left) = (grows * frame as u32, left + crosses * frame as u32);
        let (top, bottom, left, right) = (400 - 2 * more, 900 + more / 2, left - more, left + 200 + more);
        let answer = format!(r#"{{{status},"boxes":[{{"box":[{top},{left},{bottom},{right}],"depth":{depth},"name":"man"}}]}}"#);
        let mut view = view(frame as u64);
        view.frame.captured = Time::ZERO + Duration::from_secs(frame as u64);
        let query = sent_query(spf.step(PolicyEvent::Frame(&view)));
        let step = spf.step(PolicyEvent::Reply { id: query.id, text: &answer, arrived: Time::ZERO, pose: view.pose });
        matches!(step, Step::Move(Move { primitives, .. }) if primitives.forward == -2.0)
    };
    labels.iter().enumerate().map(&mut backs_off).collect()
}

#[test]
fn the_craft_backs_off_from_a_person_who_walks_towards_it_and_from_no_other() {
    // 4.6 m, 2.8 m, 1.7 m.
    assert_eq!(persons(&[4, 3, 2], 400, "crane"), [false, true, true]);
    // Someone who stands there is flown around.
    assert_eq!(persons(&[2, 2, 2], 400, "crane"), [false; 3]);
    // Within 1 m whatever they do, but not for ever.
    assert_eq!(persons(&[1; 6], 400, "crane"), [true, true, true, true, false, false]);
    // One who stands there is known after two answers, if the pilot keeps more than this answer; not one who comes nearer, or
    // crosses before the craft.
    let navigating = r#""status":"navigating","point":[500,500],"depth":7,"target":"crane""#;
    assert_eq!(guided_persons_while(Method::Boxes, navigating, &[1; 4], 400, [0; 2]), [true, false, false, false]);
    assert_eq!(guided_persons_while(Method::Boxes, navigating, &[1; 3], 400, [100, 0]), [true; 3]);
    assert_eq!(guided_persons_while(Method::Boxes, navigating, &[1; 3], 200, [0, 250]), [true; 3]);
    // Who walks past, and who is flown to.
    assert_eq!(persons(&[4, 3, 2], 0, "crane"), [false; 3]);
    assert_eq!(persons(&[4, 3, 2], 400, "man"), [false; 3]);
    // A craft that searches or is held up backs off as well.
    assert_eq!(persons_while(r#""status":"not_visible""#, &[4, 3, 2], 400), [false, true, true]);
    assert_eq!(persons_while(r#""status":"blocked""#, &[4, 3, 2], 400), [false, true, true]);
}

/// Whether a guided craft backs off from a man at each of these ranges ahead, metres, while it flies `stride` metres between two
/// answers, which are `seconds` apart. He is half a metre wide and 1.7 m tall, his middle half a metre to the left of the way: from
/// 1.1 m on the image holds neither his height nor his width.
fn before_a_man(ranges: &[f64], stride: f64, seconds: u64) -> Vec<bool> {
    let mut spf = Rig::with(true, Method::Boxes);
    let mut backs_off = |(nth, range): (usize, &f64)| {
        let mut view = view(nth as u64);
        view.frame.captured = Time::ZERO + Duration::from_secs(seconds * nth as u64);
        view.pose.position.north = stride * nth as f64;
        let thousandths = |tangent: f64| (500.0 * (1.0 + tangent)).clamp(0.0, 1000.0).round();
        let [left, right] = [-0.75, -0.25].map(|side| thousandths(side / range));
        let [top, bottom] = [-0.85, 0.85].map(|end| thousandths(end / range / 0.75));
        let answer = format!(
            r#"{{"status":"navigating","point":[500,700],"depth":7,"target":"crane",
                "boxes":[{{"box":[{top},{left},{bottom},{right}],"depth":{},"name":"man"}}]}}"#,
            label_of_range(*range)
        );
        let (_, step) = told_from(&mut spf, &view, &answer);
        matches!(step, Step::Move(Move { primitives, .. }) if primitives.forward == -2.0)
    };
    ranges.iter().enumerate().map(&mut backs_off).collect()
}

#[test]
fn the_craft_does_not_back_off_from_who_stands_beside_its_way_because_it_has_come_nearer_itself() {
    assert_eq!(before_a_man(&[2.6, 2.0, 1.4, 0.8], 0.6, 2), [false; 4]);
    // The same without a motion of the craft: it is he who comes, and who has come nearer is backed off from on.
    assert_eq!(before_a_man(&[2.6, 0.8, 0.7], 0.0, 2), [false, true, true]);
}

#[test]
fn the_craft_does_not_go_to_meet_a_person_who_walks_towards_it() {
    let forward = |method: Method, ranges: &[f64]| -> Vec<f64> {
        let mut spf = Rig::with(true, method);
        let mut steps = |(nth, range): (usize, &f64)| {
            let mut view = view(nth as u64);
            view.frame.captured = Time::ZERO + Duration::from_secs(2 * nth as u64);
            let [top, bottom] = [-0.85, 0.85].map(|end: f64| (500.0 * (1.0 + end / range / 0.75)).round());
            let answer = format!(
                r#"{{"status":"navigating","target_box":[{top},470,{bottom},530],"point":[500,500],"depth":{},
                    "target":"person in pink","boxes":[]}}"#,
                label_of_range(*range)
            );
            match told_from(&mut spf, &view, &answer).1 {
                Step::Move(motion) => motion.primitives.forward,
                // Whatever is known of where he is, the craft is led no farther.
                Step::Goto(goto) => {
                    let own = goto.motion.primitives.forward;
                    let ahead = EnuPosition { north: 20.0, ..EnuPosition::default() };
                    goto.corridor.unwrap().clear(ahead, own, 20.0).unwrap_or(own)
                }
                Step::Look => 0.0,
                other => panic!("{other:?}"),
            }
        };
        ranges.iter().enumerate().map(&mut steps).collect()
    };
    let stands = forward(Method::Boxes, &[7.0, 7.0, 7.0]);
    assert!(stands.iter().all(|&step| step > 2.5), "{stands:?}");
    // At 1 m/s he will be 1 m away when the next answer comes.
    let walks = forward(Method::Boxes, &[9.0, 7.0, 5.0]);
    assert!(walks[0] > 2.5 && walks[1] < 2.0 && walks[2] == 0.0, "{walks:?}");
    assert!(forward(Method::Paper, &[9.0, 7.0, 5.0])[2] > 1.5);
}

#[test]
fn who_begins_to_walk_towards_the_craft_or_comes_between_slow_answers_is_backed_off_from() {
    // He has stood there, and comes now.
    assert_eq!(before_a_man(&[3.0, 3.0, 2.0], 0.0, 2), [false, false, true]);
    // Two answers 6 s apart; and the image holds nothing but a part of him.
    assert_eq!(before_a_man(&[4.6, 1.7], 0.0, 6), [false, true]);
    assert_eq!(before_a_man(&[2.1, 0.8], 0.0, 3), [false, true]);
}

#[test]
fn the_step_keeps_clear_of_where_somebody_is_about_to_walk() {
    let outcome = |method: Method, left: [u32; 2]| {
        let mut spf = Rig::with(true, method);
        for (nth, left) in left.into_iter().enumerate() {
            let mut view = view(nth as u64);
            view.frame.captured = Time::ZERO + Duration::from_secs(2 * nth as u64);
            let answer = format!(
                r#"{{"status":"navigating","point":[500,500],"depth":8,"target":"crane",
                    "boxes":[{{"box":[380,{left},620,{}],"depth":4,"name":"woman"}}]}}"#,
                left + 60
            );
            told_from(&mut spf, &view, &answer);
        }
        spf.reading
    };
    // From the right towards the path, 4.6 m ahead, at 0.7 m/s: she is not on it yet.
    let walks = outcome(Method::Boxes, [950, 800]);
    assert!(!matches!(walks.avoidance, Some(Avoidance::Clear)), "{walks:?}");
    assert!(walks.because.is_some_and(|because| because.walks && because.name == "woman"));
    for (method, left) in [(Method::Boxes, [800, 800]), (Method::Paper, [950, 800])] {
        let reading = outcome(method, left);
        assert_eq!((reading.avoidance, reading.actions.len()), (Some(Avoidance::Clear), 0), "{reading:?}");
    }
}

#[test]
fn only_without_guidance_a_step_leads_under_a_wall() {
    let wall = r#"{"status":"navigating","point":[450,500],"depth":8,"target":"crane",
        "boxes":[{"box":[0,0,550,1000],"depth":4,"name":"white wall"}]}"#;
    let avoided = |method: Method| {
        let mut spf = Rig::with(true, method);
        told_from(&mut spf, &view(0), wall);
        spf.reading.avoidance
    };
    assert!(matches!(avoided(Method::Boxes), Some(Avoidance::Shortened { .. })));
    assert!(matches!(avoided(Method::Paper), Some(Avoidance::Shifted { point, .. }) if point.v > 0.5));
}

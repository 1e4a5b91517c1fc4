use super::*;
use spf_core::camera::Camera;
use spf_core::frame::{FrameId, FrameMeta};
use spf_core::geometry::{Attitude, Pose};
use spf_core::query::{Mark, VerticalRoom};
use spf_core::time::Time;
use spf_pilot::policy::Expected;

const CRAFT_STEP: f64 = 2.0;

fn view(frame: u64) -> View {
    view_towards(frame, 1.0)
}

/// A frame taken at a heading, radians.
fn view_towards(frame: u64, heading: f64) -> View {
    View {
        frame: FrameMeta {
            id: FrameId(frame),
            captured: Time::ZERO,
            received: Time::ZERO,
            capture_counter: frame,
            width: 960,
            height: 720,
            unusable: None,
        },
        camera: Camera::quad(),
        pose: Pose { attitude: Attitude { heading, ..Attitude::default() }, ..Pose::default() },
        at_rest: true,
        expected: Expected::Unknown,
        reckoned: None,
        room: VerticalRoom::default(),
    }
}

fn pivot(change: impl FnOnce(&mut PivotSettings)) -> Pivot {
    let mut settings = PivotSettings::published(Craft::quad(), CRAFT_STEP);
    change(&mut settings);
    let mut pivot = Pivot::new(settings);
    assert_eq!(pivot.step(PolicyEvent::Instruction("fly to the crane")), Step::Look);
    pivot
}

fn query(step: Step) -> Query {
    match step {
        Step::Ask(query) => *query,
        other => panic!("{other:?}"),
    }
}

fn numbers(query: &Query) -> Vec<(u32, ImagePoint)> {
    let number = |mark: &Mark| if let Mark::Number { at, number } = mark { Some((*number, *at)) } else { None };
    query.marks.iter().filter_map(number).collect()
}

/// The candidate nearest to a point of the image.
fn nearest(query: &Query, u: f64, v: f64) -> u32 {
    let away = |at: ImagePoint| libm::hypot((at.u - u) * 960.0, (at.v - v) * 720.0);
    numbers(query).into_iter().min_by(|a, b| away(a.1).total_cmp(&away(b.1))).unwrap().0
}

/// The first question about candidates.
fn begun(pivot: &mut Pivot) -> Query {
    begun_towards(pivot, 1.0)
}

fn begun_towards(pivot: &mut Pivot, heading: f64) -> Query {
    let sent = query(pivot.step(PolicyEvent::Frame(&view_towards(1, heading))));
    assert_eq!(sent.kind, QueryKind::Done);
    query(pivot.step(PolicyEvent::Reply {
        id: sent.id,
        text: r#"{"done":false,"stage":1}"#,
        arrived: Time::ZERO,
        pose: Pose::default(),
    }))
}

fn answer(pivot: &mut Pivot, to: &Query, points: &[u32]) -> Step {
    pivot.step(PolicyEvent::Reply {
        id: to.id,
        text: &format!("{{\"points\":{points:?}}}"),
        arrived: Time::ZERO,
        pose: Pose::default(),
    })
}

#[test]
fn three_rounds_on_one_frame_close_in_on_the_target() {
    let mut pivot = pivot(|_| ());
    let (u, v) = (0.62, 0.41);
    let mut query = begun(&mut pivot);
    let mut counts = Vec::new();
    for round in 0..3 {
        counts.push(numbers(&query).len());
        assert_eq!((query.kind.clone(), query.frame), (QueryKind::Choose, FrameId(1)));
        let most = if round == 2 { "the numbers of the best 1," } else { "the numbers of the best 3," };
        assert!(query.prompt.contains(most) && query.prompt.contains("fly 2 m in its direction"), "{}", query.prompt);
        let number = nearest(&query, u, v);
        match answer(&mut pivot, &query, &[number]) {
            Step::Ask(next) => query = *next,
            Step::Move(motion) => {
                assert_eq!(round, 2);
                let reached = pivot.reading.clone().waypoint.unwrap();
                let away = libm::hypot((reached.u - u) * 960.0, (reached.v - v) * 720.0);
                assert!(away < 45.0, "{away} px off");
                let lifted = lift::unproject(&Camera::quad(), reached, CRAFT_STEP).unwrap();
                let lifted = lift::lift(lifted, &Camera::quad(), view(1).pose.attitude, Lifting::Levelled);
                assert_eq!(motion.primitives, Primitives::from_displacement(lifted));
                assert_eq!((motion.anchor, motion.then_rest), (Some(view(1).pose), true));
            }
            other => panic!("{other:?}"),
        }
    }
    assert_eq!(counts, [25, 10, 10]);
}

#[test]
fn arrows_begin_where_straight_on_appears() {
    let mut pivot = pivot(|_| ());
    let query = begun(&mut pivot);
    // The lens looks 5° down: straight on is tan 5° above the middle, 0.0875 · 480.3 px of 720.
    let Mark::Arrow { from, .. } = query.marks[0] else { panic!() };
    assert!((from.u - 0.5).abs() < 1e-9 && (from.v - (0.5 - 0.0875 * 480.4 / 720.0)).abs() < 1e-3, "{from:?}");
}

#[test]
fn candidates_follow_the_seed() {
    let of = |seed: u64| begun(&mut pivot(|settings| settings.seed = seed)).marks;
    assert_eq!(of(3), of(3));
    assert_ne!(of(3), of(4));
}

#[test]
fn numbers_that_are_not_in_the_image_do_not_count() {
    let mut pivot = pivot(|settings| settings.rounds = 2);
    let first = begun(&mut pivot);
    let second = query(answer(&mut pivot, &first, &[0, 26, 4_000_000_000]));
    // Nothing valid: the second round is around the origin again, with the same spread.
    let mean = numbers(&second).iter().map(|(_, at)| at.u).sum::<f64>() / 10.0;
    let widest = numbers(&second).iter().map(|(_, at)| (at.u - 0.5).abs()).fold(0.0, f64::max);
    assert!((mean - 0.5).abs() < 0.12 && widest > 0.08, "{mean} {widest}");
    assert!(matches!(answer(&mut pivot, &second, &[3]), Step::Move(_)));
}

/// It has no boxes to check a climb against.
#[test]
fn in_obstacle_mode_the_search_of_a_policy_without_boxes_does_not_climb() {
    for avoid in [false, true] {
        let mut pivot = pivot(|settings| (settings.rounds, settings.avoid) = (1, avoid));
        let (mut climbs, mut heading, mut words) = (0, 1.0, Vec::new());
        for _ in 0..40 {
            let query = begun_towards(&mut pivot, heading);
            let Step::Move(motion) = answer(&mut pivot, &query, &[]) else { break };
            climbs += u32::from(motion.primitives.climb != 0.0);
            heading += motion.primitives.yaw;
            words.extend(pivot.reading.clone().actions);
            pivot.step(PolicyEvent::MoveEnded { completed: true });
        }
        assert_eq!((climbs, words.iter().any(|word| word.starts_with("no climb"))), (u32::from(!avoid), avoid));
    }
}

#[test]
fn where_nothing_is_chosen_the_search_turns_until_it_gives_up() {
    let mut pivot = pivot(|settings| settings.rounds = 1);
    let (mut turns, mut heading) = (0, 1.0);
    for _ in 0..40 {
        let query = begun_towards(&mut pivot, heading);
        match answer(&mut pivot, &query, &[]) {
            Step::Move(motion) => {
                assert!(motion.then_rest && motion.primitives.forward == 0.0);
                heading += motion.primitives.yaw;
                turns += 1;
                assert_eq!(pivot.step(PolicyEvent::MoveEnded { completed: true }), Step::Wait);
            }
            Step::Fail(FailReason::NotFound) => {
                assert_eq!(turns, 11, "five turns, a climb, five turns");
                return;
            }
            other => panic!("{other:?}"),
        }
    }
    panic!("searches for ever");
}

#[test]
fn parallel_runs_agree_on_their_mean() {
    let mut pivot = pivot(|settings| (settings.runs, settings.rounds) = (3, 1));
    let first = begun(&mut pivot);
    let second = query(pivot.step(PolicyEvent::Continue));
    let third = query(pivot.step(PolicyEvent::Continue));
    assert_eq!(pivot.step(PolicyEvent::Continue), Step::Wait);
    assert_ne!(first.marks, second.marks);
    // In any order; a run without a choice does not count.
    assert_eq!(answer(&mut pivot, &third, &[1]), Step::Wait);
    assert_eq!(answer(&mut pivot, &first, &[]), Step::Wait);
    assert!(matches!(answer(&mut pivot, &second, &[2]), Step::Move(_)));
    let (a, b) = (numbers(&third)[0].1, numbers(&second)[1].1);
    let reached = pivot.reading.clone().waypoint.unwrap();
    assert!((reached.u - 0.5 * (a.u + b.u)).abs() < 1e-9 && (reached.v - 0.5 * (a.v + b.v)).abs() < 1e-9);
}

#[test]
fn parallel_runs_vote() {
    let mut pivot = pivot(|settings| (settings.runs, settings.rounds, settings.consensus) = (2, 1, Consensus::Vote));
    let first = begun(&mut pivot);
    let second = query(pivot.step(PolicyEvent::Continue));
    assert_eq!(answer(&mut pivot, &first, &[5]), Step::Wait);
    let vote = query(answer(&mut pivot, &second, &[7]));
    let (a, b) = (numbers(&first)[4].1, numbers(&second)[6].1);
    assert_eq!(numbers(&vote), [(1, a), (2, b)]);
    assert!(matches!(answer(&mut pivot, &vote, &[2]), Step::Move(_)));
    assert_eq!(pivot.reading.clone().waypoint, Some(b));
}

#[test]
fn done_is_believed_at_the_second_look() {
    let mut pivot = pivot(|_| ());
    let first = query(pivot.step(PolicyEvent::Frame(&view(1))));
    assert_eq!(
        pivot.step(PolicyEvent::Reply { id: first.id, text: r#"{"done":true}"#, arrived: Time::ZERO, pose: Pose::default() }),
        Step::Look
    );
    assert_eq!(pivot.step(PolicyEvent::Frame(&View { at_rest: false, ..view(2) })), Step::Wait);
    let second = query(pivot.step(PolicyEvent::Frame(&view(3))));
    assert!(second.memory.confirming && second.prompt.contains("second look"));
    assert_eq!(
        pivot.step(PolicyEvent::Reply { id: second.id, text: r#"{"done":true}"#, arrived: Time::ZERO, pose: Pose::default() }),
        Step::Done
    );
}

#[test]
fn what_cannot_be_parsed_is_refused_and_queried_again() {
    let mut pivot = pivot(|settings| settings.runs = 2);
    let first = begun(&mut pivot);
    let second = query(pivot.step(PolicyEvent::Continue));
    let refused =
        pivot.step(PolicyEvent::Reply { id: first.id, text: "the left one", arrived: Time::ZERO, pose: Pose::default() });
    assert!(matches!(refused, Step::Reject(_)) && pivot.reading.clone().refused.is_some());
    assert_eq!(answer(&mut pivot, &second, &[1]), Step::Wait, "the other run's answer is void");
    assert_eq!(query(pivot.step(PolicyEvent::Frame(&view(2)))).kind, QueryKind::Done);
}

#[test]
fn a_query_without_an_answer_is_sent_again() {
    let mut pivot = pivot(|_| ());
    let first = begun(&mut pivot);
    assert_eq!(pivot.step(PolicyEvent::ReplyFailed { id: first.id }), Step::Wait);
    assert_eq!(answer(&mut pivot, &first, &[1]), Step::Wait, "too late");
    assert_eq!(query(pivot.step(PolicyEvent::Frame(&view(2)))).kind, QueryKind::Done);
}

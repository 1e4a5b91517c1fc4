//! When queries are sent and moves are flown: stop-and-think, continuous mode, anchors, queues.

use super::*;
use spf_core::geometry::wrap_angle;

/// Camera rotation that counts as motion (3 °/s).
const REST_YAW_RATE: f64 = 3.0 * core::f64::consts::PI / 180.0;

#[test]
fn stop_mode_queries_only_frames_captured_at_rest() {
    for motion in [Motion::Sequential, Motion::Blended] {
        let mut setup = Setup::preset(Preset::Paper);
        setup.settings.motion = motion;
        let mut flight = setup.fly(perfect(target(-14.0, 22.0, 9.0), 1.0));
        assert_eq!(flight.end(), Outcome::Reached);
        assert!(flight.queries.len() > 4);
        for (at, query) in &flight.queries {
            let seen = flight.frames[usize::try_from(query.frame.0).unwrap()];
            assert!(seen.speed < 0.1 && seen.yaw_rate < REST_YAW_RATE, "{motion:?} at {at}: {seen:?}");
        }
    }
}

/// A craft that drifts in the wind never stands still: the frame is taken 1.5 s after the motion ended.
#[test]
fn stop_mode_waits_no_longer_than_one_and_a_half_seconds_for_rest() {
    let mut flight = Setup::preset(Preset::Paper).fly(always(navigate(0.5, 0.5, 5), 0.5));
    flight.until_phase(Phase::Flying);
    flight.model.creep = [0.3, 0.0];
    flight.until_asked(4);
    for pair in flight.queries[1..].windows(2) {
        let moved = flight.setpoints_since(pair[0].0).take_while(|(at, _)| *at < pair[1].0);
        let last = moved.filter(|(_, setpoint)| !setpoint.is_hold()).last().unwrap().0;
        let seen = flight.frames[usize::try_from(pair[1].1.frame.0).unwrap()];
        let waited = seen.captured.since(last).as_secs_f64();
        assert!(seen.speed > 0.1 && (1.5..1.9).contains(&waited), "{waited} s, {seen:?}");
    }
}

#[test]
fn continuous_mode_keeps_flying_while_the_answer_is_out() {
    let mut flight = Setup::preset(Preset::Default).fly(perfect(target(5.0, 40.0, 5.0), 2.0));
    flight.until("the third decision", |flight| flight.decisions().count() == 3);
    let decisions: Vec<Decision> = flight.decisions().cloned().collect();
    let thinking = flight.setpoints_since(decisions[1].queried_at).filter(|(at, _)| *at < decisions[1].answered);
    assert!(thinking.filter(|(_, setpoint)| !setpoint.is_hold()).count() > 15);
    let seen = flight.frames[usize::try_from(decisions[2].frame.0).unwrap()];
    assert!(seen.speed > 1.0, "the frame of the third question is one in motion: {seen:?}");
}

/// Two answers set the craft in motion, to the right and turning; the third is `third`, after `latency`, about a frame
/// captured in that motion; no further query is answered.
fn third_answer(latency: f64, third: String) -> Flight {
    let mut setup = Setup::preset(Preset::Default);
    setup.settings.reply_timeout = secs(30.0);
    let mut queries = 0;
    let mut flight = setup.fly(move |_, _| {
        queries += 1;
        match queries {
            1 => Answer::After(secs(0.5), navigate(0.9, 0.45, 10)),
            2 => Answer::After(secs(1.2), navigate(0.9, 0.45, 10)),
            3 => Answer::After(secs(latency), third.clone()),
            _ => Answer::Never,
        }
    });
    flight.until("the third decision", |flight| flight.decisions().count() == 3);
    let decision = flight.decisions().last().unwrap();
    let seen = flight.frames[usize::try_from(decision.frame.0).unwrap()];
    assert!(seen.speed > 1.0 && seen.yaw_rate > REST_YAW_RATE, "not flying and turning: {seen:?}");
    flight
}

/// With 3 s of latency while flying and yawing, and the target off the axis, the craft ends within 0.3 m of the plan
/// that the same frame gives without latency, and comes to rest there.
#[test]
fn a_late_plan_ends_where_the_same_frame_leads_without_latency() {
    for (u, v, depth) in [(0.2, 0.4, 9), (0.75, 0.3, 10), (0.05, 0.6, 10)] {
        let ends = [0.001, 3.0].map(|latency| {
            let mut flight = third_answer(latency, navigate(u, v, depth));
            let decision = flight.decisions().last().unwrap().clone();
            assert!(!decision.passed && (decision.latency_s - latency).abs() < 1e-6);
            let truth = flight.frames[usize::try_from(decision.frame.0).unwrap()].pose;
            assert!(decision.pose.position.distance(truth.position) < 0.05, "pose at capture {:?} {truth:?}", decision.pose);
            flight.pass(12.0);
            let goal = decision.goal.unwrap();
            assert!(flight.model.velocity.speed() < 0.1);
            assert!(flight.model.position.distance(goal.position) < 0.3, "{:?} is not at {goal:?}", flight.model.position);
            assert!(wrap_angle(flight.model.heading - goal.attitude.heading).abs() < 5.0_f64.to_radians());
            goal.position
        });
        assert!(ends[0].distance(ends[1]) < 0.3, "{ends:?}");
    }
}

/// Flown naively from the craft's position when the answer arrives, the plan would end metres away.
#[test]
fn the_latency_of_that_test_is_worth_metres() {
    let flight = third_answer(3.0, navigate(0.2, 0.4, 9));
    let decision = flight.decisions().last().unwrap();
    assert!(decision.pose_at_reply.position.distance(decision.pose.position) > 3.0);
}

#[test]
fn an_anchor_already_passed_means_hold_and_never_flying_back() {
    // A step of 1.1 m, answered when the craft is metres past it.
    let mut flight = third_answer(2.0, navigate(0.7, 0.5, 3));
    let decision = flight.decisions().last().unwrap().clone();
    assert!(decision.passed);
    let along = decision.goal.unwrap().position;
    let from = decision.pose.position;
    let way = |flight: &Flight| {
        let v = flight.model.velocity;
        (along.east - from.east) * v.east + (along.north - from.north) * v.north
    };
    for _ in 0..80 {
        flight.pass(0.1);
        assert!(way(&flight) > -0.05, "flies back at {}", flight.now);
    }
    flight.assert_stopped_since(decision.answered);
    assert!(flight.model.velocity.speed() < 0.05);
}

/// A person who walks past at arm's length leaves the image at its side, where a plan's step is short and its turn is
/// not.
#[test]
fn of_a_plan_already_passed_the_turn_is_flown() {
    for motion in [Motion::Blended, Motion::Sequential] {
        let mut setup = Setup::preset(Preset::Default);
        setup.settings.motion = motion;
        let mut queries = 0;
        let mut flight = setup.fly(move |_, _| {
            queries += 1;
            match queries {
                1 => Answer::After(secs(0.5), navigate(0.5, 0.45, 8)),
                // About a frame of this flight's first second, when the craft is already far away.
                2 => Answer::After(secs(6.0), navigate(0.95, 0.45, 1)),
                _ => Answer::Never,
            }
        });
        flight.until("the second decision", |flight| flight.decisions().count() == 2);
        let decision = flight.decisions().last().unwrap().clone();
        assert!(decision.passed, "{motion:?}");
        let goal = decision.goal.unwrap();
        let at = flight.model.position;
        for _ in 0..60 {
            flight.pass(0.1);
        }
        let off = wrap_angle(flight.model.heading - goal.attitude.heading);
        assert!(off.abs() < 0.05, "{motion:?}: {off} rad off");
        assert!(flight.model.velocity.speed() < 0.05);
        // No motion back, and forward only as far as it takes to stop.
        let on = flight.model.position.north - at.north;
        assert!((-0.1..2.5).contains(&on), "{motion:?}: {on} m");
    }
}

/// A goal ahead that is nearer than the stopping distance would require flying back: by 1.3 m at 3 m/s.
#[test]
fn a_goal_too_near_to_stop_before_is_not_flown_back_to() {
    for latency in [0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.1] {
        let mut queries = 0;
        let mut flight = Setup::preset(Preset::Default).fly(move |_, _| {
            queries += 1;
            match queries {
                1 => Answer::After(secs(0.5), navigate(0.5, 0.45, 10)),
                2 => Answer::After(secs(1.6), navigate(0.5, 0.45, 10)),
                3 => Answer::After(secs(latency), navigate(0.5, 0.45, 6)),
                _ => Answer::Never,
            }
        });
        flight.until("the third decision", |flight| flight.decisions().count() == 3);
        let decision = flight.decisions().last().unwrap().clone();
        assert_eq!(decision.passed, latency > 0.65, "{latency}");
        for _ in 0..100 {
            flight.pass(0.05);
            assert!(flight.model.velocity.north > -0.2, "{latency}: flies back at {:?}", flight.model.velocity);
        }
        let off = flight.model.position.north - decision.goal.unwrap().position.north;
        assert!(if decision.passed { (0.0..1.6).contains(&off) } else { off.abs() < 0.1 }, "{latency}: {off}");
    }
}

/// A queue that is always replaced turns and flies for ever, and never climbs.
#[test]
fn a_sequential_queue_is_flown_to_its_end_while_answers_keep_coming() {
    let mut setup = Setup::preset(Preset::Default);
    setup.settings.motion = Motion::Sequential;
    // Answers that arrive faster than queues end cost decisions.
    setup.settings.max_decisions = 500;
    // A VLM whose target stays up and ahead, so that later plans may well have been passed when they arrive.
    let mut flight = setup.fly(|_, seen| Answer::After(secs(0.5), points_at(target(6.0, 60.0, 30.0), seen)));
    flight.until("the first decision", |flight| flight.decisions().count() == 1);
    let goal = flight.decisions().next().unwrap().goal.unwrap().position;
    let by = flight.now + secs(20.0);
    flight.until("the end of the first queue", |flight| flight.model.position.distance(goal) < 0.3 || flight.now > by);
    assert!(flight.now < by, "the first plan never reached its end");
    assert!(flight.decisions().count() > 5, "answers kept coming meanwhile");
    assert!(flight.model.position.up > 4.5, "it climbed: {:?}", flight.model.position);
    assert_eq!(flight.end(), Outcome::Reached);
}

#[test]
fn a_sequential_queue_flies_one_axis_after_the_other() {
    let mut setup = Setup::preset(Preset::Paper);
    setup.settings.max_decisions = 1;
    let mut flight = setup.fly(always(navigate(0.8, 0.3, 8), 0.5));
    flight.end();
    let axis = |s: Setpoint| [s.yaw_rate, s.forward, s.up].iter().map(|x| u8::from(*x != 0.0)).collect::<Vec<_>>();
    let mut order: Vec<Vec<u8>> = flight.setpoints_since(Time::ZERO).map(|(_, s)| axis(s)).collect();
    order.retain(|axes| axes.contains(&1));
    order.dedup();
    assert_eq!(order, [vec![1, 0, 0], vec![0, 1, 0], vec![0, 0, 1]]);
}

/// At every rate that can be set, and beyond.
#[test]
fn setpoints_come_at_the_rate_that_is_set() {
    for (rate, expected) in [(10.0, 0.1), (50.0, 0.02), (0.0, 0.2), (f64::NAN, 0.2), (1e9, 0.01)] {
        let mut setup = Setup::preset(Preset::Paper);
        setup.settings.rate_hz = rate;
        let mut flight = setup.fly(always(navigate(0.5, 0.5, 9), 0.5));
        flight.until_moving();
        flight.pass(1.0);
        let times: Vec<Time> = flight.setpoints_since(flight.now - secs(1.0)).map(|(at, _)| at).collect();
        let intervals: Vec<f64> = times.windows(2).map(|pair| pair[1].since(pair[0]).as_secs_f64()).collect();
        assert!(!intervals.is_empty() && intervals.iter().all(|dt| (dt - expected).abs() < 1e-6), "{rate}: {intervals:?}");
    }
}

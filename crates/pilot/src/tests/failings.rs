//! Known failings of similar programs (docs/explanation/safety.md, "Known failings of similar programs"), as far as the
//! pilot can prevent them.

use super::*;
use spf_core::geometry::wrap_angle;

/// 1. No completion detection: the loop never ends by itself.
#[test]
fn failing_01_the_flight_ends_by_itself_when_the_target_is_reached_or_not_found() {
    for preset in PRESETS {
        let mut flight = Setup::preset(preset).fly(perfect(target(0.0, 20.0, 5.0), 1.0));
        assert_eq!(flight.end(), Outcome::Reached);
        let mut flight = Setup::preset(preset).fly(always(not_visible(Look::Left), 0.5));
        assert_eq!(flight.end(), Outcome::NotFound);
    }
}

/// 2. "Land after N errors" never fires, because swallowed errors and placeholder frames count as success.
#[test]
fn failing_02_landing_after_errors_fires_whatever_the_errors_are() {
    let answers = [
        Answer::FailsAfter(secs(0.3)),
        Answer::Never,
        Answer::After(secs(0.3), String::new()),
        Answer::After(secs(0.3), "Fly straight ahead for 100 m!".to_owned()),
        Answer::After(secs(0.3), r#"{"status":"navigating","point":[5000,500],"depth":5}"#.to_owned()),
    ];
    for preset in PRESETS {
        let mut setup = Setup::preset(preset);
        setup.settings.reply_timeout = secs(2.0);
        let answers = answers.clone();
        let mut queries = 0;
        let mut flight = setup.fly(move |_, _| {
            queries += 1;
            answers[(queries - 1) % answers.len()].clone()
        });
        assert_eq!(flight.end(), Outcome::Failed, "{preset:?}");
        assert_eq!(flight.queries.len(), 5, "the fifth in a row lands");
        assert!(flight.setpoints_since(Time::ZERO).all(|(_, setpoint)| setpoint.is_hold()), "an error is no motion");
    }
}

/// 3. A frozen, blank or placeholder frame is sent to the VLM as if it were live.
#[test]
fn failing_03_a_frozen_or_blank_frame_is_never_queried() {
    for (fault, preset) in [Fault::Freeze, Fault::Blank { p: 1.0 }, Fault::Drop].into_iter().zip([PRESETS[0]; 3]) {
        let setup = Setup::preset(preset).fault(Stream::Frames, 12.0, None, fault);
        let mut flight = setup.fly(always(navigate(0.5, 0.5, 9), 0.7));
        flight.at(Time::from_secs_f64(20.0));
        for (at, query) in &flight.queries {
            assert!(
                *at < Time::from_secs_f64(13.0) && flight.frames[query.frame.0 as usize].captured < Time::from_secs_f64(12.0)
            );
        }
        // The newest image is of 11.95 s; from 1 s after its capture nothing moves.
        flight.assert_stopped_since(Time::from_secs_f64(12.95));
        assert_eq!(flight.end(), Outcome::Failed, "{fault:?}");
        assert!(flight.finished[0].0 < Time::from_secs_f64(24.0), "{:?}", flight.finished);
    }
    // No frame is queried twice, with or without blank ones in between.
    let setup = Setup::preset(Preset::Paper).fault(Stream::Frames, 0.0, None, Fault::Blank { p: 0.7 });
    let mut flight = setup.fly(perfect(target(0.0, 25.0, 6.0), 0.2));
    assert_eq!(flight.end(), Outcome::Reached);
    let mut frames: Vec<FrameId> = flight.queries.iter().map(|(_, query)| query.frame).collect();
    frames.dedup();
    assert_eq!(frames.len(), flight.queries.len());
    for frame in frames {
        assert!(flight.delivered.iter().any(|(_, delivered)| delivered.id == frame && delivered.unusable.is_none()));
    }
}

/// 5. A timed-out call is abandoned, not cancelled: its late reply moves the drone.
#[test]
fn failing_05_the_late_reply_of_a_timed_out_call_moves_nothing() {
    for preset in PRESETS {
        let mut setup = Setup::preset(preset);
        setup.settings.reply_timeout = secs(2.0);
        let mut queries = 0;
        let mut flight = setup.fly(move |_, _| {
            queries += 1;
            if queries == 1 { Answer::After(secs(4.0), navigate(0.9, 0.2, 10)) } else { Answer::Never }
        });
        flight.until_asked(1);
        let (at, first) = flight.queries[0].clone();
        flight.at(at + secs(6.0));
        assert_eq!(flight.cancelled.first(), Some(&(at + secs(2.0), first.id)), "the call is told to end, at its deadline");
        assert_eq!((flight.pilot.late_replies(), flight.pilot.decisions()), (1, 0));
        assert!(flight.setpoints_since(Time::ZERO).all(|(_, setpoint)| setpoint.is_hold()));
        assert!(flight.queries.len() > 1, "and it is asked again");
    }
}

/// 6. Waiting twice, or unknowingly capturing the next frame while still in motion.
#[test]
fn failing_06_the_next_frame_is_one_at_rest_and_rest_is_not_waited_for_twice() {
    for preset in PRESETS {
        let mut setup = Setup::preset(preset);
        setup.settings.think = QueryTiming::Stop;
        let mut flight = setup.fly(perfect(target(-10.0, 30.0, 8.0), 1.0));
        assert_eq!(flight.end(), Outcome::Reached);
        for pair in flight.queries.windows(2) {
            let moved: Vec<Time> =
                flight.setpoints_since(pair[0].0).filter(|(at, s)| *at < pair[1].0 && !s.is_hold()).map(|(at, _)| at).collect();
            let Some(last) = moved.last() else { continue };
            let seen = flight.frames[pair[1].1.frame.0 as usize];
            assert!(seen.speed < 0.1 && seen.yaw_rate < 3.0_f64.to_radians(), "{preset:?} {seen:?}");
            // From the first true standstill to the shutter: a tick to detect it, a frame period, and no second wait.
            let still = flight.frames.iter().find(|f| f.captured > *last + secs(0.15) && f.speed < 0.1 && f.yaw_rate < 0.05);
            let waited = seen.captured.since(still.unwrap().captured);
            assert!(waited <= secs(0.35), "{preset:?}: waited {waited:?} at rest");
        }
    }
}

/// 8. A manual override does not cancel the pending reply or the command in execution; an "emergency" that only centres
///    the sticks.
#[test]
fn failing_08_an_override_cancels_reply_and_motion_and_an_emergency_cuts_the_motors() {
    for preset in PRESETS {
        let mut flight = Setup::preset(preset).fly(always(navigate(0.7, 0.5, 10), 1.0));
        flight.until_moving();
        let out = preset == Preset::Default;
        if out {
            flight.until_asked(2);
        }
        let hand = Setpoint { right: 0.0, forward: -0.5, up: 0.0, yaw_rate: 0.0 };
        flight.operator(OperatorEvent::Setpoint(hand));
        let at = flight.now;
        assert_eq!(flight.cancelled.len(), usize::from(out));
        flight.pass(5.0);
        assert!(flight.setpoints_since(at).skip_while(|(_, s)| *s != hand).all(|(_, s)| s == hand || s.is_hold()));
        assert_eq!(flight.pilot.late_replies(), u32::from(out));
        flight.operator(OperatorEvent::CutMotors);
        assert_eq!(flight.commands.last().unwrap().1, Command::EmergencyStop);
        assert_eq!(flight.phase, FlightPhase::Stopped);
    }
}

/// 10. Step scaling that changes the durations of yaw and translation alike: the turn is that of the point, at every
///     depth label.
#[test]
fn failing_10_the_turn_flown_is_that_of_the_point_whatever_the_depth() {
    for depth in [2, 6, 10] {
        let mut setup = Setup::preset(Preset::Default);
        setup.settings.max_decisions = 1;
        let mut flight = setup.fly(always(navigate(0.8, 0.5, depth), 0.5));
        flight.end();
        let turned = wrap_angle(flight.model.heading).to_degrees();
        // atan(0.6 / cos 5°) = 31.06°: the lens looks 5° down, and the turn is horizontal.
        assert!((turned - 31.06).abs() < 2.0, "label {depth}: {turned}");
    }
}

/// 11. A minimum command duration makes every step metres long; heading errors below a threshold are never corrected.
#[test]
fn failing_11_small_steps_and_small_turns_are_flown_as_small_as_they_are() {
    let mut setup = Setup::preset(Preset::Default);
    setup.settings.max_decisions = 1;
    // Label 1: 0.158 m; 0.51 is 1.1° off the axis.
    let mut flight = setup.fly(always(navigate(0.51, 0.5, 1), 0.5));
    flight.end();
    let (from, to) = (flight.decisions().next().unwrap().pose.position, flight.finished[0].2);
    let flown = from.horizontal_distance(to);
    assert!((flown - 0.158).abs() < 0.03, "{flown} m");
    assert!((flight.model.heading.to_degrees() - 1.15).abs() < 0.6, "{}", flight.model.heading.to_degrees());
}

/// 12. A depth label of 15 becomes seconds at full stick.
#[test]
fn failing_12_a_depth_label_beyond_the_scale_is_refused_or_the_greatest() {
    let reply = r#"{"status":"navigating","point":[500,500],"depth":15,"target":"crane"}"#.to_owned();
    let mut setup = Setup::preset(Preset::Default);
    setup.settings.max_decisions = 1;
    let mut flight = setup.fly(always(reply, 0.5));
    flight.end();
    assert!(flight.finished[0].2.horizontal_distance(EnuPosition::default()) < 10.5);
}

/// 15. Several encodings of the same frame in one decision; files of the second overwrite those of the first.
#[test]
fn failing_15_a_decision_sends_one_query_about_one_frame_and_ids_are_unique() {
    for preset in PRESETS {
        let mut flight = Setup::preset(preset).fly(perfect(target(8.0, 40.0, 6.0), 0.3));
        assert_eq!(flight.end(), Outcome::Reached);
        assert_eq!(flight.queries.len(), flight.decisions().count() + flight.cancelled.len());
        assert!(flight.queries.is_sorted_by(|a, b| a.1.id < b.1.id && a.1.frame < b.1.frame), "ids and frames count up");
        assert!(flight.decisions().map(|decision| decision.number).eq(1..=flight.pilot.decisions()));
    }
}

/// 17. No log from which a decision could be understood afterwards.
#[test]
fn failing_17_a_decision_record_has_pose_latency_and_reply() {
    let mut flight = Setup::preset(Preset::Default).fly(perfect(target(8.0, 40.0, 6.0), 1.25));
    assert_eq!(flight.end(), Outcome::Reached);
    for decision in flight.decisions() {
        let seen = flight.frames[decision.frame.0 as usize];
        assert!(decision.pose.position.distance(seen.pose.position) < 0.05, "{:?} {seen:?}", decision.pose);
        assert!((decision.latency_s - 1.25).abs() < 1e-9 && decision.captured == seen.captured);
        let age = decision.answered.since(seen.captured).as_secs_f64();
        assert!((decision.frame_age_s - age).abs() < 1e-9 && decision.frame_age_s >= 1.4 - 1e-9);
        assert!(!decision.reply.is_empty() && decision.reading.reply.is_some() && !decision.query.prompt.is_empty());
        assert_eq!(decision.goal.is_some(), decision.step == "move");
        if decision.step == "move" {
            let reading = &decision.reading;
            assert!(reading.waypoint.is_some() && reading.step.is_some() && reading.primitives.is_some());
        }
        let text = serde_json::to_string(decision).unwrap();
        assert_eq!(&serde_json::from_str::<Decision>(&text).unwrap(), decision, "it can be read back");
    }
}

//! The pilot's actions on its own, one test for each row of that table in `docs/explanation/safety.md`.

use super::*;
use spf_core::geometry::wrap_angle;
use spf_core::reply::{ReplyError, ReplyStream, parse_reply};

/// The default preset in obstacle mode.
fn avoiding() -> Setup {
    let mut setup = Setup::preset(Preset::Default);
    setup.settings.avoid = true;
    setup
}

/// Headings of the queried frames, degrees, until the first climb.
fn looked(flight: &mut Flight) -> Vec<f64> {
    flight.until("a climb", |flight| flight.decisions().any(|d| d.reading.primitives.is_some_and(|p| p.climb > 0.0)));
    let heading = |query: &Query| flight.frames[usize::try_from(query.frame.0).unwrap()].pose.attitude.heading.to_degrees();
    flight.queries.iter().map(|(_, query)| heading(query)).collect()
}

#[test]
fn left_right_left_and_behind_twice_are_no_full_turn_of_a_search() {
    for looks in [&[Look::Left, Look::Right][..], &[Look::Behind]] {
        let mut asked = 0;
        let mut flight = Setup::preset(Preset::Default).fly(move |_, _| {
            asked += 1;
            Answer::After(secs(0.4), not_visible(looks[asked % looks.len()]))
        });
        let seen = looked(&mut flight);
        let shown = |to: f64| seen.iter().any(|at| wrap_angle((at - to).to_radians()).to_degrees().abs() <= 45.0);
        assert!((0..360).all(|degrees| shown(f64::from(degrees))), "{looks:?}: {seen:?}");
    }
}

#[test]
fn in_obstacle_mode_a_reply_without_its_list_of_boxes_is_refused() {
    let profile = GroundingProfile::default();
    let steps = [
        r#"{"status":"navigating","point":[500,500],"depth":5BOXES}"#,
        r#"{"status":"not_visible","look":"left","point":[500,500],"depth":5BOXES}"#,
        r#"{"status":"not_visible","look":"up"BOXES}"#,
    ];
    let malformed = [r#","boxes":"none""#, r#","boxes":[{"depth":3}]"#, r#","boxes":[{"box":[1,2,3],"depth":3}]"#];
    for step in &steps[..2] {
        let with = |boxes: &str| step.replace("BOXES", boxes);
        for without in ["", r#","boxes":null"#] {
            let missing = ReplyError::Missing { field: "boxes".to_owned() };
            assert_eq!(parse_reply(&with(without), &profile, true), Err(missing.clone()), "{step}");
            let mut stream = ReplyStream::new(profile, true);
            stream.push(&with(without));
            assert_eq!(stream.early(), None, "{step}");
            assert_eq!(stream.finish(), Err(missing), "{step}");
        }
        for boxes in malformed {
            assert!(parse_reply(&with(boxes), &profile, true).is_err(), "{step} {boxes}");
        }
        assert_eq!(parse_reply(&with(r#","boxes":[]"#), &profile, true).unwrap().boxes, []);
    }
    // As in whole flights: such replies cause no motion, and the fifth lands the craft.
    for step in [steps[0], steps[1], steps[2]] {
        let mut flight = avoiding().fly(always(step.replace("BOXES", ""), 0.4));
        assert_eq!(flight.end(), Outcome::Failed, "{step}");
        assert!(flight.setpoints_since(Time::ZERO).all(|(_, setpoint)| setpoint.is_hold()), "{step}");
        assert!(flight.decisions().all(|decision| decision.reading.refused.is_some()), "{step}");
    }
    let mut flight = avoiding().fly(always(steps[0].replace("BOXES", r#","boxes":[]"#), 0.4));
    flight.until_moving();
}

#[test]
fn an_obstacle_at_an_unknown_range_is_near() {
    let wall = r#"{"status":"navigating","point":[500,500],"depth":9,"boxes":[{"box":[0,0,1000,1000],"name":"wall"DEPTH}]}"#;
    for depth in ["", r#","depth":null"#] {
        let mut flight = avoiding().fly(always(wall.replace("DEPTH", depth), 0.4));
        flight.until_asked(3);
        assert!(flight.setpoints_since(Time::ZERO).all(|(_, setpoint)| setpoint.is_hold()), "{depth}");
    }
    let far = r#","depth":9"#;
    avoiding().fly(always(wall.replace("DEPTH", far), 0.4)).until_moving();
}

/// When replies were set aside, and why.
fn set_aside(flight: &Flight) -> Vec<(Time, String)> {
    let reason = |(at, note): &(Time, Note)| match note {
        Note::QueryFailed { reason, .. } => Some((*at, reason.clone())),
        _ => None,
    };
    flight.notes.iter().filter_map(reason).collect()
}

#[test]
fn a_reply_older_than_its_limit_moves_nothing_and_the_query_is_repeated() {
    let mut flight = Setup::preset(Preset::Default).fly(always(navigate(0.5, 0.5, 9), 9.0));
    // Not a failed reply: more than five do not end a flight.
    assert_eq!(flight.end(), Outcome::Timeout);
    let aside = set_aside(&flight);
    assert!(aside.len() > 5, "{aside:?}");
    for (at, reason) in &aside {
        assert!(reason.contains("s old (limit 8 s), and the craft has flown on"), "{reason}");
        // Queried again at rest, and until that reply there is no motion.
        let Some((asked, query)) = flight.queries.iter().find(|(asked, _)| asked >= at) else { continue };
        assert!(asked.since(*at) < secs(3.0), "{asked}");
        assert!(flight.frames[usize::try_from(query.frame.0).unwrap()].speed < 0.1);
        let moved = flight.setpoints_since(*at + STOP_RULE).find(|(_, setpoint)| !setpoint.is_hold());
        assert!(moved.is_none_or(|(moved, _)| moved >= *asked + secs(9.0)), "{at} {moved:?}");
    }
    // Under the limit it flies on.
    let mut flight = Setup::preset(Preset::Default).fly(always(navigate(0.5, 0.5, 9), 7.0));
    assert_eq!((flight.end(), set_aside(&flight)), (Outcome::Timeout, Vec::new()));
    let mut setup = Setup::preset(Preset::Default);
    setup.settings.max_reply_age = secs(2.0);
    let mut flight = setup.fly(always(navigate(0.5, 0.5, 9), 3.0));
    flight.until("an old reply", |flight| !set_aside(flight).is_empty());
}

#[test]
fn an_answer_on_a_frame_from_before_the_camera_stopped_moves_nothing() {
    // In the middle of a motion, with an answer on its way; the pose is known all the time.
    for fault in [Fault::Freeze, Fault::Blank { p: 1.0 }, Fault::Drop] {
        let mut flight =
            Setup::preset(Preset::Default).fault(Stream::Frames, 14.0, Some(17.0), fault).fly(always(navigate(0.5, 0.5, 9), 5.0));
        flight.at(Time::from_secs_f64(40.0));
        let aside = set_aside(&flight);
        let [(at, reason)] = aside.as_slice() else { panic!("{fault:?}: {aside:?}") };
        assert!(
            reason.contains("the camera stopped after its frame") && (14.0..17.1).contains(&at.as_secs_f64()),
            "{at} {reason}"
        );
        // Asked again on a frame from after it, and without motion until that answer.
        let asked = flight.queries.iter().map(|(asked, _)| *asked).find(|asked| asked > at).unwrap();
        assert!((17.0..20.0).contains(&asked.as_secs_f64()), "{asked}");
        let moved = flight.setpoints_since(*at + STOP_RULE).find(|(_, setpoint)| !setpoint.is_hold()).unwrap().0;
        assert!(moved >= asked + secs(5.0), "{asked} {moved}");
    }
    // A craft at rest has not gone anywhere: its answer is flown.
    let paper = Setup::preset(Preset::Paper).fault(Stream::Frames, 14.0, Some(17.0), Fault::Drop);
    let mut flight = paper.fly(always(navigate(0.5, 0.5, 9), 8.0));
    flight.at(Time::from_secs_f64(40.0));
    assert_eq!(set_aside(&flight), Vec::new());
}

#[test]
fn a_craft_that_has_held_since_the_frame_uses_a_reply_of_any_age() {
    let mut setup = Setup::preset(Preset::Paper);
    setup.settings.reply_timeout = secs(120.0);
    setup.settings.max_time = secs(300.0);
    let mut flight = setup.fly(always(navigate(0.5, 0.5, 9), 60.0));
    assert_eq!((flight.end(), set_aside(&flight)), (Outcome::Timeout, Vec::new()));
    assert!(flight.decisions().filter(|decision| decision.step == "move").count() > 3);
    assert!(flight.model.position.north > 20.0, "{:?}", flight.model.position);
}

#[test]
fn after_motion_of_a_craft_whose_pose_is_unknown_a_reply_moves_nothing() {
    type Report = fn(Telemetry) -> Telemetry;
    let reports: [(Report, bool); 3] = [
        (|telemetry| Telemetry { position: None, velocity: None, ..telemetry }, true),
        // Its velocity determines its position relative to the frame.
        (|telemetry| Telemetry { position: None, ..telemetry }, false),
        (|telemetry| telemetry, false),
    ];
    for (report, unknown) in reports {
        let mut setup = Setup::preset(Preset::Default);
        setup.reports = report;
        let mut flight = setup.fly(always(navigate(0.5, 0.5, 9), 1.5));
        flight.until_asked(6);
        let aside = set_aside(&flight);
        assert_eq!(!aside.is_empty(), unknown, "{aside:?}");
        for (at, reason) in aside {
            assert!(reason.contains("has moved") && reason.contains("its pose is unknown"), "{reason}");
            let next = flight.queries.iter().find(|(asked, _)| *asked >= at).map_or(Time::MAX, |(asked, _)| *asked);
            let moved = flight.setpoints_since(at + STOP_RULE).find(|(_, setpoint)| !setpoint.is_hold());
            assert!(moved.is_none_or(|(moved, _)| moved > next), "{moved:?}");
        }
    }
    // Turned more than 10° by commands alone.
    let mut setup = Setup::preset(Preset::Default);
    setup.reports = |telemetry| Telemetry { position: None, velocity: None, ..telemetry };
    let mut flight = setup.fly(always(navigate(0.95, 0.5, 1), 1.0));
    flight.until("a reply set aside", |flight| set_aside(flight).iter().any(|(_, reason)| reason.contains("has turned")));
}

#[test]
fn a_gap_in_dead_reckoning_leaves_the_pose_unknown() {
    let setup = Setup::preset(Preset::Default).fault(Stream::Telemetry, 14.0, Some(15.3), Fault::Drop);
    let mut flight = Setup { reports: |telemetry| Telemetry { position: None, ..telemetry }, ..setup }
        .fly(always(navigate(0.5, 0.5, 10), 3.0));
    flight.at(Time::from_secs_f64(25.0));
    let aside = set_aside(&flight);
    assert!(aside.iter().all(|(at, _)| (15.0..19.0).contains(&at.as_secs_f64())) && !aside.is_empty(), "{aside:?}");
}

/// In obstacle mode, a search to the right without obstacles for `free` replies; then `look`, below a beam.
fn below_a_beam(free: usize, look: &'static str) -> Flight {
    let mut asked = 0;
    avoiding().fly(move |_, _| {
        asked += 1;
        let beam = r#"{"box":[0,300,200,700],"depth":2,"name":"beam"}"#;
        let (look, boxes) = if asked <= free { ("right", "") } else { (look, beam) };
        Answer::After(secs(0.4), format!(r#"{{"status":"not_visible","look":"{look}","boxes":[{boxes}]}}"#))
    })
}

/// Climbs of the decisions so far, metres.
fn climbs(flight: &Flight) -> Vec<f64> {
    flight.decisions().filter_map(|d| d.reading.primitives).map(|p| p.climb).filter(|climb| *climb != 0.0).collect()
}

#[test]
fn what_replaces_a_climb_that_is_not_clear_is_checked_too() {
    // Five turns are a full turn, after which the search climbs: instead of the look up, unless that is checked as well.
    for look in ["up", "right"] {
        let mut flight = below_a_beam(5, look);
        assert_eq!(flight.end(), Outcome::NotFound, "{look}");
        assert!(climbs(&flight).is_empty(), "{look}: {:?}", climbs(&flight));
        assert!(flight.decisions().any(|d| d.reading.actions.iter().any(|action| action.contains("not looking up or down"))));
    }
    let mut flight = below_a_beam(100, "right");
    assert_eq!((flight.end(), climbs(&flight)), (Outcome::NotFound, vec![3.0]));
}

#[test]
fn a_climb_is_kept_clear_of_what_was_seen_from_here() {
    // A beam in every second frame, which the frames between do not show; the look up is answered on one of those.
    let flown = |name: &'static str, latency: f64| {
        let mut asked = 0;
        let mut flight = avoiding().fly(move |_, _| {
            asked += 1;
            let (look, boxes) = match asked {
                1 => ("left", format!(r#"{{"box":[0,300,200,700],"depth":2,"name":"{name}"}}"#)),
                _ => ("up", String::new()),
            };
            Answer::After(secs(latency), format!(r#"{{"status":"not_visible","look":"{look}","boxes":[{boxes}]}}"#))
        });
        flight.until_asked(3);
        let frame = |n: usize| flight.queries[n].1.frame;
        let captured = |n: usize| flight.frames[usize::try_from(frame(n).0).unwrap()].captured;
        (captured(1).since(captured(0)), climbs(&flight))
    };
    for (name, latency, apart_at_most, climbs) in [
        ("beam", 0.1, 3.0, vec![]),
        ("beam", 3.0, 10.0, vec![]),
        // The craft is still below it.
        ("beam", 11.0, 30.0, vec![]),
        // A person walks on.
        ("woman", 0.1, 3.0, vec![]),
        ("woman", 1.5, 5.0, vec![]),
        ("woman", 6.0, 30.0, vec![1.0]),
    ] {
        let (apart, climbed) = flown(name, latency);
        assert!(apart < secs(apart_at_most) && climbed == climbs, "{name} {latency}: {apart:?} {climbed:?}");
    }
}

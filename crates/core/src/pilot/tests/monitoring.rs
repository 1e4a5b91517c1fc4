//! Flights that a monitor watches.

use super::*;
use crate::guidance::Guidance;
use crate::monitor::{JudgedBy, Judgement, Verdict};
use crate::query::QueryKind;
use crate::reply::ObstacleBox;
use crate::track::{TrackQuality, TrackReport, TrackStart};

const LATENCY: f64 = 1.5;

fn setup(monitor: bool, track: bool) -> Setup {
    let mut setup = Setup::preset(Preset::Default);
    setup.settings.guidance = Guidance { slow_anchor: true, monitor, track, ..Guidance::default() };
    (setup.settings.near_m, setup.settings.max_decisions) = (Some(3.0), 200);
    setup
}

/// A VLM with perfect perception, whose monitor says what `state` gives for the time of capture.
fn watched(goal: EnuPosition, state: impl Fn(f64, &Seen) -> &'static str + 'static) -> impl FnMut(&Query, &Seen) -> Answer {
    move |query, seen| match query.kind {
        QueryKind::Monitor => Answer::After(secs(0.5), format!("{{\"state\":\"{}\"}}", state(seen.captured.as_secs_f64(), seen))),
        _ => Answer::After(secs(LATENCY), points_at(goal, seen)),
    }
}

fn is_monitors(query: &Query) -> bool {
    query.kind == QueryKind::Monitor
}

fn judgements(flight: &Flight) -> Vec<(Time, Judgement)> {
    let of = |(at, note): &(Time, Note)| if let Note::Monitor(judgement) = note { Some((*at, *judgement)) } else { None };
    flight.notes.iter().filter_map(of).collect()
}

/// The first judgement that changes something.
fn first_effect(flight: &Flight) -> Option<(Time, Judgement)> {
    judgements(flight).into_iter().find(|(_, judgement)| judgement.verdict != Verdict::Continue && !judgement.outdated)
}

#[test]
fn a_monitor_that_sees_nothing_wrong_changes_nothing() {
    let goal = target(2.0, 60.0, 4.0);
    let mut flight = setup(true, false).fly(watched(goal, |_, _| "continue"));
    assert_eq!(flight.end(), Outcome::Reached);
    let mut without = setup(false, false).fly(perfect(goal, LATENCY));
    assert_eq!(without.end(), Outcome::Reached);
    assert!(flight.commands == without.commands, "the same flight to the last command");
    let policy = |flight: &Flight| flight.queries.iter().filter(|(_, query)| !is_monitors(query)).cloned().collect::<Vec<_>>();
    assert_eq!(policy(&flight), policy(&without));

    let asked: Vec<&(Time, Query)> = flight.queries.iter().filter(|(_, query)| is_monitors(query)).collect();
    assert!(asked.len() > 5);
    for pair in asked.windows(2) {
        assert!(pair[1].0.since(pair[0].0) >= secs(2.0) - secs(0.001), "{} {}", pair[0].0, pair[1].0);
        assert!(pair[1].1.id > pair[0].1.id);
    }
    let (_, query) = asked[2];
    assert_eq!((query.image_size, query.near_m, query.memory.stage), (Some((384, 288)), Some(3.0), 1));
    // The target is ahead: the region around it, 0.4 of the frame wide.
    let region = query.close_up.unwrap();
    assert!((region.right - region.left - 0.4).abs() < 1e-9 && region.contains(ImagePoint { u: 0.5, v: 0.5 }), "{region:?}");
    assert!(query.prompt.contains("«fly to the red crane»") && query.prompt.contains("The second image"), "{}", query.prompt);
}

#[test]
fn a_stop_brakes_and_the_second_look_alone_finishes() {
    let goal = target(0.0, 40.0, 4.0);
    let near = move |_, seen: &Seen| if seen.pose.position.distance(goal) < 6.0 { "stop" } else { "continue" };
    let mut flight = setup(true, false).fly(watched(goal, near));
    flight.until("a stop", |flight| first_effect(flight).is_some());
    let (at, judgement) = first_effect(&flight).unwrap();
    assert_eq!((judgement.verdict, judgement.by, judgement.side), (Verdict::Stop, JudgedBy::Vlm, None));
    flight.until("the second look", |flight| flight.queries.last().is_some_and(|(then, _)| *then > at));
    flight.assert_stopped_since(at);
    let (_, query) = flight.queries.last().unwrap();
    assert!(query.memory.confirming && !is_monitors(query));
    let seen = flight.frames[query.frame.0 as usize];
    assert!(seen.speed < 0.15 && seen.captured >= at, "taken at rest: {} m/s", seen.speed);
    assert_eq!(flight.end(), Outcome::Reached);

    // A monitor that always says stop does not end a flight: the second look does not confirm it.
    let far = target(0.0, 60.0, 4.0);
    let mut flight = setup(true, false).fly(watched(far, |_, _| "stop"));
    assert_eq!(flight.end(), Outcome::Reached);
    assert!(flight.frames.last().unwrap().pose.position.distance(far) < 5.0 || flight.finished[0].2.distance(far) < 5.0);
}

#[test]
fn a_loss_holds_and_searches_on_the_side_where_the_target_was() {
    // Seen until 14 s, 12 m to the left of the way, and never again.
    let goal = target(-12.0, 60.0, 4.0);
    let mut flight = setup(true, false).fly(move |query, seen| {
        let gone = seen.captured > Time::from_millis(14_000);
        match (&query.kind, gone) {
            (QueryKind::Monitor, _) => {
                Answer::After(secs(0.3), format!("{{\"state\":\"{}\"}}", if gone { "lost" } else { "continue" }))
            }
            // The VLM does not know where it is.
            (_, true) => Answer::After(secs(4.0), json(&Reply::new(Status::NotVisible))),
            (_, false) => Answer::After(secs(LATENCY), points_at(goal, seen)),
        }
    });
    flight.until("a loss", |flight| first_effect(flight).is_some());
    let (at, judgement) = first_effect(&flight).unwrap();
    assert_eq!((judgement.verdict, judgement.by), (Verdict::Lost, JudgedBy::Vlm));
    flight.pass(1.0);
    flight.assert_stopped_since(at);
    assert!(flight.cancelled.iter().any(|(then, _)| *then == at), "a reply about an earlier frame is out of date");
    flight.until("a turn", |flight| flight.now > at + secs(3.0) && flight.setpoint().yaw_rate != 0.0);
    let looks = flight.queries.iter().filter(|(then, query)| *then >= at && !is_monitors(query)).count();
    assert_eq!(looks, 1, "the monitor has not seen it, and one look at rest has not: that is enough");
    let left = judgement.side == Some(Look::Left);
    assert_eq!(flight.setpoint().yaw_rate < 0.0, left, "{judgement:?}");
    // It never lands by itself: the search has its own end.
    assert_eq!(flight.end(), Outcome::NotFound);
}

#[test]
fn a_track_that_is_lost_where_the_target_should_be_is_a_loss_without_any_query() {
    let goal = target(0.0, 400.0, 4.0);
    let mut flight = setup(true, true).fly(watched(goal, |_, _| "continue"));
    flight.until("a track", |flight| flight.tracked.len() >= 2);
    let (began, mut steps) = (flight.now, 0);
    while first_effect(&flight).is_none() {
        assert!(steps < 60, "no loss");
        let TrackStart { id, frame, area } = flight.tracked.last().unwrap().1.unwrap();
        let captured = flight.now;
        flight.tell(Event::Track(TrackReport { id, frame, captured, area, scale: 1.0, quality: TrackQuality::Lost }));
        flight.pass(0.1);
        steps += 1;
    }
    let (at, judgement) = first_effect(&flight).unwrap();
    assert_eq!((judgement.verdict, judgement.by), (Verdict::Lost, JudgedBy::Pilot));
    assert!(at >= began + secs(0.9), "{began} {at}");
    flight.pass(0.5);
    flight.assert_stopped_since(at);
}

#[test]
fn a_craft_that_is_held_in_place_is_stuck_and_looks_from_rest() {
    let mut stuck = setup(true, false);
    // The craft reports that it stands, whatever it is told.
    stuck.reports = |telemetry| {
        let up = telemetry.position.map_or(0.0, |position| position.up);
        Telemetry {
            position: Some(EnuPosition { east: 0.0, north: 0.0, up }),
            velocity: Some(EnuVelocity::default()),
            ..telemetry
        }
    };
    let mut flight = stuck.fly(|query, _| match query.kind {
        QueryKind::Monitor => Answer::After(secs(0.5), r#"{"state":"continue"}"#.to_owned()),
        _ => Answer::After(
            secs(LATENCY),
            points_at(
                target(0.0, 30.0, 3.0),
                &Seen {
                    pose: Pose { position: target(0.0, 0.0, 3.0), ..Pose::default() },
                    speed: 0.0,
                    yaw_rate: 0.0,
                    captured: Time::ZERO,
                },
            ),
        ),
    });
    flight.until("stuck", |flight| first_effect(flight).is_some());
    let (at, judgement) = first_effect(&flight).unwrap();
    assert_eq!((judgement.verdict, judgement.by), (Verdict::Stuck, JudgedBy::Pilot));
    flight.pass(0.5);
    flight.assert_stopped_since(at);
}

#[test]
fn nonsense_failures_and_late_words_change_nothing() {
    let goal = target(0.0, 60.0, 4.0);
    for (name, answer) in [
        ("nonsense", Answer::After(secs(0.5), "stop, I think".to_owned())),
        ("failure", Answer::FailsAfter(secs(0.5))),
        ("silence", Answer::Never),
        // By then replies about newer frames have told where the target is.
        ("late", Answer::After(secs(5.0), r#"{"state":"lost"}"#.to_owned())),
    ] {
        let mut flight = setup(true, false).fly(move |query, seen| match query.kind {
            QueryKind::Monitor => answer.clone(),
            _ => Answer::After(secs(LATENCY), points_at(goal, seen)),
        });
        assert_eq!(flight.end(), Outcome::Reached, "{name}");
        let mut without = setup(false, false).fly(perfect(goal, LATENCY));
        without.end();
        // A reply that arrives at the instant of a tick may come before or after it.
        let moving = |flight: &Flight| flight.setpoints_since(Time::ZERO).filter(|(_, setpoint)| !setpoint.is_hold()).count();
        assert!(moving(&flight).abs_diff(moving(&without)) <= 1, "{name} {:?}", judgements(&flight));
        assert!(flight.commands == without.commands || name == "late", "{name}");
        let failed = flight
            .notes
            .iter()
            .any(|(_, note)| matches!(note, Note::QueryFailed { reason, .. } if reason.starts_with("the monitor: ")));
        assert_eq!(failed, name != "late", "{name}");
        assert!(judgements(&flight).iter().all(|(_, judgement)| judgement.outdated), "{name} {:?}", judgements(&flight));
    }
}

#[test]
fn without_blended_continuous_motion_and_in_a_search_nothing_is_asked() {
    let mut paper = Setup::preset(Preset::Paper);
    paper.settings.guidance.monitor = true;
    let goal = target(0.0, 30.0, 4.0);
    let mut flight = paper.fly(watched(goal, |_, _| "lost"));
    assert_eq!(flight.end(), Outcome::Reached);
    assert!(!flight.queries.iter().any(|(_, query)| is_monitors(query)));

    let mut flight = setup(true, false).fly(always(not_visible(Look::Right), 0.5));
    assert_eq!(flight.end(), Outcome::NotFound);
    assert!(!flight.queries.iter().any(|(_, query)| is_monitors(query)));
}

/// Whether a flight whose target is hidden from 14 s until then, with a box in front of it or without, turns away; and when it ends.
fn turns_away(monitor: bool, until: f64, with_box: bool) -> (bool, Time) {
    let goal = target(0.0, 60.0, 4.0);
    let mut setup = setup(monitor, false);
    setup.settings.avoid = true;
    let mut flight = setup.fly(move |query, seen| {
        let hidden = (14.0..until).contains(&seen.captured.as_secs_f64());
        let mut reply = match hidden {
            true => Reply { look: Some(Look::Right), ..Reply::new(Status::NotVisible) },
            false => crate::reply::parse_reply(&points_at(goal, seen), &GroundingProfile::default(), false).unwrap(),
        };
        let area = ImageBox { left: 0.3, top: 0.2, right: 0.7, bottom: 0.7 };
        reply.boxes.extend((hidden && with_box).then(|| ObstacleBox { area, depth: 5, name: "truck".to_owned() }));
        Answer::After(
            secs(1.0),
            match query.kind {
                QueryKind::Monitor => format!("{{\"state\":\"{}\"}}", if hidden { "lost" } else { "continue" }),
                _ => reply.to_json(&GroundingProfile::default(), true),
            },
        )
    });
    assert_eq!(flight.end(), Outcome::Reached, "{monitor} {until} {with_box}");
    let turned = flight.setpoints_since(Time::ZERO).any(|(_, setpoint)| setpoint.yaw_rate.abs() > 0.5);
    (turned, flight.finished[0].0)
}

#[test]
fn a_target_that_is_hidden_for_a_moment_is_waited_for_before_the_craft_turns_away() {
    let (with, without) = (turns_away(true, 19.0, true), turns_away(false, 19.0, true));
    assert!(!with.0 && without.0 && with.1 < without.1, "{with:?} {without:?}");
    assert!(!turns_away(true, 15.5, false).0, "a second look has seen it again");
    // What nothing hides is gone, and what is hidden for ever is searched for.
    let (gone, hidden) = (turns_away(true, 19.0, false), turns_away(true, 26.0, true));
    assert!(gone.0 && hidden.0, "{gone:?} {hidden:?}");
}

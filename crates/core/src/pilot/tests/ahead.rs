//! Two open queries while searching.

use super::*;
use crate::geometry::wrap_angle;
use crate::reply::ObstacleBox;

fn asking(ask: AskWhen) -> Setup {
    let mut setup = Setup::preset(Preset::Default);
    setup.settings.ask = ask;
    setup
}

/// Number of queries that are neither answered nor cancelled at a time.
fn open_at(flight: &Flight, time: Time) -> usize {
    let ended = |id: QueryId| {
        let answered = flight.decisions().find(|decision| decision.query.id == id).map(|decision| decision.answered);
        let failed = flight.notes.iter().find_map(|(at, note)| match note {
            Note::QueryFailed { id: failed, .. } if *failed == id => Some(*at),
            _ => None,
        });
        let cancelled = flight.cancelled.iter().find(|(_, cancelled)| *cancelled == id).map(|(at, _)| *at);
        [answered, failed, cancelled].into_iter().flatten().min()
    };
    flight.queries.iter().filter(|(asked, query)| *asked <= time && ended(query.id).is_none_or(|end| end > time)).count()
}

fn most_open(flight: &Flight) -> usize {
    flight.queries.iter().map(|(asked, _)| open_at(flight, *asked)).max().unwrap()
}

fn seconds(flight: &Flight) -> f64 {
    flight.finished[0].0.as_secs_f64()
}

/// A search that finds nothing, with answers that take this long.
fn searched(ask: AskWhen, latency: f64) -> Flight {
    let mut flight = asking(ask).fly(always(not_visible(Look::Right), latency));
    assert_eq!(flight.end(), Outcome::NotFound);
    flight
}

/// Prints the table of docs/guide/vlm.md.
#[test]
fn seconds_of_a_search() {
    for (latency, part) in [(1.0, 0.85), (2.0, 0.8), (4.0, 0.75), (6.0, 0.75)] {
        let (one, two) = (seconds(&searched(AskWhen::Always, latency)), seconds(&searched(AskWhen::News, latency)));
        println!("| {latency} s | {one:.0} | {two:.0} |");
        assert!(two < part * one, "{latency} s: {one} {two}");
    }
}

#[test]
fn a_search_asks_about_the_next_view_before_the_last_one_is_answered() {
    let (one, two) = (searched(AskWhen::Always, 4.0), searched(AskWhen::News, 4.0));
    assert_eq!((most_open(&one), most_open(&two)), (1, 2));
    // The same views, in the same order, each from rest.
    let turns = |flight: &Flight| -> Vec<(f64, f64)> {
        let primitives = flight.decisions().filter_map(|decision| decision.reading.primitives);
        primitives.map(|p| (p.yaw.to_degrees().round(), p.climb)).collect()
    };
    assert_eq!(turns(&two), turns(&one));
    let headings = |flight: &Flight| -> Vec<(f64, f64)> {
        let asked = flight.queries.iter().map(|(_, query)| (query, flight.frames[usize::try_from(query.frame.0).unwrap()]));
        asked.map(|(query, seen)| (seen.pose.attitude.heading, query.memory.turned.to_degrees().round())).collect()
    };
    for ((heading, turned), (expected, told)) in headings(&two).into_iter().zip(headings(&one)) {
        assert!(wrap_angle(heading - expected).abs() < 3.0_f64.to_radians(), "{heading} {expected}");
        assert_eq!(turned, told);
    }
    for (_, query) in &two.queries {
        let seen = two.frames[usize::try_from(query.frame.0).unwrap()];
        assert!(seen.speed < 0.1 && seen.yaw_rate < 3.0_f64.to_radians(), "half a turn answers nothing");
    }
    assert_eq!(two.cancelled, [], "every answer is of use");
}

/// An answer that shows the target makes the turn that was begun, and the query about what it shows, void.
#[test]
fn a_target_that_is_found_is_flown_to_from_beyond_it() {
    for (right, forward) in [(30.0, -5.0), (-20.0, -30.0), (-30.0, 3.0)] {
        for latency in [0.5, 2.0, 4.0] {
            let mut flight = asking(AskWhen::News).fly(perfect(target(right, forward, 4.0), latency));
            assert_eq!(flight.end(), Outcome::Reached, "{right} {forward} {latency}");
            assert!(flight.finished[0].2.distance(target(right, forward, 4.0)) < 3.5);
            assert!(most_open(&flight) <= 2);
            assert!(flight.cancelled.len() <= 1, "{:?}", flight.cancelled);
        }
    }
}

/// A flight in which the second answer is this one and all others see nothing, with `latency` seconds.
fn second_is(text: String, latency: f64, setup: Setup) -> Flight {
    let mut queries = 0;
    let nothing = Reply { look: Some(Look::Right), ..Reply::new(Status::NotVisible) };
    let nothing = nothing.to_json(&GroundingProfile::default(), setup.settings.avoid);
    setup.fly(move |_, _| {
        queries += 1;
        Answer::After(secs(latency), if queries == 2 { text.clone() } else { nothing.clone() })
    })
}

/// The heading from which a query was asked, degrees, less that of another.
fn turned(flight: &Flight, from: usize, to: usize) -> f64 {
    let heading = |i: usize| flight.frames[usize::try_from(flight.queries[i].1.frame.0).unwrap()].pose.attitude.heading;
    wrap_angle(heading(to) - heading(from)).to_degrees().round()
}

/// An answer that came too late for a craft that has turned on is asked for again, and then it waits.
#[test]
fn answers_older_than_permitted_end_no_search() {
    let (one, two) = (searched(AskWhen::Always, 9.0), searched(AskWhen::News, 9.0));
    let failed = |flight: &Flight| flight.notes.iter().filter(|(_, note)| matches!(note, Note::QueryFailed { .. })).count();
    assert_eq!((failed(&one), failed(&two)), (0, 1));
    assert_eq!(two.decisions().count(), one.decisions().count());
    assert_eq!(most_open(&two), 2);
}

/// A second look, or a step back, is decided by the view that was answered, and not by the one to which the craft has turned.
#[test]
fn what_must_be_looked_at_again_is_turned_back_to() {
    let mut flight = second_is(done(), 4.0, asking(AskWhen::News));
    flight.until_asked(4);
    assert!((turned(&flight, 1, 2) - 72.0).abs() < 3.0);
    assert!(turned(&flight, 1, 3).abs() < 3.0, "{}", turned(&flight, 1, 3));
    assert!(flight.queries[3].1.memory.confirming);

    let mut setup = asking(AskWhen::News);
    setup.settings.avoid = true;
    let area = ImageBox { left: 0.4, top: 0.1, right: 0.6, bottom: 1.0 };
    let person = ObstacleBox { name: "person".to_owned(), area, depth: 1 };
    let reply = Reply { boxes: vec![person], look: Some(Look::Right), ..Reply::new(Status::NotVisible) };
    let mut flight = second_is(reply.to_json(&GroundingProfile::default(), true), 3.0, setup);
    flight.until_asked(3);
    let at = flight.model.position;
    flight.until_asked(4);
    assert!(turned(&flight, 1, 3).abs() < 3.0, "{}", turned(&flight, 1, 3));
    let told = flight.decisions().nth(1).unwrap();
    assert_eq!((told.step.as_str(), told.reading.primitives), ("move", None), "what it does not fly is not told");
    assert_eq!(told.reading.actions, ["turns back to that view first"]);
    assert!(flight.model.position.distance(at) < 0.1, "it does not back off from where it looks by then");
}

/// The second query was about a part of the instruction that has ended.
#[test]
fn a_part_that_ends_makes_the_second_query_void() {
    let next = Reply { stage: Some(2), look: Some(Look::Right), ..Reply::new(Status::NotVisible) };
    let mut flight = second_is(json(&next), 4.0, asking(AskWhen::News));
    flight.until_asked(4);
    let cancelled: Vec<QueryId> = flight.cancelled.iter().map(|(_, id)| *id).collect();
    assert_eq!(cancelled, [flight.queries[2].1.id]);
    assert_eq!(flight.queries[3].1.memory.stage, 2);
}

/// An answer that asks for another view than the one the craft has turned to.
#[test]
fn another_turn_than_the_one_begun_is_flown_from_the_view_that_was_answered() {
    let mut queries = 0;
    let mut flight = asking(AskWhen::News).fly(move |_, _| {
        queries += 1;
        Answer::After(secs(4.0), not_visible(if queries == 2 { Look::Left } else { Look::Right }))
    });
    flight.until_asked(4);
    let turned = |from: usize, to: usize| turned(&flight, from, to);
    assert!((turned(0, 1) - 72.0).abs() < 3.0 && (turned(1, 2) - 72.0).abs() < 3.0);
    assert_eq!(flight.cancelled.iter().map(|(_, id)| *id).collect::<Vec<_>>(), [flight.queries[2].1.id]);
    // From the view that was answered, not from where the craft is: back to the first view, which a sweep sees last.
    assert!((turned(1, 3) + 72.0).abs() < 3.0, "{}", turned(1, 3));
}

#[test]
fn failed_and_overtaken_answers_are_asked_for_again() {
    for case in 0..4 {
        let mut queries = 0;
        let mut flight = asking(AskWhen::News).fly(move |_, _| {
            queries += 1;
            match (case, queries) {
                (0, 2) | (1, 3) => Answer::FailsAfter(secs(2.0)),
                // The second of two comes first.
                (2, 2) => Answer::After(secs(6.0), not_visible(Look::Right)),
                (3, 3) => Answer::Never,
                _ => Answer::After(secs(2.0), not_visible(Look::Right)),
            }
        });
        assert_eq!(flight.end(), Outcome::NotFound, "{case}");
        assert!(most_open(&flight) <= 2, "{case}");
        assert_eq!(flight.decisions().filter(|decision| decision.step == "move").count(), 11, "{case}");
        // What was not used was not read either: no map takes it for what is seen from where the craft is.
        let unused: Vec<_> =
            flight.decisions().filter(|decision| decision.step == "wait").map(|decision| &decision.reading).collect();
        assert!(case != 2 || unused.len() == 1, "{unused:?}");
        for reading in unused {
            let actions = vec!["not used: the view before is not answered yet".to_owned()];
            assert_eq!(*reading, crate::policy::Reading { actions, ..Default::default() });
        }
    }
}

#[test]
fn whoever_takes_over_ends_both() {
    let mut flight = asking(AskWhen::News).fly(always(not_visible(Look::Right), 3.0));
    flight.until("two open queries", |flight| open_at(flight, flight.now) == 2);
    flight.operator(OperatorEvent::Hold);
    assert_eq!(flight.cancelled.len(), 2);
    let held = flight.now;
    flight.pass(4.0);
    flight.assert_stopped_since(held);
    // What was decided before is no reason to turn: only the next answer is.
    let asked = flight.queries.len();
    flight.operator(OperatorEvent::Resume);
    flight.until_asked(asked + 1);
    flight.pass(2.9);
    flight.assert_stopped_since(held);
    // Nothing has failed or come too late: later turns are made ahead of answers again.
    flight.until("two open queries", |flight| open_at(flight, flight.now) == 2);
    assert_eq!(flight.end(), Outcome::NotFound);
}

/// Whatever ends between a turn and the next query, for which nothing is open that could be cancelled.
#[test]
fn a_turn_of_before_a_hold_or_marked_places_permits_no_other() {
    let places = OperatorEvent::KeepOut(vec![]);
    for events in [vec![OperatorEvent::Hold, OperatorEvent::Resume], vec![places]] {
        let mut flight = asking(AskWhen::News).fly(always(not_visible(Look::Right), 3.0));
        // The first answer's turn is at its end, and the next query is not sent yet.
        flight.until("the first answer", |flight| flight.decisions().count() == 1);
        flight.until("the end of its turn", |flight| !flight.pilot.executing);
        assert_eq!(flight.queries.len(), 1);
        for event in &events {
            flight.operator(event.clone());
        }
        flight.until_asked(2);
        let asked = flight.now;
        flight.pass(2.9);
        flight.assert_stopped_since(asked);
        // Nothing has failed: later turns are made ahead of answers again.
        flight.until("two open queries", |flight| open_at(flight, flight.now) == 2);
        assert_eq!(flight.end(), Outcome::NotFound);
    }
}

#[test]
fn an_open_query_counts_towards_the_limit_of_decisions() {
    for most in 1..6 {
        let mut setup = asking(AskWhen::News);
        setup.settings.max_decisions = most;
        let mut flight = setup.fly(always(not_visible(Look::Right), 2.0));
        assert_eq!(flight.end(), Outcome::Timeout);
        assert_eq!((flight.pilot.decisions(), flight.queries.len()), (most, most as usize));
    }
}

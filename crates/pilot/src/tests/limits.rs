//! Limits that end a flight: of place, of decisions without progress, and of queries.

use super::*;
use crate::policy::Output;
use spf_core::primitives::Primitives;
use spf_core::query::QueryKind;
use spf_envelope::geofence::Geofence;

const FENCE: &str = r#"{"type": "Polygon", "coordinates": [[[-20, -20], [20, -20], [20, 20], [-20, 20], [-20, -20]]]}"#;

/// A policy that climbs by 3 m at every answer.
struct Climbs {
    then_rest: bool,
}

impl Policy for Climbs {
    fn name(&self) -> &'static str {
        "climbs"
    }

    fn handle(&mut self, event: PolicyEvent<'_>) -> Output {
        let primitives = Primitives { climb: 3.0, ..Primitives::default() };
        let step = match event {
            PolicyEvent::Frame(view) => {
                Step::Ask(Box::new(Query::new(QueryId(view.frame.id.0), view.frame.id, QueryKind::Choose)))
            }
            PolicyEvent::Reply { .. } => Step::Move(Move { primitives, anchor: None, then_rest: self.then_rest, looks: false }),
            _ => Step::Wait,
        };
        step.into()
    }
}

/// A target out of the fence or too far away is not asked for again and again.
#[test]
fn the_limit_that_refuses_three_answers_in_a_row_ends_the_flight_and_is_named() {
    type Limited = fn(&mut Limits);
    let all: [(EnuPosition, Limited, &str); 2] = [
        (target(4.0, 60.0, 5.0), |limits| limits.max_distance = 20.0, "the maximum distance of 20 m from the take-off point"),
        (target(4.0, 60.0, 5.0), |limits| limits.geofence = Some(Geofence::from_geojson(FENCE).unwrap()), "the geofence"),
    ];
    for preset in PRESETS {
        for (to, limit, named) in all {
            for latency in [0.3, 1.5] {
                let mut setup = Setup::preset(preset);
                limit(&mut setup.limits);
                let mut flight = setup.fly(perfect(to, latency));
                assert_eq!(flight.end(), Outcome::Aborted, "{preset:?} {named} {latency}");
                assert_eq!(flight.finished[0].1.cause, format!("{named} refused the motion of 3 answers in a row"));
                let waited = flight.frames.iter().rev().filter(|seen| seen.captured < flight.finished[0].0);
                let still = waited.take_while(|seen| seen.pose.position.distance(flight.finished[0].2) < 1.0).count();
                let waited = still as f64 * PERIOD.as_secs_f64();
                assert!(waited < 14.0, "{preset:?} {named} {latency}: held back for {waited} s");
            }
        }
    }
}

#[test]
fn the_ceiling_that_refuses_three_answers_in_a_row_ends_the_flight() {
    for (preset, then_rest) in [(Preset::Default, false), (Preset::Default, true), (Preset::Paper, true)] {
        let mut setup = Setup::preset(preset).policy(Climbs { then_rest });
        setup.limits.max_altitude = 7.5;
        let mut flight = setup.fly(always("up".to_owned(), 0.5));
        assert_eq!(flight.end(), Outcome::Aborted, "{preset:?} {then_rest}");
        assert_eq!(flight.finished[0].1.cause, "the maximum height of 7.5 m refused the motion of 3 answers in a row");
        assert!(flight.queries.len() <= 14, "{preset:?} {then_rest}: {}", flight.queries.len());
    }
}

/// Where one answer of three is flown, or looks elsewhere, the next may lead there.
#[test]
fn whoever_flies_or_turns_elsewhere_in_between_flies_on() {
    let away = || json(&Reply { point: Some(ImagePoint { u: 0.99, v: 0.5 }), depth: Some(8), ..Reply::new(Status::Navigating) });
    for (third, name) in [(not_visible(Look::Right), "turned"), (away(), "flown")] {
        let mut setup = Setup::preset(Preset::Paper);
        setup.limits.geofence = Some(Geofence::from_geojson(FENCE).unwrap());
        (setup.settings.max_decisions, setup.settings.max_time) = (25, secs(1000.0));
        let mut flight = setup.fly(move |query, seen| {
            // At the northern edge it looks to the side at every third answer, and back.
            let is_third = query.id.0 % 3 == 2 && seen.pose.position.north > 18.0;
            Answer::After(secs(0.5), if is_third { third.clone() } else { points_at(target(0.0, 60.0, 5.0), seen) })
        });
        assert_eq!(flight.end(), Outcome::Timeout, "{name}: {:?}", flight.finished);
        assert!(flight.frames.iter().any(|seen| seen.pose.position.north > 18.0), "{name}");
    }
}

/// A `done` at the limit, and the second look that it needs, are not refused.
#[test]
fn a_second_look_at_the_limit_is_taken() {
    let mut setup = Setup::preset(Preset::Default);
    setup.limits.max_distance = 20.0;
    let mut refused = 0;
    let mut flight = setup.fly(move |_, seen| {
        refused += u32::from(seen.pose.position.north > 19.0);
        Answer::After(secs(1.0), if refused > 1 { done() } else { points_at(target(0.0, 60.0, 5.0), seen) })
    });
    assert_eq!(flight.end(), Outcome::Reached, "{:?}", flight.finished);
}

fn without_progress(most: u32) -> Setup {
    let mut setup = Setup::preset(Preset::Default);
    (setup.settings.counted, setup.settings.max_decisions) = (Counted::WithoutProgress, most);
    setup.settings.max_time = secs(1000.0);
    setup
}

#[test]
fn a_long_way_is_flown_and_one_that_leads_nowhere_is_not() {
    let far = target(30.0, 200.0, 20.0);
    let mut flight = without_progress(10).fly(perfect(far, 0.3));
    assert_eq!(flight.end(), Outcome::Reached);
    assert!(flight.pilot.decisions() > 60, "{}", flight.pilot.decisions());

    // On and back between two places.
    let mut queries = 0;
    let mut flight = without_progress(10).fly(move |_, seen| {
        queries += 1;
        let to = if queries / 4 % 2 == 0 { target(0.0, 12.0, 3.0) } else { target(0.0, 0.0, 3.0) };
        Answer::After(
            secs(0.5),
            if seen.pose.position.distance(to) < 3.2 { not_visible(Look::Behind) } else { points_at(to, seen) },
        )
    });
    assert_eq!(flight.end(), Outcome::Timeout);
    let cause = &flight.finished[0].1.cause;
    assert!(cause.starts_with("the limit of 10 decisions without progress was reached"), "{cause}");
    assert!(flight.pilot.decisions() < 40, "{}", flight.pilot.decisions());
}

/// The stated search of a whole circle, a climb and another circle is shorter than the limit of `spf fly`.
#[test]
fn a_search_is_completed() {
    let mut flight = without_progress(30).fly(always(not_visible(Look::Up), 0.4));
    assert_eq!(flight.end(), Outcome::NotFound);
}

#[test]
fn the_limit_of_queries_counts_second_looks_and_ends_after_the_last_plan() {
    let mut setup = Setup::preset(Preset::Default);
    setup.settings.max_queries = Some(7);
    // Every other answer is a `done` that the second look does not confirm.
    let mut flight = setup.fly(|query, _| {
        let goes_on = query.memory.confirming || query.id.0 % 2 == 0;
        Answer::After(secs(0.5), if goes_on { navigate(0.5, 0.5, 8) } else { done() })
    });
    assert_eq!(flight.end(), Outcome::Timeout);
    assert_eq!(flight.queries.len(), 7);
    assert!(flight.queries.iter().any(|(_, query)| query.memory.confirming));
    assert_eq!(flight.finished[0].1.cause, "the limit of 7 queries was reached");
}

/// A new instruction after the end has limits of its own.
#[test]
fn queries_count_afresh_after_the_end() {
    let mut setup = Setup::preset(Preset::Default);
    (setup.settings.max_queries, setup.settings.at_end) = (Some(3), AtEnd::Hover);
    let mut flight = setup.fly(always(navigate(0.5, 0.5, 3), 0.5));
    flight.until_phase(Phase::Hovering);
    assert_eq!(flight.queries.len(), 3);
    flight.operator(OperatorEvent::Instruction("fly to the tree".to_owned()));
    flight.until_phase(Phase::Flying);
    flight.until_phase(Phase::Hovering);
    assert_eq!(flight.queries.len(), 6);
}

//! Tracks that are asked for, and reports on them.

use super::*;
use spf_core::query::QueryId;
use spf_core::track::{TrackQuality, TrackReport, TrackStart};

fn tracked() -> Setup {
    let mut setup = Setup::preset(Preset::Default);
    setup.settings.track = true;
    setup
}

/// The reply that points at a goal, and follows it; a search where it is not in view.
fn followed(goal: EnuPosition, seen: &Seen) -> String {
    let profile = GroundingProfile::default();
    let mut reply = spf_core::reply::parse_reply(&points_at(goal, seen), &profile, false).unwrap();
    if reply.status == Status::Navigating {
        reply.status = Status::Following;
    }
    reply.to_json(&profile, false)
}

fn follows(goal: EnuPosition, latency: f64) -> impl FnMut(&Query, &Seen) -> Answer {
    move |_, seen| Answer::After(secs(latency), followed(goal, seen))
}

#[test]
fn each_box_of_a_reply_that_follows_is_tracked_from_its_own_frame_and_nothing_without_the_setting() {
    let goal = target(3.0, 40.0, 4.0);
    let mut flight = tracked().fly(follows(goal, 1.5));
    assert_eq!(flight.end(), Outcome::Reached);
    let starts: Vec<TrackStart> = flight.tracked.iter().filter_map(|(_, start)| *start).collect();
    assert!(starts.len() > 5);
    for start in starts {
        let query = &flight.queries.iter().find(|(_, query)| query.id == start.id).unwrap().1;
        assert_eq!(start.frame, query.frame);
        assert!((start.area.right - start.area.left - 0.04).abs() < 0.01, "{start:?}");
    }
    // Nor is anything without the setting, or in a flight to something.
    let mut without = Setup::preset(Preset::Default).fly(follows(goal, 1.5));
    without.end();
    let mut to = tracked().fly(perfect(goal, 1.5));
    to.end();
    assert!(without.tracked.is_empty() && to.tracked.is_empty());
}

#[test]
fn a_search_and_a_new_instruction_end_the_track() {
    // Seen once, then no more.
    let mut answers = 0;
    let mut flight = tracked().fly(move |_, seen| {
        answers += 1;
        let text = if answers == 1 { followed(target(0.0, 30.0, 3.0), seen) } else { not_visible(Look::Left) };
        Answer::After(secs(0.5), text)
    });
    flight.end();
    assert_eq!(started(&flight), [true, false]);

    let mut flight = tracked().fly(follows(target(0.0, 60.0, 3.0), 0.5));
    while flight.tracked.is_empty() {
        flight.step(secs_time(60.0));
        flight.pump();
    }
    flight.operator(OperatorEvent::Instruction("fly to the tree".to_owned()));
    assert_eq!(started(&flight), [true, false]);
}

fn started(flight: &Flight) -> Vec<bool> {
    flight.tracked.iter().map(|(_, start)| start.is_some()).collect()
}

#[test]
fn reports_on_other_tracks_older_ones_and_nonsense_are_ignored() {
    let goal = target(0.0, 60.0, 3.0);
    let mut flight = tracked().fly(follows(goal, 1.5));
    while flight.tracked.is_empty() {
        flight.step(secs_time(60.0));
        flight.pump();
    }
    let start = flight.tracked.last().unwrap().1.unwrap();
    let report = |id: QueryId, at: f64, left: f64| TrackReport {
        id,
        frame: start.frame,
        captured: secs_time(at),
        area: ImageBox { left, right: left + 0.1, ..start.area },
        scale: 1.0,
        quality: TrackQuality::Good,
    };
    let at = flight.now.as_secs_f64();
    flight.tell(Event::Track(report(start.id, at - 0.5, 0.4)));
    for ignored in [
        report(QueryId(start.id.0 + 7), at - 0.1, 0.6),
        report(start.id, at - 0.6, 0.6),
        report(start.id, at - 0.1, f64::NAN),
        TrackReport { scale: 0.0, ..report(start.id, at - 0.1, 0.6) },
    ] {
        flight.tell(Event::Track(ignored));
        assert_eq!(flight.pilot.track().map(|track| track.area.left), Some(0.4));
    }
    flight.tell(Event::Track(report(start.id, at - 0.4, 0.5)));
    assert_eq!(flight.pilot.track().map(|track| track.area.left), Some(0.5));
}

fn secs_time(seconds: f64) -> Time {
    Time::ZERO + secs(seconds)
}

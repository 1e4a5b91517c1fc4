//! Queries only when something is new.

use super::*;
use crate::guidance::Guidance;
use crate::track::{TrackQuality, TrackReport, TrackStart};

fn asking(ask: AskWhen) -> Setup {
    let mut setup = Setup::preset(Preset::Default);
    (setup.settings.ask, setup.settings.max_decisions) = (ask, 300);
    setup
}

/// How many queries a straight flight takes, and when it arrives.
fn straight(ask: AskWhen, latency: f64) -> (usize, f64) {
    let mut flight = asking(ask).fly(perfect(target(0.0, 90.0, 4.0), latency));
    assert_eq!(flight.end(), Outcome::Reached, "{ask:?}");
    let last = flight.frames.last().unwrap().captured;
    (flight.queries.len(), last.as_secs_f64())
}

/// The answer that is needed next is there before the craft would have to wait for it.
#[test]
fn fewer_queries_lead_as_far_in_the_same_time() {
    for (latency, part) in [(0.3, 0.5), (0.5, 0.7), (1.5, 1.0), (3.0, 1.0)] {
        let (always, news) = (straight(AskWhen::Always, latency), straight(AskWhen::News, latency));
        assert!(news.0 as f64 <= part * always.0 as f64, "{latency} s: {always:?} {news:?}");
        assert!(news.1 <= 1.05 * always.1 + 0.5, "{latency} s: {always:?} {news:?}");
    }
}

/// No frame waits longer than 3 s to be asked about.
#[test]
fn after_three_seconds_a_query_is_sent_in_any_case() {
    let mut flight = asking(AskWhen::News).fly(perfect(target(0.0, 400.0, 4.0), 0.3));
    flight.pass(40.0);
    let times: Vec<f64> = flight.queries.iter().map(|(at, _)| at.as_secs_f64()).collect();
    assert!(times.len() > 8);
    let longest = times.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f64::max);
    assert!((1.0..3.4).contains(&longest), "{longest}");
}

/// What is off in the picture is told at once: a target that is out of sight is searched for with a query each time.
#[test]
fn a_search_asks_as_often_as_ever() {
    let count = |ask| {
        let mut flight = asking(ask).fly(always(not_visible(Look::Right), 0.5));
        assert_eq!(flight.end(), Outcome::NotFound);
        flight.queries.len()
    };
    assert_eq!(count(AskWhen::Always), count(AskWhen::News));
}

/// Seconds from an answer to the next query, if a tracker at 10 Hz loses its target `good` seconds after the answer.
fn next_query_after_a_track_of(good: f64) -> f64 {
    let mut setup = asking(AskWhen::News);
    setup.settings.guidance = Guidance { track: true, ..Guidance::default() };
    let mut flight = setup.fly(perfect(target(0.0, 400.0, 4.0), 0.3));
    flight.until("a track begun by the third answer", |flight| flight.tracked.len() >= 3);
    let (_, start) = *flight.tracked.last().unwrap();
    let TrackStart { id, frame, area } = start.unwrap();
    let (queries, mut tenths) = (flight.queries.len(), 0);
    while flight.queries.len() == queries {
        assert!(tenths < 100, "no query");
        let passed = 0.1 * f64::from(tenths);
        let quality = if passed < good { TrackQuality::Good } else { TrackQuality::Lost };
        let captured = flight.now;
        flight.tell(Event::Track(TrackReport { id, frame, captured, area, scale: 1.0, quality }));
        flight.pass(0.1);
        tenths += 1;
    }
    0.1 * f64::from(tenths)
}

/// A track that an answer has begun is missed as soon as it is lost.
#[test]
fn a_lost_track_is_news() {
    let (lost, held) = (next_query_after_a_track_of(0.5), next_query_after_a_track_of(10.0));
    assert!((0.5..0.9).contains(&lost) && held > lost + 0.3, "{lost} {held}");
}

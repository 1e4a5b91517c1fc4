//! A walking person, tracked by a tracker that sees the true box in each frame.

use super::*;
use spf_core::direction::Direction;
use spf_core::query::{QueryId, QueryKind};
use spf_core::reply::ObstacleBox;
use spf_core::track::{TrackQuality, TrackReport};

/// Where the person is: straight away from the take-off point at 0.8 m/s, and back after 40 m.
fn person(at: Time) -> EnuPosition {
    let walked = 0.8 * at.as_secs_f64() % 80.0;
    target(0.3 * walked, 8.0 + if walked < 40.0 { walked } else { 80.0 - walked }, 0.9)
}

fn person_in(seen: &Seen) -> Option<(ImageBox, f64)> {
    let away = seen.pose.position.displacement_to(person(seen.captured), seen.pose.attitude.heading);
    let at = project_displacement(away, &Camera::quad(), seen.pose.attitude, Lifting::Levelled).filter(|at| at.is_in_image())?;
    let (range, clamp) = (away.length(), |x: f64| x.clamp(0.0, 1.0));
    let (wide, high) = (0.13 / range, 0.5 / range);
    let area =
        ImageBox { left: clamp(at.u - wide), right: clamp(at.u + wide), top: clamp(at.v - high), bottom: clamp(at.v + high) };
    Some((area, range))
}

/// A reply, with a list of boxes if the query asks for one.
fn written(query: &Query, reply: &Reply) -> String {
    reply.to_json(&GroundingProfile::default(), matches!(query.kind, QueryKind::Point { avoid: true, .. }))
}

fn sees_the_person(latency: f64) -> impl FnMut(&Query, &Seen) -> Answer {
    move |query, seen| {
        assert_eq!(query.keep_m, Some(2.5));
        let text = match person_in(seen) {
            Some((area, range)) => written(
                query,
                &Reply {
                    point: Some(ImagePoint { u: 0.5 * (area.left + area.right), v: 0.5 * (area.top + area.bottom) }),
                    depth: Some(spf_core::lift::label_of_range(range)),
                    target: Some("man".to_owned()),
                    target_box: Some(area),
                    ..Reply::new(Status::Following)
                },
            ),
            None => written(query, &Reply { look: Some(Look::Left), ..Reply::new(Status::NotVisible) }),
        };
        Answer::After(secs(latency), text)
    }
}

/// A tracker at 10 Hz; it sees nothing from `blind` on.
pub(super) struct Tracker {
    /// The box of its target in a frame, and the range.
    sees: fn(&Seen) -> Option<(ImageBox, f64)>,
    reported: usize,
    start: Option<(QueryId, f64)>,
    starts: usize,
    blind: Time,
}

impl Tracker {
    fn new(blind: f64) -> Self {
        Self::of(person_in, blind)
    }

    pub(super) fn of(sees: fn(&Seen) -> Option<(ImageBox, f64)>, blind: f64) -> Self {
        Self { sees, reported: 0, start: None, starts: 0, blind: Time::ZERO + secs(blind) }
    }

    pub(super) fn fly(&mut self, flight: &mut Flight, seconds: f64) {
        let until = flight.now + secs(seconds);
        while flight.now < until && flight.pilot.phase() != Phase::Ended {
            flight.step(until);
            if let Some((_, start)) = flight.tracked.get(self.starts..).and_then(|new| new.last()) {
                self.starts = flight.tracked.len();
                self.start = start.and_then(|start| {
                    let seen = flight.frames[usize::try_from(start.frame.0).unwrap()];
                    Some((start.id, (self.sees)(&seen)?.1))
                });
            }
            if let (Some((id, range)), true) = (self.start, flight.delivered.len() > self.reported) {
                self.reported = flight.delivered.len();
                let frame = flight.delivered[self.reported - 1].1;
                let seen = flight.frames[usize::try_from(frame.id.0).unwrap()];
                if let Some((area, now)) =
                    (self.sees)(&seen).filter(|_| frame.captured < self.blind && frame.id.0.is_multiple_of(2))
                {
                    let report = TrackReport {
                        id,
                        frame: frame.id,
                        captured: frame.captured,
                        area,
                        scale: range / now,
                        quality: TrackQuality::Good,
                    };
                    flight.tell(Event::Track(report));
                }
            }
        }
    }
}

fn follows() -> Setup {
    let mut setup = Setup::preset(Preset::Default);
    setup.settings.track = true;
    setup.settings.max_time = secs(180.0);
    setup
}

fn distances(flight: &Flight, from: f64) -> Vec<f64> {
    let late = |seen: &&Seen| seen.captured.as_secs_f64() >= from;
    flight.frames.iter().filter(late).map(|seen| seen.pose.position.horizontal_distance(person(seen.captured))).collect()
}

#[test]
fn a_walking_person_is_followed_at_the_distance_to_keep() {
    let mut flight = follows().fly(sees_the_person(3.0));
    Tracker::new(1000.0).fly(&mut flight, 70.0);
    assert!(flight.decisions().any(|decision| decision.step == "follow"));
    let all = distances(&flight, 30.0);
    let near = all.iter().filter(|&&distance| distance < 4.0).count();
    assert!(near as f64 > 0.9 * all.len() as f64, "{near} of {}", all.len());
    // The person turns round and walks towards the craft, which backs off.
    let least = all.iter().copied().fold(f64::INFINITY, f64::min);
    assert!(least > 1.0, "{least}");
    let shown = flight.pilot.followed(flight.now).unwrap();
    assert!(shown.is_sure && shown.position.horizontal_distance(person(flight.now)) < 1.5, "{shown:?}");
}

#[test]
fn beside_somebody_else_a_craft_that_follows_goes_on_asking() {
    let mut setup = follows();
    setup.settings.avoid = true;
    let mut flight = setup.fly(|query: &Query, seen: &Seen| {
        let Answer::After(latency, text) = sees_the_person(1.0)(query, seen) else { panic!("it answers") };
        // A bystander to the right of the way, within 3 m.
        let woman = r#""boxes":[{"box":[200,620,900,700],"depth":3,"name":"woman"}]"#;
        Answer::After(latency, text.replace(r#""boxes":[]"#, woman))
    });
    Tracker::new(1000.0).fly(&mut flight, 40.0);
    let late = |decision: &&Decision| decision.answered.as_secs_f64() > 25.0;
    let follows = flight.decisions().filter(late).filter(|decision| decision.step == "follow").count();
    assert!(follows >= 4, "{follows}");
    assert!(flight.decisions().any(|decision| decision.reading.is_before_person));
}

#[test]
fn without_its_track_the_craft_stops_closing_within_half_a_second_and_ends_within_three() {
    let blind = 20.0;
    let mut flight = follows().fly(move |query: &Query, seen: &Seen| {
        // The VLM is gone as well.
        if seen.captured.as_secs_f64() > blind { Answer::Never } else { sees_the_person(1.0)(query, seen) }
    });
    Tracker::new(blind).fly(&mut flight, 40.0);
    // A frame takes 0.15 s to arrive.
    for (at, setpoint) in flight.setpoints_since(Time::ZERO + secs(blind + 0.8)) {
        let toward = Direction { bearing: flight.model.heading, elevation: 0.0 };
        assert!(setpoint.forward <= 1e-9, "{at}: {setpoint:?} {toward:?}");
    }
    assert!(flight.setpoints_since(Time::ZERO + secs(blind + 3.5)).all(|(_, setpoint)| setpoint.is_hold()));
}

#[test]
fn a_follow_time_ends_the_flight_as_reached() {
    let mut setup = follows();
    setup.settings.follow_time = Some(secs(10.0));
    let mut flight = setup.fly(sees_the_person(1.0));
    Tracker::new(1000.0).fly(&mut flight, 100.0);
    assert_eq!(flight.outcome(), Outcome::Reached);
    assert_eq!(flight.finished[0].1.cause, "the target was followed for 10 s");
}

#[test]
fn one_reply_that_does_not_see_a_tracked_person_changes_nothing() {
    let mut answers = 0;
    let mut flight = follows().fly(move |query: &Query, seen: &Seen| {
        answers += 1;
        let text = not_visible(Look::Left);
        if answers % 5 == 0 { Answer::After(secs(1.0), text) } else { sees_the_person(1.0)(query, seen) }
    });
    Tracker::new(1000.0).fly(&mut flight, 60.0);
    let steps: Vec<&str> = flight.decisions().map(|decision| decision.step.as_str()).collect();
    assert!(steps.contains(&"keep") && !steps[4..].contains(&"move"), "{steps:?}");
}

/// Somebody else stands before the person for 6 s.
fn is_hidden(at: Time) -> bool {
    (30.0..36.0).contains(&at.as_secs_f64())
}

fn hidden_person(covered: bool) -> impl FnMut(&Query, &Seen) -> Answer {
    move |query, seen| {
        if !is_hidden(seen.captured) {
            return sees_the_person(1.0)(query, seen);
        }
        let before = person_in(seen).filter(|_| covered).map(|(area, range)| ObstacleBox {
            name: "woman".to_owned(),
            area,
            depth: spf_core::lift::label_of_range(range) - 1,
        });
        let reply = Reply { look: Some(Look::Left), boxes: before.into_iter().collect(), ..Reply::new(Status::NotVisible) };
        Answer::After(secs(1.0), written(query, &reply))
    }
}

fn fly_hidden(covered: bool) -> Flight {
    let mut setup = follows();
    setup.settings.avoid = true;
    let mut flight = setup.fly(hidden_person(covered));
    Tracker::of(|seen| person_in(seen).filter(|_| !is_hidden(seen.captured)), 1000.0).fly(&mut flight, 60.0);
    flight
}

#[test]
fn somebody_who_is_hidden_by_another_is_waited_for_and_followed_again() {
    let flight = fly_hidden(true);
    let steps: Vec<_> = flight.decisions().map(|decision| (decision.answered.as_secs_f64(), decision.step.as_str())).collect();
    assert!(steps.iter().any(|&(at, step)| step == "look" && (30.0..38.0).contains(&at)), "{steps:?}");
    assert!(!steps.iter().any(|&(at, step)| step == "move" && at > 30.0), "{steps:?}");
    assert!(steps.iter().any(|&(at, step)| step == "follow" && at > 36.0), "{steps:?}");
    let all = distances(&flight, 50.0);
    assert!(all.iter().filter(|&&distance| distance < 4.0).count() as f64 > 0.9 * all.len() as f64, "{all:?}");
}

#[test]
fn somebody_who_is_gone_is_looked_for_again_from_rest_and_then_searched() {
    let flight = fly_hidden(false);
    let steps: Vec<_> = flight.decisions().map(|decision| (decision.answered.as_secs_f64(), decision.step.as_str())).collect();
    let first = |wanted: &str| steps.iter().find(|&&(at, step)| at > 30.0 && step == wanted).map(|&(at, _)| at);
    assert!(first("look").unwrap() < first("move").unwrap(), "{steps:?}");
}

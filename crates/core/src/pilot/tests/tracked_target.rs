//! A target that stands still, tracked between slow answers.

use super::following::Tracker;
use super::*;
use crate::guidance::Guidance;
use crate::lift::label_of_range;
use crate::query::ImageBox;

const GOAL: EnuPosition = EnuPosition { east: 4.0, north: 40.0, up: 3.0 };
/// Half of the target's width, metres.
const HALF: f64 = 0.4;

fn goal_in(seen: &Seen) -> Option<(ImageBox, f64)> {
    thing_in(seen, GOAL)
}

/// Somewhere else: the track has slid off to it.
fn beside_goal_in(seen: &Seen) -> Option<(ImageBox, f64)> {
    thing_in(seen, EnuPosition { east: GOAL.east + 15.0, ..GOAL })
}

fn thing_in(seen: &Seen, thing: EnuPosition) -> Option<(ImageBox, f64)> {
    let away = seen.pose.position.displacement_to(thing, seen.pose.attitude.heading);
    let at = project_displacement(away, &Camera::quad(), seen.pose.attitude, Lifting::Levelled).filter(|at| at.is_in_image())?;
    let range = away.length();
    let (wide, high) = (HALF * 0.5 / range, HALF * 0.67 / range);
    Some((ImageBox { left: at.u - wide, right: at.u + wide, top: at.v - high, bottom: at.v + high }, range))
}

/// Answers with a point on the target, and the label of this multiple of the range.
fn points(latency: f64, times: f64) -> impl FnMut(&Query, &Seen) -> Answer {
    move |_, seen| {
        let text = match goal_in(seen) {
            Some((area, range)) => json(&Reply {
                point: Some(ImagePoint { u: 0.5 * (area.left + area.right), v: 0.5 * (area.top + area.bottom) }),
                depth: Some(label_of_range(times * range)),
                target: Some("crane".to_owned()),
                target_box: Some(area),
                ..Reply::new(Status::Navigating)
            }),
            None => not_visible(Look::Left),
        };
        Answer::After(secs(latency), text)
    }
}

fn setup(track: bool) -> Setup {
    let mut setup = Setup::preset(Preset::Default);
    setup.settings.guidance = Guidance { anchor: true, track, ..Guidance::default() };
    setup.settings.max_time = secs(180.0);
    setup
}

/// How far off the anchor's range is after this many seconds, as the logarithm of a factor, and its standard deviation.
fn range_error(flight: &Flight) -> (f64, f64) {
    let sight = flight.pilot.anchor_view(flight.now).unwrap();
    let truth = flight.model.position.distance(GOAL);
    (f64::ln(sight.range / truth), sight.range_sd / sight.range)
}

#[test]
fn the_growth_of_a_track_corrects_a_range_that_every_answer_states_wrong() {
    let flown = |track: bool| {
        let mut flight = setup(track).fly(points(4.0, 2.5));
        Tracker::of(goal_in, 1000.0).fly(&mut flight, 26.0);
        range_error(&flight)
    };
    let ((with, sd), (without, _)) = (flown(true), flown(false));
    assert!(without > 0.3, "{without} {with}");
    assert!(with.abs() < 0.2 && sd < 0.25, "{with} {sd}");
}

#[test]
fn a_track_that_has_slid_off_the_target_changes_nothing() {
    let flown = |track: bool, sees: fn(&Seen) -> Option<(ImageBox, f64)>| {
        let mut flight = setup(track).fly(points(4.0, 1.0));
        Tracker::of(sees, 1000.0).fly(&mut flight, 20.0);
        flight.model.position
    };
    let (off, without) = (flown(true, beside_goal_in), flown(false, goal_in));
    assert!(off.distance(without) < 0.05, "{off:?} {without:?}");
}

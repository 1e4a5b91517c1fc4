//! What the pilot does on its own, one test for each row of that table in `docs/explanation/safety.md`.

use super::*;
use crate::geometry::wrap_angle;
use crate::reply::{ReplyError, ReplyStream, parse_reply};

/// The default preset in obstacle mode.
fn avoiding() -> Setup {
    let mut setup = Setup::preset(Preset::Default);
    setup.settings.avoid = true;
    setup
}

/// Headings of the frames that were asked about, degrees, until the first climb.
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
    // The same as flights: nothing is flown on such replies, and the fifth lands the craft.
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

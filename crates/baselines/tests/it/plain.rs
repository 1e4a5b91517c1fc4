//! Text actions in flight.

use spf_baselines::plain::{Plain, PlainSettings};
use spf_core::query::{ActForm, QueryKind};
use spf_core::time::Time;
use spf_pilot::{OperatorEvent, Outcome, Preset};

use crate::flight::Flight;

fn plain(confirm_done: bool, texts: &'static [&'static str]) -> Flight {
    let mut number = 0;
    let policy = Plain::new(PlainSettings { confirm_done, image_size: None, form: ActForm::Commands, near_m: None });
    Flight::new(Preset::Paper, 0.0, policy, move |query, _| {
        assert_eq!(query.kind, QueryKind::Act { form: ActForm::Commands });
        number += 1;
        (0.5, texts[(number - 1).min(texts.len() - 1)].to_owned())
    })
}

const SQUARE: &str =
    r#"{"actions":[{"cmd":"forward","value":3},{"cmd":"yaw_right","value":90},{"cmd":"up","value":1}],"done":false}"#;
const DONE: &str = r#"{"actions":[],"done":true}"#;

#[test]
fn plain_flies_its_actions_one_after_the_other_and_then_looks_again() {
    let mut flight = plain(true, &[SQUARE, DONE]);
    assert_eq!(flight.end().0, Outcome::Reached);
    let axes: Vec<usize> =
        flight.setpoints_since(Time::ZERO).filter_map(|s| [s.forward, s.yaw_rate, s.up].iter().position(|x| *x != 0.0)).collect();
    let mut order = axes.clone();
    order.dedup();
    assert_eq!(order, [0, 1, 2], "forward, then the turn, then the climb");
    let last = flight.frames[usize::try_from(flight.query[1].frame.0).unwrap()];
    assert!(last.speed < 0.1, "asked again only after all of them, at rest");
    // The paper's timed moves of a craft that accelerates: about the requested distance.
    assert!((last.pose.position.north - 3.0).abs() < 0.7 && (last.pose.position.up - 4.0).abs() < 0.5, "{last:?}");
    assert!((last.pose.attitude.heading.to_degrees() - 90.0).abs() < 25.0, "{last:?}");
    let told: Vec<usize> = flight.query.iter().map(|query| query.memory.actions.len()).collect();
    assert_eq!(told, [0, 3, 3], "what was flown is told; a done is looked at twice");
    assert_eq!(flight.pilot.decisions(), 3);
    assert_eq!(flight.decisions().next().unwrap().reading.actions.len(), 3);
}

#[test]
fn plain_believes_done_at_once_where_it_is_set_to() {
    let mut flight = plain(false, &[DONE]);
    assert_eq!(flight.end().0, Outcome::Reached);
    assert_eq!(flight.query.len(), 1);
    let mut flight = plain(true, &[DONE]);
    assert_eq!(flight.end().0, Outcome::Reached);
    let confirming: Vec<bool> = flight.query.iter().map(|query| query.memory.confirming).collect();
    assert_eq!(confirming, [false, true]);
}

#[test]
fn plain_does_not_resume_what_was_cut_short() {
    let mut flight = plain(true, &[SQUARE, DONE]);
    flight.until_moving();
    flight.operator(OperatorEvent::Hold);
    flight.pass(2.0);
    let resumed = flight.now;
    flight.operator(OperatorEvent::Resume);
    assert_eq!(flight.end().0, Outcome::Reached);
    assert!(flight.setpoints_since(resumed).all(|setpoint| setpoint.is_hold()), "the old turn and climb are gone");
}

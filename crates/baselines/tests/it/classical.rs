//! The pilot without a language model in flight.

use spf_baselines::classical::{Act, Classical, ClassicalSettings, Sought};
use spf_core::camera::Camera;
use spf_core::craft::Craft;
use spf_core::detection::Appearance;
use spf_core::geometry::Pose;
use spf_core::query::QueryKind;
use spf_pilot::{Outcome, Preset};

use crate::flight::{CRANE, Flight, sighted};

/// Height of what stands at the crane's place, metres.
const TALL_M: f64 = 4.0;

/// A list with the crane as far as it is in view, and something larger of another colour.
fn list(pose: &Pose, name: &str) -> String {
    let other = "crane_9 x:0.20 y:0.60 width:0.30 height:0.70 color:yellow\n";
    let Some(at) = sighted(pose) else { return other.to_owned() };
    let height = TALL_M * Camera::quad().fy / pose.position.distance(CRANE) / 720.0;
    let (top, bottom) = ((at.v - 0.5 * height).max(0.0), (at.v + 0.5 * height).min(1.0));
    format!(
        "{other}{name}_1 x:{:.2} y:{:.2} width:{:.2} height:{:.2} color:red\n",
        at.u,
        0.5 * (top + bottom),
        0.3 * height,
        bottom - top
    )
}

fn sought(act: Act, name: &str) -> Sought {
    let appearance = Appearance { names: vec![name.to_owned()], colour: Some("red".to_owned()) };
    Sought { act, appearances: if act == Act::Turn { Vec::new() } else { vec![appearance] }, other: false }
}

fn flight(heading: f64, name: &'static str, stages: Vec<Sought>) -> Flight {
    let settings = ClassicalSettings { craft: Craft::quad(), image_size: None, near_m: Some(3.0), avoid: false };
    Flight::new(Preset::Default, heading, Classical::new(settings, stages), move |query, seen| {
        assert_eq!(query.kind, QueryKind::Detect { coco: false, scored: false }, "it asks a detector, and nothing else");
        (0.1, list(&seen.pose, name))
    })
}

#[test]
fn it_flies_to_what_has_the_class_and_the_colour() {
    // In view, and behind, where it is searched for.
    for heading in [0.0, 2.5] {
        let mut flight = flight(heading, "crane", vec![sought(Act::Reach, "crane")]);
        let (outcome, ended_at) = flight.end();
        assert_eq!(outcome, Outcome::Reached, "{heading}");
        assert!(ended_at.distance(CRANE) < 4.0, "{heading}: {ended_at:?}");
    }
}

#[test]
fn stages_follow_one_another() {
    let mut flight = flight(0.0, "crane", vec![sought(Act::Turn, ""), sought(Act::Through, "crane")]);
    let (outcome, ended_at) = flight.end();
    assert_eq!(outcome, Outcome::Reached);
    // Straight on beyond it.
    assert!(ended_at.north > CRANE.north + 2.0, "{ended_at:?}");
}

#[test]
fn what_it_does_not_know_by_class_and_colour_is_not_found() {
    let (outcome, _) = flight(0.0, "crane", vec![sought(Act::Reach, "church")]).end();
    assert_eq!(outcome, Outcome::NotFound);
    let (outcome, _) = flight(0.0, "crane", Vec::new()).end();
    assert_eq!(outcome, Outcome::NotFound);
}

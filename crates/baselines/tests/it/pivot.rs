//! PIVOT in flight.

use spf_baselines::pivot::{Pivot, PivotSettings};
use spf_core::craft::Craft;
use spf_core::geometry::Pose;
use spf_core::query::{ImagePoint, Mark, Query, QueryKind};
use spf_pilot::{Outcome, Preset};

use crate::flight::{CRANE, Flight, sighted};

/// Chooses the candidate nearest to the crane within 150 pixels, as the oracle does.
fn choose(query: &Query, pose: &Pose) -> String {
    let Some(target) = sighted(pose) else { return r#"{"points":[]}"#.to_owned() };
    let away = |at: &ImagePoint| libm::hypot((at.u - target.u) * 960.0, (at.v - target.v) * 720.0);
    let near = query.marks.iter().filter_map(|mark| match mark {
        Mark::Number { at, number } if away(at) < 150.0 => Some((away(at), *number)),
        _ => None,
    });
    let points: Vec<u32> = near.min_by(|a, b| a.0.total_cmp(&b.0)).into_iter().map(|(_, number)| number).collect();
    format!("{{\"points\":{points:?}}}")
}

#[test]
fn pivot_flies_to_what_the_choices_lead_to() {
    for (preset, heading) in [(Preset::Default, 0.0), (Preset::Default, 2.0), (Preset::Paper, 0.0)] {
        let settings = PivotSettings::published(Craft::quad(), 2.0);
        let mut flight = Flight::new(preset, heading, Pivot::new(settings), move |query, seen| {
            let text = match query.kind {
                QueryKind::Done => format!("{{\"done\":{},\"stage\":1}}", seen.pose.position.distance(CRANE) < 3.0),
                _ => choose(query, &seen.pose),
            };
            (0.5, text)
        });
        let (outcome, ended_at) = flight.end();
        assert_eq!(outcome, Outcome::Reached, "{preset:?} {heading}");
        assert!(ended_at.distance(CRANE) < 3.2, "{ended_at:?}");
        assert!(flight.query.iter().any(|query| query.marks.len() == 50), "25 arrows with their numbers");
    }
}

//! The baselines fly through the same pilot, executor and envelope as the method.

use super::*;
use crate::policy::pivot::{Pivot, PivotSettings};
use crate::policy::typefly::{TypeFly, TypeFlySettings};
use crate::query::{Mark, QueryKind};

/// The crane stands 20 m ahead and 8 m to the right of the start, 6 m up.
const CRANE: EnuPosition = EnuPosition { east: 8.0, north: 20.0, up: 6.0 };

/// Where the crane appears from a pose, if it does.
fn sighted(pose: &Pose) -> Option<ImagePoint> {
    let away = pose.position.displacement_to(CRANE, pose.attitude.heading);
    let point = project_displacement(away, &Camera::quad(), pose.attitude, Lifting::Levelled)?;
    ((0.0..=1.0).contains(&point.u) && (0.0..=1.0).contains(&point.v)).then_some(point)
}

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
        let mut flight = Setup::preset(preset).policy(Pivot::new(settings)).fly(move |query, seen| {
            let text = match query.kind {
                QueryKind::Done => format!("{{\"done\":{},\"stage\":1}}", seen.pose.position.distance(CRANE) < 3.0),
                _ => choose(query, &seen.pose),
            };
            Answer::After(secs(0.5), text)
        });
        flight.model.heading = heading;
        assert_eq!(flight.end(), Outcome::Reached, "{preset:?} {heading}");
        let (_, _, ended_at) = flight.finished[0];
        assert!(ended_at.distance(CRANE) < 3.2, "{ended_at:?}");
        assert!(flight.asked.iter().any(|(_, query)| query.marks.len() == 50), "25 arrows with their numbers");
    }
}

/// The crane, 4 m high and wide, as a detector lists it.
fn listed(pose: &Pose) -> String {
    let Some(centre) = sighted(pose) else { return "none".to_owned() };
    let range = pose.position.distance(CRANE);
    // At 1 m a metre takes up half the width of the picture, and two thirds of its height.
    let (width, height) = (2.0 / range, 2.7 / range);
    format!("crane_1 x:{:.2} y:{:.2} width:{:.2} height:{:.2} color:red", centre.u, centre.v, width.min(1.0), height.min(1.0))
}

#[test]
fn typefly_goes_to_what_its_list_tells() {
    for (preset, heading) in [(Preset::Default, 0.0), (Preset::Default, 2.0), (Preset::Paper, 0.0)] {
        let settings = TypeFlySettings::new(Craft::quad());
        let mut flight = Setup::preset(preset).policy(TypeFly::new(settings)).fly(move |query, seen| {
            let text = match &query.kind {
                QueryKind::Detect { .. } => listed(&seen.pose),
                QueryKind::Done => format!("{{\"done\":{}}}", seen.pose.position.distance(CRANE) < 4.0),
                _ if query.detections.is_empty() => "_1=s('crane');?_1==False{->False;}rp;".to_owned(),
                _ => "?oy('crane_1')<0.3{mu(100);}_1=o('crane_1');?oh('crane_1')>0.5{mf(100);->True;}_1=g('crane_1');?_1==False{rp;}->True;"
                    .to_owned(),
            };
            Answer::After(secs(0.3), text)
        });
        flight.model.heading = heading;
        assert_eq!(flight.end(), Outcome::Reached, "{preset:?} {heading}");
        let (_, _, ended_at) = flight.finished[0];
        assert!(ended_at.distance(CRANE) < 4.2, "{ended_at:?}");
        // Lists are many, and no decisions.
        let lists = flight.asked.iter().filter(|(_, query)| matches!(query.kind, QueryKind::Detect { .. })).count();
        assert!(lists > flight.pilot.decisions() as usize + 4, "{lists} {}", flight.pilot.decisions());
    }
}

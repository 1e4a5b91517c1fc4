//! TypeFly in flight.

use spf_baselines::typefly::{TypeFly, TypeFlySettings};
use spf_core::craft::Craft;
use spf_core::geometry::Pose;
use spf_core::query::QueryKind;
use spf_pilot::{Outcome, Preset};

use crate::flight::{CRANE, Flight, sighted};

/// The crane, 4 m high and wide, as a detector lists it.
fn listed(pose: &Pose) -> String {
    let Some(centre) = sighted(pose) else { return "none".to_owned() };
    let range = pose.position.distance(CRANE);
    // At 1 m, one metre covers half the width of the image, and two thirds of its height.
    let (width, height) = (2.0 / range, 2.7 / range);
    format!("crane_1 x:{:.2} y:{:.2} width:{:.2} height:{:.2} color:red", centre.u, centre.v, width.min(1.0), height.min(1.0))
}

#[test]
fn typefly_flies_to_what_its_list_contains() {
    for (preset, heading) in [(Preset::Default, 0.0), (Preset::Default, 2.0), (Preset::Paper, 0.0)] {
        let settings = TypeFlySettings::new(Craft::quad());
        let mut flight = Flight::new(preset, heading, TypeFly::new(settings), move |query, seen| {
            let text = match &query.kind {
                QueryKind::Detect { .. } => listed(&seen.pose),
                QueryKind::Done => format!("{{\"done\":{}}}", seen.pose.position.distance(CRANE) < 4.0),
                _ if query.detections.is_empty() => "_1=s('crane');?_1==False{->False;}rp;".to_owned(),
                _ => "?oy('crane_1')<0.3{mu(100);}_1=o('crane_1');?oh('crane_1')>0.5{mf(100);->True;}_1=g('crane_1');?_1==False{rp;}->True;"
                    .to_owned(),
            };
            (0.3, text)
        });
        let (outcome, ended_at) = flight.end();
        assert_eq!(outcome, Outcome::Reached, "{preset:?} {heading}");
        assert!(ended_at.distance(CRANE) < 4.2, "{ended_at:?}");
        // There are many lists, and they are not decisions.
        let lists = flight.query.iter().filter(|query| matches!(query.kind, QueryKind::Detect { .. })).count();
        assert!(lists > flight.pilot.decisions() as usize + 4, "{lists} {}", flight.pilot.decisions());
    }
}

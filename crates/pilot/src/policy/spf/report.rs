//! The obstacles that replies reported in the last seconds, or nearby: what a climb or a descent must not meet.

use super::Spf;
use crate::policy::View;
use spf_core::geometry::{EnuPosition, Pose};
use spf_core::lift::range_of_label;
use spf_core::query::ImageBox;
use spf_core::reply::ObstacleBox;
use spf_core::time::Duration;
use spf_space::avoid::{self, is_person};

/// How long obstacles count for climbs and descents after the frame in which they were reported: a person, who walks on, and
/// whatever else there is, which may leave the view long before the craft climbs beside it.
const PERSON_REPORTED: Duration = Duration::from_secs(3);
const REPORTED: Duration = Duration::from_secs(10);
/// What reaches beyond the upper edge of an image may hang over where the image was taken, or ahead of it. However old it is, it
/// counts until the craft is this much farther from there, horizontally, than its label says, metres.
const OVERHEAD: f64 = 2.5;
/// Farther than this label, 2.8 m, it does not hang over a craft that stays where it is.
const OVERHEAD_LABEL: u8 = 3;
/// Most reports that are kept.
const REPORTS: usize = 32;

/// The obstacles that were reported in a view; none outside obstacle mode.
#[derive(Clone, Debug)]
pub(super) struct Report {
    view: View,
    boxes: Vec<ObstacleBox>,
}

impl Report {
    pub(super) fn view(&self) -> &View {
        &self.view
    }

    pub(super) fn boxes(&self) -> &[ObstacleBox] {
        &self.boxes
    }

    /// Whether a climb from `pose`, negative for a descent, is clear of these obstacles.
    pub(super) fn clears(&self, pose: &Pose, climb: f64, clearance: f64) -> bool {
        let View { camera, pose: seen, .. } = self.view;
        // The same end height, relative to where the view was taken.
        let from_there = climb + pose.position.up - seen.position.up;
        let end = EnuPosition { up: pose.position.up + climb, ..pose.position };
        let way = [pose.position, end].map(|point| seen.position.displacement_to(point, seen.attitude.heading));
        // What a view from elsewhere shows of the path down must not be an obstacle.
        let is_seen_free = climb > 0.0 || avoid::is_free(&camera, seen.attitude, &self.boxes, way, clearance);
        let is_clear =
            from_there * climb <= 0.0 || avoid::is_clear_vertically(&camera, seen.attitude, &self.boxes, from_there, clearance);
        is_clear && is_seen_free
    }
}

/// Whether an obstacle of an image may hang over a craft that is `away` metres from where the image was taken.
fn hangs_over(obstacle: &ObstacleBox, away: f64) -> bool {
    let farthest = if obstacle.depth <= 1 { 0.0 } else { range_of_label(f64::from(obstacle.depth) + 0.5) };
    obstacle.area.top < ImageBox::CUT && obstacle.depth <= OVERHEAD_LABEL && away < OVERHEAD + farthest
}

impl Spf {
    /// Remembers the obstacles of a view, besides those of the seconds before it.
    pub(super) fn report(&mut self, view: &View, boxes: &[ObstacleBox]) {
        let now = view.frame.captured;
        self.reported.retain_mut(|report| {
            if report.view.frame.captured + PERSON_REPORTED < now {
                report.boxes.retain(|obstacle| !is_person(&obstacle.name));
            }
            if report.view.frame.captured + REPORTED < now {
                let away = report.view.pose.position.horizontal_distance(view.pose.position);
                report.boxes.retain(|obstacle| hangs_over(obstacle, away));
                return !report.boxes.is_empty();
            }
            true
        });
        // The last of the old ones tells the least: those before it were taken from about the same place.
        while self.reported.len() >= REPORTS {
            let is_old = |report: &Report| report.view.frame.captured + REPORTED < now || report.boxes.is_empty();
            self.reported.remove(self.reported.iter().rposition(is_old).unwrap_or(0));
        }
        self.reported.push(Report { view: *view, boxes: boxes.to_vec() });
    }
}

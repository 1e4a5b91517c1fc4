//! What is drawn over the picture, in fractions of the image, as seen from where the picture was taken.

use serde::Serialize;
use spf_core::camera::Camera;
use spf_core::geometry::{BodyDisplacement, EnuPosition, Pose};
use spf_core::keep_out::{KeepOut, MARKED};
use spf_core::lift::{Lifting, project_displacement};
use spf_core::panel::Panel;
use spf_core::query::{ImageBox, ImagePoint};
use spf_core::time::{Duration, Time};
use spf_core::track::TrackQuality;
use spf_pilot::{Action, Decision, Note, Pilot};

/// How long the boxes of a reply and the report of a tracker are shown.
const BOXES_SHOWN: Duration = Duration::from_millis(1500);
const TRACK_SHOWN: Duration = Duration::from_secs(1);
/// Distance from which on a waypoint is shown, metres.
const SHOWN_FROM_M: f64 = 0.3;
/// The depth label at which the flown distance moves a box least.
const FAR: u8 = 10;
/// Maximum number of points of the path.
const PATH: usize = 60;

/// The overlay of one picture.
#[derive(Clone, Debug, Default, Serialize)]
pub(crate) struct Overlay {
    /// Where the craft flies to.
    #[serde(skip_serializing_if = "Option::is_none")]
    point: Option<Point>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    boxes: Vec<Box>,
    /// Places that the operator has marked.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    marked: Vec<Marked>,
    #[serde(skip_serializing_if = "Option::is_none")]
    track: Option<Track>,
    /// The planned path.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    path: Vec<[f64; 2]>,
    /// Two points of the horizon.
    #[serde(skip_serializing_if = "Option::is_none")]
    horizon: Option<[[f64; 2]; 2]>,
}

/// What the craft flies to, in an image.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Point {
    u: f64,
    v: f64,
    label: String,
    metres: f64,
    /// Whether it is the target's estimated place, and not the end of a step towards it.
    target: bool,
}

#[derive(Clone, Debug, Serialize)]
struct Box {
    area: [f64; 4],
    label: String,
}

#[derive(Clone, Debug, Serialize)]
struct Marked {
    id: u32,
    area: [f64; 4],
    metres: f64,
}

#[derive(Clone, Debug, Serialize)]
struct Track {
    area: [f64; 4],
    sure: bool,
}

/// What the last decision left to be drawn.
#[derive(Clone, Debug, Default)]
pub(crate) struct Drawn {
    goal: Option<EnuPosition>,
    label: String,
    boxes: Vec<(Panel, String)>,
    boxes_until: Time,
}

impl Drawn {
    /// Takes over what a decision says.
    pub(crate) fn note(&mut self, now: Time, action: &Action, camera: &Camera) {
        match action {
            Action::Note(Note::Decision(decision)) => self.decided(now, decision, camera),
            Action::Finished(_) => *self = Self::default(),
            _ => {}
        }
    }

    fn decided(&mut self, now: Time, decision: &Decision, camera: &Camera) {
        let reply = decision.reading.reply.as_ref();
        self.goal = decision.goal.filter(|_| !decision.passed).map(|goal| goal.position);
        self.label = reply.and_then(|reply| reply.target.clone()).unwrap_or_default();
        let boxes = reply.into_iter().flat_map(|reply| &reply.boxes).filter(|b| b.name != MARKED);
        self.boxes = boxes.map(|b| (Panel::new(camera, decision.pose, b.area, b.depth), b.name.clone())).collect();
        self.boxes_until = now + BOXES_SHOWN;
    }

    /// The overlay of a picture taken at `at` from `pose`.
    pub(crate) fn seen(&self, now: Time, at: Time, pose: Pose, camera: &Camera, pilot: &Pilot) -> Overlay {
        let boxes: &[(Panel, String)] = if now < self.boxes_until { &self.boxes } else { &[] };
        let boxes = boxes.iter().filter_map(|(place, label)| {
            let (area, _) = place.seen_from(camera, pose)?;
            Some(Box { area: corners(area), label: label.clone() })
        });
        let path = pilot.guide().into_iter().flat_map(|guide| guide.path.iter().take(PATH));
        Overlay {
            point: self.point(pose, camera, pilot),
            boxes: boxes.collect(),
            marked: pilot.kept_out().iter().filter_map(|place| marked(place, pose, camera)).collect(),
            track: track(at, pose, camera, pilot),
            path: path.filter_map(|cell| project(cell.middle(), pose, camera)).map(|p| [p.u, p.v]).collect(),
            horizon: horizon(pose, camera),
        }
    }

    /// What the craft flies to, as seen from a pose.
    pub(crate) fn point(&self, pose: Pose, camera: &Camera, pilot: &Pilot) -> Option<Point> {
        let anchor = pilot.anchor().map(|anchor| anchor.position());
        let place = anchor.or(self.goal)?;
        let metres = pose.position.distance(place);
        let at = project(place, pose, camera).filter(|_| metres >= SHOWN_FROM_M)?;
        Some(Point { u: at.u, v: at.v, label: self.label.clone(), metres, target: anchor.is_some() })
    }
}

fn corners(area: ImageBox) -> [f64; 4] {
    [area.left, area.top, area.right, area.bottom]
}

fn project(place: EnuPosition, pose: Pose, camera: &Camera) -> Option<ImagePoint> {
    let ahead = pose.position.displacement_to(place, pose.attitude.heading);
    project_displacement(ahead, camera, pose.attitude, Lifting::Levelled).filter(|p| p.u.is_finite() && p.v.is_finite())
}

fn horizon(pose: Pose, camera: &Camera) -> Option<[[f64; 2]; 2]> {
    let far = |right| {
        let ahead = BodyDisplacement { right, forward: 1.0, up: 0.0 };
        project_displacement(ahead, camera, pose.attitude, Lifting::Levelled).map(|p| [p.u, p.v])
    };
    Some([far(-0.3)?, far(0.3)?])
}

fn marked(place: &KeepOut, pose: Pose, camera: &Camera) -> Option<Marked> {
    let (area, metres) = place.panel.seen_from(camera, pose)?;
    Some(Marked { id: place.id, area: corners(area), metres })
}

fn track(at: Time, pose: Pose, camera: &Camera, pilot: &Pilot) -> Option<Track> {
    let report = pilot.track().filter(|report| at.since(report.captured) <= TRACK_SHOWN)?;
    if !matches!(report.quality, TrackQuality::Good | TrackQuality::Coasting) {
        return None;
    }
    let then = pilot.pose_at(report.captured)?;
    let (area, _) = Panel::new(camera, then, report.area, FAR).seen_from(camera, pose)?;
    Some(Track { area: corners(area), sure: report.quality == TrackQuality::Good })
}

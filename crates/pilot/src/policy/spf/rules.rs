//! What the settings of SPF come to.

use super::SpfSettings;
use crate::policy::View;
use spf_core::query::{ImagePoint, QueryKind};
use spf_core::reply::{Reply, Status};
use spf_space::Viewpoint;
use spf_space::avoid::{BODY_MARGIN, PlannedStep};

/// A point this near to the image's edge, as a fraction of its size, is no place of a target.
const IMAGE_EDGE: f64 = 0.02;

/// What keeps a step clear of obstacles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum KeptClear {
    /// Nothing but the operator's keep-out volumes: the paper without obstacle mode.
    Unchecked,
    /// The obstacle boxes of replies (paper §3.1).
    ByBoxes,
    /// The planner, on a map that a depth sensor fills.
    ByPlanner,
}

/// The method of a flight.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rules {
    pub(super) settings: SpfSettings,
    /// What keeps steps clear of obstacles.
    pub(super) kept_clear: KeptClear,
    /// Whether the pilot keeps the target's place ([`crate::policy::Step::Goto`]), which guides the craft between two replies.
    pub(super) keeps_place: bool,
    /// Distance kept from somebody whom the pilot tracks, metres; `None` if it tracks nobody.
    pub(super) kept_m: Option<f64>,
}

impl Rules {
    pub(super) fn new(settings: SpfSettings) -> Self {
        let kept_clear = match settings.avoid {
            false => KeptClear::Unchecked,
            true if settings.method.measures_view() => KeptClear::ByPlanner,
            true => KeptClear::ByBoxes,
        };
        Self { settings, kept_clear, keeps_place: settings.method.keeps_place(), kept_m: settings.keep_m }
    }

    /// The kind of its queries.
    pub(super) fn kind(&self) -> QueryKind {
        QueryKind::Point { avoid: self.settings.avoid, depth: self.settings.depth }
    }

    /// Size of the image of a view as it is sent, pixels.
    pub(super) fn sent_size(&self, view: &View) -> (u32, u32) {
        self.settings.image_size.unwrap_or((view.frame.width, view.frame.height))
    }

    /// Distance to keep free around the body, metres.
    pub(super) fn clearance(&self) -> f64 {
        self.settings.craft.radius + BODY_MARGIN
    }

    /// A step towards an image point, to be checked against obstacles.
    pub(super) fn planned<'a>(&self, view: &'a Viewpoint, point: ImagePoint, step: f64) -> PlannedStep<'a> {
        PlannedStep {
            view,
            lifting: self.settings.lifting,
            shape: self.settings.shape,
            point,
            step,
            // Without guidance it is all that leads out from before a wall.
            dives: !self.keeps_place,
        }
    }

    /// Whether the pilot stays with the target by its track.
    pub(super) fn follows(&self, reply: &Reply) -> bool {
        self.kept_m.is_some() && reply.target_box.is_some() && reply.status == Status::Following
    }
}

/// Whether a point lies at the image's edge: what is pointed at goes on beyond it.
pub(super) fn is_at_edge(point: ImagePoint) -> bool {
    [point.u, point.v].iter().any(|&at| !(IMAGE_EDGE..=1.0 - IMAGE_EDGE).contains(&at))
}

#[cfg(test)]
mod tests {
    use super::super::tests::settings;
    use super::*;
    use crate::method::{Measured, Method};
    use crate::steering::DEFAULT_KEEP;

    #[test]
    fn only_a_map_that_a_sensor_fills_takes_the_place_of_the_boxes() {
        let kept_clear = |avoid: bool, method: Method| Rules::new(SpfSettings { method, ..settings(avoid) }).kept_clear;
        assert_eq!(kept_clear(true, Method::Depth(Measured::View)), KeptClear::ByPlanner);
        assert_eq!(kept_clear(true, Method::Depth(Measured::Part)), KeptClear::ByBoxes);
        assert_eq!(kept_clear(true, Method::Boxes), KeptClear::ByBoxes);
        assert_eq!(kept_clear(false, Method::Depth(Measured::View)), KeptClear::Unchecked);
    }

    #[test]
    fn a_tracker_follows_whom_the_reply_follows() {
        let follows = |track: bool, status, target: &str| {
            let area = spf_core::query::ImageBox { left: 0.0, top: 0.4, right: 0.6, bottom: 0.6 };
            let reply = Reply {
                target: Some(target.to_owned()),
                target_box: Some(area),
                point: Some(ImagePoint { u: 0.5, v: 0.5 }),
                ..Reply::new(status)
            };
            Rules::new(SpfSettings { keep_m: track.then_some(DEFAULT_KEEP), ..settings(false) }).follows(&reply)
        };
        assert!(follows(true, Status::Following, "cart") && !follows(false, Status::Following, "cart"));
        assert!(!follows(true, Status::Navigating, "woman"));
    }
}

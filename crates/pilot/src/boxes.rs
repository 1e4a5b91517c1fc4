//! The boxes of the last replies as obstacles for the brake, while the craft follows somebody: between two replies it flies ways
//! that no reply has checked.

use super::{Pilot, Waiting};
use crate::policy::Reading;
use spf_core::direction::Direction;
use spf_core::geometry::EnuPosition;
use spf_core::lift::range_of_label;
use spf_core::query::{ImageBox, ImagePoint};
use spf_core::time::{Duration, Time};
use spf_space::avoid::{is_person, same_name};

/// A box counts for this long; that of a person, who walks on, for this.
const FIXED: Duration = Duration::from_secs(8);
const PERSON: Duration = Duration::from_secs(3);
/// Distance of the points that stand for a box, metres, and most points along a side.
const SPACING: f64 = 0.3;
const MOST: f64 = 12.0;
/// Boxes farther away than this do not matter yet, metres.
const SIGHT: f64 = 8.0;
/// Most boxes that are kept.
const KEPT: usize = 64;

/// Points on the near sides of boxes, and until when they count.
#[derive(Debug, Default)]
pub(super) struct Boxes {
    known: Vec<(Time, Vec<EnuPosition>)>,
    /// Whether the brake has been told of any.
    told: bool,
}

impl Boxes {
    /// Forgets them.
    pub(super) fn clear(&mut self) {
        self.known.clear();
    }
}

impl Pilot {
    /// Takes the boxes of a reply, except that of the target.
    pub(super) fn remember_boxes(&mut self, waiting: &Waiting, reading: &Reading) {
        let Some(reply) = &reading.reply else { return };
        let view = &waiting.view;
        let is_target = |name: &str| reply.target.as_deref().is_some_and(|target| same_name(target, name));
        for obstacle in reply.boxes.iter().filter(|obstacle| !is_target(&obstacle.name)) {
            // From the near end of the label's range.
            let range = range_of_label(f64::from(obstacle.depth) - 0.5);
            if range > SIGHT {
                continue;
            }
            let ImageBox { left, top, right, bottom } = obstacle.area;
            let direction = |u: f64, v: f64| Direction::of_point(&view.camera, view.pose, ImagePoint { u, v });
            let place = |u: f64, v: f64| direction(u, v).place(view.pose.position, range);
            let steps = |a: EnuPosition, b: EnuPosition| libm::ceil(a.distance(b) / SPACING).clamp(1.0, MOST) as u32;
            let across = steps(place(left, top), place(right, top));
            let down = steps(place(left, top), place(left, bottom));
            let places = (0..=across).flat_map(|i| (0..=down).map(move |j| (i, j))).map(|(i, j)| {
                let (x, y) = (f64::from(i) / f64::from(across), f64::from(j) / f64::from(down));
                place(left + x * (right - left), top + y * (bottom - top))
            });
            let lasts = if is_person(&obstacle.name) { PERSON } else { FIXED };
            self.boxes.known.push((view.frame.captured + lasts, places.collect()));
        }
        let surplus = self.boxes.known.len().saturating_sub(KEPT);
        self.boxes.known.drain(..surplus);
    }

    /// Tells the brake of them while somebody is followed, and of none otherwise: then each step has been checked against its
    /// own reply.
    pub(super) fn brake_for_boxes(&mut self, now: Time) {
        if self.is_mapped() || !self.settings.guidance.track {
            return;
        }
        let follows = self.guiding.is_following();
        if follows {
            self.boxes.known.retain(|(until, _)| now <= *until);
            self.envelope.observe_obstacles(self.boxes.known.iter().flat_map(|(_, places)| places).copied());
        } else if self.boxes.told {
            self.envelope.observe_obstacles(core::iter::empty());
        }
        self.boxes.told = follows;
    }
}

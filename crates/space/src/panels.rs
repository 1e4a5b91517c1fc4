//! The boxes of the last replies as obstacles for the brake, while the craft follows somebody: between two replies it flies ways
//! that no reply has checked.

use crate::avoid::{is_person, same_name};
use crate::viewpoint::Viewpoint;
use spf_core::direction::Direction;
use spf_core::geometry::EnuPosition;
use spf_core::lift::range_of_label;
use spf_core::query::{ImageBox, ImagePoint};
use spf_core::reply::Reply;
use spf_core::time::{Duration, Time};

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
#[derive(Clone, Debug, Default)]
pub(crate) struct Panels(Vec<(Time, Vec<EnuPosition>)>);

impl Panels {
    /// Forgets them.
    pub(crate) fn clear(&mut self) {
        self.0.clear();
    }

    /// Takes the boxes of a reply, except that of the target.
    pub(crate) fn reply(&mut self, Viewpoint { captured, camera, pose, .. }: Viewpoint, reply: &Reply) {
        let is_target = |name: &str| reply.target.as_deref().is_some_and(|target| same_name(target, name));
        for obstacle in reply.boxes.iter().filter(|obstacle| !is_target(&obstacle.name)) {
            // From the near end of the label's range.
            let range = range_of_label(f64::from(obstacle.depth) - 0.5);
            if range > SIGHT {
                continue;
            }
            let ImageBox { left, top, right, bottom } = obstacle.area;
            let direction = |u: f64, v: f64| Direction::of_point(&camera, pose, ImagePoint { u, v });
            let place = |u: f64, v: f64| direction(u, v).place(pose.position, range);
            let steps = |a: EnuPosition, b: EnuPosition| libm::ceil(a.distance(b) / SPACING).clamp(1.0, MOST) as u32;
            let across = steps(place(left, top), place(right, top));
            let down = steps(place(left, top), place(left, bottom));
            let places = (0..=across).flat_map(|i| (0..=down).map(move |j| (i, j))).map(|(i, j)| {
                let (x, y) = (f64::from(i) / f64::from(across), f64::from(j) / f64::from(down));
                place(left + x * (right - left), top + y * (bottom - top))
            });
            let lasts = if is_person(&obstacle.name) { PERSON } else { FIXED };
            self.0.push((captured + lasts, places.collect()));
        }
        let surplus = self.0.len().saturating_sub(KEPT);
        self.0.drain(..surplus);
    }

    /// The points that count at `now`.
    pub(crate) fn points(&mut self, now: Time) -> impl Iterator<Item = EnuPosition> {
        self.0.retain(|(until, _)| now <= *until);
        self.0.iter().flat_map(|(_, places)| places).copied()
    }
}

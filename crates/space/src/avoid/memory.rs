//! Obstacles of earlier replies: a box that the newest reply leaves out once is still an obstacle.

use super::same_name;
use spf_core::camera::Camera;
use spf_core::geometry::Pose;
use spf_core::lift::label_of_range;
use spf_core::panel::Panel;
use spf_core::reply::ObstacleBox;
use spf_core::time::{Duration, Time};

/// Replies in a row in which a box counts although they leave it out: a model misses one in twenty, and two in a row hardly ever.
const MISSED: u32 = 1;
/// An obstacle of an older frame no longer counts: the pose drifts, and whatever moves has moved on.
const BOX_COUNTS: Duration = Duration::from_secs(8);
/// A box of the same name whose middle is this near, as a fraction of the image, or that overlaps, is the same obstacle.
const SAME: f64 = 0.15;

/// An obstacle of an earlier reply.
#[derive(Clone, Debug)]
struct EarlierBox {
    name: String,
    place: Panel,
    captured: Time,
    /// Replies since that left it out.
    missed: u32,
}

/// The obstacles of the last replies.
#[derive(Clone, Debug, Default)]
pub struct ObstacleMemory(Vec<EarlierBox>);

impl ObstacleMemory {
    /// Takes in the boxes of a reply about the frame of `camera` taken at `pose`, and returns those of earlier replies that it
    /// leaves out though they lie in the frame, as they appear in it. The target of the reply is no obstacle.
    pub fn recall(
        &mut self,
        camera: &Camera,
        pose: Pose,
        captured: Time,
        reported: &[ObstacleBox],
        target: Option<&str>,
    ) -> Vec<ObstacleBox> {
        let is_target = |name: &str| target.is_some_and(|target| same_name(target, name));
        let mut missing = Vec::new();
        self.0.retain_mut(|seen| {
            if seen.captured + BOX_COUNTS < captured || is_target(&seen.name) {
                return false;
            }
            // What lies outside the frame is not missed.
            let Some(obstacle) = seen.in_view(camera, pose) else { return true };
            if reported.iter().any(|other| is_same(&obstacle, other)) {
                return false;
            }
            seen.missed += 1;
            let counts = seen.missed <= MISSED;
            if counts {
                missing.push(obstacle);
            }
            counts
        });
        self.0.extend(reported.iter().map(|obstacle| EarlierBox::new(camera, pose, captured, obstacle)));
        missing
    }
}

impl EarlierBox {
    fn new(camera: &Camera, pose: Pose, captured: Time, obstacle: &ObstacleBox) -> Self {
        let place = Panel::new(camera, pose, obstacle.area, obstacle.depth);
        Self { name: obstacle.name.clone(), place, captured, missed: 0 }
    }

    /// Its box in the frame taken at `pose`; `None` if it lies outside.
    fn in_view(&self, camera: &Camera, pose: Pose) -> Option<ObstacleBox> {
        let (area, range) = self.place.seen_from(camera, pose)?;
        Some(ObstacleBox { area, depth: label_of_range(range), name: self.name.clone() })
    }
}

/// Whether two boxes of one frame may be the same obstacle.
fn is_same(one: &ObstacleBox, other: &ObstacleBox) -> bool {
    let (a, b) = (one.area, other.area);
    let overlap = a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom;
    let middles = libm::hypot(0.5 * (a.left + a.right - b.left - b.right), 0.5 * (a.top + a.bottom - b.top - b.bottom));
    same_name(&one.name, &other.name) && (overlap || middles < SAME)
}

#[cfg(test)]
mod tests {
    use super::*;
    use spf_core::geometry::{Attitude, EnuPosition};
    use spf_core::query::ImageBox;

    fn boxed(left: f64, right: f64, depth: u8, name: &str) -> ObstacleBox {
        ObstacleBox { area: ImageBox { left, top: 0.2, right, bottom: 0.9 }, depth, name: name.to_owned() }
    }

    fn after(seconds: u64) -> Time {
        Time::ZERO + Duration::from_secs(seconds)
    }

    #[test]
    fn a_box_that_one_reply_leaves_out_still_counts_and_after_two_no_more() {
        let (camera, pose) = (Camera::quad(), Pose::default());
        let mut memory = ObstacleMemory::default();
        let mut recall = |seconds, boxes: &[ObstacleBox]| memory.recall(&camera, pose, after(seconds), boxes, Some("crane"));
        let person = boxed(0.4, 0.6, 1, "white person");
        assert!(recall(0, std::slice::from_ref(&person)).is_empty());
        let [recalled] = &recall(1, &[])[..] else { panic!("it is forgotten") };
        assert_eq!((recalled.depth, recalled.name.as_str()), (1, "white person"));
        let near = |a: f64, b: f64| (a - b).abs() < 1e-9;
        assert!(near(recalled.area.left, 0.4) && near(recalled.area.bottom, 0.9), "{recalled:?}");
        assert!(recall(2, &[]).is_empty());
        // Listed again, it counts again; listed elsewhere under its name, it is the new box alone.
        recall(3, &[person]);
        assert!(recall(4, &[boxed(0.5, 0.7, 2, "White person")]).is_empty());
        assert_eq!(recall(5, &[boxed(0.5, 0.7, 2, "wall")]).len(), 1);
        // Age ends it too, and what is flown to is no obstacle.
        recall(6, &[boxed(0.1, 0.3, 3, "post"), boxed(0.7, 0.9, 3, "Crane")]);
        assert!(memory.recall(&camera, pose, after(15), &[], None).is_empty());
    }

    #[test]
    fn it_is_where_it_was_when_the_craft_has_moved_and_turned() {
        let camera = Camera::quad();
        let mut memory = ObstacleMemory::default();
        let at = |north: f64, heading: f64| Pose {
            position: EnuPosition { north, ..EnuPosition::default() },
            attitude: Attitude { heading, ..Attitude::default() },
        };
        // 4.6 m ahead, and 2.2 m after 2.4 m.
        memory.recall(&camera, at(0.0, 0.0), after(0), &[boxed(0.45, 0.55, 4, "post")], None);
        let [nearer] = &memory.clone().recall(&camera, at(2.4, 0.0), after(1), &[], None)[..] else { panic!("forgotten") };
        assert_eq!(nearer.depth, label_of_range(2.2));
        assert!(nearer.area.left < 0.42 && nearer.area.right > 0.58, "{nearer:?}");
        // 20° to the right, it is left of the middle; behind the craft, it is neither seen nor missed.
        let [left] = &memory.clone().recall(&camera, at(0.0, 0.35), after(1), &[], None)[..] else { panic!("forgotten") };
        assert!(left.area.right < 0.5);
        assert!(memory.recall(&camera, at(0.0, 3.0), after(1), &[], None).is_empty());
        assert_eq!(memory.recall(&camera, at(0.0, 0.0), after(2), &[], None).len(), 1);
    }
}

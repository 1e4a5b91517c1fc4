//! The close-up: the region of a small target, which goes along as a second, enlarged image (`docs/guide/vlm.md`).

use spf_core::camera::Camera;
use spf_core::geometry::{Pose, wrap_angle};
use spf_core::query::{ImageBox, ImagePoint};

/// A target is small if the longer side of its box is below this, pixels of the image as sent.
pub const SMALL_TARGET: f64 = 24.0;
/// A target of at least this many times that size is hardly ever missed.
const EASILY_SEEN: u32 = 2;
/// Width and height of the region, as a fraction of the image's: five times enlarged at the same size.
const REGION: f64 = 0.2;

/// The box of the last target that was pointed at, and the pose of its frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct LastBox {
    /// The box.
    pub(super) area: ImageBox,
    /// Pose of the camera in its frame.
    pub(super) pose: Pose,
}

/// Whether a target with this box counts as small in an image of `size` pixels.
#[must_use]
pub fn is_small(area: &ImageBox, (width, height): (u32, u32)) -> bool {
    let (across, down) = ((area.right - area.left) * f64::from(width), (area.bottom - area.top) * f64::from(height));
    across.max(down) < SMALL_TARGET
}

/// The region around a point, moved so that it lies within the image; `None` if the point is outside.
#[must_use]
pub fn region(middle: ImagePoint) -> Option<ImageBox> {
    if !middle.is_in_image() {
        return None;
    }
    let start = |middle: f64| (middle - 0.5 * REGION).clamp(0.0, 1.0 - REGION);
    let (left, top) = (start(middle.u), start(middle.v));
    Some(ImageBox { left, top, right: left + REGION, bottom: top + REGION })
}

impl LastBox {
    /// The region of the present frame that shows a small target: where the direction of its box is now, of which only the
    /// turn since is known. `None` if the target is not small, or its direction is outside the frame.
    pub(super) fn close_up(&self, camera: &Camera, now: Pose, size: (u32, u32)) -> Option<ImageBox> {
        if is_small(&self.area, size) { region(self.in_view(camera, now)?) } else { None }
    }

    /// Whether the present frame should show the target, which is so small that a single look may miss it.
    pub(super) fn may_be_missed(&self, camera: &Camera, now: Pose, (width, height): (u32, u32)) -> bool {
        is_small(&self.area, (width / EASILY_SEEN, height / EASILY_SEEN))
            && self.in_view(camera, now).is_some_and(|at| at.is_in_image())
    }

    /// Where its direction is in the present frame; `None` if it is behind the camera.
    fn in_view(&self, camera: &Camera, now: Pose) -> Option<ImagePoint> {
        let middle = ImagePoint { u: 0.5 * (self.area.left + self.area.right), v: 0.5 * (self.area.top + self.area.bottom) };
        let ray = camera.ray(middle);
        let turned = wrap_angle(now.attitude.heading - self.pose.attitude.heading);
        let (sin, cos) = (libm::sin(turned), libm::cos(turned));
        // The ray in the axes of the turned camera.
        let (right, forward) = (ray.right * cos - sin, ray.right * sin + cos);
        camera.project(right, forward, ray.up)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn last(u: f64, side: f64) -> LastBox {
        let area = ImageBox { left: u - side / 2.0, right: u + side / 2.0, top: 0.49, bottom: 0.51 };
        LastBox { area, pose: Pose::default() }
    }

    fn turned(degrees: f64) -> Pose {
        let mut pose = Pose::default();
        pose.attitude.heading = f64::to_radians(degrees);
        pose
    }

    #[test]
    fn only_small_targets_get_a_close_up() {
        let camera = Camera::quad();
        let region_of = |side| last(0.5, side).close_up(&camera, Pose::default(), (960, 720));
        // 0.02 · 960 = 19.2 px; 0.03 · 960 = 28.8 px.
        let region = region_of(0.02).unwrap();
        for (value, expected) in [(region.left, 0.4), (region.right, 0.6), (region.top, 0.4), (region.bottom, 0.6)] {
            assert!((value - expected).abs() < 1e-9, "{region:?}");
        }
        assert_eq!(region_of(0.03), None);
        // In a smaller image it is small again.
        assert!(last(0.5, 0.03).close_up(&camera, Pose::default(), (640, 480)).is_some());
    }

    /// The quad's camera spans 90°: 1 in the tangent from the middle to an edge.
    #[test]
    fn the_region_follows_the_turn() {
        let camera = Camera::quad();
        // Seen 45° right of the middle, and turned towards it.
        let ahead = last(1.0, 0.01).close_up(&camera, turned(45.0), (960, 720)).unwrap();
        assert!((ahead.left - 0.4).abs() < 1e-6, "{ahead:?}");
        // Turned 20° to the right, a target in the middle is tan 20° = 0.364 left of it: u = 0.5 − 0.182.
        let left = last(0.5, 0.01).close_up(&camera, turned(20.0), (960, 720)).unwrap();
        assert!((left.left - (0.5 - 0.182 - 0.1)).abs() < 1e-3, "{left:?}");
        // At the edge it stays within the image; beyond it there is none.
        assert_eq!(last(0.5, 0.01).close_up(&camera, turned(44.0), (960, 720)).unwrap().left, 0.0);
        assert_eq!(last(0.5, 0.01).close_up(&camera, turned(60.0), (960, 720)), None);
        assert_eq!(last(0.5, 0.01).close_up(&camera, turned(170.0), (960, 720)), None);
    }
}

//! Motion blur: light from several instants while the shutter is open, rendered separately and added.
//!
//! Rendering each instant is expensive but correct for moving objects, occlusions and edges. Few instants are needed,
//! since their number depends on the image motion, and a craft at rest needs one.

use rayon::prelude::*;
use spf_core::camera::Camera;
use spf_core::geometry::{Pose, wrap_angle};
use spf_core::time::{Duration, Time};

use super::light::Curve;
use crate::RenderedImage;

/// Maximum image motion between instants, pixels: anti-aliased edges then show no steps.
const STEP: f64 = 1.5;
/// Maximum number of instants; beyond 24 pixels of blur steps begin to show.
const MOST: usize = 16;
/// Assumed distance of the nearest surface in most images, metres: translation blurs as if everything were this near.
const NEAR: f64 = 3.0;

/// The state of a scene at one instant, for rendering: the craft's pose, and whatever else moves.
pub trait Posed {
    /// Pose of the craft.
    fn pose(&self) -> &Pose;
}

impl Posed for Pose {
    fn pose(&self) -> &Pose {
        self
    }
}

/// The instants that an image is exposed to: one state `M`, or several while the shutter is open.
#[derive(Clone, Debug, PartialEq)]
pub struct Shot<M> {
    at: Time,
    /// At least one.
    moments: Vec<M>,
}

impl<M> Shot<M> {
    /// An image of a single instant, without motion blur.
    #[must_use]
    pub fn still(at: Time, moment: M) -> Self {
        Self { at, moments: vec![moment] }
    }

    /// The capture time: the middle of the exposure.
    #[must_use]
    pub fn at(&self) -> Time {
        self.at
    }

    /// The states during the exposure, in order of time.
    #[must_use]
    pub fn moments(&self) -> &[M] {
        &self.moments
    }
}

pub(super) fn shot<M: Posed>(
    camera: &Camera,
    shutter: Option<Duration>,
    at: Time,
    snapshot_at: impl Fn(Time) -> Option<M>,
) -> Option<Shot<M>> {
    let capture = snapshot_at(at)?;
    let Some(shutter) = shutter else { return Some(Shot::still(at, capture)) };
    // Nothing exists before the flight began: a shutter that would open earlier opens at its beginning.
    let opens = Time::from_nanos(at.as_nanos().saturating_sub(shutter.as_nanos() as u64 / 2));
    let closes = at + shutter / 2;
    let open = closes.since(opens).as_nanos() as u64;
    let count = moments(camera, snapshot_at(opens)?.pose(), snapshot_at(closes)?.pose());
    if count == 1 {
        return Some(Shot::still(at, capture));
    }
    let moment = |i: usize| snapshot_at(opens + Duration::from_nanos(open * (2 * i as u64 + 1) / (2 * count as u64)));
    Some(Shot { at, moments: (0..count).map(moment).collect::<Option<_>>()? })
}

/// Number of instants that the motion from one pose to the other requires.
fn moments(camera: &Camera, from: &Pose, to: &Pose) -> usize {
    let (a, b) = (from.attitude, to.attitude);
    let turned = wrap_angle(b.heading - a.heading).abs() + (b.pitch - a.pitch).abs() + (b.roll - a.roll).abs();
    let moved = from.position.distance(to.position) / NEAR;
    let pixels = camera.fx.max(camera.fy) * (turned + moved);
    (libm::ceil(pixels / STEP) as usize).clamp(1, MOST)
}

/// Renders every instant and stores the mean of their light in `image`.
pub(super) fn add_up<M>(moments: &[M], image: &mut RenderedImage, mut draw: impl FnMut(&M, &mut RenderedImage)) {
    let curve = Curve::get();
    let mut sum: Vec<f32> = Vec::new();
    for moment in moments {
        draw(moment, image);
        let rgb = image.rgb.as_deref().unwrap_or_default();
        sum.resize(rgb.len(), 0.0);
        sum.par_iter_mut().zip(rgb).for_each(|(sum, byte)| *sum += curve.light(*byte));
    }
    let fraction = 1.0 / moments.len().max(1) as f32;
    if let Some(rgb) = &mut image.rgb {
        rgb.par_iter_mut().zip(&sum).for_each(|(byte, sum)| *byte = curve.byte(sum * fraction));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use spf_core::geometry::{Attitude, EnuPosition};

    fn flying(at: Time) -> Option<Pose> {
        let position = EnuPosition { north: 3.0 * at.as_secs_f64(), ..EnuPosition::default() };
        (at <= Time::from_millis(2000)).then_some(Pose { position, attitude: Attitude::default() })
    }

    #[test]
    fn moments_lie_around_the_capture() {
        let shutter = Some(Duration::from_millis(10));
        let shot = shot(&Camera::quad(), shutter, Time::from_millis(1000), flying).unwrap();
        // 3 cm at 3 m with 480 pixels a radian: 4.8 pixels.
        let at: Vec<f64> = shot.moments().iter().map(|pose| pose.position.north / 3.0 * 1000.0 - 1000.0).collect();
        assert_eq!(at.len(), 4);
        assert!(at.iter().zip([-3.75, -1.25, 1.25, 3.75]).all(|(at, expected)| (at - expected).abs() < 1e-9), "{at:?}");
    }

    #[test]
    fn a_shutter_that_is_still_open_gives_no_image() {
        let shutter = Some(Duration::from_millis(10));
        assert_eq!(shot(&Camera::quad(), shutter, Time::from_millis(1996), flying), None);
        assert!(shot(&Camera::quad(), shutter, Time::from_millis(1995), flying).is_some());
        assert!(shot(&Camera::quad(), None, Time::from_millis(2000), flying).is_some());
        assert!(shot(&Camera::quad(), shutter, Time::ZERO, flying).is_some());
    }
}

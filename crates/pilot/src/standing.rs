//! Range of what stands on the ground, from one box: by where its lower edge is, and a person's by its height.
//!
//! At the height h above the ground, feet that appear at the angle a below the horizon are h/tan a away. A person of stature s whose
//! head and feet appear at the elevations t and f is s/(tan t − tan f) away. A box that an edge of the image cuts off shows less
//! than all of the person, who is therefore nearer than what is seen says.

use spf_core::camera::Camera;
use spf_core::direction::Direction;
use spf_core::geometry::Pose;
use spf_core::query::{ImageBox, ImagePoint};

/// A box that ends this near to the image's edge, as a fraction of its size, goes on beyond it.
pub const IMAGE_EDGE: f64 = 0.02;
/// Standard deviation of each of a box's edges, as a fraction of its height; and of the camera's pitch, radians.
const EDGE_SD: f64 = 0.05;
const PITCH_SD: f64 = 0.02;
/// Standard deviation of the height above the ground under the feet: metres (a Tello's telemetry tells 0.1 to 0.3 m too little), and as
/// a fraction of the height.
const HEIGHT_SD: (f64, f64) = (0.2, 0.05);
/// Below this height the angle is too small to tell anything, metres.
const LEAST_HEIGHT: f64 = 0.3;
/// Stature of grown-up people, metres, and the standard deviation of its logarithm: between means of 1.6 m and 1.8 m around the
/// world, 0.07 m within each, and postures.
const STATURE: f64 = 1.7;
const STATURE_SD: f64 = 0.08;
/// From the middle of a person to the surface that faces the camera, metres: labels mean that surface.
const MIDDLE_TO_SURFACE: f64 = 0.2;
/// The same from the feet.
pub const FEET_TO_SURFACE: f64 = 0.1;
/// Nearer than this nobody is, metres.
const NEAREST: f64 = 0.3;
/// A range of a larger relative error says less than a label.
const MOST_SD: f64 = 0.5;

/// A reading and another range that differ by more standard deviations than this are not of the same thing.
const GATE: f64 = 2.5;

/// Logarithm of a range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// Logarithm of the range in metres.
    pub ln_range: f64,
    /// Its standard deviation.
    pub sigma: f64,
    /// An edge of the image cuts the box off: the target is at most this far away.
    pub is_bound: bool,
}

impl Reading {
    /// Fused with another logarithm of the range and its variance; `None` if they are too far apart to be of the same thing.
    #[must_use]
    pub fn fused_with(&self, (ln_range, variance): (f64, f64)) -> Option<(f64, f64)> {
        let (apart, own) = (self.ln_range - ln_range, self.sigma * self.sigma);
        let total = 1.0 / (1.0 / own + 1.0 / variance);
        (apart * apart <= GATE * GATE * (own + variance)).then(|| (total * (self.ln_range / own + ln_range / variance), total))
    }
}

/// Elevations of a box's upper edge, middle and lower edge, of what the image shows of it.
struct Edges {
    top: f64,
    middle: f64,
    foot: f64,
}

impl Edges {
    fn of(camera: &Camera, pose: Pose, area: ImageBox) -> Self {
        let u = 0.5 * (area.left + area.right);
        let elevation = |v: f64| Direction::of_point(camera, pose, ImagePoint { u, v: v.clamp(0.0, 1.0) }).elevation;
        Self {
            top: elevation(area.top),
            middle: elevation(0.5 * (area.top.max(0.0) + area.bottom.min(1.0))),
            foot: elevation(area.bottom),
        }
    }
}

/// The range from the camera to the surface of a target that stands on the ground from which the craft took off, `depth` metres
/// before its foot; `None` if the lower edge is not clearly below the horizon. What hangs above the ground is nearer.
#[must_use]
pub fn by_ground(camera: &Camera, pose: Pose, area: ImageBox, depth: f64) -> Option<Reading> {
    let height = pose.position.up;
    if height.is_nan() || height < LEAST_HEIGHT {
        return None;
    }
    let is_bound = area.bottom > 1.0 - IMAGE_EDGE;
    let Edges { top, middle, foot } = Edges::of(camera, pose, area);
    let below = -foot;
    if below <= PITCH_SD {
        return None;
    }
    let angle = if is_bound { PITCH_SD } else { libm::hypot(EDGE_SD * (top - foot), PITCH_SD) };
    let high = (HEIGHT_SD.0 + HEIGHT_SD.1 * height) / height;
    let sigma = libm::hypot(angle / (libm::sin(below) * libm::cos(below)), high);
    let ln_range = ln_surface(height / (libm::tan(below) * libm::cos(middle)), depth);
    (sigma <= MOST_SD).then_some(Reading { ln_range, sigma, is_bound })
}

/// The range from the camera to the surface of a person, by the box around them; `None` for a box without height.
#[must_use]
pub fn by_stature(camera: &Camera, pose: Pose, area: ImageBox) -> Option<Reading> {
    let is_bound = area.bottom > 1.0 - IMAGE_EDGE || area.top < IMAGE_EDGE;
    let Edges { top, middle, foot } = Edges::of(camera, pose, area);
    let high = libm::tan(top) - libm::tan(foot);
    if high.is_nan() || high <= f64::EPSILON {
        return None;
    }
    let ln_range = ln_surface(STATURE / (high * libm::cos(middle)), MIDDLE_TO_SURFACE);
    Some(Reading { ln_range, sigma: libm::hypot(STATURE_SD, core::f64::consts::SQRT_2 * EDGE_SD), is_bound })
}

/// Height of the middle of a person who is `range` metres away, in the frame of the camera's position; `None` if neither head nor
/// feet are in the image.
#[must_use]
pub fn middle_of(camera: &Camera, pose: Pose, area: ImageBox, range: f64) -> Option<f64> {
    let Edges { top, middle, foot } = Edges::of(camera, pose, area);
    let level = (range + MIDDLE_TO_SURFACE) * libm::cos(middle);
    let above = match (area.top >= IMAGE_EDGE, area.bottom <= 1.0 - IMAGE_EDGE) {
        (true, true) => 0.5 * level * (libm::tan(top) + libm::tan(foot)),
        (true, false) => level * libm::tan(top) - 0.5 * STATURE,
        (false, true) => level * libm::tan(foot) + 0.5 * STATURE,
        (false, false) => return None,
    };
    Some(pose.position.up + above)
}

fn ln_surface(range: f64, depth: f64) -> f64 {
    libm::log((range - depth).max(NEAREST))
}

#[cfg(test)]
mod tests {
    use super::*;
    use spf_core::geometry::EnuPosition;

    /// Level, with tan 36.87° = 3/4 to each edge of the image: an angle t is at v = 0.5 − tan t / 1.5.
    fn seen(height: f64, top: f64, bottom: f64) -> (Camera, Pose, ImageBox) {
        let camera = Camera::from_fov(960, 720, 90.0_f64.to_radians(), 2.0 * libm::atan(0.75), 0.0);
        let pose = Pose { position: EnuPosition { up: height, ..EnuPosition::default() }, ..Pose::default() };
        (camera, pose, ImageBox { left: 0.45, right: 0.55, top, bottom })
    }

    #[test]
    fn a_person_of_1_7_m_at_5_2_m_has_their_surface_at_5_m() {
        // Head and feet 0.85 m above and below the camera.
        let part = 0.85 / 5.2 / 1.5;
        let (camera, pose, area) = seen(0.85, 0.5 - part, 0.5 + part);
        let stature = by_stature(&camera, pose, area).unwrap();
        assert!((libm::exp(stature.ln_range) - 5.0).abs() < 1e-9 && !stature.is_bound, "{stature:?}");
        assert!((stature.sigma - 0.1068).abs() < 1e-3, "{stature:?}");
        let ground = by_ground(&camera, pose, area, FEET_TO_SURFACE).unwrap();
        assert!((libm::exp(ground.ln_range) - 5.1).abs() < 1e-9 && !ground.is_bound, "{ground:?}");
        // 0.2425 of 0.85 m, and 0.026 rad at 9.3° below the horizon.
        assert!((ground.sigma - 0.329).abs() < 0.01, "{ground:?}");
    }

    #[test]
    fn an_edge_of_the_image_makes_it_an_upper_bound() {
        // From 2 m, what ends at the lower edge is at most 2 m / 0.75 away on the ground.
        let (camera, pose, area) = seen(2.0, 0.5, 1.0);
        let ground = by_ground(&camera, pose, area, FEET_TO_SURFACE).unwrap();
        let middle = libm::atan(0.375);
        assert!((libm::exp(ground.ln_range) - (2.0 / 0.75 / libm::cos(middle) - 0.1)).abs() < 1e-9, "{ground:?}");
        let stature = by_stature(&camera, pose, area).unwrap();
        assert!(ground.is_bound && stature.is_bound);
        // Who fills the image's height is nearer than 1.7 m / 1.5, less to the surface.
        let (camera, pose, area) = seen(2.0, 0.0, 1.0);
        let stature = by_stature(&camera, pose, area).unwrap();
        assert!((libm::exp(stature.ln_range) - (1.7 / 1.5 - 0.2)).abs() < 1e-9 && stature.is_bound, "{stature:?}");
    }

    #[test]
    fn nothing_is_told_from_the_ground_or_by_feet_at_the_horizon_or_by_no_box() {
        let (camera, pose, area) = seen(0.2, 0.4, 0.6);
        assert_eq!(by_ground(&camera, pose, area, FEET_TO_SURFACE), None);
        let (camera, pose, area) = seen(2.0, 0.3, 0.5);
        assert_eq!(by_ground(&camera, pose, area, FEET_TO_SURFACE), None);
        let (camera, pose, area) = seen(f64::NAN, 0.4, 0.6);
        assert_eq!(by_ground(&camera, pose, area, FEET_TO_SURFACE), None);
        let (camera, pose, area) = seen(2.0, 0.6, 0.6);
        assert_eq!(by_stature(&camera, pose, area), None);
    }

    #[test]
    fn the_middle_of_a_person_is_known_by_head_or_feet() {
        // 1.7 m, 5 m to the surface, from 1 m: head 0.7 m above, feet 1 m below.
        let edge = |above: f64| 0.5 - above / 5.2 / 1.5;
        let middle = |top: f64, bottom: f64| {
            let (camera, pose, area) = seen(1.0, top, bottom);
            middle_of(&camera, pose, area, 5.0)
        };
        for (top, bottom) in [(edge(0.7), edge(-1.0)), (edge(0.7), 1.0), (0.0, edge(-1.0))] {
            let up = middle(top, bottom).unwrap();
            assert!((up - 0.85).abs() < 0.05, "{up}");
        }
        assert_eq!(middle(0.0, 1.0), None);
    }
}

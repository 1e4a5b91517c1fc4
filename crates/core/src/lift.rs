//! Lifting: from a waypoint in the image to a displacement in the body frame (paper §3.3, eq. 2), and back.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::camera::Camera;
use crate::geometry::{Attitude, BodyDisplacement, wrap_angle};
use crate::query::ImagePoint;

/// A displacement in camera axes, metres: the result of the paper's equation 2.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CameraDisplacement {
    /// To the right of the optical axis, the paper's `Sx`, metres.
    pub right: f64,
    /// Along the optical axis, the paper's `Sy`, metres.
    pub forward: f64,
    /// Towards the upper edge of the image, the paper's `Sz`, metres.
    pub up: f64,
}

/// The rotations applied between camera axes and the level body frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Lifting {
    /// Neither mount tilt nor attitude: camera axes are used as body axes, as in the paper.
    Paper,
    /// Tilt, then roll, then pitch, into the level frame that turns with the heading (`docs/explanation/method.md`).
    #[default]
    Levelled,
}

/// Why a point cannot be lifted. The caller must not fly there.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum UnprojectError {
    /// A coordinate is not a number, or infinite.
    #[error("waypoint (`{u}`, `{v}`) is not finite")]
    NotFinite {
        /// Fraction of the image width.
        u: f64,
        /// Fraction of the image height.
        v: f64,
    },
    /// The point lies outside the image.
    #[error("waypoint (`{u}`, `{v}`) is outside the image; coordinates must be 0 to 1")]
    OutsideImage {
        /// Fraction of the image width.
        u: f64,
        /// Fraction of the image height.
        v: f64,
    },
    /// No viewing direction leads there: the camera's distortion coefficients fold the image back before this point.
    #[error("waypoint (`{u}`, `{v}`) is beyond the valid range of the camera's distortion model; check the calibration")]
    BeyondLens {
        /// Fraction of the image width.
        u: f64,
        /// Fraction of the image height.
        v: f64,
    },
    /// The step is not a positive length.
    #[error("step length `{step}` m is not positive; check the constants of the step rule")]
    BadStep {
        /// Step, metres.
        step: f64,
    },
}

/// Lifts a waypoint to a displacement in camera axes (paper §3.3, eq. 2): `Sx = U·d·tan α`, `Sy = d`, `Sz = V·d·tan β`
/// for a centred camera without distortion; for any other, the point along its true ray. `step` is the adjusted
/// distance along the optical axis, metres (the paper's `d_adj`), so the distance to a point off the axis is longer
/// than `step`.
///
/// ```
/// use spf_core::camera::Camera;
/// use spf_core::lift::unproject;
/// use spf_core::query::ImagePoint;
///
/// // A 90° × 60° camera, 4 m, at three quarters of the width: U = 0.5, so Sx = 0.5 · 4 m · tan 45° = 2 m.
/// let camera = Camera::from_fov(960, 720, 90_f64.to_radians(), 60_f64.to_radians(), 0.0);
/// let there = unproject(&camera, ImagePoint { u: 0.75, v: 0.5 }, 4.0)?;
/// assert!((there.right - 2.0).abs() < 1e-9);
/// assert!((there.forward - 4.0).abs() < 1e-9);
/// assert!(there.up.abs() < 1e-9);
/// # Ok::<(), spf_core::lift::UnprojectError>(())
/// ```
///
/// # Errors
/// [`UnprojectError::NotFinite`] and [`UnprojectError::OutsideImage`] for a point that is not in the image (its edges
/// are), [`UnprojectError::BeyondLens`] where no viewing direction leads to the point, [`UnprojectError::BadStep`]
/// unless `step` is finite and above 0.
pub fn unproject(camera: &Camera, point: ImagePoint, step: f64) -> Result<CameraDisplacement, UnprojectError> {
    let ImagePoint { u, v } = point;
    if !(u.is_finite() && v.is_finite()) {
        return Err(UnprojectError::NotFinite { u, v });
    }
    if !point.is_in_image() {
        return Err(UnprojectError::OutsideImage { u, v });
    }
    if !step.is_finite() || step <= 0.0 {
        return Err(UnprojectError::BadStep { step });
    }
    let ray = camera.ray(point);
    let seen = |back: ImagePoint| (back.u - u).abs() < 1e-6 && (back.v - v).abs() < 1e-6;
    if !camera.distortion.is_none() && !camera.project(ray.right, 1.0, ray.up).is_some_and(seen) {
        return Err(UnprojectError::BeyondLens { u, v });
    }
    Ok(CameraDisplacement { right: ray.right * step, forward: step, up: ray.up * step })
}

/// Rotates a displacement from camera axes into the level body frame: by the mount tilt, then by roll, then by pitch
/// (aerospace order; the level frame turns with the heading). `attitude` is the attitude at the frame's *capture*.
/// [`Lifting::Paper`] applies no rotation.
#[must_use]
pub fn lift(displacement: CameraDisplacement, camera: &Camera, attitude: Attitude, lifting: Lifting) -> BodyDisplacement {
    let CameraDisplacement { right, forward, up } = displacement;
    if lifting == Lifting::Paper {
        return BodyDisplacement { right, forward, up };
    }
    // A lens tilted down by τ: forward' = f·cos τ + u·sin τ, up' = u·cos τ − f·sin τ. The same as pitch by −τ.
    let (up, forward) = turn(up, forward, camera.tilt);
    // Right side down by φ tips the body's up axis to the right: right' = r·cos φ + u·sin φ, up' = u·cos φ − r·sin φ.
    let (up, right) = turn(up, right, attitude.roll);
    // Nose up by θ: forward' = f·cos θ − u·sin θ, up' = u·cos θ + f·sin θ.
    let (up, forward) = turn(up, forward, -attitude.pitch);
    BodyDisplacement { right, forward, up }
}

/// The inverse of [`lift`].
#[must_use]
pub fn lower(displacement: BodyDisplacement, camera: &Camera, attitude: Attitude, lifting: Lifting) -> CameraDisplacement {
    let BodyDisplacement { right, forward, up } = displacement;
    if lifting == Lifting::Paper {
        return CameraDisplacement { right, forward, up };
    }
    let (up, forward) = turn(up, forward, attitude.pitch);
    let (up, right) = turn(up, right, -attitude.roll);
    let (up, forward) = turn(up, forward, -camera.tilt);
    CameraDisplacement { right, forward, up }
}

/// Where something far away is in the image after the camera has turned from one attitude to another; the place may lie outside the
/// image. `None` if it leaves the half of space before the lens.
#[must_use]
pub fn seen_after_turn(at: ImagePoint, camera: &Camera, before: Attitude, after: Attitude) -> Option<ImagePoint> {
    let ray = camera.ray(at);
    let seen = CameraDisplacement { right: ray.right, forward: 1.0, up: ray.up };
    let level = lift(seen, camera, before, Lifting::Levelled);
    // The level frame turns with the heading: what is ahead moves to the left when the nose turns to the right.
    let turned = wrap_angle(after.heading - before.heading);
    let (sin, cos) = (libm::sin(turned), libm::cos(turned));
    let level = BodyDisplacement {
        right: level.right * cos - level.forward * sin,
        forward: level.forward * cos + level.right * sin,
        up: level.up,
    };
    let CameraDisplacement { right, forward, up } = lower(level, camera, after, Lifting::Levelled);
    camera.project(right, forward, up)
}

/// Projects the end of a body-frame displacement into the image: the inverse of [`unproject`] and [`lift`], for
/// overlaying waypoints and corridors. The point may lie outside the image; `None` if it is not in front of the lens.
#[must_use]
pub fn project_displacement(
    displacement: BodyDisplacement,
    camera: &Camera,
    attitude: Attitude,
    lifting: Lifting,
) -> Option<ImagePoint> {
    let CameraDisplacement { right, forward, up } = lower(displacement, camera, attitude, lifting);
    camera.project(right, forward, up)
}

/// Rotates the plane of `up` and another axis by `angle`, from `up` towards the other for positive angles.
fn turn(up: f64, other: f64, angle: f64) -> (f64, f64) {
    let (sin, cos) = (libm::sin(angle), libm::cos(angle));
    (up * cos - other * sin, other * cos + up * sin)
}

/// Number of depth labels, the paper's `L`.
pub const DEPTH_LABELS: u8 = 10;

/// The range in metres that a depth label stands for, as defined in the prompt: `10^((label − 1) / 4.5)`, so 1 at 1 m and 10
/// at 100 m (`docs/explanation/method.md`). Half labels are meaningful, so the label is a number.
#[must_use]
pub fn range_of_label(label: f64) -> f64 {
    libm::pow(10.0, (label - 1.0) / 4.5)
}

/// The depth label of a range in metres: `round(1 + 4.5·log10 range)`, clamped to `1..=10`. NaN and ranges that are not
/// positive give 1, the cautious end.
#[must_use]
pub fn label_of_range(range: f64) -> u8 {
    // The logarithm of a range that is not positive is −∞ or NaN, and `as` maps both to 0.
    let label = libm::round(1.0 + 4.5 * libm::log10(range));
    (label as u8).clamp(1, DEPTH_LABELS)
}

/// The same, not rounded.
#[must_use]
pub fn exact_label_of_range(range: f64) -> f64 {
    let label = 1.0 + 4.5 * libm::log10(range);
    // A range that is not positive gives −∞ or NaN, neither of which passes.
    if label >= 1.0 { label.min(f64::from(DEPTH_LABELS)) } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const MIDDLE: ImagePoint = ImagePoint { u: 0.5, v: 0.5 };

    fn tilted(degrees: f64) -> Camera {
        Camera::from_fov(960, 720, 90.0_f64.to_radians(), 60.0_f64.to_radians(), degrees.to_radians())
    }

    fn attitude_deg(pitch: f64, roll: f64) -> Attitude {
        Attitude { heading: 1.0, pitch: pitch.to_radians(), roll: roll.to_radians() }
    }

    fn assert_near(got: BodyDisplacement, right: f64, forward: f64, up: f64) {
        let near = (got.right - right).abs() < 5e-3 && (got.forward - forward).abs() < 5e-3 && (got.up - up).abs() < 5e-3;
        assert!(near, "{got:?}, expected right {right} forward {forward} up {up}");
    }

    /// U = 0.5, V = 0.5 on 90° by 60° with d = 4: Sx = 0.5·4·1 = 2, Sy = 4, Sz = 0.5·4·tan 30° = 1.1547.
    #[test]
    fn equation_2_by_hand() {
        let got = unproject(&tilted(0.0), ImagePoint { u: 0.75, v: 0.25 }, 4.0).unwrap();
        assert!((got.right - 2.0).abs() < 1e-12 && (got.forward - 4.0).abs() < 1e-12 && (got.up - 1.154_700_538).abs() < 1e-9);
    }

    /// By hand: image centre, τ = 5°, d = 10 m: forward 10·cos 5° = 9.96, up −10·sin 5° = −0.87.
    #[test]
    fn tilt_by_hand() {
        let camera = tilted(5.0);
        let point = unproject(&camera, MIDDLE, 10.0).unwrap();
        assert_near(lift(point, &camera, Attitude::default(), Lifting::Levelled), 0.0, 9.96, -0.87);
        assert_near(lift(point, &camera, attitude_deg(-9.0, 20.0), Lifting::Paper), 0.0, 10.0, 0.0);
    }

    /// Nose up by 5° undoes a tilt of 5°; nose down by 9° (a Tello accelerating) adds: 10·cos 14° = 9.70, −10·sin 14° = −2.42.
    #[test]
    fn pitch_by_hand() {
        let camera = tilted(5.0);
        let point = unproject(&camera, MIDDLE, 10.0).unwrap();
        assert_near(lift(point, &camera, attitude_deg(5.0, 0.0), Lifting::Levelled), 0.0, 10.0, 0.0);
        assert_near(lift(point, &camera, attitude_deg(-9.0, 0.0), Lifting::Levelled), 0.0, 9.70, -2.42);
    }

    /// Right side down by 30°: a point to the right in the image is below: 2·cos 30° = 1.73 right, −2·sin 30° = −1 up.
    #[test]
    fn roll_by_hand() {
        let camera = tilted(0.0);
        let point = CameraDisplacement { right: 2.0, forward: 5.0, up: 0.0 };
        assert_near(lift(point, &camera, attitude_deg(0.0, 30.0), Lifting::Levelled), 1.732, 5.0, -1.0);
        // Roll is applied before pitch: rolled by 90°, the image's right is the body's down, and nose up by 90° turns the
        // body's down to forward.
        assert_near(lift(point, &camera, attitude_deg(90.0, 90.0), Lifting::Levelled), 0.0, 2.0, 5.0);
    }

    #[test]
    fn points_outside_the_image_are_refused() {
        let camera = tilted(0.0);
        for (u, v) in [(-0.01, 0.5), (0.5, 1.01)] {
            assert_eq!(unproject(&camera, ImagePoint { u, v }, 1.0), Err(UnprojectError::OutsideImage { u, v }));
        }
        let nan = unproject(&camera, ImagePoint { u: f64::NAN, v: 0.5 }, 1.0);
        assert!(matches!(nan, Err(UnprojectError::NotFinite { .. })));
        for step in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(matches!(unproject(&camera, MIDDLE, step), Err(UnprojectError::BadStep { .. })));
        }
        assert!(unproject(&camera, ImagePoint { u: 1.0, v: 0.0 }, 1.0).is_ok());
    }

    /// A barrel lens that folds at 1.05 focal lengths has no direction for a point 1.19 focal lengths off axis.
    #[test]
    fn points_beyond_the_lens_are_refused() {
        let mut camera = Camera::from_fov(960, 720, 100.0_f64.to_radians(), 80.0_f64.to_radians(), 0.0);
        camera.distortion.k1 = -0.3;
        assert!(matches!(unproject(&camera, ImagePoint { u: 1.0, v: 0.5 }, 1.0), Err(UnprojectError::BeyondLens { .. })));
        assert!(unproject(&camera, ImagePoint { u: 0.75, v: 0.5 }, 1.0).is_ok());
    }

    #[test]
    fn labels_are_the_scale_of_the_prompt() {
        for (label, range) in (1u8..).zip([1.0, 1.7, 2.8, 4.6, 7.7, 13.0, 22.0, 36.0, 60.0, 100.0]) {
            assert_eq!(label_of_range(range), label, "{range} m");
            assert!((range_of_label(f64::from(label)) / range - 1.0).abs() < 0.03, "label {label}");
        }
        assert_eq!([0.0, -1.0, f64::NAN, 0.2, 1e9, f64::INFINITY].map(label_of_range), [1, 1, 1, 1, 10, 10]);
    }

    proptest! {
        #[test]
        fn projecting_the_displacement_gives_the_waypoint_back(
            u in 0.0..=1.0, v in 0.0..=1.0, step in 0.1..10.0, tilt in -0.3..0.6, pitch in -0.5..0.5, roll in -0.7..0.7,
            hfov in 0.6..1.8, k1 in -0.06..0.15, off in -20.0..20.0,
        ) {
            let mut camera = Camera::from_fov(960, 720, hfov, 0.75 * hfov, tilt);
            camera.cx += off;
            camera.cy -= off;
            camera.distortion.k1 = k1;
            let attitude = Attitude { heading: 2.0, pitch, roll };
            for lifting in [Lifting::Paper, Lifting::Levelled] {
                let flown = lift(unproject(&camera, ImagePoint { u, v }, step).unwrap(), &camera, attitude, lifting);
                let back = project_displacement(flown, &camera, attitude, lifting).unwrap();
                prop_assert!((back.u - u).abs() < 1e-9 && (back.v - v).abs() < 1e-9, "{back:?}");
            }
        }

        #[test]
        fn lifting_keeps_length(right in -9.0..9.0, forward in -9.0..9.0, up in -9.0..9.0, tilt in -1.0..1.0, pitch in -1.0..1.0, roll in -3.0..3.0) {
            let lifted = lift(CameraDisplacement { right, forward, up }, &tilted(f64::to_degrees(tilt)), Attitude { heading: 0.0, pitch, roll }, Lifting::Levelled);
            let length = BodyDisplacement { right, forward, up }.length();
            prop_assert!((lifted.length() - length).abs() < 1e-9);
        }
    }
}

//! The pinhole camera: fx, fy, cx, cy, lens distortion and mount tilt (paper §3.3).

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::query::ImagePoint;

/// Lens distortion after Brown and Conrady, OpenCV's order of coefficients.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Distortion {
    /// Radial, r².
    pub k1: f64,
    /// Radial, r⁴.
    pub k2: f64,
    /// Tangential.
    pub p1: f64,
    /// Tangential.
    pub p2: f64,
}

/// A pinhole camera on a craft.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Camera {
    /// Image width, pixels.
    pub width: u32,
    /// Image height, pixels.
    pub height: u32,
    /// Focal length along the width, pixels.
    pub fx: f64,
    /// Focal length along the height, pixels.
    pub fy: f64,
    /// Principal point, pixels from the left edge of the image.
    pub cx: f64,
    /// Principal point, pixels from the upper edge of the image.
    pub cy: f64,
    /// Lens distortion; zero for a perfect pinhole.
    pub distortion: Distortion,
    /// Mount tilt, radians, positive when the lens looks below the body's forward axis.
    pub tilt: f64,
}

impl Camera {
    /// A centred, undistorted camera from *full* fields of view in radians (the paper's α and β are their halves).
    #[must_use]
    pub fn from_fov(width: u32, height: u32, horizontal_fov: f64, vertical_fov: f64, tilt: f64) -> Self {
        let (w, h) = (f64::from(width), f64::from(height));
        Self {
            width,
            height,
            fx: 0.5 * w / libm::tan(0.5 * horizontal_fov),
            fy: 0.5 * h / libm::tan(0.5 * vertical_fov),
            cx: 0.5 * w,
            cy: 0.5 * h,
            distortion: Distortion::default(),
            tilt,
        }
    }

    /// The same camera with its image scaled to another size.
    #[must_use]
    pub fn resized(&self, width: u32, height: u32) -> Self {
        let (x, y) = (f64::from(width) / f64::from(self.width), f64::from(height) / f64::from(self.height));
        Self { width, height, fx: self.fx * x, fy: self.fy * y, cx: self.cx * x, cy: self.cy * y, ..*self }
    }

    /// The simulator's `quad` camera: 90° × 73.7° at 960×720, tilt 5°.
    #[must_use]
    pub fn quad() -> Self {
        Self::from_fov(960, 720, 90.0_f64.to_radians(), 73.7_f64.to_radians(), 5.0_f64.to_radians())
    }

    /// A Tello's video at 960×720: fx = fy = 915, cx 458, cy 350, tilt 5° (calibrations collected in docs/explanation/method.md).
    #[must_use]
    pub fn tello() -> Self {
        Self {
            width: 960,
            height: 720,
            fx: 915.0,
            fy: 915.0,
            cx: 458.0,
            cy: 350.0,
            distortion: Distortion::default(),
            tilt: 5.0_f64.to_radians(),
        }
    }

    /// Half the horizontal and half the vertical field of view, radians: the paper's α and β (§3.3). For a distorted or
    /// off-centre lens, half the angle between the midpoints of opposite image edges.
    #[must_use]
    pub fn half_fov(&self) -> (f64, f64) {
        let (u, v) = (self.cx / f64::from(self.width), self.cy / f64::from(self.height));
        let (left, right) = (self.ray(ImagePoint { u: 0.0, v }), self.ray(ImagePoint { u: 1.0, v }));
        let (top, bottom) = (self.ray(ImagePoint { u, v: 0.0 }), self.ray(ImagePoint { u, v: 1.0 }));
        (0.5 * (libm::atan(right.right) - libm::atan(left.right)), 0.5 * (libm::atan(top.up) - libm::atan(bottom.up)))
    }

    /// Converts to the paper's normalised coordinates: `U = 2u/W − 1`, `V = 1 − 2v/H` with `u`, `v` in pixels (§3.3).
    /// An [`ImagePoint`] is already a fraction of the image size.
    #[must_use]
    pub fn normalise(point: ImagePoint) -> NormalisedPoint {
        NormalisedPoint { right: 2.0 * point.u - 1.0, up: 1.0 - 2.0 * point.v }
    }

    /// The viewing direction of an image point, with lens distortion removed. Any finite point, also outside the image,
    /// gives a finite ray. Where the distortion polynomial folds back and no direction exists, it is the closest found,
    /// and [`project`](Self::project) does not return the same point.
    #[must_use]
    pub fn ray(&self, point: ImagePoint) -> Ray {
        let x = (point.u * f64::from(self.width) - self.cx) / self.fx;
        let y = (point.v * f64::from(self.height) - self.cy) / self.fy;
        let (x, y) = self.distortion.undistort(x, y);
        Ray { right: x, up: -y }
    }

    /// Projects a point `right`, `forward` and `up` metres from the lens, in camera axes, into the image; the inverse
    /// of [`ray`](Self::ray). The result may lie outside the image. `None` if the point is not in front of the lens, or
    /// so far off axis that the distortion polynomial folds back.
    #[must_use]
    pub fn project(&self, right: f64, forward: f64, up: f64) -> Option<ImagePoint> {
        if forward.is_nan() || forward <= 0.0 {
            return None;
        }
        let (x, y) = (right / forward, -up / forward);
        if !self.distortion.is_invertible_at(x, y) {
            return None;
        }
        let (x, y) = self.distortion.distort(x, y);
        let point = ImagePoint {
            u: (x * self.fx + self.cx) / f64::from(self.width),
            v: (y * self.fy + self.cy) / f64::from(self.height),
        };
        (point.u.is_finite() && point.v.is_finite()).then_some(point)
    }
}

/// An image point in the paper's normalised coordinates (§3.3): both −1..=1 inside the image, 0 at its centre.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct NormalisedPoint {
    /// The paper's `U`, positive to the right.
    pub right: f64,
    /// The paper's `V`, positive upwards.
    pub up: f64,
}

/// A direction in camera axes: metres right and up per metre along the optical axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Ray {
    /// Metres to the right per metre forward: the tangent of the bearing.
    pub right: f64,
    /// Metres up per metre forward: the tangent of the elevation above the optical axis.
    pub up: f64,
}

impl Distortion {
    /// True for a lens without distortion.
    #[must_use]
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }

    /// Undistorted to distorted coordinates, both in units of the focal length, `y` downwards (Brown 1966; OpenCV's model).
    fn distort(&self, x: f64, y: f64) -> (f64, f64) {
        let r2 = x * x + y * y;
        let radial = 1.0 + r2 * (self.k1 + r2 * self.k2);
        (
            x * radial + 2.0 * self.p1 * x * y + self.p2 * (r2 + 2.0 * x * x),
            y * radial + self.p1 * (r2 + 2.0 * y * y) + 2.0 * self.p2 * x * y,
        )
    }

    /// The inverse, by Newton's method from the distorted point, since the polynomial has no closed-form inverse. Full
    /// steps converge in three or four iterations for typical drone lenses; a step that does not reduce the residual is
    /// halved.
    fn undistort(&self, distorted_x: f64, distorted_y: f64) -> (f64, f64) {
        if self.is_none() {
            return (distorted_x, distorted_y);
        }
        let residual = |x: f64, y: f64| {
            let (dx, dy) = self.distort(x, y);
            (dx - distorted_x, dy - distorted_y)
        };
        let (mut x, mut y) = (distorted_x, distorted_y);
        let mut error = residual(x, y);
        for _ in 0..32 {
            let size = error.0.abs() + error.1.abs();
            if size < 1e-13 {
                break;
            }
            let (xx, xy, yy) = self.jacobian(x, y);
            let determinant = xx * yy - xy * xy;
            if determinant.abs() < 1e-9 {
                break;
            }
            let (step_x, step_y) = ((error.0 * yy - error.1 * xy) / determinant, (error.1 * xx - error.0 * xy) / determinant);
            let mut scale = 1.0;
            let (next, next_error) = loop {
                let next = (x - scale * step_x, y - scale * step_y);
                let next_error = residual(next.0, next.1);
                if next_error.0.abs() + next_error.1.abs() < size || scale < 1e-3 {
                    break (next, next_error);
                }
                scale *= 0.5;
            };
            if next_error.0.abs() + next_error.1.abs() >= size {
                break;
            }
            (x, y) = next;
            error = next_error;
        }
        (x, y)
    }

    /// Derivatives of [`distort`](Self::distort): ∂x/∂x, ∂x/∂y (which equals ∂y/∂x) and ∂y/∂y.
    fn jacobian(&self, x: f64, y: f64) -> (f64, f64, f64) {
        let r2 = x * x + y * y;
        let radial = 1.0 + r2 * (self.k1 + r2 * self.k2);
        // Half the derivative of `radial` by r².
        let slope = self.k1 + 2.0 * r2 * self.k2;
        (
            radial + 2.0 * x * x * slope + 2.0 * self.p1 * y + 6.0 * self.p2 * x,
            2.0 * x * y * slope + 2.0 * self.p1 * x + 2.0 * self.p2 * y,
            radial + 2.0 * y * y * slope + 6.0 * self.p1 * y + 2.0 * self.p2 * x,
        )
    }

    /// True where the distorted radius grows with the radius all the way from the centre: `1 + 3 k1 r² + 5 k2 r⁴ > 0`.
    /// Beyond that, two directions map to the same pixel.
    fn is_invertible_at(&self, x: f64, y: f64) -> bool {
        let r2 = x * x + y * y;
        let slope = |r2: f64| 1.0 + r2 * (3.0 * self.k1 + r2 * 5.0 * self.k2);
        // The minimum slope is at the end, or at the parabola's vertex if that comes first.
        let vertex = if self.k2 > 0.0 { (-0.3 * self.k1 / self.k2).clamp(0.0, r2) } else { r2 };
        slope(r2) > 0.0 && slope(vertex) > 0.0
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn close(a: f64, b: f64, tolerance: f64) -> bool {
        (a - b).abs() <= tolerance
    }

    /// Equation 2's factors: for a centred, undistorted camera the ray is (U tan α, V tan β).
    #[test]
    fn ray_of_a_centred_camera_is_equation_2() {
        let camera = Camera::from_fov(960, 720, 90.0_f64.to_radians(), 60.0_f64.to_radians(), 0.0);
        let (alpha, beta) = camera.half_fov();
        assert!(close(alpha, 45.0_f64.to_radians(), 1e-12) && close(beta, 30.0_f64.to_radians(), 1e-12));
        for (u, v) in [(0.0, 0.0), (0.5, 0.5), (1.0, 1.0), (0.75, 0.1)] {
            let normalised = Camera::normalise(ImagePoint { u, v });
            let ray = camera.ray(ImagePoint { u, v });
            assert!(close(ray.right, normalised.right * libm::tan(alpha), 1e-12));
            assert!(close(ray.up, normalised.up * libm::tan(beta), 1e-12));
        }
        // By hand: three quarters along the width is U = 0.5, and tan 45° = 1.
        assert!(close(camera.ray(ImagePoint { u: 0.75, v: 0.5 }).right, 0.5, 1e-12));
    }

    /// Failing 14: a Tello's field is 55.4° by 42.9°, so a point at the right edge turns by 28.7° (27.7° of a centred lens;
    /// the principal point lies 22 pixels left of the middle), not by the 54° that a field of 108° would give.
    #[test]
    fn failing_14_tello_field_of_view() {
        let (alpha, beta) = Camera::tello().half_fov();
        assert!(close(2.0 * alpha.to_degrees(), 55.4, 0.1), "{}", 2.0 * alpha.to_degrees());
        assert!(close(2.0 * beta.to_degrees(), 42.9, 0.1), "{}", 2.0 * beta.to_degrees());
        let edge = libm::atan(Camera::tello().ray(ImagePoint { u: 1.0, v: 0.5 }).right).to_degrees();
        assert!(close(edge, 27.7, 1.2), "{edge}");
        let centred = Camera::from_fov(960, 720, 55.4_f64.to_radians(), 42.9_f64.to_radians(), 0.0);
        assert!(close(libm::atan(centred.ray(ImagePoint { u: 1.0, v: 0.5 }).right).to_degrees(), 27.7, 1e-9));
    }

    #[test]
    fn nothing_behind_the_lens_is_seen() {
        assert_eq!(Camera::quad().project(1.0, -5.0, 0.0), None);
        assert_eq!(Camera::quad().project(1.0, 0.0, 0.0), None);
        assert_eq!(Camera::quad().project(f64::NAN, 1.0, 0.0), None);
    }

    /// A barrel lens whose polynomial folds at r² = 1 / 0.9: points beyond must not appear inside the image.
    #[test]
    fn folded_distortion_projects_nothing() {
        let mut camera = Camera::quad();
        camera.distortion.k1 = -0.3;
        assert!(camera.project(1.0, 1.0, 0.0).is_some());
        assert_eq!(camera.project(1.1, 1.0, 0.0), None);
        assert_eq!(camera.project(1.9, 1.0, 0.0), None);
    }

    proptest! {
        #[test]
        fn projecting_a_ray_gives_the_point_back(
            u in 0.0..=1.0, v in 0.0..=1.0, hfov in 0.5..1.5, k1 in -0.08..0.2, k2 in 0.0..0.1, p1 in -0.01..0.01, p2 in -0.01..0.01,
        ) {
            let mut camera = Camera::from_fov(960, 720, hfov, 0.75 * hfov, 0.0);
            (camera.cx, camera.cy) = (camera.cx + 11.0, camera.cy - 7.0);
            camera.distortion = Distortion { k1, k2, p1, p2 };
            let ray = camera.ray(ImagePoint { u, v });
            let back = camera.project(3.0 * ray.right, 3.0, 3.0 * ray.up).unwrap();
            prop_assert!(close(back.u, u, 1e-9) && close(back.v, v, 1e-9), "{back:?} for {u} {v}");
        }

        #[test]
        fn any_finite_point_gives_a_finite_ray(u in -1e6..1e6, v in -1e6..1e6, k1 in -1.0..1.0, k2 in -1.0..1.0) {
            let mut camera = Camera::quad();
            camera.distortion = Distortion { k1, k2, p1: 0.0, p2: 0.0 };
            let ray = camera.ray(ImagePoint { u, v });
            prop_assert!(ray.right.is_finite() && ray.up.is_finite());
        }
    }
}

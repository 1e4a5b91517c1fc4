//! Camera pose, and projection of the world to pixels.

use glam::Vec3;
use spf_core::camera::Camera;
use spf_core::geometry::Pose;

/// A camera at a pose, in single precision, for rasteriser and shader.
///
/// Lens distortion is not rendered: images are those of the ideal pinhole camera with the same fx, fy, cx, cy.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pinhole {
    pub(crate) width: u32,
    pub(crate) height: u32,
    /// Lens position, ENU metres.
    pub(crate) eye: Vec3,
    /// Unit vectors of the image in the world: right, down, and along the optical axis.
    pub(crate) right: Vec3,
    pub(crate) down: Vec3,
    pub(crate) forward: Vec3,
    pub(crate) fx: f32,
    pub(crate) fy: f32,
    pub(crate) cx: f32,
    pub(crate) cy: f32,
}

impl Pinhole {
    /// The camera vector is turned by tilt, then roll, then pitch, then heading.
    pub(crate) fn new(camera: &Camera, pose: &Pose) -> Self {
        let turn = |v: [f64; 3]| {
            let a = pose.attitude;
            let (st, ct) = (libm::sin(camera.tilt), libm::cos(camera.tilt));
            let (sr, cr) = (libm::sin(a.roll), libm::cos(a.roll));
            let (sp, cp) = (libm::sin(a.pitch), libm::cos(a.pitch));
            let (sh, ch) = (libm::sin(a.heading), libm::cos(a.heading));
            let [right, forward, up] = v;
            // Tilt: the lens looks below the body's forward axis.
            let (forward, up) = (forward * ct + up * st, up * ct - forward * st);
            // Roll: the right side goes down.
            let (right, up) = (right * cr + up * sr, up * cr - right * sr);
            // Pitch: the nose goes up.
            let (forward, up) = (forward * cp - up * sp, up * cp + forward * sp);
            Vec3::new((right * ch + forward * sh) as f32, (forward * ch - right * sh) as f32, up as f32)
        };
        let p = pose.position;
        Self {
            width: camera.width,
            height: camera.height,
            eye: Vec3::new(p.east as f32, p.north as f32, p.up as f32),
            right: turn([1.0, 0.0, 0.0]),
            down: turn([0.0, 0.0, -1.0]),
            forward: turn([0.0, 1.0, 0.0]),
            fx: camera.fx as f32,
            fy: camera.fy as f32,
            cx: camera.cx as f32,
            cy: camera.cy as f32,
        }
    }

    /// Planes (inward normal, offset) that bound the visible region.
    pub(crate) fn frustum(&self) -> [(Vec3, f32); 5] {
        let (left, right) = (-self.cx / self.fx, (self.width as f32 - self.cx) / self.fx);
        let (top, bottom) = (-self.cy / self.fy, (self.height as f32 - self.cy) / self.fy);
        [
            self.forward,
            self.right - self.forward * left,
            self.forward * right - self.right,
            self.down - self.forward * top,
            self.forward * bottom - self.down,
        ]
        .map(|n| (n, n.dot(self.eye)))
    }

    /// World position to camera axes: right, down, along the optical axis.
    #[inline]
    pub(crate) fn to_camera(self, position: Vec3) -> Vec3 {
        let v = position - self.eye;
        Vec3::new(v.dot(self.right), v.dot(self.down), v.dot(self.forward))
    }
}

/// Approximate view frustum of a camera, for culling moving objects before they are transformed to the world frame.
#[derive(Clone, Debug)]
pub struct Frustum([(Vec3, f32); 5]);

impl Frustum {
    /// The frustum of `camera` at `pose`.
    #[must_use]
    pub fn new(camera: &Camera, pose: &Pose) -> Self {
        Self(Pinhole::new(camera, pose).frustum())
    }

    /// Whether any part of the sphere around `centre` may be in the image; may be true for a sphere outside, never false for
    /// one inside.
    #[must_use]
    pub fn sees(&self, centre: Vec3, radius: f32) -> bool {
        self.0.iter().all(|(normal, offset)| normal.dot(centre) + radius * normal.length() >= *offset)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use spf_core::geometry::{Attitude, EnuPosition};

    fn view(heading: f64, pitch: f64, roll: f64, tilt: f64) -> Pinhole {
        let camera = Camera { tilt, ..Camera::quad() };
        let attitude = Attitude { heading, pitch, roll };
        Pinhole::new(&camera, &Pose { position: EnuPosition::default(), attitude })
    }

    #[test]
    fn a_ball_is_left_out_only_when_it_is_beside_or_behind() {
        let (camera, pose) = (Camera::quad(), Pose::default());
        let frustum = Frustum::new(&camera, &pose);
        // 90 degrees wide, facing north: at 10 m the image reaches 10 m to each side; a ball of 1 m reaches in from 1.4 m beyond.
        for (centre, seen) in [
            (Vec3::new(0.0, 10.0, 0.0), true),
            (Vec3::new(11.3, 10.0, 0.0), true),
            (Vec3::new(11.6, 10.0, 0.0), false),
            (Vec3::new(0.0, -1.1, 0.0), false),
            (Vec3::new(0.0, -0.9, 0.0), true),
            (Vec3::new(0.0, 10.0, 12.0), false),
        ] {
            assert_eq!(frustum.sees(centre, 1.0), seen, "{centre}");
        }
    }

    #[test]
    fn axes_follow_heading_pitch_roll_and_tilt() {
        let quarter = core::f64::consts::FRAC_PI_2;
        // Facing east, level: right is south, the axis east.
        let v = view(quarter, 0.0, 0.0, 0.0);
        assert!(
            (v.forward - Vec3::X).length() < 1e-6 && (v.right + Vec3::Y).length() < 1e-6 && (v.down + Vec3::Z).length() < 1e-6
        );
        // Nose up by 0.3 and a lens 0.3 below the nose: the axis is level again.
        assert!((view(0.0, 0.3, 0.0, 0.3).forward - Vec3::Y).length() < 1e-6);
        // Rolled by a quarter, right side down: the image's right is the world's down.
        assert!((view(0.0, 0.0, quarter, 0.0).right + Vec3::Z).length() < 1e-6);
    }
}

//! AirSim's frames and ours: world NED from an origin against world ENU, quaternions against heading, pitch and roll.

use glam::{DQuat, DVec3, EulerRot};
use spf_core::geometry::{Attitude, EnuPosition, EnuVelocity, Pose, wrap_angle};
use spf_drone::airsim::wire::structs::{self as wire, Quaternionr, Vector3r};

/// The world NED frame whose origin is this position.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Ned(pub(super) EnuPosition);

impl Ned {
    /// A position in this frame, metres.
    pub(super) fn of(self, position: EnuPosition) -> Vector3r {
        Vector3r::new(position.north - self.0.north, position.east - self.0.east, self.0.up - position.up)
    }

    /// The position of a point of this frame.
    pub(super) fn position(self, point: Vector3r) -> EnuPosition {
        EnuPosition { east: self.0.east + point.y_val, north: self.0.north + point.x_val, up: self.0.up - point.z_val }
    }

    /// A pose in this frame.
    pub(super) fn pose(self, pose: &Pose) -> wire::Pose {
        wire::Pose { position: self.of(pose.position), orientation: quaternion(pose.attitude) }
    }
}

/// A velocity, NED.
pub(super) fn ned(velocity: EnuVelocity) -> Vector3r {
    Vector3r::new(velocity.north, velocity.east, -velocity.up)
}

/// A velocity from NED.
pub(super) fn velocity(v: Vector3r) -> EnuVelocity {
    EnuVelocity { east: v.y_val, north: v.x_val, up: -v.z_val }
}

/// The rotation of body FRD into world NED: yaw, pitch, roll in aerospace order.
pub(super) fn rotation(attitude: Attitude) -> DQuat {
    DQuat::from_euler(EulerRot::ZYX, attitude.heading, attitude.pitch, attitude.roll)
}

/// The same as it is sent.
pub(super) fn quaternion(attitude: Attitude) -> Quaternionr {
    let q = rotation(attitude);
    Quaternionr { w_val: q.w, x_val: q.x, y_val: q.y, z_val: q.z }
}

/// The attitude of a rotation.
pub(super) fn attitude_of(q: DQuat) -> Attitude {
    let (heading, pitch, roll) = q.to_euler(EulerRot::ZYX);
    Attitude { heading: wrap_angle(heading), pitch, roll }
}

/// The attitude of a quaternion of any length; `None` if it is zero or not finite.
pub(super) fn attitude(q: Quaternionr) -> Option<Attitude> {
    let length = libm::sqrt(q.w_val * q.w_val + q.x_val * q.x_val + q.y_val * q.y_val + q.z_val * q.z_val);
    (length.is_finite() && length > 1e-9)
        .then(|| attitude_of(DQuat::from_xyzw(q.x_val / length, q.y_val / length, q.z_val / length, q.w_val / length)))
}

/// A mounted thing's pose: `mount` is its place (FRD, metres) and attitude on the body.
pub(super) fn mounted(body: &Pose, place: Vector3r, turned: Attitude) -> Pose {
    let turn = rotation(body.attitude);
    let arm = turn * DVec3::new(place.x_val, place.y_val, place.z_val);
    Pose {
        position: Ned(body.position).position(Vector3r::new(arm.x, arm.y, arm.z)),
        attitude: attitude_of(turn * rotation(turned)),
    }
}

/// A world NED vector in body FRD.
pub(super) fn to_body(attitude: Attitude, v: Vector3r) -> Vector3r {
    let v = rotation(attitude).inverse() * DVec3::new(v.x_val, v.y_val, v.z_val);
    Vector3r::new(v.x, v.y, v.z)
}

/// The direction of a body FRD vector in the world, as a displacement.
pub(super) fn to_world(attitude: Attitude, v: Vector3r) -> Vector3r {
    let v = rotation(attitude) * DVec3::new(v.x_val, v.y_val, v.z_val);
    Vector3r::new(v.x, v.y, v.z)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn north_is_x_east_is_y_and_down_is_z() {
        let origin = EnuPosition { east: 10.0, north: 20.0, up: 1.0 };
        let point = Ned(origin).of(EnuPosition { east: 13.0, north: 24.0, up: 6.0 });
        assert_eq!(point, Vector3r::new(4.0, 3.0, -5.0));
        assert_eq!(Ned(origin).position(point), EnuPosition { east: 13.0, north: 24.0, up: 6.0 });
    }

    #[test]
    fn what_is_mounted_ahead_of_a_craft_that_faces_east_is_in_the_east() {
        let facing_east = Pose { attitude: Attitude { heading: 90_f64.to_radians(), ..Attitude::default() }, ..Pose::default() };
        let down = Attitude { pitch: -90_f64.to_radians(), ..Attitude::default() };
        let pose = mounted(&facing_east, Vector3r::new(0.5, 0.0, 0.1), down);
        assert!((pose.position.east - 0.5).abs() < 1e-9 && pose.position.north.abs() < 1e-9, "{pose:?}");
        assert!((pose.position.up + 0.1).abs() < 1e-9 && (pose.attitude.pitch - down.pitch).abs() < 1e-6, "{pose:?}");
    }

    proptest! {
        #[test]
        fn attitudes_survive_as_quaternions(heading in -3.1..3.1, pitch in -1.5..1.5, roll in -3.1..3.1) {
            let before = Attitude { heading, pitch, roll };
            let after = attitude(quaternion(before)).unwrap();
            let near = |a: f64, b: f64| wrap_angle(a - b).abs() < 1e-6;
            prop_assert!(near(after.heading, heading) && near(after.pitch, pitch) && near(after.roll, roll), "{after:?}");
        }

        #[test]
        fn vectors_survive_the_body(heading in -3.1..3.1, pitch in -1.5..1.5, x in -9.0..9.0, z in -9.0..9.0) {
            let (at, v) = (Attitude { heading, pitch, roll: 0.3 }, Vector3r::new(x, 1.0, z));
            let back = to_world(at, to_body(at, v));
            prop_assert!((back.x_val - x).abs() < 1e-9 && (back.z_val - z).abs() < 1e-9, "{back:?}");
        }
    }
}

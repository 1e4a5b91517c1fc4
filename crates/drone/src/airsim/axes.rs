//! From the simulator's axes to ours, and back: the only place that knows both.
//!
//! Theirs are north, east, down with the origin where the vehicle started, metres; quaternions turn the body (forward, right, down)
//! into the world. Ours are east, north, up, and a heading clockwise from north.

use spf_core::command::Setpoint;
use spf_core::geometry::{Attitude, EnuPosition, EnuVelocity};

/// Turns that look aside by more than this are no camera that looks ahead, radians.
const AHEAD: f64 = 10.0 * core::f64::consts::PI / 180.0;

/// A position of theirs.
pub(super) fn position([north, east, down]: [f64; 3]) -> EnuPosition {
    EnuPosition { east, north, up: -down }
}

/// A velocity of theirs.
pub(super) fn velocity([north, east, down]: [f64; 3]) -> EnuVelocity {
    EnuVelocity { east, north, up: -down }
}

/// A quaternion of theirs, w first; `None` if it is no turn. It need not have unit length.
pub(super) fn attitude(quaternion: [f64; 4]) -> Option<Attitude> {
    let [w, x, y, z] = unit(quaternion)?;
    let sin_pitch = (2.0 * (w * y - z * x)).clamp(-1.0, 1.0);
    Some(Attitude {
        heading: libm::atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
        pitch: libm::asin(sin_pitch),
        roll: libm::atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
    })
}

/// How a camera looks from its body: tilt below the forward axis, radians; `None` if it looks aside or is rolled, and if one of the
/// two is no turn.
pub(super) fn tilt(body: [f64; 4], camera: [f64; 4]) -> Option<f64> {
    let ([w, x, y, z], camera) = (unit(body)?, unit(camera)?);
    let Attitude { heading, pitch, roll } = attitude(product([w, -x, -y, -z], camera))?;
    // Straight down, heading and roll are one.
    let looks_ahead = heading.abs() <= AHEAD && roll.abs() <= AHEAD;
    looks_ahead.then_some(-pitch)
}

/// A setpoint as body velocity forward, right, down, m/s, and yaw rate, degrees per second clockwise.
pub(super) fn body_velocity(setpoint: Setpoint) -> [f64; 4] {
    [setpoint.forward, setpoint.right, -setpoint.up, setpoint.yaw_rate.to_degrees()]
}

fn unit(quaternion: [f64; 4]) -> Option<[f64; 4]> {
    let length = libm::sqrt(quaternion.iter().map(|part| part * part).sum::<f64>());
    (length.is_finite() && length > 1e-6).then(|| quaternion.map(|part| part / length))
}

fn product([a, b, c, d]: [f64; 4], [w, x, y, z]: [f64; 4]) -> [f64; 4] {
    [a * w - b * x - c * y - d * z, a * x + b * w + c * z - d * y, a * y - b * z + c * w + d * x, a * z + b * y - c * x + d * w]
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const DEGREE: f64 = core::f64::consts::PI / 180.0;

    /// About one axis, of x, y and z.
    fn about(axis: usize, angle: f64) -> [f64; 4] {
        let mut turn = [libm::cos(0.5 * angle), 0.0, 0.0, 0.0];
        turn[axis + 1] = libm::sin(0.5 * angle);
        turn
    }

    /// By hand: 3 m north, 4 m east, 5 m down is east 4, north 3, up −5.
    #[test]
    fn north_east_down_becomes_east_north_up() {
        assert_eq!(position([3.0, 4.0, 5.0]), EnuPosition { east: 4.0, north: 3.0, up: -5.0 });
        assert_eq!(velocity([1.0, -2.0, -0.5]), EnuVelocity { east: -2.0, north: 1.0, up: 0.5 });
    }

    /// By hand: a turn of 90° about down looks east, whose heading is 90° clockwise from north; about the right axis the nose goes
    /// up, about the forward axis the right side goes down.
    #[test]
    fn turns_have_the_signs_of_aerospace() {
        let near = |a: f64, b: f64| (a - b).abs() < 1e-12;
        let east = attitude(about(2, 90.0 * DEGREE)).unwrap();
        assert!(near(east.heading, 90.0 * DEGREE) && near(east.pitch, 0.0) && near(east.roll, 0.0));
        assert!(near(attitude(about(1, 20.0 * DEGREE)).unwrap().pitch, 20.0 * DEGREE));
        assert!(near(attitude(about(0, 20.0 * DEGREE)).unwrap().roll, 20.0 * DEGREE));
        // Twice as long is the same turn; without length there is none.
        assert!(near(attitude(about(2, 1.0).map(|part| 2.0 * part)).unwrap().heading, 1.0));
        assert_eq!(
            [attitude([0.0; 4]), attitude([f64::NAN, 0.0, 0.0, 1.0]), attitude([f64::INFINITY, 0.0, 0.0, 0.0])],
            [None; 3]
        );
    }

    /// The craft looks east, its nose 3° down; the camera looks 15° below its forward axis.
    #[test]
    fn the_tilt_of_a_camera_is_that_from_its_body() {
        let body = product(about(2, 90.0 * DEGREE), about(1, -3.0 * DEGREE));
        let tilted = |turn| tilt(body, product(body, turn));
        assert!((tilted(about(1, -15.0 * DEGREE)).unwrap() - 15.0 * DEGREE).abs() < 1e-12);
        assert!(tilted(about(2, 8.0 * DEGREE)).unwrap().abs() < 1e-12);
        assert_eq!([tilted(about(2, 90.0 * DEGREE)), tilted(about(0, 45.0 * DEGREE)), tilt(body, [0.0; 4])], [None; 3]);
    }

    /// By hand: 1 m/s ahead, 2 to the right, 0.5 up and a quarter turn clockwise a second.
    #[test]
    fn a_setpoint_becomes_forward_right_down_and_degrees() {
        let setpoint = Setpoint { forward: 1.0, right: 2.0, up: 0.5, yaw_rate: 0.5 * core::f64::consts::PI };
        assert_eq!(body_velocity(setpoint), [1.0, 2.0, -0.5, 90.0]);
    }

    proptest! {
        #[test]
        fn any_turn_is_read_back(heading in -3.1..3.1, pitch in -1.5..1.5, roll in -3.1..3.1) {
            let turn = product(product(about(2, heading), about(1, pitch)), about(0, roll));
            let back = attitude(turn).unwrap();
            for (a, b) in [(back.heading, heading), (back.pitch, pitch), (back.roll, roll)] {
                prop_assert!((a - b).abs() < 1e-9, "{back:?}");
            }
        }

        #[test]
        fn no_four_numbers_make_it_panic(parts in proptest::array::uniform4(proptest::num::f64::ANY)) {
            if let Some(attitude) = attitude(parts) {
                prop_assert!(attitude.heading.is_finite() && attitude.pitch.is_finite() && attitude.roll.is_finite());
            }
        }
    }
}

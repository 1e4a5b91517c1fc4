//! Conversion between the frames of MAVLink (north-east-down, forward-right-down) and ours (east-north-up, the level body frame).

use spf_core::command::Setpoint;
use spf_core::geometry::{Attitude, EnuPosition, EnuVelocity, wrap_angle};

/// `MAV_FRAME_BODY_NED`: forward, right, down, turned by the heading alone. The only frame of a velocity that PX4 and ArduPilot
/// both take.
pub const FRAME: u8 = 8;
/// `type_mask` of a setpoint: ignore position, acceleration and yaw; take velocity and yaw rate.
pub const VELOCITY_AND_YAW_RATE: u16 = 0x05c7;
/// Metres per degree of latitude on the sphere that both autopilots project with.
const METRES_PER_DEGREE: f64 = 6_371_000.0 * core::f64::consts::PI / 180.0;

/// A position, metres north, east and down of the estimator's origin, as ours.
#[must_use]
pub fn position_from_ned([north, east, down]: [f32; 3]) -> EnuPosition {
    EnuPosition { east: east.into(), north: north.into(), up: -f64::from(down) }
}

/// A position as metres north, east and down.
#[must_use]
pub fn position_to_ned(position: EnuPosition) -> [f32; 3] {
    [position.north as f32, position.east as f32, -position.up as f32]
}

/// A velocity, m/s north, east and down, as ours.
#[must_use]
pub fn velocity_from_ned([north, east, down]: [f32; 3]) -> EnuVelocity {
    EnuVelocity { east: east.into(), north: north.into(), up: -f64::from(down) }
}

/// A velocity as m/s north, east and down.
#[must_use]
pub fn velocity_to_ned(velocity: EnuVelocity) -> [f32; 3] {
    [velocity.north as f32, velocity.east as f32, -velocity.up as f32]
}

/// Roll, pitch and yaw, radians, aerospace order as ours: yaw clockwise from north, pitch nose up, roll right side down.
#[must_use]
pub fn attitude([roll, pitch, yaw]: [f32; 3]) -> Attitude {
    Attitude { heading: wrap_angle(yaw.into()), pitch: pitch.into(), roll: roll.into() }
}

/// The velocity (forward, right, down, m/s) and yaw rate (rad/s, clockwise) of a setpoint in [`FRAME`].
#[must_use]
pub fn setpoint_to_body(setpoint: Setpoint) -> ([f32; 3], f32) {
    ([setpoint.forward as f32, setpoint.right as f32, -setpoint.up as f32], setpoint.yaw_rate as f32)
}

/// A setpoint from a velocity in [`FRAME`].
#[must_use]
pub fn setpoint_from_body([forward, right, down]: [f32; 3], yaw_rate: f32) -> Setpoint {
    Setpoint { right: right.into(), forward: forward.into(), up: -f64::from(down), yaw_rate: yaw_rate.into() }
}

/// A setpoint from a velocity north, east, down, for a craft with this heading, radians.
#[must_use]
pub fn setpoint_from_ned([north, east, down]: [f32; 3], yaw_rate: f32, heading: f64) -> Setpoint {
    let (sin, cos) = (libm::sin(heading), libm::cos(heading));
    let (north, east) = (f64::from(north), f64::from(east));
    Setpoint {
        forward: north * cos + east * sin,
        right: east * cos - north * sin,
        up: -f64::from(down),
        yaw_rate: yaw_rate.into(),
    }
}

/// A place on the globe: degrees, and metres above mean sea level.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GlobalPosition {
    /// Degrees north.
    pub latitude: f64,
    /// Degrees east.
    pub longitude: f64,
    /// Metres above mean sea level.
    pub altitude: f64,
}

impl GlobalPosition {
    /// The place at an offset in metres, on the plane that touches the globe here: accurate to centimetres within a kilometre.
    #[must_use]
    pub fn offset(self, by: EnuPosition) -> Self {
        let per_degree = METRES_PER_DEGREE * libm::cos(self.latitude.to_radians());
        Self {
            latitude: self.latitude + by.north / METRES_PER_DEGREE,
            longitude: self.longitude + by.east / per_degree,
            altitude: self.altitude + by.up,
        }
    }

    /// The offset of another place from here, metres.
    #[must_use]
    pub fn offset_to(self, other: Self) -> EnuPosition {
        let per_degree = METRES_PER_DEGREE * libm::cos(self.latitude.to_radians());
        EnuPosition {
            east: (other.longitude - self.longitude) * per_degree,
            north: (other.latitude - self.latitude) * METRES_PER_DEGREE,
            up: other.altitude - self.altitude,
        }
    }

    /// Latitude and longitude in units of 1e-7 degrees, as messages carry them.
    #[must_use]
    pub fn e7(self) -> [i32; 2] {
        [self.latitude, self.longitude].map(|degrees| libm::round(degrees * 1e7) as i32)
    }
}

#[cfg(test)]
mod tests {
    use core::f64::consts::FRAC_PI_2;

    use proptest::prelude::*;

    use super::*;

    /// Worked by hand: 3 m north, 2 m east, 1 m above the origin.
    #[test]
    fn north_east_down_is_turned_into_east_north_up() {
        assert_eq!(position_from_ned([3.0, 2.0, -1.0]), EnuPosition { east: 2.0, north: 3.0, up: 1.0 });
        assert_eq!(velocity_from_ned([1.0, 0.0, 0.5]), EnuVelocity { east: 0.0, north: 1.0, up: -0.5 });
        // Nose to the east, up by 0.1, right side down by 0.2.
        let seen = attitude([0.2, 0.1, 1.5]);
        assert!((seen.heading - 1.5).abs() < 1e-6 && (seen.pitch - 0.1).abs() < 1e-6 && (seen.roll - 0.2).abs() < 1e-6);
    }

    /// Climbing at 0.5 m/s while flying forward at 1 m/s and turning right.
    #[test]
    fn a_setpoint_has_forward_first_and_down_positive() {
        let setpoint = Setpoint { right: 0.25, forward: 1.0, up: 0.5, yaw_rate: 0.75 };
        assert_eq!(setpoint_to_body(setpoint), ([1.0, 0.25, -0.5], 0.75));
    }

    /// A craft that looks east flies north by going to its left.
    #[test]
    fn a_velocity_to_the_north_is_to_the_left_of_a_craft_that_looks_east() {
        let setpoint = setpoint_from_ned([1.0, 0.0, -0.5], 0.0, FRAC_PI_2);
        assert!((setpoint.right + 1.0).abs() < 1e-12 && setpoint.forward.abs() < 1e-12 && setpoint.up == 0.5, "{setpoint:?}");
    }

    /// One degree of latitude is 111.2 km on that sphere; at 60° north a degree of longitude is half of it.
    #[test]
    fn a_degree_is_as_long_as_on_the_globe() {
        let there = GlobalPosition { latitude: 60.0, longitude: 10.0, altitude: 5.0 }.offset(EnuPosition {
            east: 55_597.5,
            north: 111_194.9,
            up: 2.0,
        });
        assert!((there.latitude - 61.0).abs() < 1e-5 && (there.longitude - 11.0).abs() < 1e-4, "{there:?}");
        assert_eq!(there.altitude, 7.0);
    }

    proptest! {
        #[test]
        fn there_and_back_is_the_same(
            ned in proptest::array::uniform3(-1e4_f32..1e4),
            body in proptest::array::uniform3(-50.0_f32..50.0),
            rate in -3.0_f32..3.0,
            latitude in -80.0..80.0_f64,
            longitude in -179.0..179.0_f64,
        ) {
            prop_assert_eq!(position_to_ned(position_from_ned(ned)), ned);
            prop_assert_eq!(velocity_to_ned(velocity_from_ned(ned)), ned);
            prop_assert_eq!(setpoint_to_body(setpoint_from_body(body, rate)), (body, rate));
            // Whatever the heading, the same velocity: its length stays.
            let turned = setpoint_from_ned(body, rate, f64::from(rate));
            let length = f64::from(body[0]).hypot(body[1].into());
            prop_assert!((turned.forward.hypot(turned.right) - length).abs() < 1e-9);
            let here = GlobalPosition { latitude, longitude, altitude: 400.0 };
            let offset = position_from_ned(ned);
            let back = here.offset_to(here.offset(offset));
            prop_assert!(back.distance(offset) < 1e-4, "{:?} {:?}", back, offset);
        }
    }
}

//! What a vehicle does.

use serde::{Deserialize, Serialize};

use super::{GeoPoint, Pose, Quaternionr, Vector3r};
use crate::airsim::wire::number::whole;

/// What becomes of the heading.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct YawMode {
    /// Whether it turns at a rate; else it goes to an angle.
    pub is_rate: bool,
    /// Degrees, or degrees per second; clockwise from above.
    pub yaw_or_rate: f64,
}

/// Place and motion.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct KinematicsState {
    /// NED from the vehicle's start, metres.
    pub position: Vector3r,
    /// Attitude.
    pub orientation: Quaternionr,
    /// World NED, m/s.
    pub linear_velocity: Vector3r,
    /// Body FRD, rad/s.
    pub angular_velocity: Vector3r,
    /// World NED, m/s².
    pub linear_acceleration: Vector3r,
    /// Body FRD, rad/s².
    pub angular_acceleration: Vector3r,
}

impl KinematicsState {
    /// Its pose.
    #[must_use]
    pub fn pose(&self) -> Pose {
        Pose { position: self.position, orientation: self.orientation }
    }
}

/// A collision.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CollisionInfo {
    /// Whether there was one since this was last read.
    pub has_collided: bool,
    /// Metres.
    pub penetration_depth: f64,
    /// Nanoseconds.
    #[serde(deserialize_with = "whole")]
    pub time_stamp: u64,
    /// Normal of the surface, NED.
    pub normal: Vector3r,
    /// Where it was touched, NED, metres.
    pub impact_point: Vector3r,
    /// Where the vehicle was, NED, metres.
    pub position: Vector3r,
    /// What was touched.
    pub object_name: String,
    /// Its number in the segmentation; -1 if it has none.
    #[serde(deserialize_with = "whole")]
    pub object_id: i32,
}

impl Default for CollisionInfo {
    fn default() -> Self {
        Self {
            has_collided: false,
            penetration_depth: 0.0,
            time_stamp: 0,
            normal: Vector3r::default(),
            impact_point: Vector3r::default(),
            position: Vector3r::default(),
            object_name: String::new(),
            object_id: -1,
        }
    }
}

/// A remote control.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RcData {
    /// Nanoseconds.
    #[serde(deserialize_with = "whole")]
    pub timestamp: u64,
    /// -1 to 1.
    pub pitch: f64,
    /// -1 to 1.
    pub roll: f64,
    /// 0 to 1.
    pub throttle: f64,
    /// -1 to 1.
    pub yaw: f64,
    /// -1 to 1.
    pub left_z: f64,
    /// -1 to 1.
    pub right_z: f64,
    /// A bit for each switch.
    #[serde(deserialize_with = "whole")]
    pub switches: u32,
    /// Its maker.
    pub vendor_id: String,
    /// Whether there is one.
    pub is_initialized: bool,
    /// Whether its values count.
    pub is_valid: bool,
}

/// The state of a multirotor. AirSim sends its first six fields, Colosseum all nine: what is `None` is not written.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MultirotorState {
    /// Its last collision.
    pub collision: CollisionInfo,
    /// Where it takes itself to be.
    pub kinematics_estimated: KinematicsState,
    /// Where that is on the earth.
    pub gps_location: GeoPoint,
    /// Nanoseconds.
    #[serde(deserialize_with = "whole")]
    pub timestamp: u64,
    /// 0 on the ground, 1 in the air.
    #[serde(deserialize_with = "whole")]
    pub landed_state: u8,
    /// Its remote control.
    pub rc_data: RcData,
    /// Whether it can be flown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ready: Option<bool>,
    /// Why not.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ready_message: Option<String>,
    /// Whether it can be armed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub can_arm: Option<bool>,
}

/// The surroundings.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct EnvironmentState {
    /// NED from the vehicle's start, metres.
    pub position: Vector3r,
    /// The same on the earth.
    pub geo_point: GeoPoint,
    /// NED, m/s².
    pub gravity: Vector3r,
    /// Pascal.
    pub air_pressure: f64,
    /// Kelvin.
    pub temperature: f64,
    /// kg/m³.
    pub air_density: f64,
}

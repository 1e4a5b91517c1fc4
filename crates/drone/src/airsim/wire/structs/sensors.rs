//! What sensors measure.

use serde::{Deserialize, Serialize};

use super::{GeoPoint, Pose, Quaternionr, Vector3r};
use crate::airsim::wire::number::whole;

/// An inertial sensor.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ImuData {
    /// Nanoseconds.
    #[serde(deserialize_with = "whole")]
    pub time_stamp: u64,
    /// Attitude.
    pub orientation: Quaternionr,
    /// Body FRD, rad/s.
    pub angular_velocity: Vector3r,
    /// Specific force, body FRD, m/s²: at rest (0, 0, -g).
    pub linear_acceleration: Vector3r,
}

/// A lidar.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LidarData {
    /// Nanoseconds.
    #[serde(deserialize_with = "whole")]
    pub time_stamp: u64,
    /// x, y, z of every point, metres.
    pub point_cloud: Vec<f32>,
    /// Its pose.
    pub pose: Pose,
    /// A number of the segmentation for every point.
    pub segmentation: Vec<i32>,
}

/// A rangefinder.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct DistanceSensorData {
    /// Nanoseconds.
    #[serde(deserialize_with = "whole")]
    pub time_stamp: u64,
    /// Metres.
    pub distance: f64,
    /// Metres.
    pub min_distance: f64,
    /// Metres.
    pub max_distance: f64,
    /// Its pose on the vehicle, FRD.
    pub relative_pose: Pose,
}

/// A barometer.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct BarometerData {
    /// Nanoseconds.
    #[serde(deserialize_with = "whole")]
    pub time_stamp: u64,
    /// Metres above mean sea level.
    pub altitude: f64,
    /// Pascal.
    pub pressure: f64,
    /// Pressure at sea level, hectopascal.
    pub qnh: f64,
}

/// A magnetometer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MagnetometerData {
    /// Nanoseconds.
    #[serde(deserialize_with = "whole")]
    pub time_stamp: u64,
    /// Body FRD, gauss.
    pub magnetic_field_body: Vector3r,
    /// Its covariance; mostly empty.
    pub magnetic_field_covariance: Vec<f64>,
}

/// What satellites tell.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct GnssReport {
    /// Where it is.
    pub geo_point: GeoPoint,
    /// Horizontal uncertainty.
    pub eph: f64,
    /// Vertical uncertainty.
    pub epv: f64,
    /// NED, m/s.
    pub velocity: Vector3r,
    /// 0 none, 1 time alone, 2 without altitude, 3 all.
    #[serde(deserialize_with = "whole")]
    pub fix_type: u8,
    /// Nanoseconds.
    #[serde(deserialize_with = "whole")]
    pub time_utc: u64,
}

/// A receiver of satellites.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct GpsData {
    /// Nanoseconds.
    #[serde(deserialize_with = "whole")]
    pub time_stamp: u64,
    /// What it reports.
    pub gnss: GnssReport,
    /// Whether that counts.
    pub is_valid: bool,
}

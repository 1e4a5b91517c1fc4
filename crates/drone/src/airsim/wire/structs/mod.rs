//! The structs of AirSim, each with the keys of AirSim 1.8.1 in the order of Colosseum's arrays.
//!
//! Lengths are metres, angles radians but where a name says `deg`, times seconds, time stamps nanoseconds.

mod geometry;
mod image;
mod sensors;
mod state;

pub use geometry::{GeoPoint, Pose, Quaternionr, Vector3r};
pub use image::{CameraInfo, ImageRequest, ImageResponse, ImageType, ProjectionMatrix};
pub use sensors::{BarometerData, DistanceSensorData, GnssReport, GpsData, ImuData, LidarData, MagnetometerData};
pub use state::{CollisionInfo, EnvironmentState, KinematicsState, MultirotorState, RcData, YawMode};

//! Pictures.

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::{Pose, Quaternionr, Vector3r};
use crate::airsim::wire::number::whole;

/// What a picture shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ImageType {
    /// Colours.
    Scene,
    /// Distance along the optical axis, metres.
    DepthPlanar,
    /// Distance along the ray, metres.
    DepthPerspective,
    /// Distance along the optical axis, 0 to 100 m.
    DepthVis,
    /// Disparity of a stereo pair.
    DisparityNormalized,
    /// A colour for each object.
    Segmentation,
    /// Normals of surfaces.
    SurfaceNormals,
    /// Infrared.
    Infrared,
    /// Optical flow.
    OpticalFlow,
    /// Optical flow in colours.
    OpticalFlowVis,
}

impl ImageType {
    /// All, each at its number.
    pub const ALL: [Self; 10] = [
        Self::Scene,
        Self::DepthPlanar,
        Self::DepthPerspective,
        Self::DepthVis,
        Self::DisparityNormalized,
        Self::Segmentation,
        Self::SurfaceNormals,
        Self::Infrared,
        Self::OpticalFlow,
        Self::OpticalFlowVis,
    ];

    /// Its number on the wire.
    #[must_use]
    pub const fn number(self) -> u8 {
        self as u8
    }

    /// The type of a number; `None` above 9.
    #[must_use]
    pub fn of(number: u8) -> Option<Self> {
        Self::ALL.get(usize::from(number)).copied()
    }
}

impl Serialize for ImageType {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_u8(self.number())
    }
}

impl<'de> Deserialize<'de> for ImageType {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let number: u8 = whole(deserializer)?;
        Self::of(number).ok_or_else(|| serde::de::Error::custom(format!("no type of image has the number {number}")))
    }
}

/// One picture that is asked for.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ImageRequest {
    /// Name or number of the camera; empty for the first one.
    pub camera_name: String,
    /// What it is to show.
    pub image_type: ImageType,
    /// Whether pixels are floats.
    pub pixels_as_float: bool,
    /// Whether it is a PNG; else raw bytes, blue, green, red, row by row from the top. Of floats without effect.
    pub compress: bool,
}

/// One picture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ImageResponse {
    /// A PNG, or raw bytes: blue, green, red, row by row from the top.
    #[serde(with = "serde_bytes")]
    pub image_data_uint8: Vec<u8>,
    /// Pixels as floats, row by row from the top.
    pub image_data_float: Vec<f32>,
    /// Place of the camera, NED, metres.
    pub camera_position: Vector3r,
    /// Its name.
    pub camera_name: String,
    /// Its attitude.
    pub camera_orientation: Quaternionr,
    /// Nanoseconds.
    #[serde(deserialize_with = "whole")]
    pub time_stamp: u64,
    /// Why there is no picture.
    pub message: String,
    /// As asked for.
    pub pixels_as_float: bool,
    /// As asked for.
    pub compress: bool,
    /// Pixels; 0 without a picture.
    #[serde(deserialize_with = "whole")]
    pub width: u32,
    /// Pixels; 0 without a picture.
    #[serde(deserialize_with = "whole")]
    pub height: u32,
    /// As asked for.
    pub image_type: ImageType,
}

/// A projection.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ProjectionMatrix {
    /// Row by row.
    pub matrix: [[f64; 4]; 4],
}

/// Where a camera is, and what it sees.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CameraInfo {
    /// Its pose, NED from the vehicle's start.
    pub pose: Pose,
    /// Horizontal field of view, the whole angle, degrees.
    pub fov: f64,
    /// Its projection.
    pub proj_mat: ProjectionMatrix,
}

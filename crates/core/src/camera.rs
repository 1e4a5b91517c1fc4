//! The pinhole camera: fx, fy, cx, cy, lens distortion and mount tilt (paper §3.3).

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

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
    /// Picture width, pixels.
    pub width: u32,
    /// Picture height, pixels.
    pub height: u32,
    /// Focal length along the width, pixels.
    pub fx: f64,
    /// Focal length along the height, pixels.
    pub fy: f64,
    /// Principal point, pixels from the left edge of the picture.
    pub cx: f64,
    /// Principal point, pixels from the upper edge of the picture.
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

    /// The simulator's `quad` camera: 90° × 73.7° at 960×720, tilt 5° (DESIGN.md section 5).
    #[must_use]
    pub fn quad() -> Self {
        Self::from_fov(960, 720, 90.0_f64.to_radians(), 73.7_f64.to_radians(), 5.0_f64.to_radians())
    }

    /// A Tello's video at 960×720: fx = fy = 915, cx 458, cy 350, tilt 5° (calibrations collected in docs/method.md).
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
}

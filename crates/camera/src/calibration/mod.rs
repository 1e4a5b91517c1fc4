//! Calibrations of cameras: focal length, principal point and distortion, as OpenCV and ROS write them.

mod lens;
mod undistort;
mod yaml;

use spf_core::camera::{Camera, Distortion};

pub use lens::Lens;
pub use undistort::Undistorter;

/// Largest calibration file, bytes; real ones have about 1000.
pub const LONGEST_FILE: usize = 64 << 10;
/// Longest side of a calibrated image, pixels.
const LONGEST_SIDE: u32 = 65_536;

/// The calibration of a camera.
#[derive(Clone, Debug, PartialEq)]
pub struct Calibration {
    /// Width of the image for which it holds, pixels.
    pub width: u32,
    /// Height of that image, pixels.
    pub height: u32,
    /// Focal length along the width, pixels.
    pub fx: f64,
    /// Focal length along the height, pixels.
    pub fy: f64,
    /// Principal point, pixels from the left edge.
    pub cx: f64,
    /// Principal point, pixels from the upper edge.
    pub cy: f64,
    /// The lens.
    pub lens: Lens,
}

/// Why a calibration file was rejected.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum CalibrationError {
    /// Larger than any calibration.
    #[error("it has more than {} KiB", LONGEST_FILE >> 10)]
    Long,
    /// Not YAML.
    #[error("it is no valid YAML: {0}")]
    Yaml(String),
    /// A value that is missing.
    #[error("`{0}` is missing")]
    Missing(&'static str),
    /// A value that is invalid.
    #[error("`{0}` is invalid: {1}")]
    Invalid(&'static str, &'static str),
    /// An unknown model.
    #[error("the distortion model `{0}` is unknown: plumb_bob, rational_polynomial and equidistant (fisheye) can be read")]
    Model(String),
}

impl Calibration {
    /// Reads a calibration in the YAML of OpenCV (`camera_matrix`, `distortion_coefficients`) or of ROS (`camera_info`).
    ///
    /// # Errors
    /// [`CalibrationError`] if something is missing or cannot be.
    pub fn parse(text: &str) -> Result<Self, CalibrationError> {
        if text.len() > LONGEST_FILE {
            return Err(CalibrationError::Long);
        }
        let values = yaml::values(text)?;
        let side = |key| {
            let value: Option<f64> = values.number(key)?;
            let value = value.ok_or(CalibrationError::Missing(key))?;
            let whole = value.fract() == 0.0 && (1.0..=f64::from(LONGEST_SIDE)).contains(&value);
            if whole { Ok(value as u32) } else { Err(CalibrationError::Invalid(key, "not a number of pixels")) }
        };
        let (width, height) = (side("image_width")?, side("image_height")?);
        let matrix = values.numbers("camera_matrix")?.ok_or(CalibrationError::Missing("camera_matrix"))?;
        let [fx, skew, cx, zero, fy, cy, x, y, one] = matrix[..] else {
            return Err(CalibrationError::Invalid("camera_matrix", "nine numbers are needed"));
        };
        if [x, y, one] != [0.0, 0.0, 1.0] || zero != 0.0 || skew.abs() > 1e-3 * fx.abs() {
            return Err(CalibrationError::Invalid("camera_matrix", "not of the form fx 0 cx, 0 fy cy, 0 0 1"));
        }
        // From a fisheye of 220° to a telescope of 0.6°.
        let possible = |focal: f64, side: u32| (0.05..100.0).contains(&(focal / f64::from(side)));
        if !possible(fx, width) || !possible(fy, height) {
            return Err(CalibrationError::Invalid("camera_matrix", "the focal length does not fit the size of the image"));
        }
        if !(0.0..=f64::from(width)).contains(&cx) || !(0.0..=f64::from(height)).contains(&cy) {
            return Err(CalibrationError::Invalid("camera_matrix", "the principal point is outside of the image"));
        }
        let coefficients = values.numbers("distortion_coefficients")?.unwrap_or_default();
        let lens = Lens::of(values.text("distortion_model"), values.number("fisheye_model")?, &coefficients)?;
        Ok(Self { width, height, fx, fy, cx, cy, lens })
    }

    /// The camera whose images come out of an [`Undistorter`]; `tilt` in radians, downwards positive. OpenCV counts from the
    /// centre of the first pixel, and a [`Camera`] from its edge.
    #[must_use]
    pub fn camera(&self, tilt: f64) -> Camera {
        let Self { width, height, fx, fy, cx, cy, .. } = *self;
        Camera { width, height, fx, fy, cx: cx + 0.5, cy: cy + 0.5, distortion: Distortion::default(), tilt }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const OPENCV: &str = "%YAML:1.0\n---\ncalibration_time: \"Thu 26 Nov 2026 10:00:00\"\nimage_width: 640\nimage_height: 480\n\
                          fisheye_model: 0\ncamera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ 5.3e+02, 0., \
                          3.4e+02, 0.,\n       5.31e+02, 2.35e+02, 0., 0., 1. ]\ndistortion_coefficients: !!opencv-matrix\n   rows: 5\n   \
                          cols: 1\n   dt: d\n   data: [ -2.8e-01, 2.5e-02, 1.2e-03,\n       -1.3e-04, 1.6e-01 ]\navg_reprojection_error: \
                          2.1e-01\n";
    const ROS: &str = "image_width: 1280\nimage_height: 720\ncamera_name: front\ncamera_matrix:\n  rows: 3\n  cols: 3\n  data: [900, 0, \
                       640, 0, 905.5, 360, 0, 0, 1]\ndistortion_model: plumb_bob\ndistortion_coefficients:\n  rows: 1\n  cols: 5\n  data: \
                       [0.1, -0.2, 0.001, -0.002, 0]\nrectification_matrix:\n  rows: 3\n  cols: 3\n  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]\n\
                       projection_matrix:\n  rows: 3\n  cols: 4\n  data: [900, 0, 640, 0, 0, 905.5, 360, 0, 0, 0, 1, 0]\n";

    #[test]
    fn files_of_opencv_and_ros_are_read() {
        let opencv = Calibration::parse(OPENCV).unwrap();
        assert_eq!((opencv.width, opencv.height, opencv.fx, opencv.fy), (640, 480, 530.0, 531.0));
        assert_eq!((opencv.cx, opencv.cy), (340.0, 235.0));
        assert_eq!(opencv.lens, Lens::brown([-0.28, 0.025, 0.0012, -0.00013, 0.16, 0.0, 0.0, 0.0]));
        let ros = Calibration::parse(ROS).unwrap();
        assert_eq!((ros.width, ros.fy, ros.lens), (1280, 905.5, Lens::brown([0.1, -0.2, 0.001, -0.002, 0.0, 0.0, 0.0, 0.0])));
        let camera = ros.camera(0.1);
        assert_eq!((camera.fx, camera.tilt, camera.distortion.is_none()), (900.0, 0.1, true));
        let fisheye = ROS.replace("plumb_bob", "equidistant").replace("-0.002, 0]", "-0.002]");
        assert_eq!(Calibration::parse(&fisheye).unwrap().lens, Lens::fisheye([0.1, -0.2, 0.001, -0.002]));
        // The older names of OpenCV's sample.
        let older = OPENCV
            .replace("image_w", "image_W")
            .replace("camera_matrix", "Camera_Matrix")
            .replace("distortion_c", "Distortion_C");
        assert_eq!(Calibration::parse(&older).unwrap(), opencv);
    }

    #[test]
    fn wrong_files_are_refused() {
        for (from, to, expected) in [
            ("image_width: 1280", "", "`image_width` is missing"),
            ("image_width: 1280", "image_width: 12.5", "`image_width` is invalid"),
            ("image_width: 1280", "image_width: wide", "`image_width` is invalid"),
            ("900, 0, 640, 0, 905.5, 360, 0, 0, 1]\ndist", "900, 0, 640]\ndist", "nine numbers"),
            ("data: [900, 0, 640", "data: [9, 0, 640", "focal length"),
            ("data: [900, 0, 640", "data: [900, 0, 1300", "principal point"),
            ("plumb_bob", "thin_prism", "`thin_prism` is unknown"),
            ("-0.002, 0]", "-0.002, nan]", "`distortion_coefficients` is invalid"),
            ("camera_name: front", "camera_name: [", "YAML"),
            ("camera_name: front", "camera_name: &a [*a, *a]", "YAML"),
        ] {
            let error = Calibration::parse(&ROS.replacen(from, to, 1)).unwrap_err().to_string();
            assert!(error.contains(expected), "{error}");
        }
        assert_eq!(Calibration::parse(&" ".repeat(LONGEST_FILE + 1)), Err(CalibrationError::Long));
        assert!(Calibration::parse(&"[".repeat(LONGEST_FILE)).is_err());
    }

    proptest! {
        #[test]
        fn any_text_is_read_or_refused(text in "[a-z: \\[\\]{}\n&*!%0-9.-]{0,200}", cut in 0_usize..500, at in 0_usize..500) {
            drop(Calibration::parse(&text));
            let mut changed = ROS.to_owned();
            changed.insert_str(at.min(ROS.len()), &text);
            drop(Calibration::parse(&changed));
            drop(Calibration::parse(&OPENCV[..cut.min(OPENCV.len())]));
        }
    }
}

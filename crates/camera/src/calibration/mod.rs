//! Calibrations of cameras: focal length, principal point and distortion, as OpenCV, ROS and Kalibr write them.

mod lens;
mod undistort;
mod yaml;

use core::fmt;

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
    #[error(
        "the model `{0}` is unknown: plumb_bob, radtan, rational_polynomial and equidistant (fisheye), of a pinhole, can be read"
    )]
    Model(String),
    /// A key that is not known, and may say something about the lens.
    #[error(
        "the key `{0}` is unknown: camera_matrix (K, intrinsics), distortion_coefficients (D, dist_coeffs, distortion_coeffs), \
         distortion_model, camera_model, image_width and image_height (resolution) can be read; take the line out if it \
         says nothing of the lens"
    )]
    Unknown(String),
    /// Two names of the same.
    #[error("`{0}` and `{1}` say the same: keep one of them")]
    Twice(&'static str, &'static str),
    /// Two models.
    #[error("`{0}` and `{1}` name different models")]
    Contradiction(&'static str, &'static str),
    /// Several cameras.
    #[error("it has several cameras ({0}): copy the part of one into a file of its own")]
    Several(String),
}

/// The names of what is read: those of OpenCV first, then of ROS, Kalibr and others. Capitals and underscores do not matter.
const WIDTH: &[&str] = &["image_width", "width"];
const HEIGHT: &[&str] = &["image_height", "height"];
const SIZE: &[&str] = &["resolution", "image_size"];
const MATRIX: &[&str] = &["camera_matrix", "K", "intrinsics", "mtx"];
const COEFFICIENTS: &[&str] = &[
    "distortion_coefficients",
    "distortion_coeffs",
    "dist_coefficients",
    "dist_coeffs",
    "dist_coeff",
    "dist_coefs",
    "dist",
    "D",
];
const LENS: &[&str] = &["distortion_model", "camera_model", "fisheye_model"];
/// What part of its sensor a camera uses, in `camera_info`.
const WINDOW: [&str; 6] = ["binning_x", "binning_y", "roi.x_offset", "roi.y_offset", "roi.width", "roi.height"];
/// What such files also say, and what says nothing of the lens: how it was calibrated and how well, the camera's name and
/// place, and the rectification of a pair of cameras.
const OTHERS: [&str; 51] = [
    "aspect_ratio",
    "avg_reprojection_error",
    "board_height",
    "board_width",
    "calibration_date",
    "calibration_time",
    "cam_overlaps",
    "camera_id",
    "camera_name",
    "comment",
    "date",
    "description",
    "error",
    "extrinsic_parameters",
    "fix_aspect_ratio",
    "flags",
    "frame_id",
    "grid_points",
    "header",
    "image_points",
    "marker_size",
    "mean_error",
    "mean_reprojection_error",
    "name",
    "new_camera_matrix",
    "nframes",
    "nr_of_frames",
    "P",
    "pattern_size",
    "per_view_errors",
    "per_view_reprojection_errors",
    "projection_matrix",
    "R",
    "rate_hz",
    "rectification_matrix",
    "reprojection_error",
    "ret",
    "rms",
    "rms_error",
    "roi",
    "rostopic",
    "rvecs",
    "sensor_type",
    "serial",
    "serial_number",
    "square_size",
    "T_BS",
    "T_cam_imu",
    "T_cn_cnm1",
    "timeshift_cam_imu",
    "tvecs",
];

impl fmt::Display for Calibration {
    /// What was read, on one line.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { width, height, fx, fy, cx, cy, lens } = self;
        write!(f, "{width}×{height}, focal length {fx:.1} and {fy:.1} pixels, centre at ({cx:.1}, {cy:.1}), {lens}")
    }
}

impl Calibration {
    /// Reads a calibration in the YAML of OpenCV (`camera_matrix`, `distortion_coefficients`), of ROS (the file of
    /// `camera_calibration`, or a message of `camera_info`) or of Kalibr (a camchain of one camera). A key that is not known
    /// is refused, since it may be that of the distortion.
    ///
    /// # Errors
    /// [`CalibrationError`] if something is missing, unknown or cannot be.
    pub fn parse(text: &str) -> Result<Self, CalibrationError> {
        if text.len() > LONGEST_FILE {
            return Err(CalibrationError::Long);
        }
        let values = yaml::values(text)?.of_one_camera()?;
        let read = [WIDTH, HEIGHT, SIZE, MATRIX, COEFFICIENTS, LENS, &WINDOW[..2]].concat();
        if let Some(key) = values.unknown(&read, &OTHERS) {
            return Err(CalibrationError::Unknown(key.chars().filter(|c| !c.is_control()).take(60).collect()));
        }
        let side = |key, value: f64| {
            let whole = value.fract() == 0.0 && (1.0..=f64::from(LONGEST_SIDE)).contains(&value);
            if whole { Ok(value as u32) } else { Err(CalibrationError::Invalid(key, "not a number of pixels")) }
        };
        let (width, height) = match (values.numbers(SIZE)?, values.number(WIDTH)?, values.number(HEIGHT)?) {
            (Some((key, _)), Some((other, _)), _) | (Some((key, _)), _, Some((other, _))) => {
                return Err(CalibrationError::Twice(key, other));
            }
            (Some((key, sides)), None, None) => match sides[..] {
                [width, height] => (side(key, width)?, side(key, height)?),
                _ => return Err(CalibrationError::Invalid(key, "width and height are needed")),
            },
            (None, Some((wide, width)), Some((high, height))) => (side(wide, width)?, side(high, height)?),
            (None, None, _) => return Err(CalibrationError::Missing("image_width")),
            (None, _, None) => return Err(CalibrationError::Missing("image_height")),
        };
        let (key, matrix) = values.numbers(MATRIX)?.ok_or(CalibrationError::Missing("camera_matrix"))?;
        let wrong = |why| CalibrationError::Invalid(key, why);
        let [fx, fy, cx, cy] = match (key, &matrix[..]) {
            ("intrinsics", &[fx, fy, cx, cy]) => [fx, fy, cx, cy],
            ("intrinsics", _) => return Err(wrong("the four numbers of a pinhole are needed: fx, fy, cx, cy")),
            (_, &[fx, skew, cx, zero, fy, cy, x, y, one]) => {
                if [x, y, one] != [0.0, 0.0, 1.0] || zero != 0.0 || skew.abs() > 1e-3 * fx.abs() {
                    return Err(wrong("not of the form fx 0 cx, 0 fy cy, 0 0 1"));
                }
                [fx, fy, cx, cy]
            }
            _ => return Err(wrong("nine numbers are needed")),
        };
        // From a fisheye of 220° to a telescope of 0.6°.
        let possible = |focal: f64, side: u32| (0.05..100.0).contains(&(focal / f64::from(side)));
        if !possible(fx, width) || !possible(fy, height) {
            return Err(wrong("the focal length does not fit the size of the image"));
        }
        if !(0.0..=f64::from(width)).contains(&cx) || !(0.0..=f64::from(height)).contains(&cy) {
            return Err(wrong("the principal point is outside of the image"));
        }
        Self::whole_image(&values, width, height)?;
        let (key, coefficients) = values.numbers(COEFFICIENTS)?.unwrap_or((COEFFICIENTS[0], Vec::new()));
        let models = ["distortion_model", "camera_model"].into_iter();
        let models = models.filter_map(|key| Some(values.text(key).transpose()?.map(|name| (key, name))));
        let models = models.collect::<Result<Vec<_>, _>>()?;
        let fisheye = values.number(&["fisheye_model"])?.map(|(_, flag)| flag);
        let lens = Lens::of(&models, fisheye, (key, &coefficients))?;
        Ok(Self { width, height, fx, fy, cx, cy, lens })
    }

    /// Refuses a ROS `camera_info` of a part of the sensor, or of joined pixels: its matrix is that of the whole one.
    fn whole_image(values: &yaml::Values, width: u32, height: u32) -> Result<(), CalibrationError> {
        let [binning_x, binning_y, left, top, wide, high] = WINDOW;
        for key in [binning_x, binning_y] {
            if values.number(&[key])?.is_some_and(|(_, pixels)| pixels > 1.0) {
                return Err(CalibrationError::Invalid(key, "a calibration of joined pixels cannot be used"));
            }
        }
        for (key, whole) in [(left, 0), (top, 0), (wide, width), (high, height)] {
            // Zero stands for the whole image.
            let part = values.number(&[key])?.is_some_and(|(_, given)| given != 0.0 && given != f64::from(whole));
            if part {
                return Err(CalibrationError::Invalid(key, "a calibration of a part of the image cannot be used"));
            }
        }
        Ok(())
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

    /// A message of ROS 2, as `ros2 topic echo` writes it, and its numbers in a file of ROS 1.
    const CAMERA_INFO: &str = "header:\n  stamp:\n    sec: 1\n    nanosec: 2\n  frame_id: front\nheight: 720\nwidth: 1280\n\
                               distortion_model: plumb_bob\nd:\n- 0.1\n- -0.2\n- 0.001\n- -0.002\n- 0.0\nk:\n- 900.0\n- 0.0\n- 640.0\n\
                               - 0.0\n- 905.5\n- 360.0\n- 0.0\n- 0.0\n- 1.0\nr: [1, 0, 0, 0, 1, 0, 0, 0, 1]\np: [900, 0, 640, 0, 0, \
                               905.5, 360, 0, 0, 0, 1, 0]\nbinning_x: 0\nbinning_y: 0\nroi:\n  x_offset: 0\n  y_offset: 0\n  \
                               height: 720\n  width: 1280\n  do_rectify: false\n---\n";
    const KALIBR: &str = "cam0:\n  cam_overlaps: []\n  camera_model: pinhole\n  distortion_coeffs: [0.1, -0.2, 0.001, -0.002]\n  \
                          distortion_model: equidistant\n  intrinsics: [900.0, 905.5, 640.0, 360.0]\n  resolution: [1280, 720]\n  \
                          rostopic: /front\n  T_cam_imu:\n  - [1, 0, 0, 0]\n  - [0, 1, 0, 0]\n";

    #[test]
    fn the_same_lens_is_read_under_every_name() {
        let ros = Calibration::parse(ROS).unwrap();
        assert_eq!(Calibration::parse(CAMERA_INFO).unwrap(), ros);
        let first = CAMERA_INFO.replace("\nd:", "\nD:").replace("\nk:", "\nK:").replace("\nr:", "\nR:").replace("\np:", "\nP:");
        assert_eq!(Calibration::parse(&first).unwrap(), ros);
        for name in ["dist_coeffs", "distCoeffs", "dist_coeff", "distortion_coeffs", "dist"] {
            assert_eq!(Calibration::parse(&ROS.replace("distortion_coefficients", name)).unwrap(), ros, "{name}");
        }
        let python = "image_size: [1280, 720]\ncamera_matrix:\n- [900, 0, 640]\n- [0, 905.5, 360]\n- [0, 0, 1]\ndist_coeff:\n\
                      - [0.1, -0.2, 0.001, -0.002, 0.0]\n";
        assert_eq!(Calibration::parse(python).unwrap(), ros);
        let fisheye = Calibration { lens: Lens::fisheye([0.1, -0.2, 0.001, -0.002]), ..ros.clone() };
        assert_eq!(Calibration::parse(KALIBR).unwrap(), fisheye);
        assert_eq!(Calibration::parse(&KALIBR.replace("equidistant", "radtan")).unwrap(), ros);
        let euroc = KALIBR.replace("equidistant", "radial-tangential").replace("cam0:\n", "").replace("\n  ", "\n");
        assert_eq!(Calibration::parse(euroc.trim_start()).unwrap(), ros);
        // The model of the camera alone.
        let alone = KALIBR.replace("  distortion_model: equidistant\n", "").replace("pinhole", "equidistant");
        assert_eq!(Calibration::parse(&alone).unwrap(), fisheye);
        let two = format!("{KALIBR}{}", KALIBR.replace("cam0", "cam1"));
        assert_eq!(Calibration::parse(&two), Err(CalibrationError::Several("cam0, cam1".to_owned())));
        let omni = KALIBR.replace("intrinsics: [", "intrinsics: [0.9, ");
        assert!(Calibration::parse(&omni).unwrap_err().to_string().contains("the four numbers of a pinhole"));
    }

    #[test]
    fn a_calibration_is_written_as_it_was_read() {
        let shown = |text: &str| Calibration::parse(text).unwrap().to_string();
        assert_eq!(
            shown(ROS),
            "1280×720, focal length 900.0 and 905.5 pixels, centre at (640.0, 360.0), Brown (plumb_bob, radtan): k1 0.1, k2 -0.2, \
             p1 0.001, p2 -0.002, k3 0"
        );
        assert!(shown(KALIBR).ends_with("fisheye (equidistant): k1 0.1, k2 -0.2, k3 0.001, k4 -0.002"), "{}", shown(KALIBR));
        let rational = ROS.replace("-0.002, 0]", "-0.002, 0, 0.3, 0, 0.5]");
        assert!(shown(&rational).ends_with("k3 0, k4 0.3, k6 0.5"), "{}", shown(&rational));
        assert!(shown(&ROS.replace("[0.1, -0.2, 0.001, -0.002, 0]", "[]")).ends_with("no distortion"));
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
            // What may be the lens is never passed over.
            ("camera_name: front", "dist_koeffs: [0.1]", "the key `dist_koeffs` is unknown"),
            ("camera_name: front", "Camera.fx: 900", "the key `Camera.fx` is unknown"),
            ("camera_name: front", "dist_coeffs: [0.1]", "`distortion_coefficients` and `dist_coeffs` say the same"),
            ("camera_name: front", "resolution: [1280, 720]", "`resolution` and `image_width` say the same"),
            ("camera_name: front", "camera_model: equidistant", "`distortion_model` and `camera_model` name different models"),
            ("camera_name: front", "camera_model: omni", "the model `omni` is unknown"),
            ("camera_name: front", "fisheye_model: 1", "`fisheye_model` and `distortion_model` name different models"),
            ("plumb_bob", "none", "`distortion_coefficients` is invalid: there are some"),
            ("camera_name: front", "binning_x: 2", "joined pixels"),
            ("camera_name: front", "roi: {x_offset: 8, width: 640}", "a part of the image"),
            ("camera_name: front", "image_width: 1280", "`image_width` is invalid: one number is needed"),
            ("  cols: 3\n", "  columns: 3\n", "the key `camera_matrix.columns` is unknown"),
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
            for known in [CAMERA_INFO, KALIBR] {
                let mut changed = known.to_owned();
                changed.insert_str(at.min(known.len()), &text);
                if let Ok(read) = Calibration::parse(&changed) {
                    prop_assert!(read.fx > 0.0 && read.to_string().contains("pixels"));
                }
            }
        }
    }
}

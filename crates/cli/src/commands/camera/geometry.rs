//! How a camera sees, by its flags.

use std::time::Instant;

use spf_camera::calibration::{Calibration, Undistorter};
use spf_camera::craft::SHAPE;
use spf_camera::{Camera, CameraUrl};
use spf_core::camera::Camera as Optics;
use spf_drone::tello::TelloSettings;
use spf_flight::doctor::{Check, Finding};

use super::{Finish, calibrate, settings, start};
use crate::args::{CameraArgs, Times};
use crate::commands::read;
use crate::error::CliError;

/// How a camera sees and how it is mounted.
pub(super) struct Geometry {
    calibration: Option<Calibration>,
    /// That of a Tello is known.
    known: Option<Optics>,
    /// Horizontal field of view otherwise, radians.
    fov: f64,
    /// Radians, downwards positive.
    tilt: f64,
    /// Measured time from capture to arrival, s.
    latency: Option<f64>,
    times: Option<Times>,
}

impl Geometry {
    pub(super) fn of(args: &CameraArgs, url: &CameraUrl) -> Result<Self, CliError> {
        let within = |flag: &str, value: f64, least: f64, most: f64| {
            if (least..=most).contains(&value) {
                return Ok(value);
            }
            Err(CliError::usage(format!("{flag}: `{value}` is not a number from {least} to {most}")))
        };
        let known = matches!(url, CameraUrl::Tello(_)).then(Optics::tello);
        let usual = known.map_or(0.0, |known| known.tilt.to_degrees());
        let tilt = within("--camera-tilt", args.tilt.unwrap_or(usual), -45.0, 90.0)?.to_radians();
        let latency = calibrate::latency("--camera-latency", args.latency.as_deref())?;
        let calibration = match &args.calibration {
            Some(path) => {
                let parsed = Calibration::parse(&read(path, "calibration")?);
                Some(parsed.map_err(|error| {
                    CliError::usage(format!("invalid calibration file `{}`", path.display()))
                        .because(&error)
                        .hint("the YAML of OpenCV's calibration sample, of ROS and of Kalibr can be read (docs/guide/cameras.md)")
                })?)
            }
            None => None,
        };
        let fov = match (&calibration, args.fov) {
            (_, Some(fov)) => within("--camera-fov", fov, 5.0, 150.0)?.to_radians(),
            (Some(_), None) => 0.0,
            (None, None) if known.is_some() => 0.0,
            (None, None) => {
                return Err(CliError::usage("--camera: how wide the camera sees is unknown")
                    .hint("give --camera-calibration FILE, or --camera-fov with its horizontal field of view in degrees"));
            }
        };
        Ok(Self { calibration, known: known.filter(|_| args.fov.is_none()), fov, tilt, latency, times: args.times })
    }

    /// Starts the camera.
    pub(super) fn start(&self, url: CameraUrl, tello: TelloSettings, from: Instant) -> Result<Camera, CliError> {
        let finish: Finish = match &self.calibration {
            Some(calibration) => {
                let mut undistorter = Undistorter::new(calibration.clone());
                Box::new(move |image| undistorter.undistort(image))
            }
            None => Box::new(|image| image),
        };
        let settings = settings(self.latency, self.times, tello, &url);
        start(url, &settings, from, finish)
    }

    /// The camera that sees images of this size.
    pub(super) fn optics(&self, (width, height): (u32, u32)) -> Optics {
        match (&self.calibration, self.known) {
            (Some(calibration), _) => calibration.camera(self.tilt).resized(width, height),
            (None, Some(known)) => Optics { tilt: self.tilt, ..known }.resized(width, height),
            (None, None) => {
                let high = f64::from(height) / f64::from(width) * libm::tan(0.5 * self.fov);
                Optics::from_fov(width, height, self.fov, 2.0 * libm::atan(high), self.tilt)
            }
        }
    }

    /// The lens as its calibration was read, for `spf doctor`.
    pub(super) fn lens(&self) -> Option<Check> {
        let calibration = self.calibration.as_ref()?;
        let (across, down) = calibration.camera(self.tilt).half_fov();
        let (across, down) = (2.0 * across.to_degrees(), 2.0 * down.to_degrees());
        let found = format!("{calibration}; without distortion it sees {across:.0}° × {down:.0}°");
        Some(Check::new("lens", Finding::Good, found, None))
    }

    /// Whether the images have another shape than those of the calibration.
    pub(super) fn mismatch(&self, (width, height): (u32, u32)) -> Option<String> {
        let known = self.calibration.as_ref()?;
        let shape = |width: u32, height: u32| f64::from(width) / f64::from(height);
        let off = shape(width, height) / shape(known.width, known.height) - 1.0;
        (off.abs() > SHAPE).then(|| format!("calibrated at {}×{}, which has another shape", known.width, known.height))
    }
}

//! Depth grids: what a depth sensor, or a network that estimates depth from a frame, measures at one instant.

pub(crate) mod packed;
pub mod stereo;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::camera::Camera;
use crate::geometry::{EnuPosition, Pose};
use crate::lift::{CameraDisplacement, Lifting, lift};
use crate::query::ImagePoint;
use crate::time::Time;

/// Maximum number of values of a grid: 640×480.
pub const MAX_DEPTHS: usize = 640 * 480;

/// Where a grid comes from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum DepthSource {
    /// A sensor: each value is measured.
    #[default]
    Sensor,
    /// A network: values are estimated, and may share a scale error.
    Network,
}

/// Depths along the optical axis, row by row from the upper left.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct DepthGrid {
    /// Flight time of the measurement.
    pub captured: Time,
    /// The sensor's own counter; two grids with the same counter are the same measurement.
    pub counter: u64,
    /// Its camera, with the grid's width and height.
    pub camera: Camera,
    /// Centimetres along the optical axis; 0 where nothing was measured: a hole, glass, sky, or beyond the sensor's range.
    #[serde(with = "packed")]
    #[schemars(with = "String")]
    pub cm: Vec<u16>,
    /// Where it comes from.
    pub source: DepthSource,
}

/// A grid that cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum DepthError {
    /// The number of values is not that of the camera's pixels.
    #[error("the depth grid has {values} values for {width}×{height} pixels")]
    WrongSize {
        /// Number of values.
        values: usize,
        /// Width, pixels.
        width: u32,
        /// Height, pixels.
        height: u32,
    },
    /// More values than [`MAX_DEPTHS`].
    #[error("the depth grid has {0} values, more than {MAX_DEPTHS}")]
    TooLarge(usize),
    /// The camera's focal lengths are not positive numbers.
    #[error("the camera's focal lengths must be positive numbers")]
    BadCamera,
}

/// The optical axes of a camera in the world: metres per metre along each camera axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraAxes {
    /// Position of the lens; the craft's, since its offset from the craft is within the body.
    pub origin: EnuPosition,
    right: [f64; 3],
    forward: [f64; 3],
    up: [f64; 3],
}

impl CameraAxes {
    /// The axes of a camera on a craft at `pose`.
    #[must_use]
    pub fn new(camera: &Camera, pose: Pose) -> Self {
        let axis = |right, forward, up| {
            let body = lift(CameraDisplacement { right, forward, up }, camera, pose.attitude, Lifting::Levelled);
            let at = EnuPosition::default().displaced(body, pose.attitude.heading);
            [at.east, at.north, at.up]
        };
        Self { origin: pose.position, right: axis(1.0, 0.0, 0.0), forward: axis(0.0, 1.0, 0.0), up: axis(0.0, 0.0, 1.0) }
    }

    /// The world position of a point in camera axes, metres.
    #[must_use]
    pub fn place(&self, right: f64, forward: f64, up: f64) -> EnuPosition {
        let along = |i: usize| right * self.right[i] + forward * self.forward[i] + up * self.up[i];
        EnuPosition { east: self.origin.east + along(0), north: self.origin.north + along(1), up: self.origin.up + along(2) }
    }

    /// A world position in camera axes, metres.
    #[must_use]
    pub fn look(&self, at: EnuPosition) -> CameraDisplacement {
        let away = [at.east - self.origin.east, at.north - self.origin.north, at.up - self.origin.up];
        let dot = |axis: &[f64; 3]| axis[0] * away[0] + axis[1] * away[1] + axis[2] * away[2];
        CameraDisplacement { right: dot(&self.right), forward: dot(&self.forward), up: dot(&self.up) }
    }

    /// Whether the image of `camera`, whose axes these are, shows a world position if nothing is in between.
    #[must_use]
    pub fn shows(&self, camera: &Camera, at: EnuPosition) -> bool {
        let CameraDisplacement { right, forward, up } = self.look(at);
        camera.project(right, forward, up).is_some_and(|point| point.is_in_image())
    }
}

impl DepthGrid {
    /// Checks the number of values and the camera.
    ///
    /// # Errors
    /// [`DepthError`]; such a grid must not be used.
    pub fn check(&self) -> Result<(), DepthError> {
        let Camera { width, height, fx, fy, .. } = self.camera;
        if self.cm.len() > MAX_DEPTHS {
            return Err(DepthError::TooLarge(self.cm.len()));
        }
        if self.cm.len() as u64 != u64::from(width) * u64::from(height) {
            return Err(DepthError::WrongSize { values: self.cm.len(), width, height });
        }
        if !(fx.is_finite() && fy.is_finite() && fx > 0.0 && fy > 0.0) {
            return Err(DepthError::BadCamera);
        }
        Ok(())
    }

    /// The fraction of pixels with a value; 0 for an empty grid.
    #[must_use]
    pub fn valid_fraction(&self) -> f64 {
        let valid = self.cm.iter().filter(|&&cm| cm > 0).count();
        if self.cm.is_empty() { 0.0 } else { valid as f64 / self.cm.len() as f64 }
    }

    /// Metres right, forward and up in camera axes for every pixel with a value, row by row, with the index of the pixel.
    pub fn points(&self) -> impl Iterator<Item = (usize, CameraDisplacement)> {
        let camera = &self.camera;
        let straight = camera.distortion.is_none();
        let (width, height) = (f64::from(camera.width), f64::from(camera.height));
        let (fx, fy) = (1.0 / camera.fx, 1.0 / camera.fy);
        let columns = camera.width.max(1) as usize;
        self.cm.iter().enumerate().filter(|&(_, &cm)| cm > 0).map(move |(index, &cm)| {
            let (x, y) = ((index % columns) as f64 + 0.5, (index / columns) as f64 + 0.5);
            let forward = 0.01 * f64::from(cm);
            let (right, up) = if straight {
                ((x - camera.cx) * fx, (camera.cy - y) * fy)
            } else {
                let ray = camera.ray(ImagePoint { u: x / width, v: y / height });
                (ray.right, ray.up)
            };
            (index, CameraDisplacement { right: right * forward, forward, up: up * forward })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Attitude;

    fn grid(cm: Vec<u16>) -> DepthGrid {
        let camera = Camera::from_fov(2, 2, 90.0_f64.to_radians(), 90.0_f64.to_radians(), 0.0);
        DepthGrid { captured: Time::ZERO, counter: 0, camera, cm, source: DepthSource::Sensor }
    }

    /// A 2×2 camera of 90°: pixel centres are half a unit off the axis. The craft faces east.
    #[test]
    fn pixels_are_places_in_the_world() {
        let grid = grid(vec![0, 400, 0, 200]);
        assert_eq!(grid.check(), Ok(()));
        assert!((grid.valid_fraction() - 0.5).abs() < 1e-12);
        let position = EnuPosition { east: 1.0, north: 2.0, up: 3.0 };
        let attitude = Attitude { heading: core::f64::consts::FRAC_PI_2, ..Attitude::default() };
        let axes = CameraAxes::new(&grid.camera, Pose { position, attitude });
        let places: Vec<_> = grid.points().map(|(i, at)| (i, axes.place(at.right, at.forward, at.up))).collect();
        // Upper right pixel, 4 m: 2 m right (south) and 2 m up. Lower right, 2 m: 1 m right and 1 m down.
        let expected = [(1, [5.0, 0.0, 5.0]), (3, [3.0, 1.0, 2.0])];
        for ((i, at), (j, [east, north, up])) in places.into_iter().zip(expected) {
            assert_eq!(i, j);
            assert!(at.distance(EnuPosition { east, north, up }) < 1e-9, "{at:?}");
            assert!(axes.shows(&grid.camera, at) && !axes.shows(&grid.camera, EnuPosition { east: -9.0, ..at }));
        }
    }

    #[test]
    fn a_grid_of_another_size_is_refused() {
        assert!(matches!(grid(vec![1; 3]).check(), Err(DepthError::WrongSize { values: 3, .. })));
        assert!(matches!(grid(vec![1; MAX_DEPTHS + 1]).check(), Err(DepthError::TooLarge(_))));
        let mut bad = grid(vec![1; 4]);
        bad.camera.fx = f64::NAN;
        assert_eq!(bad.check(), Err(DepthError::BadCamera));
    }
}

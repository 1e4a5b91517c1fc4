//! Depth that a network estimates from one frame, and its scale (`docs/guide/obstacles.md`, "A depth network").
//!
//! Most networks know which of two things is nearer, but not how far away either is. [`MonoDepth`] is what such a network gives for a
//! frame; [`Scale`] turns it into metres, by what is known of distances in that frame: the ground, range sensors.
//! Without any of these there are no metres.

mod clues;
mod fit;
mod scale;

use spf_core::camera::Camera;
use spf_core::depth::DepthGrid;
use spf_core::frame::FrameId;
use spf_core::time::Time;
use thiserror::Error;

pub use clues::{Clues, PastScan};
pub use scale::{FARTHEST, NoScale, Scale, ScaleSource};

/// Largest width and height of an estimate, cells: at 10 m and 90°, a cell of the obstacle map.
pub const MOST_CELLS: (u32, u32) = (96, 72);
/// The smallest part of the values that must be usable: the rest may be sky.
const FEWEST: f64 = 0.05;

/// What the values of a network mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DepthKind {
    /// Inverse depth, up to a scale and a shift: near = large.
    Disparity,
    /// Depth, up to a scale and perhaps a shift: far = large.
    Relative,
    /// Depth in metres, up to the network's own error of scale.
    Metric,
}

/// What a network estimates for one frame: one value for each cell of the image, row by row from the upper left.
#[derive(Clone, Debug, PartialEq)]
pub struct MonoDepth {
    /// The frame.
    pub frame: FrameId,
    /// When that frame was captured.
    pub captured: Time,
    /// What the values mean.
    pub kind: DepthKind,
    /// The frame's camera, with the number of cells as width and height.
    pub camera: Camera,
    /// Upper 16 bits of each value as a 32-bit float, which is exact to 0.2 %; 0 for none.
    pub values: Vec<u16>,
}

/// An output of a network that is no depth.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum MonoDepthError {
    /// The number of values is not that of the image's pixels.
    #[error("{values} values for {width}×{height} pixels")]
    WrongSize {
        /// Number of values.
        values: usize,
        /// Width, pixels.
        width: usize,
        /// Height, pixels.
        height: usize,
    },
    /// Nearly all values are not positive numbers.
    #[error("nearly all of its values are not positive numbers")]
    NoNumbers,
}

impl MonoDepth {
    /// Takes a network's output for a frame that `camera` took, `size` (width, height) pixels that cover the whole image. It is reduced
    /// to at most [`MOST_CELLS`], by the median of the positive numbers in each cell.
    ///
    /// # Errors
    /// [`MonoDepthError`] if it cannot be used.
    pub fn new(
        (frame, captured): (FrameId, Time),
        camera: &Camera,
        kind: DepthKind,
        size: (usize, usize),
        output: &[f32],
    ) -> Result<Self, MonoDepthError> {
        let (width, height) = size;
        if width == 0 || height == 0 || width.checked_mul(height) != Some(output.len()) {
            return Err(MonoDepthError::WrongSize { values: output.len(), width, height });
        }
        let (columns, rows) = (width.min(MOST_CELLS.0 as usize), height.min(MOST_CELLS.1 as usize));
        let mut values = Vec::with_capacity(columns * rows);
        let mut inside = Vec::new();
        for row in 0..rows {
            for column in 0..columns {
                inside.clear();
                for y in row * height / rows..(row + 1) * height / rows {
                    let line = &output[y * width..(y + 1) * width];
                    let cell = &line[column * width / columns..(column + 1) * width / columns];
                    inside.extend(cell.iter().copied().filter(|value| value.is_finite() && *value > 0.0));
                }
                inside.sort_unstable_by(f32::total_cmp);
                values.push(inside.get(inside.len() / 2).map_or(0, |value| rounded(*value)));
            }
        }
        let usable = values.iter().filter(|value| **value > 0).count();
        if (usable as f64) < FEWEST * values.len() as f64 {
            return Err(MonoDepthError::NoNumbers);
        }
        let camera = camera.resized(columns as u32, rows as u32);
        Ok(Self { frame, captured, kind, camera, values })
    }

    /// Whether the number of values is that of the camera's pixels, and the camera is one.
    #[must_use]
    pub fn is_valid(&self) -> bool {
        let Camera { width, height, fx, fy, .. } = self.camera;
        let sized = (1..=MOST_CELLS.0).contains(&width) && (1..=MOST_CELLS.1).contains(&height);
        sized && self.values.len() == (width * height) as usize && fx.is_finite() && fy.is_finite() && fx > 0.0 && fy > 0.0
    }

    /// The value of a cell; `None` for none, and outside.
    #[must_use]
    pub fn value(&self, index: usize) -> Option<f64> {
        let value = f32::from_bits(u32::from(*self.values.get(index)?) << 16);
        (value.is_finite() && value > 0.0).then_some(f64::from(value))
    }
}

/// A positive number as its upper 16 bits, rounded; the largest ones and the smallest ones have none.
fn rounded(value: f32) -> u16 {
    let bits = value.to_bits().saturating_add(0x8000) >> 16;
    if bits < u32::from(INFINITE) { bits as u16 } else { 0 }
}

/// Upper 16 bits of infinity.
const INFINITE: u16 = 0x7f80;

/// Depths in metres, each with its standard deviation.
#[derive(Clone, Debug, PartialEq)]
pub struct Metres {
    /// The depths.
    pub grid: DepthGrid,
    /// Standard deviation of the natural logarithm of each depth; of no meaning where there is none.
    pub log_sd: Vec<f32>,
}

#[cfg(test)]
mod tests;

//! From what the screen shows to the picture of a camera: instruments painted over, and no larger than a pilot needs.

use std::time::Instant;

use spf_media::{Rgb, Scaler};

use crate::area::{Area, Region};
use crate::mask::paint_over;
use crate::pixels::limited;

/// Longest side of a picture, pixels.
pub const LONGEST_SIDE: u32 = 960;

/// What was captured of the screen.
#[derive(Clone, Debug)]
pub struct Shown {
    /// The picture, in the screen's pixels.
    pub image: Rgb,
    /// Where on the screen it is; on macOS in points, of which one may be several pixels.
    pub area: Area,
    /// When it was asked for: it is no older.
    pub at: Instant,
}

/// Makes pictures of what was captured.
#[derive(Default)]
pub struct Pictures {
    masks: Vec<Region>,
    scaler: Scaler,
}

impl Pictures {
    /// With these parts painted over.
    #[must_use]
    pub fn new(masks: &[Region]) -> Self {
        Self { masks: masks.to_vec(), scaler: Scaler::default() }
    }

    /// The picture, with a longest side of at most [`LONGEST_SIDE`].
    pub fn finish(&mut self, captured: Rgb) -> Rgb {
        let size = (captured.width(), captured.height());
        let (width, height) = limited(size, LONGEST_SIDE);
        let mut image = if (width, height) == size { captured } else { self.scaler.scale(&captured, width, height) };
        paint_over(&mut image, &self.masks);
        image
    }
}

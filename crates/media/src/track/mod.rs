//! Images to track in, and the shifts between them: what the tracker of a box and the points of an image share.
//!
//! Pure given the images: sums are integers, and the rest is IEEE arithmetic in a fixed order, so equal images give equal bits on
//! every machine.

mod area;
pub mod grey;
mod image;

pub use area::{PixelBox, Shift};
pub use image::TrackImage;

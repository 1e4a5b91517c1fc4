//! The images that are tracked in.

use super::grey::Grey;
use crate::frame::{FrameError, Rgb};

/// Width up to which the colours of an image are kept; those of larger ones are averaged over blocks.
const MOST: u32 = 120;

/// An image to track in: its brightness, and at a fraction of the size its colours, if it has any.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TrackImage {
    /// Its brightness.
    pub grey: Grey,
    /// Red less blue, and green less the mean of both, halved, about 128.
    pub tints: Option<[Grey; 2]>,
}

impl TrackImage {
    /// A colour image.
    #[must_use]
    pub fn of(image: &Rgb) -> Self {
        Self { grey: Grey::of(image), tints: Some(tints(image)) }
    }

    /// A grey image of 8 bits, rows from the top.
    ///
    /// # Errors
    /// [`FrameError::WrongLength`] if `data` is not `width × height` bytes long.
    pub fn from_grey(width: u32, height: u32, data: Vec<u8>) -> Result<Self, FrameError> {
        Ok(Self { grey: Grey::from_raw(width, height, data)?, tints: None })
    }

    /// Width and height, pixels.
    #[must_use]
    pub const fn size(&self) -> (u32, u32) {
        self.grey.size()
    }
}

fn tints(image: &Rgb) -> [Grey; 2] {
    let block = image.width().div_ceil(MOST).max(1);
    let (width, height) = (image.width() / block, image.height() / block);
    let (side, row) = (block as usize, image.width() as usize * 3);
    let mut tints = [Vec::new(), Vec::new()];
    for y in 0..height as usize {
        for x in 0..width as usize {
            let mut sum = [0_i32; 3];
            for line in 0..side {
                let start = (y * side + line) * row + x * side * 3;
                for pixel in image.data()[start..start + 3 * side].chunks_exact(3) {
                    for (sum, value) in sum.iter_mut().zip(pixel) {
                        *sum += i32::from(*value);
                    }
                }
            }
            let [red, green, blue] = sum.map(|sum| sum / (block * block) as i32);
            let differences = [red - blue, green - (red + blue) / 2];
            tints.iter_mut().zip(differences).for_each(|(tint, by)| tint.push((128 + by / 2).clamp(0, 255) as u8));
        }
    }
    tints.map(|tint| Grey::of_bytes(width, height, tint))
}

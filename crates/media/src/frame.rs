//! An image in memory.

use core::hash::Hasher as _;

use fnv::FnvHasher;

/// Why a buffer is not a valid image.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum FrameError {
    /// The buffer does not hold `width × height` pixels of three bytes.
    #[error("an image of {width}×{height} needs {needed} bytes, but the buffer has `{actual}`")]
    WrongLength {
        /// Width, pixels.
        width: u32,
        /// Height, pixels.
        height: u32,
        /// Number of bytes needed.
        needed: u64,
        /// Number of bytes given.
        actual: usize,
    },
}

/// An image: 8-bit sRGB, rows from the top, pixels from the left, three bytes (red, green, blue) each, no padding.
///
/// Invariant: `data` is `width × height × 3` bytes long. Width and height may be zero.
#[derive(Clone, PartialEq, Eq)]
pub struct Rgb {
    width: u32,
    height: u32,
    data: Vec<u8>,
}

impl core::fmt::Debug for Rgb {
    /// Shows size and digest instead of the pixels.
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "Rgb({}×{}, {:016x})", self.width, self.height, self.digest())
    }
}

impl Rgb {
    /// A black image.
    #[must_use]
    pub fn new(width: u32, height: u32) -> Self {
        Self { width, height, data: vec![0; width as usize * height as usize * 3] }
    }

    /// An image of one colour.
    #[must_use]
    pub fn filled(width: u32, height: u32, colour: [u8; 3]) -> Self {
        let mut image = Self::new(width, height);
        for pixel in image.data.chunks_exact_mut(3) {
            pixel.copy_from_slice(&colour);
        }
        image
    }

    /// An image from its bytes.
    ///
    /// # Errors
    /// [`FrameError::WrongLength`] if `data` is not `width × height × 3` bytes long.
    pub fn from_raw(width: u32, height: u32, data: Vec<u8>) -> Result<Self, FrameError> {
        // Saturates for absurd sizes, which then cannot match the length of a buffer.
        let needed = (u64::from(width) * u64::from(height)).saturating_mul(3);
        if u64::try_from(data.len()) == Ok(needed) {
            Ok(Self { width, height, data })
        } else {
            Err(FrameError::WrongLength { width, height, needed, actual: data.len() })
        }
    }

    /// Width, pixels.
    #[must_use]
    pub const fn width(&self) -> u32 {
        self.width
    }

    /// Height, pixels.
    #[must_use]
    pub const fn height(&self) -> u32 {
        self.height
    }

    /// The bytes, in rows from the top.
    #[must_use]
    pub fn data(&self) -> &[u8] {
        &self.data
    }

    /// The bytes, for modification in place.
    #[must_use]
    pub fn data_mut(&mut self) -> &mut [u8] {
        &mut self.data
    }

    /// Consumes the image and returns its bytes.
    #[must_use]
    pub fn into_data(self) -> Vec<u8> {
        self.data
    }

    /// The pixel `x` from the left and `y` from the top; `None` outside the image.
    #[must_use]
    pub fn pixel(&self, x: u32, y: u32) -> Option<[u8; 3]> {
        let at = self.offset(x, y)?;
        Some([self.data[at], self.data[at + 1], self.data[at + 2]])
    }

    /// Sets a pixel; does nothing outside the image.
    pub fn set_pixel(&mut self, x: u32, y: u32, colour: [u8; 3]) {
        if let Some(at) = self.offset(x, y) {
            self.data[at..at + 3].copy_from_slice(&colour);
        }
    }

    /// A 64-bit FNV-1a digest of size and bytes, equal on every machine, for golden tests and comparisons between runs.
    /// Not cryptographic.
    #[must_use]
    pub fn digest(&self) -> u64 {
        let mut hasher = FnvHasher::default();
        for bytes in [&self.width.to_le_bytes()[..], &self.height.to_le_bytes(), &self.data] {
            hasher.write(bytes);
        }
        hasher.finish()
    }

    fn offset(&self, x: u32, y: u32) -> Option<usize> {
        (x < self.width && y < self.height).then(|| (y as usize * self.width as usize + x as usize) * 3)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_buffer_of_the_wrong_length_is_refused() {
        assert!(Rgb::from_raw(2, 2, vec![0; 12]).is_ok());
        let error = Rgb::from_raw(2, 2, vec![0; 11]).unwrap_err();
        assert_eq!(error.to_string(), "an image of 2×2 needs 12 bytes, but the buffer has `11`");
        assert!(Rgb::from_raw(u32::MAX, u32::MAX, vec![]).is_err());
    }

    #[test]
    fn pixels_outside_are_none() {
        let mut image = Rgb::filled(3, 2, [1, 2, 3]);
        image.set_pixel(2, 1, [9, 8, 7]);
        image.set_pixel(3, 0, [0, 0, 0]);
        assert_eq!(image.pixel(2, 1), Some([9, 8, 7]));
        assert_eq!(image.pixel(1, 1), Some([1, 2, 3]));
        assert_eq!(image.pixel(0, 2), None);
    }

    #[test]
    fn the_digest_tells_shapes_of_equal_bytes_apart() {
        // FNV-1a of the eight size bytes of an empty image, worked by the reference definition: eight zero bytes multiply
        // the offset basis by the prime eight times.
        assert_eq!(Rgb::new(0, 0).digest(), 0xa8c7_f832_281a_39c5);
        assert_ne!(Rgb::new(2, 3).digest(), Rgb::new(3, 2).digest());
    }
}

//! The images that are tracked in.

use super::colour::Colours;
use super::grey::Grey;
use crate::frame::{FrameError, Rgb};

/// An image to track in: its brightness, and at a quarter of the size its colours, if it has any.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TrackImage {
    pub(crate) grey: Grey,
    pub(super) colours: Option<Colours>,
}

impl TrackImage {
    /// A colour image.
    #[must_use]
    pub fn of(image: &Rgb) -> Self {
        Self { grey: Grey::of(image), colours: Some(Colours::of(image)) }
    }

    /// A grey image of 8 bits, rows from the top.
    ///
    /// # Errors
    /// [`FrameError::WrongLength`] if `data` is not `width × height` bytes long.
    pub fn from_grey(width: u32, height: u32, data: Vec<u8>) -> Result<Self, FrameError> {
        Ok(Self { grey: Grey::from_raw(width, height, data)?, colours: None })
    }

    /// Width and height, pixels.
    #[must_use]
    pub const fn size(&self) -> (u32, u32) {
        self.grey.size()
    }
}

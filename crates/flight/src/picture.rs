//! Where the pictures that a VLM is shown come from.

use std::sync::Arc;

use spf_core::query::Query;
use spf_drone::tello::camera::Frames;
use spf_media::{Rgb, resize};
use spf_vlm::{Picture, VlmError};

/// A camera whose frames can be had as pictures for a while after their capture.
pub trait PictureSource: Send {
    /// The picture a query is about, made when it is first looked at.
    fn of<'a>(&'a mut self, query: &'a Query) -> Box<dyn Picture + 'a>;
}

/// A picture's size, its quality, and its bytes.
type Encoded = ((u32, u32), u8, Arc<[u8]>);

/// A query's picture: made at the size that is asked for, its marks drawn on it, encoded once.
pub(crate) struct Marked<'a, F> {
    query: &'a Query,
    size: (u32, u32),
    /// Makes the frame at a size.
    frame: F,
    /// Made already, with its marks.
    drawn: Option<Rgb>,
    /// One for each size and quality that was asked for: one, unless two models are asked.
    encoded: Vec<Encoded>,
}

impl<'a, F: Fn((u32, u32)) -> Result<Rgb, VlmError>> Marked<'a, F> {
    /// The picture of a query from a camera of that size.
    pub(crate) fn new(query: &'a Query, size: (u32, u32), frame: F) -> Self {
        Self { query, size, frame, drawn: None, encoded: Vec::new() }
    }

    fn draw(&self, size: (u32, u32)) -> Result<Rgb, VlmError> {
        let mut picture = (self.frame)(size)?;
        spf_media::marks::draw(&mut picture, &self.query.marks);
        Ok(picture)
    }
}

impl<F: Fn((u32, u32)) -> Result<Rgb, VlmError>> Picture for Marked<'_, F> {
    fn size(&self) -> (u32, u32) {
        self.size
    }

    fn prepare(&mut self, size: (u32, u32)) {
        // What fails here fails again when the picture is wanted, and says why.
        self.drawn = self.draw(size).ok();
    }

    fn jpeg(&mut self, size: (u32, u32), quality: u8) -> Result<Arc<[u8]>, VlmError> {
        if let Some((.., encoded)) = self.encoded.iter().find(|(of, at, _)| (*of, *at) == (size, quality)) {
            return Ok(encoded.clone());
        }
        let picture = match self.drawn.take().filter(|drawn| (drawn.width(), drawn.height()) == size) {
            Some(drawn) => drawn,
            None => self.draw(size)?,
        };
        let encoded = spf_media::Jpeg::encode(&picture, quality).map_err(|error| VlmError::Picture(error.to_string()))?.shared();
        self.encoded.push((size, quality, encoded.clone()));
        Ok(encoded)
    }
}

/// A real camera's frames.
pub struct CameraPictures {
    size: (u32, u32),
    frames: Frames,
}

impl CameraPictures {
    /// Frames of a camera of that size.
    #[must_use]
    pub fn new(size: (u32, u32), frames: Frames) -> Self {
        Self { size, frames }
    }
}

impl PictureSource for CameraPictures {
    fn of<'a>(&'a mut self, query: &'a Query) -> Box<dyn Picture + 'a> {
        // Held from the beginning: the camera forgets its frames within a second.
        let frame = self.frames.picture(query.frame);
        let made = move |(width, height): (u32, u32)| {
            let frame = frame.as_ref().ok_or_else(|| VlmError::Picture(format!("frame {} is no longer kept", query.frame.0)))?;
            Ok(if (frame.width(), frame.height()) == (width, height) { (**frame).clone() } else { resize(frame, width, height) })
        };
        Box::new(Marked::new(query, self.size, made))
    }
}

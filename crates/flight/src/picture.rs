//! Where the pictures that a VLM is shown come from.

use std::sync::Arc;

use spf_core::frame::FrameId;
use spf_core::query::Query;
use spf_drone::tello::camera::Frames;
use spf_media::{Rgb, Scaler};
use spf_vlm::{Picture, VlmError};

/// A camera whose frames can be had as pictures for a while after their capture.
pub trait PictureSource: Send {
    /// The picture a query is about, made when it is first looked at.
    fn of<'a>(&'a mut self, query: &'a Query) -> Box<dyn Picture + 'a>;
}

/// A picture's size, its quality, and its bytes.
type Encoded = ((u32, u32), u8, Arc<[u8]>);

/// The frame that a picture is made of.
pub(crate) trait FrameSource {
    /// The frame at a size, to be drawn on.
    fn at(&mut self, size: (u32, u32)) -> Result<Rgb, VlmError>;

    /// Takes back what [`Self::at`] gave, once it is encoded.
    fn reuse(&mut self, _: Rgb) {}
}

impl<F: FnMut((u32, u32)) -> Result<Rgb, VlmError>> FrameSource for F {
    fn at(&mut self, size: (u32, u32)) -> Result<Rgb, VlmError> {
        self(size)
    }
}

/// A query's picture: made at the size that is asked for, its marks drawn on it, encoded once.
pub(crate) struct Marked<'a, F> {
    query: &'a Query,
    size: (u32, u32),
    frame: F,
    /// Made already, with its marks.
    drawn: Option<Rgb>,
    /// One for each size and quality that was asked for: one, unless two models are asked.
    encoded: Vec<Encoded>,
}

impl<'a, F: FrameSource> Marked<'a, F> {
    /// The picture of a query from a camera of that size.
    pub(crate) fn new(query: &'a Query, size: (u32, u32), frame: F) -> Self {
        Self { query, size, frame, drawn: None, encoded: Vec::new() }
    }

    fn draw(&mut self, size: (u32, u32)) -> Result<Rgb, VlmError> {
        let mut picture = self.frame.at(size)?;
        spf_media::marks::draw(&mut picture, &self.query.marks);
        Ok(picture)
    }
}

impl<F: FrameSource> Picture for Marked<'_, F> {
    fn size(&self) -> (u32, u32) {
        self.size
    }

    fn prepare(&mut self, size: (u32, u32)) {
        // What fails here fails again when the picture is wanted, and says why.
        self.drawn = self.draw(size).ok();
    }

    fn pixels(&mut self) -> Result<Rgb, VlmError> {
        match self.drawn.take().filter(|drawn| (drawn.width(), drawn.height()) == self.size) {
            Some(drawn) => Ok(drawn),
            None => self.draw(self.size),
        }
    }

    fn jpeg(&mut self, size: (u32, u32), quality: u8) -> Result<Arc<[u8]>, VlmError> {
        if let Some((.., encoded)) = self.encoded.iter().find(|(of, at, _)| (*of, *at) == (size, quality)) {
            return Ok(encoded.clone());
        }
        let picture = match self.drawn.take().filter(|drawn| (drawn.width(), drawn.height()) == size) {
            Some(drawn) => drawn,
            None => self.draw(size)?,
        };
        let encoded = spf_media::Jpeg::encode(&picture, quality);
        self.frame.reuse(picture);
        let encoded = encoded.map_err(|error| VlmError::Picture(error.to_string()))?.shared();
        self.encoded.push((size, quality, encoded.clone()));
        Ok(encoded)
    }
}

/// A real camera's frames.
pub struct CameraPictures {
    size: (u32, u32),
    frames: Frames,
    scaler: Scaler,
}

/// A real camera's frame, scaled in memory that is kept from one query to the next.
struct CameraFrame<'a> {
    id: FrameId,
    /// Held from the beginning: the camera forgets its frames within a second.
    frame: Option<Arc<Rgb>>,
    scaler: &'a mut Scaler,
}

impl FrameSource for CameraFrame<'_> {
    fn at(&mut self, (width, height): (u32, u32)) -> Result<Rgb, VlmError> {
        let frame = self.frame.as_ref().ok_or_else(|| VlmError::Picture(format!("frame {} is no longer kept", self.id.0)))?;
        Ok(self.scaler.scale(frame, width, height))
    }

    fn reuse(&mut self, picture: Rgb) {
        self.scaler.reuse(picture);
    }
}

impl CameraPictures {
    /// Frames of a camera of that size.
    #[must_use]
    pub fn new(size: (u32, u32), frames: Frames) -> Self {
        Self { size, frames, scaler: Scaler::default() }
    }
}

impl PictureSource for CameraPictures {
    fn of<'a>(&'a mut self, query: &'a Query) -> Box<dyn Picture + 'a> {
        let frame = CameraFrame { id: query.frame, frame: self.frames.picture(query.frame), scaler: &mut self.scaler };
        Box::new(Marked::new(query, self.size, frame))
    }
}

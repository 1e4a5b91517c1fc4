//! The images sent to a VLM.

use std::sync::Arc;

use spf_core::query::Query;
use spf_drone::Drone;
use spf_drone::frames::{Frames, Photo};
use spf_media::{Rgb, Scaler};
use spf_vlm::{QueryImage, VlmError};

/// Prepares images from the frames of a craft's camera.
pub struct QueryImages {
    frames: Arc<dyn Frames>,
    size: (u32, u32),
    scaler: Scaler,
}

impl QueryImages {
    /// Images from this craft's camera.
    #[must_use]
    pub fn of(drone: &dyn Drone) -> Self {
        let camera = drone.capabilities().camera;
        Self { frames: drone.frames(), size: (camera.width, camera.height), scaler: Scaler::default() }
    }

    /// The image for a query. Its frame is held from now on, because a camera may drop it within a second.
    pub fn about<'a>(&'a mut self, query: &'a Query) -> impl QueryImage + 'a {
        Marked::new(query, self.size, self.frames.photo(query.frame), &mut self.scaler)
    }
}

/// Image size, JPEG quality and bytes.
type Encoded = ((u32, u32), u8, Arc<[u8]>);

/// A query's image: scaled to the requested size, with its marks overlaid, and encoded once.
pub(crate) struct Marked<'a> {
    query: &'a Query,
    size: (u32, u32),
    /// `None` if the frame is no longer available.
    photo: Option<Photo>,
    /// Buffers reused between queries.
    scaler: &'a mut Scaler,
    /// Rendered already, with its marks.
    drawn: Option<Rgb>,
    /// One entry per size and quality requested: usually one, more if two models are queried.
    encoded: Vec<Encoded>,
}

impl<'a> Marked<'a> {
    /// The image for a query from a camera of this size.
    pub(crate) fn new(query: &'a Query, size: (u32, u32), photo: Option<Photo>, scaler: &'a mut Scaler) -> Self {
        Self { query, size, photo, scaler, drawn: None, encoded: Vec::new() }
    }

    fn plain(&mut self, size: (u32, u32)) -> Result<Rgb, VlmError> {
        let gone = || VlmError::Image(format!("frame {} is no longer stored", self.query.frame.0));
        Ok(self.photo.as_ref().ok_or_else(gone)?.at(size, self.scaler))
    }

    fn draw(&mut self, size: (u32, u32)) -> Result<Rgb, VlmError> {
        let mut image = self.plain(size)?;
        spf_media::marks::draw(&mut image, &self.query.marks);
        Ok(image)
    }
}

impl QueryImage for Marked<'_> {
    fn size(&self) -> (u32, u32) {
        self.size
    }

    fn prepare(&mut self, size: (u32, u32)) {
        // An error here recurs when the image is requested, and is reported then.
        self.drawn = self.draw(size).ok();
    }

    fn pixels(&mut self) -> Result<Rgb, VlmError> {
        match self.drawn.take().filter(|drawn| (drawn.width(), drawn.height()) == self.size) {
            Some(drawn) => Ok(drawn),
            None => self.draw(self.size),
        }
    }

    fn frame(&mut self) -> Result<Rgb, VlmError> {
        self.plain(self.size)
    }

    fn jpeg(&mut self, size: (u32, u32), quality: u8) -> Result<Arc<[u8]>, VlmError> {
        if let Some((.., encoded)) = self.encoded.iter().find(|(of, at, _)| (*of, *at) == (size, quality)) {
            return Ok(encoded.clone());
        }
        let image = match self.drawn.take().filter(|drawn| (drawn.width(), drawn.height()) == size) {
            Some(drawn) => drawn,
            None => self.draw(size)?,
        };
        let encoded = spf_media::Jpeg::encode(&image, quality);
        self.scaler.reuse(image);
        let encoded = encoded.map_err(|error| VlmError::Image(error.to_string()))?.shared();
        self.encoded.push((size, quality, encoded.clone()));
        Ok(encoded)
    }
}

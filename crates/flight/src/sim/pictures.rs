//! The simulated camera's frames for a VLM that wants to see them.

use std::sync::Arc;

use spf_core::query::Query;
use spf_media::Rgb;
use spf_vlm::{Picture, VlmError};

use super::world::SimWorld;
use crate::picture::PictureSource;

/// The simulated camera's frames as pictures, drawn when a VLM looks.
pub struct SimPictures(SimWorld);

impl SimPictures {
    /// Pictures of a world's camera.
    #[must_use]
    pub fn new(world: SimWorld) -> Self {
        Self(world)
    }
}

/// A picture's size, its quality, and its bytes.
type Encoded = ((u32, u32), u8, Arc<[u8]>);

struct SimPicture<'a> {
    world: &'a SimWorld,
    query: &'a Query,
    /// Drawn already, with its marks.
    drawn: Option<Rgb>,
    /// One for each size and quality that was asked for: one, unless two models are asked.
    encoded: Vec<Encoded>,
}

impl SimPicture<'_> {
    fn draw(&self, size: (u32, u32)) -> Result<Rgb, VlmError> {
        let frame = self.query.frame;
        let shot =
            self.world.capture_shot(frame).ok_or_else(|| VlmError::Picture(format!("frame {} is no longer kept", frame.0)))?;
        let mut picture = self.world.photograph(&shot, Some(size).filter(|size| *size != self.size()));
        spf_media::marks::draw(&mut picture, &self.query.marks);
        Ok(picture)
    }
}

impl PictureSource for SimPictures {
    fn of<'a>(&'a mut self, query: &'a Query) -> Box<dyn Picture + 'a> {
        Box::new(SimPicture { world: &self.0, query, drawn: None, encoded: Vec::new() })
    }
}

impl Picture for SimPicture<'_> {
    fn size(&self) -> (u32, u32) {
        let camera = self.world.camera();
        (camera.width, camera.height)
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

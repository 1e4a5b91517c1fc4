//! The simulated camera's frames for a VLM that wants to see them.

use std::sync::Arc;

use spf_core::query::Query;
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

struct SimPicture<'a> {
    world: &'a SimWorld,
    query: &'a Query,
    encoded: Option<Arc<[u8]>>,
}

impl PictureSource for SimPictures {
    fn of<'a>(&'a mut self, query: &'a Query) -> Box<dyn Picture + 'a> {
        Box::new(SimPicture { world: &self.0, query, encoded: None })
    }
}

impl Picture for SimPicture<'_> {
    fn jpeg(&mut self) -> Result<Arc<[u8]>, VlmError> {
        if let Some(encoded) = &self.encoded {
            return Ok(encoded.clone());
        }
        let frame = self.query.frame;
        let shot =
            self.world.capture_shot(frame).ok_or_else(|| VlmError::Picture(format!("frame {} is no longer kept", frame.0)))?;
        let mut picture = self.world.photograph(&shot, self.query.image_size);
        spf_media::marks::draw(&mut picture, &self.query.marks);
        let encoded =
            spf_media::jpeg::Jpeg::encode(&picture, JPEG_QUALITY).map_err(|error| VlmError::Picture(error.to_string()))?.shared();
        self.encoded = Some(encoded.clone());
        Ok(encoded)
    }
}

/// Quality of the JPEG that a VLM is shown: 85 keeps a far car's edges at a third of the size of 95.
const JPEG_QUALITY: u8 = 85;

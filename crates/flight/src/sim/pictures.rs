//! The simulated camera's frames for a VLM that wants to see them.

use std::sync::Arc;

use spf_core::query::Query;
use spf_media::Rgb;
use spf_sim::effects::Shot;
use spf_vlm::{Picture, VlmError};

use super::stage::Moment;
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

/// The frame of a query as a picture.
pub(crate) struct SimPicture<'a> {
    world: &'a SimWorld,
    query: &'a Query,
    /// What was there to be seen, told when it is to be drawn; none when it is no longer kept.
    shot: Box<dyn Fn() -> Option<Shot<Moment>> + 'a>,
    /// Drawn already, with its marks.
    drawn: Option<Rgb>,
    /// One for each size and quality that was asked for: one, unless two models are asked.
    encoded: Vec<Encoded>,
}

impl<'a> SimPicture<'a> {
    /// A query's picture, of what `shot` tells when somebody looks.
    pub(crate) fn new(world: &'a SimWorld, query: &'a Query, shot: impl Fn() -> Option<Shot<Moment>> + 'a) -> Self {
        Self { world, query, shot: Box::new(shot), drawn: None, encoded: Vec::new() }
    }

    fn draw(&self, size: (u32, u32)) -> Result<Rgb, VlmError> {
        let gone = || VlmError::Picture(format!("frame {} is no longer kept", self.query.frame.0));
        let shot = (self.shot)().ok_or_else(gone)?;
        let mut picture = self.world.photograph(&shot, Some(size).filter(|size| *size != self.size()));
        spf_media::marks::draw(&mut picture, &self.query.marks);
        Ok(picture)
    }
}

impl PictureSource for SimPictures {
    fn of<'a>(&'a mut self, query: &'a Query) -> Box<dyn Picture + 'a> {
        Box::new(SimPicture::new(&self.0, query, || self.0.capture_shot(query.frame)))
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

//! The simulated camera's frames for a VLM that wants to see them.

use spf_core::query::Query;
use spf_render::effects::Shot;
use spf_vlm::{Picture, VlmError};

use super::stage::Moment;
use super::world::SimWorld;
use crate::picture::{Marked, PictureSource};

/// The simulated camera's frames as pictures, drawn when a VLM looks.
pub struct SimPictures(SimWorld);

impl SimPictures {
    /// Pictures of a world's camera.
    #[must_use]
    pub fn new(world: SimWorld) -> Self {
        Self(world)
    }
}

/// The frame of a query as a picture. `shot` tells what was there to be seen, when it is to be drawn; none when it is no longer
/// kept.
pub(crate) fn sim_picture<'a>(
    world: &'a SimWorld,
    query: &'a Query,
    shot: impl Fn() -> Option<Shot<Moment>> + 'a,
) -> impl Picture + 'a {
    let camera = (world.camera().width, world.camera().height);
    let drawn = move |size| {
        let gone = || VlmError::Picture(format!("frame {} is no longer kept", query.frame.0));
        Ok(world.photograph(&shot().ok_or_else(gone)?, Some(size).filter(|size| *size != camera)))
    };
    Marked::new(query, camera, drawn)
}

impl PictureSource for SimPictures {
    fn of<'a>(&'a mut self, query: &'a Query) -> Box<dyn Picture + 'a> {
        Box::new(sim_picture(&self.0, query, || self.0.capture_shot(query.frame)))
    }
}

//! The simulated camera's frames, rendered on demand.

use spf_core::frame::{FrameId, FrameMeta};
use spf_drone::frames::{Frames, Photo};
use spf_render::effects::Shot;
use spf_sim::frame_clock::FrameClock;

use super::loaded_scene::WorldSnapshot;
use super::world::SimWorld;

/// The frames of a world's camera.
pub struct SimFrames(SimWorld);

impl SimFrames {
    /// The camera frames of this world.
    #[must_use]
    pub fn new(world: SimWorld) -> Self {
        Self(world)
    }
}

impl Frames for SimFrames {
    fn photo(&self, id: FrameId) -> Option<Photo> {
        self.0.capture_shot(id).map(|shot| photo(&self.0, shot))
    }

    fn newest(&self) -> Option<(FrameMeta, Photo)> {
        let (clock, camera) = (FrameClock::default(), self.0.camera());
        let id = clock.delivered(self.0.truth().time)?;
        Some((clock.meta(id, camera.width, camera.height), self.photo(id)?))
    }
}

/// The camera image for the light that reached the sensor, at the requested size.
pub(crate) fn photo(world: &SimWorld, shot: Shot<WorldSnapshot>) -> Photo {
    let (world, size) = (world.clone(), (world.camera().width, world.camera().height));
    Photo::drawn(size, move |wanted| world.photograph(&shot, Some(wanted).filter(|wanted| *wanted != size)))
}

//! Visibility for the judge: what the craft's camera shows clearly, from ids alone.

use spf_core::camera::Camera;
use spf_core::craft::CraftKind;
use spf_flight::sim::{LoadedScene, WorldSnapshot, sighted};
use spf_render::surroundings::Surroundings;
use spf_render::{Channels, RenderedImage};
use spf_scene::geometry::ObjectId;

/// A target is clearly visible if it is at least this fraction of the frame high and a quarter of it is inside, or if
/// it fills a tenth of the frame (the paper's appendix).
pub const CLEAR_HEIGHT: f64 = 0.015;

/// Renders a craft's camera view without camera effects.
pub struct JudgeCamera {
    camera: Camera,
    surroundings: Surroundings,
    image: RenderedImage,
    around: RenderedImage,
}

impl JudgeCamera {
    /// The view of a craft.
    #[must_use]
    pub fn of(craft: CraftKind) -> Self {
        let camera = craft.camera();
        Self {
            camera,
            surroundings: Surroundings::of(&camera),
            image: RenderedImage::default(),
            around: RenderedImage::default(),
        }
    }

    /// Its camera.
    #[must_use]
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// The objects clearly visible in a snapshot.
    pub fn clearly(&mut self, loaded: &LoadedScene, snapshot: &WorldSnapshot, objects: &[ObjectId]) -> Vec<ObjectId> {
        let channels = Channels { ids: true, openings: true, ..Channels::default() };
        loaded.render_into(&self.camera, snapshot, channels, &mut self.image);
        let (around, surroundings) = (&mut self.around, &self.surroundings);
        sighted(&self.image, objects, CLEAR_HEIGHT, || {
            loaded.render_into(surroundings.camera(), snapshot, channels, around);
            surroundings.fractions(around)
        })
    }

    /// Whether one of the objects has a pixel in a snapshot.
    pub fn glimpses(&mut self, loaded: &LoadedScene, snapshot: &WorldSnapshot, objects: &[ObjectId]) -> bool {
        let channels = Channels { ids: true, openings: true, ..Channels::default() };
        loaded.render_into(&self.camera, snapshot, channels, &mut self.image);
        let images = [&self.image.ids, &self.image.opening_ids];
        images.into_iter().flatten().flatten().any(|id| *id != 0 && objects.contains(id))
    }
}

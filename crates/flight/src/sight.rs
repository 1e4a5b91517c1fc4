//! What an observer may see of a flight besides the pilot: the camera's frames, and the scene's outline where it is known.

use std::sync::Arc;

use spf_core::camera::Camera;
use spf_core::frame::{FrameId, FrameMeta};
use spf_core::geometry::EnuPosition;
use spf_drone::frames::{Frames, Photo};
use spf_record::trajectory::Outline;

use crate::frame_source::FrameSource;

/// Frames and outlines of a flight. Clones share them.
#[derive(Clone)]
pub struct Sight {
    frames: Arc<dyn Frames>,
    source: Arc<dyn FrameSource>,
}

impl Sight {
    pub(crate) fn new(frames: Arc<dyn Frames>, source: Arc<dyn FrameSource>) -> Self {
        Self { frames, source }
    }

    /// The camera.
    #[must_use]
    pub fn camera(&self) -> &Camera {
        self.source.camera()
    }

    /// A frame that the pilot was told of; `None` if it is no longer kept.
    #[must_use]
    pub fn photo(&self, id: FrameId) -> Option<Photo> {
        self.frames.photo(id)
    }

    /// Frames after this one that a simulated camera has exposed and not delivered yet, oldest first. A display may draw their pixels
    /// meanwhile, as a camera develops them, and must show none before the pilot is told of it. None of a real camera.
    #[must_use]
    pub fn exposed(&self, after: FrameId) -> Vec<(FrameMeta, Photo)> {
        self.source.exposed(after)
    }

    /// The scene from above, lowest objects first; empty where none is known. Metres east and north of the scene's origin.
    #[must_use]
    pub fn outlines(&self) -> Vec<Outline> {
        self.source.map(&[]).0
    }

    /// Where the craft truly is on that map, metres; `None` where no simulator tells. To place the map below a craft that counts
    /// its position from its take-off point; a display must show nothing else of it.
    #[must_use]
    pub fn place_on_map(&self) -> Option<EnuPosition> {
        self.source.true_pose().map(|pose| pose.position)
    }
}

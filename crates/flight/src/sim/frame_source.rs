//! A recorder's access to a simulated world, including ground truth.

use spf_core::camera::Camera;
use spf_core::frame::{FrameId, FrameMeta};
use spf_core::geometry::{EnuPosition, Pose};
use spf_core::time::Time;
use spf_drone::frames::Photo;
use spf_record::log::foxglove::Prism;
use spf_record::trajectory::Outline;
use spf_sim::frame_clock::FrameClock;

use super::frames::photo;
use super::outline;
use super::world::SimWorld;
use crate::frame_source::FrameSource;

/// Frames and ground truth of a world.
pub(super) struct SimFrameSource(pub(super) SimWorld);

impl FrameSource for SimFrameSource {
    fn camera(&self) -> &Camera {
        self.0.camera()
    }

    fn shot(&self, at: Time) -> Option<Photo> {
        self.0.shot(at).map(|shot| photo(&self.0, shot))
    }

    fn exposed(&self, after: FrameId) -> Vec<(FrameMeta, Photo)> {
        let (clock, camera, now) = (FrameClock::default(), self.0.camera(), self.0.craft().time());
        let exposed = (after.0 + 1..).map(FrameId).take_while(|id| clock.captured(*id) <= now);
        let frame = |id| Some((clock.meta(id, camera.width, camera.height), photo(&self.0, self.0.capture_shot(id)?)));
        exposed.filter_map(frame).collect()
    }

    fn true_pose(&self) -> Option<Pose> {
        Some(self.0.truth().pose)
    }

    fn true_pose_of(&self, frame: FrameId) -> Option<Pose> {
        self.0.capture(frame).map(|moment| moment.pose)
    }

    fn prisms(&self) -> Vec<Prism> {
        outline::prisms(self.0.loaded())
    }

    fn map(&self, targets: &[String]) -> (Vec<Outline>, Option<EnuPosition>) {
        let (loaded, now) = (self.0.loaded(), self.0.now());
        let here = now.pose.position;
        let distance = |id| loaded.distance_to(id, &now.actors, here);
        let ids = targets.iter().filter_map(|key| Some(loaded.scene.by_key(key)?.id));
        let near = ids.filter_map(|id| Some((id, distance(id)?))).min_by(|a, b| a.1.total_cmp(&b.1));
        let surface = near.and_then(|(id, _)| loaded.nearest_of(id, &now.actors, here));
        (outline::outlines(loaded, &now.actors), surface)
    }
}

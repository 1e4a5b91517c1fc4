//! What can be seen of a flight by whoever records it: the whole simulated world, or a real camera's frames and nothing else.

use std::sync::Arc;

use spf_core::camera::Camera;
use spf_core::frame::FrameId;
use spf_core::geometry::{EnuPosition, Pose};
use spf_core::time::{Duration, Time};
use spf_drone::frames::{Frames, Photo};
use spf_media::{Rgb, Scaler};
use spf_record::log::foxglove::Prism;
use spf_record::trajectory::Outline;
use spf_render::effects;

use crate::outline;
use crate::sim::{Moment, SimWorld};

/// A real frame older than this is no picture of now.
const OLD: Duration = Duration::from_secs(2);

/// What a recorder sees.
#[derive(Clone)]
pub(crate) enum Witness {
    /// The simulator, truth included.
    Sim(SimWorld),
    /// A real craft's camera.
    Real {
        /// What it is.
        camera: Camera,
        /// What it shows.
        frames: Arc<dyn Frames>,
    },
}

/// A picture to be.
pub(crate) enum Seen {
    /// Light that the simulator adds up.
    Sim(effects::Shot<Moment>),
    /// A frame that was received, and the time that it is shown at.
    Real(Photo, Time),
}

impl Seen {
    /// The flight time that it is a picture of.
    pub(crate) fn at(&self) -> Time {
        match self {
            Self::Sim(shot) => shot.at(),
            Self::Real(_, at) => *at,
        }
    }
}

impl Witness {
    /// The camera.
    pub(crate) fn camera(&self) -> &Camera {
        match self {
            Self::Sim(world) => world.camera(),
            Self::Real { camera, .. } => camera,
        }
    }

    /// The true pose, where there is truth.
    pub(crate) fn true_pose(&self) -> Option<Pose> {
        match self {
            Self::Sim(world) => Some(world.truth().pose),
            Self::Real { .. } => None,
        }
    }

    /// The true pose at a frame's capture, where there is truth.
    pub(crate) fn true_pose_of(&self, frame: FrameId) -> Option<Pose> {
        match self {
            Self::Sim(world) => world.capture(frame).map(|moment| moment.pose),
            Self::Real { .. } => None,
        }
    }

    /// What there was to see at `at`; none when that is not known yet or no longer.
    pub(crate) fn shot(&self, at: Time) -> Option<Seen> {
        match self {
            Self::Sim(world) => world.shot(at).map(Seen::Sim),
            Self::Real { frames, .. } => {
                let (meta, picture) = frames.newest()?;
                (at.since(meta.received) < OLD).then_some(Seen::Real(picture, at))
            }
        }
    }

    /// The picture at a size.
    pub(crate) fn photograph(&self, seen: &Seen, size: (u32, u32)) -> Rgb {
        match (self, seen) {
            (Self::Sim(world), Seen::Sim(shot)) => world.photograph(shot, Some(size)),
            (_, Seen::Real(picture, _)) => picture.at(size, &mut Scaler::default()),
            // A picture of another world than this one.
            (Self::Real { .. }, Seen::Sim(_)) => Rgb::new(size.0, size.1),
        }
    }

    /// What stands in the scene, for a log.
    pub(crate) fn prisms(&self) -> Vec<Prism> {
        match self {
            Self::Sim(world) => outline::prisms(world.stage()),
            Self::Real { .. } => Vec::new(),
        }
    }

    /// The scene from above, and where the object with a key is.
    pub(crate) fn map(&self, target: Option<&str>) -> (Vec<Outline>, Option<EnuPosition>) {
        match self {
            Self::Sim(world) => {
                let (stage, actors) = (world.stage(), world.now().actors);
                let centre = target.and_then(|key| outline::centre(stage, &actors, key));
                (outline::outlines(stage, &actors), centre)
            }
            Self::Real { .. } => (Vec::new(), None),
        }
    }
}

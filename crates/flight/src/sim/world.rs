//! One simulated craft in its scene, and the camera that the oracle and the recorder look through.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use spf_core::camera::Camera;
use spf_core::craft::CraftKind;
use spf_core::frame::FrameId;
use spf_core::geometry::Pose;
use spf_core::time::Time;
use spf_media::frame::Rgb;
use spf_render::effects::{Effects, Eye, Shot};
use spf_render::surroundings::Surroundings;
use spf_render::{Channels, Picture};
use spf_sim::craft::{SimCraft, Truth};
use spf_sim::dynamics::Conditions;
use spf_sim::frame_clock::FrameClock;
use spf_sim::model::Model;
use spf_sim::wind::Wind;

use super::stage::{Moment, Stage};

/// What a flight meets besides its scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Circumstances {
    /// The wind.
    pub wind: Wind,
    /// Battery charge at the start, 0..=1.
    pub battery: f64,
    /// What the camera does to its pictures.
    pub effects: Effects,
}

impl Default for Circumstances {
    /// Still air, a full battery, a perfect camera.
    fn default() -> Self {
        Self { wind: Wind::default(), battery: 1.0, effects: Effects::default() }
    }
}

/// One simulated craft in its scene, shared by the driver, the oracle's eye, the recorder and the judge.
#[derive(Clone)]
pub struct SimWorld {
    stage: Arc<Stage>,
    eye: Arc<Eye>,
    surroundings: Arc<Surroundings>,
    craft: Arc<Mutex<SimCraft>>,
}

impl SimWorld {
    /// A craft on the ground below `start`, in still air, with a full battery and a perfect camera.
    #[must_use]
    pub fn new(stage: Arc<Stage>, kind: CraftKind, start: Pose, seed: u64) -> Self {
        Self::under(&Circumstances::default(), stage, kind, start, seed)
    }

    /// A craft on the ground below `start`, under other circumstances.
    #[must_use]
    pub fn under(circumstances: &Circumstances, stage: Arc<Stage>, kind: CraftKind, start: Pose, seed: u64) -> Self {
        let Circumstances { wind, battery, effects } = circumstances;
        let conditions = Conditions { wind: *wind, battery: *battery, ..Conditions::new(seed) };
        let craft = SimCraft::among(stage.cast.clone(), stage.collider.clone(), Model::of(kind), start, conditions);
        let eye = Eye::new(kind.camera(), effects.clone(), seed);
        let surroundings = Arc::new(Surroundings::of(eye.camera()));
        Self { stage, eye: Arc::new(eye), surroundings, craft: Arc::new(Mutex::new(craft)) }
    }

    /// The craft, for its driver.
    pub(super) fn craft(&self) -> MutexGuard<'_, SimCraft> {
        // A panic elsewhere leaves the craft where it was; its state is whole between calls.
        self.craft.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The craft itself, for whoever serves its protocol and advances it in place of this world.
    #[must_use]
    pub fn shared_craft(&self) -> Arc<Mutex<SimCraft>> {
        self.craft.clone()
    }

    /// The scene it is in.
    #[must_use]
    pub fn stage(&self) -> &Arc<Stage> {
        &self.stage
    }

    /// Its camera, with its lens.
    #[must_use]
    pub fn camera(&self) -> &Camera {
        self.eye.camera()
    }

    /// Moves the world on to `now`.
    pub fn advance_to(&self, now: Time) {
        self.craft().advance_to(now);
    }

    /// The truth now. For the judge and the recorder alone.
    #[must_use]
    pub fn truth(&self) -> Truth {
        self.craft().truth()
    }

    /// What there was to see at a time not longer ago than the simulator remembers. For the camera, the judge and the recorder
    /// alone.
    #[must_use]
    pub fn moment_at(&self, at: Time) -> Option<Moment> {
        let craft = self.craft();
        craft.true_pose_at(at).zip(craft.actors_at(at)).map(|(pose, actors)| Moment { pose, actors })
    }

    /// What there is to see now.
    #[must_use]
    pub fn now(&self) -> Moment {
        let craft = self.craft();
        Moment { pose: craft.dynamics().pose(), actors: craft.actors_at(craft.time()).unwrap_or_default() }
    }

    /// What there was to see when a frame was captured.
    #[must_use]
    pub fn capture(&self, frame: FrameId) -> Option<Moment> {
        self.moment_at(FrameClock::default().captured(frame))
    }

    /// What a photograph captured at `at` takes its light from; none while its shutter is open, and when it is too long ago.
    #[must_use]
    pub fn shot(&self, at: Time) -> Option<Shot<Moment>> {
        self.eye.shot(at, |at| self.moment_at(at))
    }

    /// The same for a frame.
    #[must_use]
    pub fn capture_shot(&self, frame: FrameId) -> Option<Shot<Moment>> {
        self.shot(FrameClock::default().captured(frame))
    }

    /// The same of a world in which nothing moves.
    #[must_use]
    pub fn still(&self, at: Time, moment: &Moment) -> Option<Shot<Moment>> {
        self.eye.shot(at, |_| Some(moment.clone()))
    }

    /// What the camera sees at a moment.
    #[must_use]
    pub fn look(&self, moment: &Moment, channels: Channels) -> Picture {
        let mut picture = Picture::default();
        self.look_into(moment, channels, &mut picture);
        picture
    }

    /// A photograph, at the camera's size or another.
    #[must_use]
    pub fn photograph(&self, shot: &Shot<Moment>, size: Option<(u32, u32)>) -> Rgb {
        self.photograph_with(shot, size, Channels::RGB)
    }

    /// A photograph as fine as `channels` says.
    #[must_use]
    pub fn photograph_with(&self, shot: &Shot<Moment>, size: Option<(u32, u32)>, channels: Channels) -> Rgb {
        self.eye.photograph(shot, size, |camera, moment, picture| self.stage.render_into(camera, moment, channels, picture))
    }

    /// What the camera sees at a moment, into the buffers of an earlier picture: fresh pages cost a fifth of a decision.
    pub fn look_into(&self, moment: &Moment, channels: Channels, picture: &mut Picture) {
        self.eye.look(self.camera(), picture, |camera, picture| {
            self.stage.render_into(camera, moment, channels, picture);
        });
    }

    /// Light on each thing of a picture with ids and depth of a moment, as in [`Renderer::light_on`].
    ///
    /// [`Renderer::light_on`]: spf_render::Renderer::light_on
    #[must_use]
    pub fn light_on(&self, moment: &Moment, picture: &Picture) -> BTreeMap<u16, f32> {
        self.stage.renderer.light_on(self.camera(), &moment.pose, picture)
    }

    /// Share of each object's silhouette that lies inside the frame; openings by their own. The view in which they are counted is
    /// drawn into `picture`.
    #[must_use]
    pub fn in_frame(&self, moment: &Moment, picture: &mut Picture) -> BTreeMap<u16, f32> {
        let channels = Channels { ids: true, openings: true, ..Channels::default() };
        self.stage.render_into(self.surroundings.camera(), moment, channels, picture);
        self.surroundings.shares(picture)
    }
}

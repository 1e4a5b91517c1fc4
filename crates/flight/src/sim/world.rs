//! The simulated craft behind the `Drone` interface, and the camera that the oracle and the recorder look through.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use spf_core::camera::Camera;
use spf_core::command::Command;
use spf_core::envelope::Cleared;
use spf_core::frame::FrameId;
use spf_core::geometry::Pose;
use spf_core::time::Time;
use spf_drone::{Capabilities, Drone, DroneError, DroneEvent};
use spf_media::frame::Rgb;
use spf_sim::craft::{SimCraft, Truth};
use spf_sim::dynamics::Conditions;
use spf_sim::frame_clock::FrameClock;
use spf_sim::model::{CraftKind, Model};
use spf_sim::render::{Channels, Picture};

use super::stage::{Moment, Stage};

/// How much wider than the camera's the view is in which the share of a silhouette inside the frame is counted.
const WIDE: f64 = 2.5;
/// Size of that view, pixels.
const WIDE_SIZE: (u32, u32) = (320, 240);

/// One simulated craft in its scene, shared by the driver, the oracle's eye, the recorder and the judge.
#[derive(Clone)]
pub struct SimWorld {
    stage: Arc<Stage>,
    camera: Camera,
    craft: Arc<Mutex<SimCraft>>,
}

impl SimWorld {
    /// A craft on the ground below `start`.
    #[must_use]
    pub fn new(stage: Arc<Stage>, kind: CraftKind, start: Pose, seed: u64) -> Self {
        let conditions = Conditions::new(seed);
        let craft = SimCraft::among(stage.cast.clone(), stage.collider.clone(), Model::of(kind), start, conditions);
        let camera = kind.camera();
        Self { stage, camera, craft: Arc::new(Mutex::new(craft)) }
    }

    fn craft(&self) -> MutexGuard<'_, SimCraft> {
        // A panic elsewhere leaves the craft where it was; its state is whole between calls.
        self.craft.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The scene it is in.
    #[must_use]
    pub fn stage(&self) -> &Arc<Stage> {
        &self.stage
    }

    /// Its camera.
    #[must_use]
    pub fn camera(&self) -> &Camera {
        &self.camera
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

    /// What the camera sees at a moment.
    #[must_use]
    pub fn look(&self, moment: &Moment, channels: Channels) -> Picture {
        self.stage.render(&self.camera, moment, channels)
    }

    /// A photograph of a moment, at the camera's size or another.
    #[must_use]
    pub fn photograph(&self, moment: &Moment, size: Option<(u32, u32)>) -> Rgb {
        let camera = size.map_or(self.camera, |(width, height)| self.camera.resized(width, height));
        let picture = self.stage.render(&camera, moment, Channels::RGB);
        let (width, height) = (picture.width, picture.height);
        picture.rgb.and_then(|data| Rgb::from_raw(width, height, data).ok()).unwrap_or_else(|| Rgb::new(width, height))
    }

    /// What the camera sees at a moment, into the buffers of an earlier picture: fresh pages cost a fifth of a decision.
    pub fn look_into(&self, moment: &Moment, channels: Channels, picture: &mut Picture) {
        self.stage.render_into(&self.camera, moment, channels, picture);
    }

    /// Light on each thing of a picture with ids and depth of a moment, as in [`Renderer::light_on`].
    ///
    /// [`Renderer::light_on`]: spf_sim::render::Renderer::light_on
    #[must_use]
    pub fn light_on(&self, moment: &Moment, picture: &Picture) -> BTreeMap<u16, f32> {
        self.stage.renderer.light_on(&self.camera, &moment.pose, picture)
    }

    /// Share of each object's silhouette that lies inside the frame, counted in a wider and coarser view; openings by their own.
    /// The view is drawn into `picture`.
    #[must_use]
    pub fn in_frame(&self, moment: &Moment, picture: &mut Picture) -> BTreeMap<u16, f32> {
        let wide = widened(&self.camera);
        let channels = Channels { ids: true, openings: true, ..Channels::default() };
        self.stage.render_into(&wide, moment, channels, picture);
        let (w, h) = (WIDE_SIZE.0 as usize, WIDE_SIZE.1 as usize);
        let inside = |i: usize, size: usize, centre: f64, focal: f64, low: f64, high: f64| {
            let tangent = (i as f64 + 0.5 - centre) / focal;
            i < size && (low..=high).contains(&tangent)
        };
        let camera = &self.camera;
        let (left, right) = (-camera.cx / camera.fx, (f64::from(camera.width) - camera.cx) / camera.fx);
        let (top, bottom) = (-camera.cy / camera.fy, (f64::from(camera.height) - camera.cy) / camera.fy);
        let columns: Vec<bool> = (0..w).map(|x| inside(x, w, wide.cx, wide.fx, left, right)).collect();
        let rows: Vec<bool> = (0..h).map(|y| inside(y, h, wide.cy, wide.fy, top, bottom)).collect();
        let mut counts = vec![(0u32, 0u32); self.stage.scene.objects.len() + 1];
        for ids in [picture.ids.as_deref(), picture.opening_ids.as_deref()].into_iter().flatten() {
            for (y, row) in ids.chunks_exact(w).enumerate() {
                for (x, id) in row.iter().enumerate() {
                    let count = &mut counts[usize::from(*id)];
                    count.0 += 1;
                    count.1 += u32::from(columns[x] && rows[y]);
                }
            }
        }
        let seen = counts.iter().enumerate().skip(1).filter(|(_, (all, _))| *all > 0);
        seen.map(|(id, (all, inside))| (id as u16, *inside as f32 / *all as f32)).collect()
    }
}

fn widened(camera: &Camera) -> Camera {
    let (w, h) = (f64::from(WIDE_SIZE.0), f64::from(WIDE_SIZE.1));
    Camera {
        width: WIDE_SIZE.0,
        height: WIDE_SIZE.1,
        fx: camera.fx * w / f64::from(camera.width) / WIDE,
        fy: camera.fy * h / f64::from(camera.height) / WIDE,
        cx: 0.5 * w,
        cy: 0.5 * h,
        ..*camera
    }
}

/// The driver of the simulated craft.
pub struct SimDrone {
    world: SimWorld,
    clock: FrameClock,
    telemetry_at: Time,
    frame: FrameId,
}

impl SimDrone {
    /// Drives the craft of a world.
    #[must_use]
    pub fn new(world: SimWorld) -> Self {
        Self { world, clock: FrameClock::default(), telemetry_at: Time::ZERO, frame: FrameId(0) }
    }

    fn frame_at(&self) -> Time {
        self.clock.meta(self.frame, 0, 0).received
    }
}

impl Drone for SimDrone {
    fn name(&self) -> &str {
        "sim"
    }

    fn capabilities(&self) -> Capabilities {
        Capabilities { craft: self.world.craft().dynamics().model().craft, camera: self.world.camera }
    }

    fn apply(&mut self, now: Time, command: &Cleared<Command>) -> Result<(), DroneError> {
        let mut craft = self.world.craft();
        craft.advance_to(now);
        craft.apply(now, *command.get(), command.valid_until());
        Ok(())
    }

    fn next_event(&mut self, until: Time) -> Option<(Time, DroneEvent)> {
        let frame_at = self.frame_at();
        let at = self.telemetry_at.min(frame_at);
        if at > until {
            return None;
        }
        let mut craft = self.world.craft();
        craft.advance_to(at);
        // At one instant telemetry comes first: the pilot then knows the pose of the frame.
        if self.telemetry_at <= frame_at {
            let telemetry = craft.telemetry();
            self.telemetry_at = craft.next_telemetry(at);
            return Some((at, DroneEvent::Telemetry(telemetry)));
        }
        let camera = &self.world.camera;
        let meta = self.clock.meta(self.frame, camera.width, camera.height);
        drop(craft);
        self.frame = FrameId(self.frame.0 + 1);
        Some((at, DroneEvent::Frame(meta)))
    }

    fn next_event_at(&self) -> Option<Time> {
        Some(self.telemetry_at.min(self.frame_at()))
    }
}

//! The thread behind a page: moves the page's camera and renders its view.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

use spf_core::camera::Camera;
use spf_core::craft::CraftKind;
use spf_core::time::Time;
use spf_flight::sim::{LoadedScene, WorldSnapshot};
use spf_render::{Channels, RenderedImage};
use spf_scene::actors::Traffic;
use spf_scene::{Lighting, SceneLook, Weather};
use spf_sim::model::Model;
use tokio::sync::mpsc::Sender;

use super::camera::{FreeCamera, Push};
use super::message::{Channel, FromPage, Head, ToPage, Under};
use super::quality::{Budget, FrameQuality};
use super::{InitialView, Library, draw, sight};

/// Maximum number of images sent but not yet displayed.
const AHEAD: u64 = 2;
/// Minimum image interval: at most 30 images per second.
const PERIOD: Duration = Duration::from_millis(33);
/// Validity of key input: without new input the camera stops.
const KEYS_HOLD: Duration = Duration::from_millis(500);
/// Time without motion after which the image is rendered at full quality.
const REST: Duration = Duration::from_millis(250);
/// Maximum time step of motion, so that a slow image does not cause a jump.
const LONGEST_STEP: Duration = Duration::from_millis(250);
/// Polling interval of a camera at rest.
const IDLE: Duration = Duration::from_millis(200);
/// Polling interval of a moving camera that waits for the page.
const TICK: Duration = Duration::from_millis(10);

/// A message to the page.
pub(super) enum Out {
    /// JSON.
    Text(String),
    /// Header and JPEG.
    Image(Vec<u8>),
}

/// The camera of a page in its scene.
pub(super) struct ViewRenderer {
    library: Arc<Library>,
    out: Sender<Out>,
    loaded: Arc<LoadedScene>,
    name: String,
    camera: FreeCamera,
    /// Craft model; `None` for the scene's own.
    craft: Option<CraftKind>,
    collide: bool,
    /// Actors, by the time elapsed for this page.
    traffic: Traffic,
    time: Time,
    running: bool,
    push: Push,
    pushed_at: Instant,
    moved_at: Instant,
    pointer: Option<[f64; 2]>,
    under: Option<(u16, Under)>,
    channel: Channel,
    budget: Budget,
    /// Quality of `image`; `None` before the first image.
    frame_quality: Option<FrameQuality>,
    image: RenderedImage,
    /// The camera used for `image`.
    lens: Camera,
    /// Whether the image is outdated.
    stale: bool,
    /// Whether only the outline under the pointer is outdated.
    mark_changed: bool,
    drawn_at: Option<Instant>,
    draw_ms: f64,
    frame: u64,
    shown: u64,
}

/// The page has disconnected.
pub(super) struct PageClosed;

impl ViewRenderer {
    /// Opens the initial view.
    ///
    /// # Errors
    /// A message for the page if the scene cannot be loaded.
    pub(super) fn open(library: Arc<Library>, beginning: &InitialView, out: Sender<Out>) -> Result<Self, String> {
        let loaded = library.get(&beginning.scene, &beginning.conditions)?;
        let camera = FreeCamera::new(&loaded.scene, beginning.pose.unwrap_or(loaded.scene.preview));
        let lens = loaded.scene.default_craft.camera();
        let now = Instant::now();
        Ok(Self {
            library,
            out,
            name: beginning.scene.clone(),
            camera,
            craft: beginning.craft,
            collide: true,
            traffic: Traffic::new(loaded.cast.clone(), 0),
            time: Time::ZERO,
            running: true,
            push: Push::default(),
            pushed_at: now,
            moved_at: now,
            pointer: None,
            under: None,
            channel: Channel::default(),
            budget: Budget::default(),
            frame_quality: None,
            image: RenderedImage::default(),
            lens,
            stale: true,
            mark_changed: false,
            drawn_at: None,
            draw_ms: 0.0,
            frame: 0,
            shown: 0,
            loaded,
        })
    }

    /// Moves and renders until the page disconnects.
    pub(super) fn run(mut self, inbox: &Receiver<FromPage>) -> PageClosed {
        match self.live(inbox) {
            Ok(never) => match never {},
            Err(gone) => gone,
        }
    }

    fn live(&mut self, inbox: &Receiver<FromPage>) -> Result<core::convert::Infallible, PageClosed> {
        self.tell(&ToPage::Hello {
            version: env!("CARGO_PKG_VERSION"),
            scenes: self.library.names().to_vec(),
            lights: Lighting::ALL.map(Lighting::name).to_vec(),
            weathers: Weather::ALL.map(Weather::name).to_vec(),
        })?;
        self.send_scene()?;
        let mut before = Instant::now();
        loop {
            // An image takes long; the page of a queued message may be gone by now.
            if self.out.is_closed() {
                return Err(PageClosed);
            }
            match inbox.recv_timeout(self.wait(Instant::now())) {
                Ok(message) => self.follow(message)?,
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return Err(PageClosed),
            }
            while let Ok(message) = inbox.try_recv() {
                self.follow(message)?;
            }
            let now = Instant::now();
            self.advance(now, now.duration_since(before).min(LONGEST_STEP));
            before = now;
            if self.may_send() && self.until_due(now).is_zero() && self.wants_frame(now) {
                self.look(now)?;
            }
        }
    }

    /// Time until something other than a message needs attention.
    fn wait(&self, now: Instant) -> Duration {
        if self.wants_frame(now) {
            return if self.may_send() { self.until_due(now) } else { TICK };
        }
        if self.is_moving(now) || self.is_lively() { TICK } else { IDLE }
    }

    fn may_send(&self) -> bool {
        self.frame - self.shown < AHEAD
    }

    fn until_due(&self, now: Instant) -> Duration {
        self.drawn_at.map_or(Duration::ZERO, |at| (at + PERIOD).saturating_duration_since(now))
    }

    fn is_moving(&self, now: Instant) -> bool {
        now.duration_since(self.moved_at) < REST
    }

    /// Whether anything moves by itself.
    fn is_lively(&self) -> bool {
        self.running && !self.loaded.cast.is_empty()
    }

    fn wants_frame(&self, now: Instant) -> bool {
        let coarse = !self.is_moving(now) && self.frame_quality != Some(self.next_quality(now));
        self.stale || self.mark_changed || coarse
    }

    fn kind(&self) -> CraftKind {
        self.craft.unwrap_or(self.loaded.scene.default_craft)
    }

    fn next_quality(&self, now: Instant) -> FrameQuality {
        let camera = self.kind().camera();
        self.budget.frame_quality((camera.width, camera.height), self.is_moving(now))
    }

    fn advance(&mut self, now: Instant, step: Duration) {
        if now.duration_since(self.pushed_at) > KEYS_HOLD {
            self.push = Push::default();
        }
        if self.is_lively() {
            self.time += step;
            self.traffic.advance_to(self.time);
            self.stale = true;
        }
        let radius = Model::of(self.kind()).craft.radius;
        let solid = self.collide.then_some((self.loaded.collider.as_ref(), radius));
        if self.camera.advance(&self.push, step.as_secs_f64(), solid) {
            self.moved(now);
        }
    }

    fn moved(&mut self, now: Instant) {
        self.moved_at = now;
        self.stale = true;
    }

    /// Handles a message of the page.
    fn follow(&mut self, message: FromPage) -> Result<(), PageClosed> {
        match message {
            FromPage::Fly { right, forward, up, yaw, pitch, fast } => {
                self.push = Push { right, forward, up, yaw, pitch, fast };
                self.pushed_at = Instant::now();
            }
            FromPage::Turn { yaw_deg, pitch_deg } => {
                self.camera.turn(yaw_deg.to_radians(), pitch_deg.to_radians());
                self.moved(Instant::now());
            }
            FromPage::Point { at } => return self.point(at),
            // Only images that were sent can have been displayed.
            FromPage::Shown { frame } => self.shown = self.shown.max(frame.min(self.frame)),
            FromPage::Channel { channel } => (self.channel, self.stale) = (channel, true),
            FromPage::Detail { detail } => (self.budget.detail, self.stale) = (detail, true),
            FromPage::Craft { craft } => {
                (self.craft, self.stale) = (Some(craft), true);
                return self.send_scene();
            }
            FromPage::Collide { on } => self.collide = on,
            FromPage::Run { on } => self.running = on,
            FromPage::Go { pose } => {
                self.camera.go(pose.map_or(self.loaded.scene.preview, Into::into));
                self.stale = true;
            }
            FromPage::Scene { name } => return self.enter(name, SceneLook::default()),
            FromPage::Conditions { light, weather } => {
                return self.enter(self.name.clone(), SceneLook { lighting: light, weather });
            }
        }
        Ok(())
    }

    /// Switches to another scene, or to other conditions at the same pose.
    fn enter(&mut self, name: String, conditions: SceneLook) -> Result<(), PageClosed> {
        self.tell(&ToPage::Loading { name: name.clone() })?;
        match self.library.get(&name, &conditions) {
            Ok(loaded) => {
                if name != self.name {
                    self.camera = FreeCamera::new(&loaded.scene, loaded.scene.preview);
                }
                (self.traffic, self.time) = (Traffic::new(loaded.cast.clone(), 0), Time::ZERO);
                (self.loaded, self.name, self.stale, self.under) = (loaded, name, true, None);
            }
            Err(reason) => self.tell(&ToPage::Refused { reason })?,
        }
        self.send_scene()
    }

    /// Handles pointer motion over a static image.
    fn point(&mut self, at: Option<[f64; 2]>) -> Result<(), PageClosed> {
        self.pointer = at;
        let before = self.under.take();
        self.under = self.seen_under_pointer();
        let id = |under: &Option<(u16, Under)>| under.as_ref().map(|(id, _)| *id);
        if id(&before) != id(&self.under) {
            self.mark_changed = true;
        } else if before != self.under && !self.stale {
            self.tell(&ToPage::Under { under: self.under.as_ref().map(|(_, under)| under.clone()) })?;
        }
        Ok(())
    }

    fn seen_under_pointer(&self) -> Option<(u16, Under)> {
        self.pointer.and_then(|at| sight::under(&self.loaded, &self.lens, &self.image, at))
    }

    /// Renders if anything but the outline changed, and sends.
    fn look(&mut self, now: Instant) -> Result<(), PageClosed> {
        let frame_quality = self.next_quality(now);
        let (width, height) = frame_quality.size;
        let drawn = self.stale || self.frame_quality != Some(frame_quality);
        if drawn {
            self.lens = self.kind().camera().resized(width, height);
            let channels = Channels { quality: frame_quality.quality, ..draw::channels(self.channel) };
            let actors = self.traffic.places_at(self.time).unwrap_or_default();
            let snapshot = WorldSnapshot { pose: self.camera.pose(), actors };
            self.loaded.render_into(&self.lens, &snapshot, channels, &mut self.image);
            self.draw_ms = milliseconds(now.elapsed());
        }
        (self.frame_quality, self.stale, self.mark_changed, self.drawn_at) = (Some(frame_quality), false, false, Some(now));
        self.under = self.seen_under_pointer();
        let encoding = Instant::now();
        // An outline of the ground would surround every object on it.
        let is_thing = |id: &u16| self.loaded.tags.get(usize::from(*id).wrapping_sub(1)).is_some_and(|tags| !tags.is_surface());
        let marked = self.under.as_ref().map(|(id, _)| *id).filter(is_thing);
        let jpeg = match draw::encode(&self.image, self.channel, marked) {
            Ok(jpeg) => jpeg,
            Err(error) => return self.tell(&ToPage::Refused { reason: error.to_string() }),
        };
        if drawn {
            self.budget.took(&frame_quality, now.elapsed());
        }
        self.frame += 1;
        let touching = self.camera.touching().and_then(|id| self.loaded.scene.object(id));
        let head = Head {
            frame: self.frame,
            width,
            height,
            pose: self.camera.pose().into(),
            speed_m_s: self.camera.speed(),
            touching: touching.map(|object| object.key.clone()),
            under: self.under.as_ref().map(|(_, under)| under.clone()),
            channel: self.channel,
            draw_ms: self.draw_ms,
            encode_ms: milliseconds(encoding.elapsed()),
        };
        self.send(Out::Image(head.with(jpeg.bytes())))
    }

    fn send_scene(&self) -> Result<(), PageClosed> {
        let scene = &self.loaded.scene;
        self.tell(&ToPage::Scene {
            name: self.name.clone(),
            title: scene.name.clone(),
            description: scene.description.clone(),
            objects: scene.objects.len(),
            triangles: scene.meshes().map(|part| part.triangles.len()).sum(),
            actors: self.loaded.cast.len(),
            craft: self.kind(),
            light: scene.lighting,
            weather: scene.weather,
        })
    }

    fn tell(&self, message: &ToPage) -> Result<(), PageClosed> {
        self.send(Out::Text(serde_json::to_string(message).unwrap_or_default()))
    }

    fn send(&self, out: Out) -> Result<(), PageClosed> {
        self.out.blocking_send(out).map_err(|_| PageClosed)
    }
}

fn milliseconds(time: Duration) -> f64 {
    time.as_secs_f64() * 1e3
}

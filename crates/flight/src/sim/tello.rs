//! A virtual Tello in a scene: `spf sim serve --tello`. The protocol is `spf_sim::tello`; here it gets a scene to see, and a
//! judge who knows the truth.

use std::fs::File;
use std::io::Write;
use std::net::SocketAddr;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::Instant;

use serde::Serialize;
use spf_core::camera::Camera;
use spf_core::craft::CraftKind;
use spf_core::frame::FrameId;
use spf_core::geometry::Pose;
use spf_core::telemetry::FlightPhase;
use spf_core::time::{Duration, Time};
use spf_media::{Rgb, resize};
use spf_render::{Channels, Picture, Quality};
use spf_sim::tello::{FaultSource, Figures, Fineness, Firmware, Server, ServerError, Setup, Tally, VideoQuality, VideoWish};

use super::stage::{Moment, Stage};
use super::truth::{Verdict, judge};
use super::world::{Circumstances, SimWorld};
use crate::endpoint::{Lens, Memory, Remembered};

/// From a picture's capture to its sending.
const LATENCY: Duration = Duration::from_millis(120);
/// How often the judge looks.
const LOOK: Duration = Duration::from_millis(20);

/// The instruction that flights are judged by; whoever hears one (a VLM's server, the command line) writes it here.
pub type Instruction = Arc<Mutex<Option<String>>>;

/// What is served.
pub struct TelloPlan {
    /// Where it flies.
    pub stage: Arc<Stage>,
    /// Where it stands at first; `None`: the scene's start.
    pub start: Option<Pose>,
    /// Under what circumstances.
    pub circumstances: Circumstances,
    /// Of all chance.
    pub seed: u64,
    /// The drone's address and command port.
    pub listen: SocketAddr,
    /// SDK.
    pub firmware: Firmware,
    /// How fine its pictures are.
    pub quality: VideoQuality,
    /// What goes wrong.
    pub faults: FaultSource,
    /// What flights are judged by.
    pub instruction: Instruction,
    /// Where a line of JSON about each flight goes.
    pub truth: Option<File>,
    /// Who keeps what the camera sees, for an endpoint that is asked about it.
    pub film: Option<Arc<TelloFilm>>,
}

/// What the drone's camera saw in the last seconds.
pub struct TelloFilm {
    memory: Arc<Memory>,
    newest: Mutex<Option<(FrameId, Rgb)>>,
    next: AtomicU64,
    began: Instant,
}

impl Default for TelloFilm {
    fn default() -> Self {
        Self { memory: Arc::default(), newest: Mutex::default(), next: AtomicU64::new(0), began: Instant::now() }
    }
}

impl TelloFilm {
    /// What is remembered.
    #[must_use]
    pub fn memory(&self) -> &Arc<Memory> {
        &self.memory
    }

    fn keep(&self, moment: Moment, picture: &Rgb) {
        let frame = FrameId(self.next.fetch_add(1, Ordering::Relaxed));
        self.memory.push(self.now(), Remembered { frame, moment }, picture);
        *self.newest.lock().unwrap_or_else(PoisonError::into_inner) = Some((frame, picture.clone()));
    }
}

impl Lens for TelloFilm {
    fn newest(&self) -> Option<(FrameId, Rgb)> {
        self.newest.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// The drone flies where it is flown.
    fn put(&self, _pose: Pose) -> bool {
        false
    }

    fn now(&self) -> Time {
        Time::ZERO + self.began.elapsed()
    }
}

/// A virtual Tello that flies until it is dropped.
pub struct TelloService {
    server: Server,
    world: SimWorld,
    judge: Option<JoinHandle<()>>,
    stopped: Arc<AtomicBool>,
}

impl TelloService {
    /// Begins to serve.
    ///
    /// # Errors
    /// [`ServerError`].
    pub fn start(plan: TelloPlan) -> Result<Self, ServerError> {
        let TelloPlan { stage, start, circumstances, seed, listen, firmware, quality, faults, instruction, truth, film } = plan;
        let start = start.unwrap_or(stage.scene.start);
        let world = SimWorld::under(&circumstances, stage, CraftKind::Tello, start, seed);
        let camera = world.clone();
        // The first picture in a scene prepares its shadows and lamps: seconds, on a slow machine, in which nobody flies yet.
        drop(world.look(&world.now(), channels(Fineness::Draft)));
        let setup = Setup {
            listen,
            craft: world.shared_craft(),
            quality,
            photographer: Box::new(move |at, wish, fineness| {
                let picture = photograph(&camera, at, wish, fineness)?;
                if let Some((film, moment)) = film.as_ref().filter(|_| !wish.downwards).zip(camera.moment_at(at)) {
                    film.keep(moment, &picture);
                }
                Some(picture)
            }),
            figures: Figures::default(),
            firmware,
            faults,
            seed,
            latency: LATENCY,
            start: Instant::now(),
        };
        let server = Server::start(setup)?;
        let stopped = Arc::new(AtomicBool::new(false));
        let judging = Judging { world: world.clone(), instruction, file: truth, flights: 0, flight: None };
        let ends = stopped.clone();
        let judge = std::thread::Builder::new()
            .name("judge".to_owned())
            .spawn(move || judging.run(&ends))
            .map_err(ServerError::Thread)?;
        Ok(Self { server, world, judge: Some(judge), stopped })
    }

    /// Where it listens for commands.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.server.address()
    }

    /// What video it has sent.
    #[must_use]
    pub fn tally(&self) -> Tally {
        self.server.tally()
    }

    /// The world it flies in. Nobody else may advance it.
    #[must_use]
    pub fn world(&self) -> &SimWorld {
        &self.world
    }
}

impl Drop for TelloService {
    fn drop(&mut self) {
        self.stopped.store(true, Ordering::Relaxed);
        drop(self.judge.take().map(JoinHandle::join));
    }
}

/// What is drawn for the video.
fn channels(fineness: Fineness) -> Channels {
    let quality = if fineness == Fineness::Full { Quality::Full } else { Quality::Live };
    Channels { quality, ..Channels::RGB }
}

/// What the camera saw at `at`, as the video shows it.
fn photograph(world: &SimWorld, at: Time, wish: &VideoWish, fineness: Fineness) -> Option<Rgb> {
    let channels = channels(fineness);
    if wish.downwards {
        return below(world, at, channels);
    }
    let shot = world.shot(at)?;
    let (width, height) = if wish.low_resolution { (640, 480) } else { (world.camera().width, world.camera().height) };
    let drawn = if fineness == Fineness::Draft { (width / 2, height / 2) } else { (width, height) };
    let picture = world.photograph_with(&shot, Some(drawn), channels);
    Some(if drawn == (width, height) { picture } else { resize(&picture, width, height) })
}

/// The grey picture of the camera that looks down.
fn below(world: &SimWorld, at: Time, channels: Channels) -> Option<Rgb> {
    let moment = world.moment_at(at)?;
    let camera = Camera::from_fov(320, 240, 1.0, 0.79, core::f64::consts::FRAC_PI_2);
    let mut picture = Picture::default();
    world.stage().render_into(&camera, &moment, channels, &mut picture);
    let mut pixels = picture.rgb?;
    for pixel in pixels.chunks_exact_mut(3) {
        // Luma of ITU-R BT.709.
        let [red, green, blue] = [pixel[0], pixel[1], pixel[2]].map(u32::from);
        pixel.fill(((213 * red + 715 * green + 72 * blue) / 1000) as u8);
    }
    Rgb::from_raw(picture.width, picture.height, pixels).ok()
}

/// A flight under way.
struct Flight {
    began: Time,
    start: Pose,
    path_length: f64,
    collisions: usize,
}

/// What was true of a flight when its landing began.
#[derive(Debug, Serialize)]
struct Line<'a> {
    flight: u32,
    instruction: Option<&'a str>,
    #[serde(flatten)]
    verdict: Verdict,
    collisions: usize,
    touched: Vec<String>,
    path_length_m: f64,
    took_off_at_s: f64,
    ended_at_s: f64,
    ended_by: &'static str,
}

struct Judging {
    world: SimWorld,
    instruction: Instruction,
    file: Option<File>,
    flights: u32,
    flight: Option<Flight>,
}

impl Judging {
    fn run(mut self, stopped: &AtomicBool) {
        while !stopped.load(Ordering::Relaxed) {
            self.look(false);
            std::thread::sleep(LOOK);
        }
        self.look(true);
    }

    fn look(&mut self, shut_down: bool) {
        let truth = self.world.truth();
        let ended_by = match truth.phase {
            FlightPhase::TakingOff | FlightPhase::Flying | FlightPhase::Manoeuvring if shut_down => "shutdown",
            FlightPhase::TakingOff | FlightPhase::Flying | FlightPhase::Manoeuvring => {
                self.flight.get_or_insert(Flight {
                    began: truth.time,
                    start: truth.pose,
                    path_length: truth.path_length,
                    collisions: truth.collided_with.len(),
                });
                return;
            }
            FlightPhase::Stopped if truth.collided_with.is_empty() => "motors_cut",
            FlightPhase::Stopped => "crash",
            FlightPhase::Landing | FlightPhase::OnGround => "landing",
        };
        let Some(flight) = self.flight.take() else { return };
        self.flights += 1;
        let instruction = self.instruction.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let verdict = instruction.as_deref().map_or_else(Verdict::default, |text| judge(&self.world, text, &flight.start));
        let hits = truth.collided_with.get(flight.collisions..).unwrap_or_default();
        let line = Line {
            flight: self.flights,
            instruction: instruction.as_deref(),
            verdict,
            collisions: hits.len(),
            touched: hits.iter().map(|(_, id)| self.world.stage().key(*id)).collect(),
            path_length_m: truth.path_length - flight.path_length,
            took_off_at_s: flight.began.as_secs_f64(),
            ended_at_s: truth.time.as_secs_f64(),
            ended_by,
        };
        self.write(&line);
    }

    fn write(&mut self, line: &Line<'_>) {
        let Some(file) = &mut self.file else { return };
        let written = serde_json::to_string(line).map_err(std::io::Error::from).and_then(|text| writeln!(file, "{text}"));
        if let Err(error) = written {
            tracing::warn!(%error, "the truth about a flight could not be written");
        }
    }
}

/// Opens a file for the truth; a line about each flight is added to what it holds.
///
/// # Errors
/// The operating system's.
pub fn truth_file(path: &Path) -> std::io::Result<File> {
    File::options().create(true).append(true).open(path)
}

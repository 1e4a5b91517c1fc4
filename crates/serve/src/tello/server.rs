//! Sockets, a clock and a camera for a [`VirtualTello`].
//!
//! Three threads: one receives commands and flies, one takes and encodes pictures ([`film`](super::film)), one sends them when they
//! are due.

use std::net::{SocketAddr, UdpSocket};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{Builder, JoinHandle};
use std::time::{Instant, SystemTime};

use spf_core::fault::{FaultError, FaultMachine, FaultPlan, Stream};
use spf_core::time::{Duration, Time};
use spf_sim::craft::SimCraft;

use super::figures::{Figures, Firmware};
use super::film::{Due, Photographer, film};
use super::link::Link;
use super::machine::{Output, VideoWish, VirtualTello};
use super::pace::VideoQuality;

/// How long a thread sleeps at most, so that it notices the end.
pub(super) const NAP: Duration = Duration::from_millis(20);
/// How often the file of faults is looked at.
const FAULTS_LOOK: Duration = Duration::from_millis(250);
/// Pictures that wait for their time of sending.
const WAITING: usize = 16;
/// A picture sent later than this after its time is counted as late.
const LATE: Duration = Duration::from_millis(50);

/// Where faults come from.
#[derive(Clone, Debug)]
pub enum FaultSource {
    /// These, for good.
    Plan(FaultPlan),
    /// A TOML file, read again whenever it changes: faults are switched while it flies.
    File(PathBuf),
}

/// Why a server does not begin.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ServerError {
    /// A socket.
    #[error("UDP {address} cannot be had")]
    Bind {
        /// Which.
        address: SocketAddr,
        /// Why.
        #[source]
        source: std::io::Error,
    },
    /// A thread.
    #[error("no thread can be started")]
    Thread(#[source] std::io::Error),
    /// The file of faults cannot be read.
    #[error("the faults in `{}` cannot be read", path.display())]
    FaultFile {
        /// Which.
        path: PathBuf,
        /// Why.
        #[source]
        source: std::io::Error,
    },
    /// The file of faults is no TOML, or its keys are wrong.
    #[error("the faults in `{}` are refused", path.display())]
    FaultSyntax {
        /// Which.
        path: PathBuf,
        /// Why.
        #[source]
        source: Box<toml::de::Error>,
    },
    /// A rule makes no sense.
    #[error(transparent)]
    Fault(#[from] FaultError),
}

/// What is served.
pub struct Setup {
    /// The drone's address, and its command port (a Tello's is 8889).
    pub listen: SocketAddr,
    /// The craft. Nobody else may advance it.
    pub craft: Arc<Mutex<SimCraft>>,
    /// Its camera.
    pub photographer: Photographer,
    /// How fine its pictures are.
    pub quality: VideoQuality,
    /// Times and limits.
    pub figures: Figures,
    /// SDK.
    pub firmware: Firmware,
    /// What goes wrong.
    pub faults: FaultSource,
    /// Of all chance.
    pub seed: u64,
    /// From a picture's capture to its sending: the camera's, the encoder's and the radio's.
    pub latency: Duration,
    /// When the craft's time was zero.
    pub start: Instant,
}

/// What was sent so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Pictures.
    pub frames: u64,
    /// Bytes of video.
    pub bytes: u64,
    /// Pictures that went out more than 50 ms after their time.
    pub late: u64,
    /// Nanoseconds for which video was wanted.
    pub wanted_ns: u64,
}

impl Tally {
    /// Pictures a second while video was wanted.
    #[must_use]
    pub fn rate(&self) -> f64 {
        if self.wanted_ns == 0 { 0.0 } else { self.frames as f64 / (self.wanted_ns as f64 * 1e-9) }
    }
}

#[derive(Default)]
pub(super) struct Counters {
    frames: AtomicU64,
    bytes: AtomicU64,
    late: AtomicU64,
    pub(super) wanted_ns: AtomicU64,
}

/// What the threads share.
pub(super) struct Shared {
    start: Instant,
    stopped: AtomicBool,
    pub(super) video: Mutex<Option<VideoWish>>,
    faults: Mutex<FaultMachine>,
    pub(super) counters: Counters,
}

impl Shared {
    pub(super) fn now(&self) -> Time {
        Time::ZERO + self.start.elapsed()
    }

    pub(super) fn runs(&self) -> bool {
        !self.stopped.load(Ordering::Relaxed)
    }

    pub(super) fn faults(&self) -> FaultMachine {
        lock(&self.faults).clone()
    }
}

/// A panic elsewhere leaves what is locked whole: every change is one assignment or one tick.
pub(super) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A virtual Tello that answers on its sockets until it is dropped.
pub struct Server {
    address: SocketAddr,
    shared: Arc<Shared>,
    threads: Vec<JoinHandle<()>>,
}

impl Server {
    /// Opens the sockets and begins to answer.
    ///
    /// # Errors
    /// [`ServerError`] when a socket or a thread cannot be had, or the faults make no sense.
    pub fn start(setup: Setup) -> Result<Self, ServerError> {
        let Setup { listen, craft, photographer, quality, figures, firmware, faults, seed, latency, start } = setup;
        let command = bind(listen)?;
        let address = command.local_addr().map_err(|source| ServerError::Bind { address: listen, source })?;
        // Clients know state and video by the drone's address; their source port is free.
        let state = bind(SocketAddr::new(listen.ip(), 0))?;
        let video = bind(SocketAddr::new(listen.ip(), 0))?;
        let machine = FaultMachine::new(read(&faults)?, seed)?;
        let tello = VirtualTello::new(&lock(&craft), figures, firmware, machine.clone(), seed);
        let shared = Arc::new(Shared {
            start,
            stopped: AtomicBool::new(false),
            video: Mutex::default(),
            faults: Mutex::new(machine),
            counters: Counters::default(),
        });
        let (taken, due) = sync_channel(WAITING);
        let watch = Watch::new(faults, seed);
        let spawn = |name: &str, work: Box<dyn FnOnce() + Send>| {
            Builder::new().name(format!("tello {name}")).spawn(work).map_err(ServerError::Thread)
        };
        let mut server = Self { address, shared: shared.clone(), threads: Vec::new() };
        let (one, two, three) = (shared.clone(), shared.clone(), shared);
        let filmed = craft.clone();
        server.threads.push(spawn("flight", Box::new(move || fly(&one, tello, &craft, &command, &state, watch)))?);
        server.threads.push(spawn("camera", Box::new(move || film(&two, &filmed, photographer, quality, latency, &taken)))?);
        server.threads.push(spawn("video", Box::new(move || send(&three, &due, &video)))?);
        Ok(server)
    }

    /// Where it listens for commands.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// What it has sent.
    #[must_use]
    pub fn tally(&self) -> Tally {
        let Counters { frames, bytes, late, wanted_ns } = &self.shared.counters;
        let get = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        Tally { frames: get(frames), bytes: get(bytes), late: get(late), wanted_ns: get(wanted_ns) }
    }

    /// Other faults from now on, as if the file had changed.
    pub fn set_faults(&self, faults: FaultMachine) {
        *lock(&self.shared.faults) = faults;
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.shared.stopped.store(true, Ordering::Relaxed);
        for thread in self.threads.drain(..) {
            drop(thread.join());
        }
    }
}

fn bind(address: SocketAddr) -> Result<UdpSocket, ServerError> {
    UdpSocket::bind(address).map_err(|source| ServerError::Bind { address, source })
}

fn read(source: &FaultSource) -> Result<FaultPlan, ServerError> {
    match source {
        FaultSource::Plan(plan) => Ok(plan.clone()),
        FaultSource::File(path) => {
            let failed = |source| ServerError::FaultFile { path: path.clone(), source };
            let text = std::fs::read_to_string(path).map_err(failed)?;
            toml::from_str(&text).map_err(|source| ServerError::FaultSyntax { path: path.clone(), source: Box::new(source) })
        }
    }
}

/// Looks whether the file of faults has changed.
struct Watch {
    source: FaultSource,
    seed: u64,
    seen: Option<SystemTime>,
    look_at: Time,
}

impl Watch {
    fn new(source: FaultSource, seed: u64) -> Self {
        let mut watch = Self { source, seed, seen: None, look_at: Time::ZERO };
        watch.seen = watch.changed();
        watch
    }

    fn changed(&self) -> Option<SystemTime> {
        let FaultSource::File(path) = &self.source else { return None };
        std::fs::metadata(path).and_then(|metadata| metadata.modified()).ok()
    }

    /// The new faults, when there are any. A file that makes no sense changes nothing.
    fn look(&mut self, now: Time) -> Option<FaultMachine> {
        if now < self.look_at {
            return None;
        }
        self.look_at = now + FAULTS_LOOK;
        let changed = self.changed().filter(|at| self.seen != Some(*at))?;
        self.seen = Some(changed);
        match read(&self.source).and_then(|plan| Ok(FaultMachine::new(plan, self.seed)?)) {
            Ok(machine) => Some(machine),
            Err(error) => {
                tracing::warn!(%error, "the changed faults are refused; the old ones stay");
                None
            }
        }
    }
}

/// Receives commands, flies, answers.
fn fly(
    shared: &Shared,
    mut tello: VirtualTello,
    craft: &Mutex<SimCraft>,
    command: &UdpSocket,
    state: &UdpSocket,
    mut watch: Watch,
) {
    let mut buffer = [0; 2048];
    while shared.runs() {
        let nap = tello.next_deadline().since(shared.now()).clamp(Duration::from_millis(1), NAP);
        if command.set_read_timeout(Some(nap)).is_err() {
            return;
        }
        // Errors are those of earlier sendings (nobody listens there) or the timeout.
        if let Ok((length, from)) = command.recv_from(&mut buffer) {
            tello.handle(shared.now(), from, &buffer[..length]);
        }
        let now = shared.now();
        if let Some(faults) = watch.look(now) {
            *lock(&shared.faults) = faults;
        }
        tello.set_faults(shared.faults());
        tello.advance(now, &mut lock(craft));
        *lock(&shared.video) = tello.video();
        while let Some(output) = tello.poll(now) {
            let sent = match output {
                Output::Response { to, bytes } => command.send_to(&bytes, to),
                Output::State { to, bytes } => state.send_to(&bytes, to),
            };
            if let Err(error) = sent {
                tracing::debug!(%error, "not sent");
            }
        }
    }
}

/// Sends pictures when they are due, over the link with its faults.
fn send(shared: &Shared, due: &Receiver<Due>, video: &UdpSocket) {
    let mut link = Link::new(shared.faults());
    let mut waiting: Option<Due> = None;
    while shared.runs() {
        let now = shared.now();
        link.set_faults(shared.faults());
        if let Some((at, to, datagrams)) = waiting.take_if(|(at, ..)| *at <= now) {
            let Counters { frames, bytes, late, .. } = &shared.counters;
            frames.fetch_add(1, Ordering::Relaxed);
            late.fetch_add(u64::from(now.since(at) > LATE), Ordering::Relaxed);
            bytes.fetch_add(datagrams.iter().map(Vec::len).sum::<usize>() as u64, Ordering::Relaxed);
            for datagram in datagrams {
                link.send(now, Stream::Frames, to, &datagram);
            }
        }
        while let Some(packet) = link.take(now, |_| true) {
            drop(video.send_to(&packet.bytes, packet.peer));
        }
        let wake = waiting.as_ref().map(|(at, ..)| *at).into_iter().chain(link.next_at()).min();
        let nap = wake.map_or(NAP, |at| at.since(shared.now()).min(NAP));
        if waiting.is_some() {
            std::thread::sleep(nap);
        } else {
            match due.recv_timeout(nap) {
                Ok(taken) => waiting = Some(taken),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return,
            }
        }
    }
}

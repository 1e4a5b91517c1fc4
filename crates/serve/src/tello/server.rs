//! Sockets, clock and camera for a [`VirtualTello`].
//!
//! There are three threads: one receives commands and flies, one renders and encodes images ([`film`](super::film)),
//! one sends them when they are due.

use std::net::{SocketAddr, UdpSocket};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::sync::{Arc, Mutex};
use std::thread::{Builder, JoinHandle};
use std::time::Instant;

use spf_core::time::Duration;
use spf_sim::craft::SimCraft;

use super::error::ServerError;
use super::faults::{FaultSource, Watch, read};
use super::figures::{Firmware, ProtocolParameters};
use super::film::{Due, FrameRenderer, film};
use super::link::Link;
use super::machine::{Output, VirtualTello};
use super::pace::VideoQuality;
use super::shared::{Counters, POLL_INTERVAL, SendStats, Shared, lock};
use crate::fault::{FaultMachine, Stream};

/// Maximum number of images waiting to be sent.
const WAITING: usize = 16;
/// An image sent later than this counts as late.
const LATE: Duration = Duration::from_millis(50);

/// Longest command, bytes; longer datagrams are ignored.
const LONGEST_COMMAND: usize = 1024;

/// Configuration of a server.
pub struct Setup {
    /// The drone's address and command port (a Tello's is 8889).
    pub listen: SocketAddr,
    /// The craft. Only the server may advance it.
    pub craft: Arc<Mutex<SimCraft>>,
    /// Its camera.
    pub photographer: FrameRenderer,
    /// Video quality.
    pub quality: VideoQuality,
    /// Times and limits of the protocol.
    pub figures: ProtocolParameters,
    /// SDK version.
    pub firmware: Firmware,
    /// Faults.
    pub faults: FaultSource,
    /// Seed of all random choices.
    pub seed: u64,
    /// Latency from capture to sending: camera, encoder and radio.
    pub latency: Duration,
    /// Wall-clock time of the craft's time zero.
    pub start: Instant,
}

/// A running virtual Tello; it stops when dropped.
pub struct Server {
    address: SocketAddr,
    shared: Arc<Shared>,
    threads: Vec<JoinHandle<()>>,
}

impl Server {
    /// Opens the sockets and starts serving.
    ///
    /// # Errors
    /// [`ServerError`] if a socket cannot be bound, a thread cannot be started, or the faults are invalid.
    pub fn start(setup: Setup) -> Result<Self, ServerError> {
        let Setup { listen, craft, photographer, quality, figures, firmware, faults, seed, latency, start } = setup;
        let command = bind(listen)?;
        let address = command.local_addr().map_err(|source| ServerError::Bind { address: listen, source })?;
        // Clients identify state and video by the drone's address; the source port is arbitrary.
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

    /// The command address.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Transmission statistics.
    #[must_use]
    pub fn tally(&self) -> SendStats {
        let Counters { frames, bytes, late, wanted_ns } = &self.shared.counters;
        let get = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        SendStats { frames: get(frames), bytes: get(bytes), late: get(late), wanted_ns: get(wanted_ns) }
    }

    /// Sets new faults, as if the file had changed.
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

/// Receives commands, flies, responds.
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
        let nap = tello.next_deadline().since(shared.now()).clamp(Duration::from_millis(1), POLL_INTERVAL);
        if command.set_read_timeout(Some(nap)).is_err() {
            return;
        }
        // Errors are from earlier sends (nobody listens there) or the timeout.
        if let Ok((length, from)) = command.recv_from(&mut buffer)
            && length <= LONGEST_COMMAND
        {
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

/// Sends images when they are due, over the faulty link.
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
        let nap = wake.map_or(POLL_INTERVAL, |at| at.since(shared.now()).min(POLL_INTERVAL));
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

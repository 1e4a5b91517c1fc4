//! A Tello with its sockets and threads.

use std::net::{IpAddr, SocketAddr, UdpSocket};
use std::panic::AssertUnwindSafe;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{Builder, JoinHandle};
use std::time::Instant;

use spf_core::camera::Camera;
use spf_core::command::Command;
use spf_core::craft::Craft;
use spf_core::time::{Duration, Time};
use spf_envelope::Cleared;
use spf_media::h264::Decoder;
use spf_motion::estimator::TelemetryAccuracy;

use super::camera::{FrameDecoder, Lack, gather, watch};
use super::conversation::Order;
use super::inlet::Inlet;
use super::intake;
use super::link::{Link, MotionFault, Notice};
use super::opening::{ConnectError, Firmware, STATE_WAIT, bind, command_socket, enter, first_state, is_flying};
use super::settings::{TelloMotion, TelloSettings};
use super::state::State;
use super::video_link::video_socket;
use crate::abandon::{self, EmergencyLand};
use crate::frames::{FrameStore, Frames};
use crate::{Capabilities, Drone, DroneError, DroneEvent};

/// Maximum blocking time of the command and state sockets.
const POLL_INTERVAL: Duration = Duration::from_millis(5);
/// Maximum blocking time of the video socket.
const VIDEO_TIMEOUT: Duration = Duration::from_millis(50);
/// Time allowed for repetitions of `emergency` at shutdown, until the state shows the motors off.
const EMERGENCY_TIME: Duration = Duration::from_secs(5);
/// Maximum blocking time of sending a command: with a full send buffer it is lost, and repeated.
const SEND_TIME: Duration = Duration::from_millis(20);
/// Time allowed for a landing at shutdown: from 10 m at 0.5 m/s, and until the state shows the motors off.
const LANDING_TIME: Duration = Duration::from_secs(25);

/// A connected drone.
pub struct Connected {
    /// The drone.
    pub drone: Tello,
    /// Its first state.
    pub state: State,
    /// Its firmware.
    pub firmware: Firmware,
}

/// State shared by the threads.
struct Shared {
    link: Mutex<Link>,
    /// Held while sending, so that datagrams leave in the order in which the link returned them, and that no socket
    /// blocks whoever needs the link.
    sending: Mutex<()>,
    command: UdpSocket,
    start: Instant,
    stopped: AtomicBool,
}

impl Shared {
    fn now(&self) -> Time {
        Time::ZERO + self.start.elapsed()
    }

    fn link(&self) -> MutexGuard<'_, Link> {
        // The link is consistent between calls.
        self.link.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Sends pending commands.
    fn flush(&self) {
        let sending = self.sending.lock().unwrap_or_else(PoisonError::into_inner);
        let next = || self.link().poll(self.now());
        while let Some(text) = next() {
            tracing::trace!(%text, "to the drone");
            if let Err(error) = self.command.send(text.as_bytes()) {
                tracing::debug!(%error, %text, "not sent");
            }
        }
        drop(sending);
        let notice = || self.link().take_notice();
        while let Some(notice) = notice() {
            match notice {
                Notice::Refused { command, answer, meaning } => {
                    tracing::warn!("the drone replied `{answer}` to `{command}`: {meaning}");
                }
                Notice::Unanswered { command } => tracing::warn!("no reply from the drone to `{command}`"),
                Notice::Unsaid { command } => {
                    tracing::warn!("`{command}` was not sent: a reply to the previous command may still arrive");
                }
                Notice::MotorsOff => tracing::warn!("the drone seems to have stopped its motors; landing it"),
                Notice::NoTakeOff => tracing::warn!("no reply to `takeoff`, and the motors do not turn: take-off abandoned"),
                Notice::Unattended { landing: false } => tracing::error!("the flight loop was silent for 2 s: the drone hovers"),
                Notice::Unattended { landing: true } => tracing::error!("the flight loop was silent for 5 s: landing the drone"),
                Notice::Unheard => {
                    tracing::error!(
                        "no reply from the drone for 3 s: commands are not reaching it, so the link is treated as lost"
                    );
                }
                Notice::Motion(MotionFault::Unseen) => {
                    tracing::error!("the drone was told to fly 2 m and reports no speed: its position is unknown");
                }
                Notice::Motion(MotionFault::Adrift) => {
                    tracing::error!("the drone was told to hover, but reports that it is still moving");
                }
                Notice::Failed => tracing::error!("a part of the Tello driver failed: landing the drone"),
            }
        }
    }
}

impl EmergencyLand for Shared {
    /// However the program ends, `rc` is sticky, and an abandoned drone would fly on for 15 s.
    fn abandon(&self) {
        let now = self.now();
        self.link().leave(now);
        let begun = Instant::now();
        while self.link().is_airborne() {
            if begun.elapsed() >= LANDING_TIME {
                tracing::error!("the drone did not report a landing within {} s", LANDING_TIME.as_secs());
                return;
            }
            self.flush();
            std::thread::sleep(POLL_INTERVAL);
        }
    }
}

/// A Tello behind the [`Drone`] interface.
pub struct Tello {
    shared: Arc<Shared>,
    frames: FrameStore,
    firmware: Firmware,
    polled: Time,
    /// Whether its video was started.
    own_video: bool,
    threads: Vec<JoinHandle<()>>,
}

impl Tello {
    /// Connects to the Tello whose command port is at `drone`: SDK mode, state, and video unless the settings say otherwise. `start` is flight time zero.
    ///
    /// # Errors
    /// [`ConnectError`] if a port cannot be bound, the drone does not answer or refuses, or no state that can be read arrives.
    pub fn connect(drone: SocketAddr, settings: &TelloSettings, start: Instant) -> Result<Connected, ConnectError> {
        let TelloSettings { local, state_port, calibration, video_latency, .. } = *settings;
        let command = command_socket(local)?;
        let reach = |source| ConnectError::Unreachable { drone, source };
        command.connect(drone).map_err(reach)?;
        let state = bind(local, state_port, "state")?;
        let video = settings.own_video.then(|| video_socket(settings)).transpose()?;
        let timeouts = [(Some(&command), POLL_INTERVAL), (Some(&state), POLL_INTERVAL), (video.as_ref(), VIDEO_TIMEOUT)];
        for (socket, nap) in timeouts {
            socket.map_or(Ok(()), |socket| socket.set_read_timeout(Some(nap))).map_err(ConnectError::Start)?;
        }
        command.set_write_timeout(Some(SEND_TIME)).map_err(ConnectError::Start)?;
        let firmware = enter(&command, drone, &|| false)?;
        let first = first_state(&state, state_port, drone.ip(), STATE_WAIT)?;
        let mut link = Link::new(calibration);
        // A program that died may have left it in the air.
        if is_flying(&state, drone.ip(), &first) {
            link.adopt(Time::ZERO + start.elapsed());
        }
        if settings.own_video {
            link.order(Order::quick("streamon"));
        }
        let shared = Arc::new(Shared {
            link: Mutex::new(link),
            sending: Mutex::default(),
            command,
            start,
            stopped: AtomicBool::new(false),
        });
        abandon::register(&(shared.clone() as Arc<dyn EmergencyLand>));
        let frames = FrameStore::default();
        let mut tello = Self {
            shared: shared.clone(),
            frames: frames.clone(),
            firmware: firmware.clone(),
            polled: Time::ZERO,
            own_video: settings.own_video,
            threads: Vec::new(),
        };
        let (one, two) = (shared.clone(), shared.clone());
        tello.spawn("answers", move || answers(&one, drone.ip()))?;
        tello.spawn("state", move || states(&two, &state, drone.ip()))?;
        let Some(video) = video else { return Ok(Connected { drone: tello, state: first, firmware }) };
        let decoder = FrameDecoder::new(Decoder::new()?, video_latency);
        let (three, four, five, seen) = (shared.clone(), shared.clone(), shared, frames);
        let inlet = Arc::<Inlet>::default();
        let received = inlet.clone();
        tello.spawn("video", move || gather(&video, drone.ip(), &received, three.start, &three.stopped))?;
        // In flight by `go` the answer to `streamon` would delay the next move.
        let by_rc = settings.motion == TelloMotion::Rc;
        let lacks = move |lack| match lack {
            Lack::Video => four.link().ask_for_video(),
            Lack::KeyFrame if by_rc => four.link().ask_for_key_frame(),
            Lack::KeyFrame => {}
        };
        tello.spawn("frames", move || watch(&inlet, decoder, &seen, five.start, &five.stopped, lacks))?;
        Ok(Connected { drone: tello, state: first, firmware })
    }

    fn spawn(&mut self, name: &str, work: impl FnOnce() + Send + 'static) -> Result<(), ConnectError> {
        let shared = self.shared.clone();
        let guarded = move || {
            // A panic must not leave the drone with its last velocity. The message was printed where it happened.
            if std::panic::catch_unwind(AssertUnwindSafe(work)).is_err() {
                let now = shared.now();
                shared.link().fail(now);
                // This thread may have been the one that sends.
                while !shared.stopped.load(Ordering::Relaxed) {
                    shared.flush();
                    std::thread::sleep(POLL_INTERVAL);
                }
            }
        };
        self.threads.push(Builder::new().name(format!("tello {name}")).spawn(guarded).map_err(ConnectError::Start)?);
        Ok(())
    }

    /// Number of `rc` commands sent.
    #[must_use]
    pub fn rc_sent(&self) -> u64 {
        self.shared.link().rc_sent()
    }
}

impl Drop for Tello {
    fn drop(&mut self) {
        // A flight ends with the first `emergency`; the repetitions may be the ones that arrive.
        let begun = Instant::now();
        while self.shared.link().is_urgent() && begun.elapsed() < EMERGENCY_TIME {
            self.shared.flush();
            std::thread::sleep(POLL_INTERVAL);
        }
        self.shared.abandon();
        self.shared.stopped.store(true, Ordering::Relaxed);
        for thread in self.threads.drain(..) {
            drop(thread.join());
        }
        // Nobody is listening any more. A video that another program started goes on.
        if self.own_video {
            drop(self.shared.command.send(b"streamoff"));
        }
    }
}

impl Drone for Tello {
    fn name(&self) -> &str {
        "tello"
    }

    fn capabilities(&self) -> Capabilities {
        // Only SDK 2.0 and later have a command that ends a move.
        let manoeuvres = self.firmware.sdk.is_some();
        Capabilities { manoeuvres, ..Capabilities::of(Craft::tello(), Camera::tello(), TelemetryAccuracy::tello()) }
    }

    fn frames(&self) -> Arc<dyn Frames> {
        Arc::new(self.frames.clone())
    }

    fn apply(&mut self, _now: Time, command: &Cleared<Command>) -> Result<(), DroneError> {
        // Use the link's clock, not the loop's: a setpoint expires on time however late it arrives here.
        let now = self.shared.now();
        let mut link = self.shared.link();
        link.heartbeat(now);
        link.apply(now, command);
        drop(link);
        self.shared.flush();
        Ok(())
    }

    fn next_event(&mut self, until: Time) -> Option<(Time, DroneEvent)> {
        self.polled = until;
        let mut link = self.shared.link();
        link.heartbeat(self.shared.now());
        if let Some(event) = link.take_event() {
            return Some(event);
        }
        drop(link);
        let meta = self.frames.take_new_frame()?;
        Some((meta.received, DroneEvent::Frame(meta)))
    }

    /// Unknown for a real craft; it is polled at this interval.
    fn next_event_at(&self) -> Option<Time> {
        Some(self.polled + POLL_INTERVAL)
    }
}

fn answers(shared: &Shared, drone: IpAddr) {
    let mut buffer = [0; intake::BUFFER];
    while !shared.stopped.load(Ordering::Relaxed) {
        if let Some(datagram) = intake::receive(&shared.command, drone, intake::TEXT, &mut buffer) {
            shared.link().handle_answer(shared.now(), datagram);
        }
        shared.flush();
    }
}

fn states(shared: &Shared, socket: &UdpSocket, drone: IpAddr) {
    let mut buffer = [0; intake::BUFFER];
    while !shared.stopped.load(Ordering::Relaxed) {
        if let Some(datagram) = intake::receive(socket, drone, intake::TEXT, &mut buffer) {
            shared.link().handle_state(shared.now(), datagram);
        }
    }
}

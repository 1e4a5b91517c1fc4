//! A Tello with its sockets.

use std::io::ErrorKind;
use std::net::{IpAddr, Ipv4Addr, SocketAddr, UdpSocket};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{Builder, JoinHandle};
use std::time::Instant;

use spf_core::camera::Camera;
use spf_core::command::Command;
use spf_core::craft::Craft;
use spf_core::envelope::Cleared;
use spf_core::time::{Duration, Time};
use spf_media::h264::Decoder;

use super::answer::{Answer, explain};
use super::camera::{Eye, gather, watch};
use super::conversation::Order;
use super::inlet::Inlet;
use super::link::{Link, Notice};
use super::state::State;
use super::sticks::Calibration;
use crate::frames::{FrameStore, Frames};
use crate::{Capabilities, Drone, DroneError, DroneEvent};

/// The drone's command port, which clients bind too where they can: some firewalls let answers pass only there.
pub const COMMAND_PORT: u16 = 8889;
/// Sockets are looked at this often even when nothing comes.
const NAP: Duration = Duration::from_millis(5);
/// The video socket's.
const VIDEO_NAP: Duration = Duration::from_millis(50);
/// Room for the video of half a second and more, bytes.
const VIDEO_BUFFER: usize = 4 << 20;
/// What is urgent is said within this time.
const LAST_WORDS: Duration = Duration::from_millis(300);
const COMMAND_TRIES: u32 = 5;
const ANSWER_WAIT: Duration = Duration::from_secs(1);
const STATE_WAIT: Duration = Duration::from_secs(2);

/// Where a Tello is, and how it is flown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TelloSettings {
    /// The drone's command port.
    pub drone: SocketAddr,
    /// Our address; unspecified for any.
    pub local: IpAddr,
    /// Where its state comes to.
    pub state_port: u16,
    /// Where its video comes to.
    pub video_port: u16,
    /// What full stick does.
    pub calibration: Calibration,
    /// From the shutter to the last datagram.
    pub video_latency: Duration,
}

impl Default for TelloSettings {
    /// A Tello that is its own access point, as it comes out of the box.
    fn default() -> Self {
        Self {
            drone: SocketAddr::from(([192, 168, 10, 1], COMMAND_PORT)),
            local: IpAddr::V4(Ipv4Addr::UNSPECIFIED),
            state_port: 8890,
            video_port: 11_111,
            calibration: Calibration::default(),
            video_latency: Duration::from_millis(150),
        }
    }
}

/// Why there is no connection. Each says what to do.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ConnectError {
    /// A port of ours is taken.
    #[error("UDP port {port} of this machine cannot be had for the drone's {what}")]
    Port {
        /// Which.
        port: u16,
        /// What comes there.
        what: &'static str,
        /// Why.
        #[source]
        source: std::io::Error,
    },
    /// Nothing can be sent there.
    #[error("{drone} cannot be reached")]
    Unreachable {
        /// The drone.
        drone: SocketAddr,
        /// Why.
        #[source]
        source: std::io::Error,
    },
    /// Nobody answers.
    #[error("{drone} does not answer `command`")]
    NoAnswer {
        /// The drone.
        drone: SocketAddr,
    },
    /// It refuses.
    #[error("the drone answers `{answer}` to `{command}`: {meaning}")]
    Refused {
        /// What was said.
        command: &'static str,
        /// Its words.
        answer: String,
        /// What they mean.
        meaning: &'static str,
    },
    /// It answers commands, and its state does not arrive.
    #[error("the drone answers, but no state arrives on UDP port {port}")]
    NoState {
        /// Where it was waited for.
        port: u16,
    },
    /// No thread or decoder.
    #[error("the driver cannot be started")]
    Start(#[source] std::io::Error),
    /// No decoder.
    #[error(transparent)]
    Decoder(#[from] spf_media::h264::DecoderError),
}

/// A drone that answers.
pub struct Connected {
    /// The drone.
    pub drone: Tello,
    /// What it told of itself.
    pub state: State,
    /// What it says of its make.
    pub firmware: Firmware,
}

/// What a Tello says of its make. What a firmware does not know the question of is none.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Firmware {
    /// The SDK that it speaks (`sdk?`); none for 1.3, which does not know the question.
    pub sdk: Option<String>,
    /// Its serial number (`sn?`).
    pub serial: Option<String>,
    /// Its kind (`hardware?`), since SDK 3.0.
    pub hardware: Option<String>,
}

impl core::fmt::Display for Firmware {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "SDK {}", self.sdk.as_deref().unwrap_or("1.3"))?;
        if let Some(hardware) = &self.hardware {
            write!(f, ", {hardware}")?;
        }
        if let Some(serial) = &self.serial {
            write!(f, ", serial number {serial}")?;
        }
        Ok(())
    }
}

/// What the threads share.
struct Shared {
    link: Mutex<Link>,
    command: UdpSocket,
    start: Instant,
    stopped: AtomicBool,
}

impl Shared {
    fn now(&self) -> Time {
        Time::ZERO + self.start.elapsed()
    }

    fn link(&self) -> MutexGuard<'_, Link> {
        // The link is whole between its calls.
        self.link.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Sends what is due.
    fn flush(&self) {
        let mut link = self.link();
        while let Some(text) = link.poll(self.now()) {
            tracing::trace!(%text, "to the drone");
            if let Err(error) = self.command.send(text.as_bytes()) {
                tracing::debug!(%error, %text, "not sent");
            }
        }
        while let Some(notice) = link.take_notice() {
            match notice {
                Notice::Refused { command, answer, meaning } => {
                    tracing::warn!("the drone answers `{answer}` to `{command}`: {meaning}");
                }
                Notice::Unanswered { command } => tracing::warn!("the drone did not answer `{command}`"),
                Notice::Unsaid { command } => {
                    tracing::warn!("`{command}` was not said: an answer to what went before it may still come");
                }
                Notice::MotorsOff => tracing::warn!("the drone stopped its motors by itself"),
            }
        }
    }
}

/// A Tello behind the [`Drone`] interface.
pub struct Tello {
    shared: Arc<Shared>,
    frames: FrameStore,
    polled: Time,
    threads: Vec<JoinHandle<()>>,
}

impl Tello {
    /// Connects: SDK mode, state, video. `start` is when flight time was zero.
    ///
    /// # Errors
    /// [`ConnectError`].
    pub fn connect(settings: &TelloSettings, start: Instant) -> Result<Connected, ConnectError> {
        let TelloSettings { drone, local, state_port, video_port, calibration, video_latency } = *settings;
        let command = command_socket(local)?;
        let reach = |source| ConnectError::Unreachable { drone, source };
        command.connect(drone).map_err(reach)?;
        let state = bind(local, state_port, "state")?;
        let video = bind(local, video_port, "video")?;
        // A small buffer loses video whenever this machine is busy; a system that gives less is told of nowhere else.
        if let Err(error) = socket2::SockRef::from(&video).set_recv_buffer_size(VIDEO_BUFFER) {
            tracing::debug!(%error, "the video's buffer stays small");
        }
        let timeouts = [(&command, NAP), (&state, NAP), (&video, VIDEO_NAP)];
        for (socket, nap) in timeouts {
            socket.set_read_timeout(Some(nap)).map_err(ConnectError::Start)?;
        }
        let firmware = enter(&command, drone)?;
        let first = first_state(&state, drone.ip()).ok_or(ConnectError::NoState { port: state_port })?;
        let mut link = Link::new(calibration);
        link.order(Order::quick("streamon"));
        let shared = Arc::new(Shared { link: Mutex::new(link), command, start, stopped: AtomicBool::new(false) });
        let frames = FrameStore::default();
        let mut tello = Self { shared: shared.clone(), frames: frames.clone(), polled: Time::ZERO, threads: Vec::new() };
        let eye = Eye::new(Decoder::new()?, video_latency);
        let (one, two, three, four, seen) = (shared.clone(), shared.clone(), shared.clone(), shared, frames);
        let inlet = Arc::<Inlet>::default();
        let received = inlet.clone();
        tello.spawn("answers", move || answers(&one))?;
        tello.spawn("state", move || states(&two, &state, drone.ip()))?;
        tello.spawn("video", move || gather(&video, drone.ip(), &received, three.start, &three.stopped))?;
        tello.spawn("pictures", move || watch(&inlet, eye, &seen, &four.stopped, || four.link().ask_for_video()))?;
        Ok(Connected { drone: tello, state: first, firmware })
    }

    fn spawn(&mut self, name: &str, work: impl FnOnce() + Send + 'static) -> Result<(), ConnectError> {
        self.threads.push(Builder::new().name(format!("tello {name}")).spawn(work).map_err(ConnectError::Start)?);
        Ok(())
    }

    /// How many `rc` were sent.
    #[must_use]
    pub fn rc_sent(&self) -> u64 {
        self.shared.link().rc_sent()
    }
}

impl Drop for Tello {
    fn drop(&mut self) {
        // A flight ends with the first `emergency`; the others may be the ones that arrive.
        let begun = Instant::now();
        while self.shared.link().is_urgent() && begun.elapsed() < LAST_WORDS {
            self.shared.flush();
            std::thread::sleep(NAP);
        }
        self.shared.stopped.store(true, Ordering::Relaxed);
        for thread in self.threads.drain(..) {
            drop(thread.join());
        }
        // Nobody listens any more.
        drop(self.shared.command.send(b"streamoff"));
    }
}

impl Drone for Tello {
    fn name(&self) -> &str {
        "tello"
    }

    fn capabilities(&self) -> Capabilities {
        Capabilities { craft: Craft::tello(), camera: Camera::tello() }
    }

    fn frames(&self) -> Arc<dyn Frames> {
        Arc::new(self.frames.clone())
    }

    fn apply(&mut self, _now: Time, command: &Cleared<Command>) -> Result<(), DroneError> {
        // The link's clock, not the loop's: a setpoint's validity ends on time however late it comes here.
        self.shared.link().apply(self.shared.now(), command);
        self.shared.flush();
        Ok(())
    }

    fn next_event(&mut self, until: Time) -> Option<(Time, DroneEvent)> {
        self.polled = until;
        if let Some(event) = self.shared.link().take_event() {
            return Some(event);
        }
        let meta = self.frames.take_news()?;
        Some((meta.received, DroneEvent::Frame(meta)))
    }

    /// What it tells comes when it comes; it is looked at this often.
    fn next_event_at(&self) -> Option<Time> {
        Some(self.polled + NAP)
    }
}

fn command_socket(local: IpAddr) -> Result<UdpSocket, ConnectError> {
    match UdpSocket::bind((local, COMMAND_PORT)) {
        Err(error) if error.kind() == ErrorKind::AddrInUse => bind(local, 0, "answers"),
        Err(source) => Err(ConnectError::Port { port: COMMAND_PORT, what: "answers", source }),
        Ok(socket) => Ok(socket),
    }
}

fn bind(local: IpAddr, port: u16, what: &'static str) -> Result<UdpSocket, ConnectError> {
    UdpSocket::bind((local, port)).map_err(|source| ConnectError::Port { port, what, source })
}

/// Waits for a datagram for at most `wait`.
fn receive(socket: &UdpSocket, wait: Duration, mut accept: impl FnMut(&[u8], SocketAddr) -> bool) -> bool {
    let (begun, mut buffer) = (Instant::now(), [0; 2048]);
    while begun.elapsed() < wait {
        if let Ok((length, from)) = socket.recv_from(&mut buffer)
            && accept(&buffer[..length], from)
        {
            return true;
        }
    }
    false
}

/// Enters SDK mode; who it is.
fn enter(socket: &UdpSocket, drone: SocketAddr) -> Result<Firmware, ConnectError> {
    for _ in 0..COMMAND_TRIES {
        socket.send(b"command").map_err(|source| ConnectError::Unreachable { drone, source })?;
        let mut answer = Answer::Noise;
        receive(socket, ANSWER_WAIT, |bytes, _| {
            answer = Answer::read(bytes);
            matches!(answer, Answer::Ok | Answer::Refused(_))
        });
        match answer {
            Answer::Ok => return Ok(ask_firmware(socket)),
            Answer::Refused(answer) => {
                let meaning = explain(&answer);
                return Err(ConnectError::Refused { command: "command", answer, meaning });
            }
            // The app's binary protocol, or silence: once more.
            _ => {}
        }
    }
    Err(ConnectError::NoAnswer { drone })
}

/// The first SDK knows none of these questions, and only the third the last.
fn ask_firmware(socket: &UdpSocket) -> Firmware {
    let sdk = ask(socket, "sdk?");
    let serial = sdk.as_ref().and_then(|_| ask(socket, "sn?"));
    let third = sdk.as_ref().and_then(|sdk| sdk.parse().ok()).is_some_and(|sdk: u32| sdk >= 30);
    let hardware = if third { ask(socket, "hardware?") } else { None };
    Firmware { sdk, serial, hardware }
}

/// The answer to a question, before the conversation begins.
fn ask(socket: &UdpSocket, question: &str) -> Option<String> {
    // Second answers to what was said before pass by.
    receive(socket, super::conversation::SPACING, |_, _| false);
    socket.send(question.as_bytes()).ok()?;
    let mut told = None;
    receive(socket, ANSWER_WAIT, |bytes, _| match Answer::read(bytes) {
        Answer::Value(value) => {
            told = Some(value);
            true
        }
        Answer::Refused(_) => true,
        _ => false,
    });
    told
}

fn first_state(socket: &UdpSocket, drone: IpAddr) -> Option<State> {
    let mut first = None;
    receive(socket, STATE_WAIT, |bytes, from| {
        first = State::read(bytes).filter(|_| from.ip() == drone);
        first.is_some()
    });
    first
}

fn answers(shared: &Shared) {
    let mut buffer = [0; 2048];
    while !shared.stopped.load(Ordering::Relaxed) {
        // Errors are those of earlier sendings, or the timeout.
        if let Ok(length) = shared.command.recv(&mut buffer) {
            shared.link().handle_answer(shared.now(), &buffer[..length]);
        }
        shared.flush();
    }
}

fn states(shared: &Shared, socket: &UdpSocket, drone: IpAddr) {
    let mut buffer = [0; 2048];
    while !shared.stopped.load(Ordering::Relaxed) {
        if let Ok((length, from)) = socket.recv_from(&mut buffer)
            && from.ip() == drone
        {
            shared.link().handle_state(shared.now(), &buffer[..length]);
        }
    }
}

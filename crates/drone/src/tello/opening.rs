//! Connecting to a Tello: sockets, SDK mode, firmware and first state.

use std::io::ErrorKind;
use std::net::{IpAddr, SocketAddr, UdpSocket};
use std::time::Instant;

use spf_core::time::{Duration, Time};

use super::answer::{Answer, explain};
use super::conversation::SPACING;
use super::ground::{ABOVE_GROUND, Ground, Place, Repeats};
use super::intake;
use super::settings::COMMAND_PORT;
use super::state::State;

const COMMAND_TRIES: u32 = 5;
const ANSWER_WAIT: Duration = Duration::from_secs(1);
/// Maximum wait for the answer to `command`, with which a connection begins.
pub const COMMAND_WAIT: Duration = Duration::from_secs(COMMAND_TRIES as u64 * ANSWER_WAIT.as_secs());
/// Maximum wait for the first state line.
pub const STATE_WAIT: Duration = Duration::from_secs(2);
/// Long enough to see the motor time advance, which counts seconds.
const MOTOR_WAIT: Duration = Duration::from_millis(2300);

/// Why the connection failed. The driver adds a remedy.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ConnectError {
    /// A local port cannot be bound.
    #[error("cannot bind UDP port {port} for Tello {what}")]
    Port {
        /// The port.
        port: u16,
        /// Its purpose.
        what: &'static str,
        /// The cause.
        #[source]
        source: std::io::Error,
    },
    /// The drone's address cannot be reached.
    #[error("cannot reach {drone}")]
    Unreachable {
        /// The drone.
        drone: SocketAddr,
        /// The cause.
        #[source]
        source: std::io::Error,
    },
    /// The drone does not answer.
    #[error("no reply from {drone} to `command`")]
    NoAnswer {
        /// The drone.
        drone: SocketAddr,
    },
    /// The drone refuses a command.
    #[error("the drone replied `{answer}` to `{command}`: {meaning}")]
    Refused {
        /// The command.
        command: &'static str,
        /// Its response.
        answer: String,
        /// Explanation of the response.
        meaning: &'static str,
    },
    /// The drone answers commands, but its state does not arrive.
    #[error("the drone replies, but no state arrives on UDP port {port}")]
    NoState {
        /// The state port.
        port: u16,
    },
    /// What the drone sends as its state is no state that can be read.
    #[error("{count} datagrams of the drone arrived on UDP port {port}, but none is a state that can be read")]
    UnreadState {
        /// The state port.
        port: u16,
        /// How many came.
        count: u32,
    },
    /// Another program of this machine receives its state, so that it flies it, or watches it.
    #[error("another program flies this Tello or watches it: UDP port {port} is in use")]
    InUse {
        /// The state port.
        port: u16,
    },
    /// It is in the air, or its motors turn.
    #[error("this Tello flies, and each command would restart its timer, which lands it 15 s after the last one")]
    Flies,
    /// A thread could not be started.
    #[error("cannot start the driver")]
    Start(#[source] std::io::Error),
    /// The video decoder could not be created.
    #[error(transparent)]
    Decoder(#[from] spf_media::h264::DecoderError),
}

/// Identification of a Tello. Values that its firmware does not provide are `None`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Firmware {
    /// SDK version (`sdk?`); `None` for 1.3, which lacks the command.
    pub sdk: Option<String>,
    /// Serial number (`sn?`).
    pub serial: Option<String>,
    /// Hardware model (`hardware?`), since SDK 3.0.
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

/// The local command socket, on any port if the usual one is taken.
pub(super) fn command_socket(local: IpAddr) -> Result<UdpSocket, ConnectError> {
    match UdpSocket::bind((local, COMMAND_PORT)) {
        Err(error) if error.kind() == ErrorKind::AddrInUse => bind(local, 0, "answers"),
        Err(source) => Err(ConnectError::Port { port: COMMAND_PORT, what: "answers", source }),
        Ok(socket) => Ok(socket),
    }
}

/// Binds a local port.
pub(super) fn bind(local: IpAddr, port: u16, what: &'static str) -> Result<UdpSocket, ConnectError> {
    UdpSocket::bind((local, port)).map_err(|source| ConnectError::Port { port, what, source })
}

/// Waits up to `wait` for a datagram of the drone.
pub(super) fn receive(socket: &UdpSocket, drone: IpAddr, wait: Duration, mut accept: impl FnMut(&[u8]) -> bool) -> bool {
    let (begun, mut buffer) = (Instant::now(), [0; intake::BUFFER]);
    while begun.elapsed() < wait {
        if intake::receive(socket, drone, intake::TEXT, &mut buffer).is_some_and(&mut accept) {
            return true;
        }
    }
    false
}

/// Enters SDK mode and identifies the drone, unless `stopped` becomes true.
pub(super) fn enter(socket: &UdpSocket, drone: SocketAddr, stopped: &dyn Fn() -> bool) -> Result<Firmware, ConnectError> {
    for _ in 0..COMMAND_TRIES {
        if stopped() {
            break;
        }
        socket.send(b"command").map_err(|source| ConnectError::Unreachable { drone, source })?;
        let mut answer = Answer::Noise;
        receive(socket, drone.ip(), ANSWER_WAIT, |bytes| {
            answer = Answer::read(bytes);
            matches!(answer, Answer::Ok | Answer::Refused(_))
        });
        match answer {
            Answer::Ok => return Ok(ask_firmware(socket, drone.ip())),
            Answer::Refused(answer) => {
                let meaning = explain(&answer);
                return Err(ConnectError::Refused { command: "command", answer, meaning });
            }
            // The app's binary protocol, or silence: try again.
            _ => {}
        }
    }
    Err(ConnectError::NoAnswer { drone })
}

/// SDK 1.3 supports none of these commands, and only SDK 3.0 the last.
fn ask_firmware(socket: &UdpSocket, drone: IpAddr) -> Firmware {
    let sdk = ask(socket, drone, "sdk?");
    let serial = sdk.as_ref().and_then(|_| ask(socket, drone, "sn?"));
    let third = sdk.as_ref().and_then(|sdk| sdk.parse().ok()).is_some_and(|sdk: u32| sdk >= 30);
    let hardware = if third { ask(socket, drone, "hardware?") } else { None };
    Firmware { sdk, serial, hardware }
}

/// The response to a read command, before the command channel is started.
fn ask(socket: &UdpSocket, drone: IpAddr, question: &str) -> Option<String> {
    // Discard late responses to earlier commands.
    receive(socket, drone, SPACING, |_| false);
    socket.send(question.as_bytes()).ok()?;
    let mut latest = None;
    receive(socket, drone, ANSWER_WAIT, |bytes| match Answer::read(bytes) {
        Answer::Value(value) => {
            latest = Some(value);
            true
        }
        Answer::Refused(_) => true,
        _ => false,
    });
    latest
}

/// The first state line of the drone within this time, on the socket of this port.
///
/// # Errors
/// [`ConnectError::NoState`] if nothing arrives, and [`ConnectError::UnreadState`] if nothing that arrives is a state line.
pub(super) fn first_state(socket: &UdpSocket, port: u16, drone: IpAddr, wait: Duration) -> Result<State, ConnectError> {
    let (mut first, mut count) = (None, 0);
    receive(socket, drone, wait, |bytes| {
        first = State::read(bytes);
        count += 1;
        first.is_some()
    });
    first.ok_or(if count == 0 { ConnectError::NoState { port } } else { ConnectError::UnreadState { port, count } })
}

/// Where the drone is, by its first state line and those of this time at most; it returns as soon as they tell.
pub(super) fn place(socket: &UdpSocket, drone: IpAddr, first: &State, wait: Duration) -> Place {
    let (begun, mut ground, mut repeats) = (Instant::now(), Ground::default(), Repeats::default());
    ground.observe(Time::ZERO, first);
    if ground.place() == Place::Unknown {
        receive(socket, drone, wait, |bytes| {
            let now = Time::ZERO + begun.elapsed();
            if let Some(state) = State::read(bytes).filter(|_| !repeats.is_stale(now, bytes)) {
                ground.observe(now, &state);
            }
            ground.place() != Place::Unknown
        });
    }
    ground.place()
}

/// Whether the drone is in the air: it is above the ground and its motors turn. One that is held in a hand is above the
/// ground too.
pub(super) fn is_flying(socket: &UdpSocket, drone: IpAddr, first: &State) -> bool {
    let above = first.height.max(first.tof).is_some_and(|cm| cm >= ABOVE_GROUND);
    above && place(socket, drone, first, MOTOR_WAIT) == Place::Airborne
}

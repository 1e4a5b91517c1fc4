//! The first words with a Tello: its sockets, SDK mode, its make and its first state, before the conversation begins.

use std::io::ErrorKind;
use std::net::{IpAddr, SocketAddr, UdpSocket};
use std::time::Instant;

use spf_core::time::Duration;

use super::answer::{Answer, explain};
use super::conversation::SPACING;
use super::settings::COMMAND_PORT;
use super::state::State;

const COMMAND_TRIES: u32 = 5;
const ANSWER_WAIT: Duration = Duration::from_secs(1);
const STATE_WAIT: Duration = Duration::from_secs(2);

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

/// Our end of the command port, or any port where that is taken.
pub(super) fn command_socket(local: IpAddr) -> Result<UdpSocket, ConnectError> {
    match UdpSocket::bind((local, COMMAND_PORT)) {
        Err(error) if error.kind() == ErrorKind::AddrInUse => bind(local, 0, "answers"),
        Err(source) => Err(ConnectError::Port { port: COMMAND_PORT, what: "answers", source }),
        Ok(socket) => Ok(socket),
    }
}

/// A port of ours.
pub(super) fn bind(local: IpAddr, port: u16, what: &'static str) -> Result<UdpSocket, ConnectError> {
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
pub(super) fn enter(socket: &UdpSocket, drone: SocketAddr) -> Result<Firmware, ConnectError> {
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
    receive(socket, SPACING, |_, _| false);
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

/// The first state line of the drone.
pub(super) fn first_state(socket: &UdpSocket, drone: IpAddr) -> Option<State> {
    let mut first = None;
    receive(socket, STATE_WAIT, |bytes, from| {
        first = State::read(bytes).filter(|_| from.ip() == drone);
        first.is_some()
    });
    first
}

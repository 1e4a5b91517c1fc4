//! One connection to a simulator: calls and their answers, over a blocking socket.

use std::io::{ErrorKind, Read as _, Write as _};
use std::net::{TcpStream, ToSocketAddrs as _};
use std::time::{Duration, Instant};

use super::address::Address;
use super::control::NUMBERS;
use super::wire::{Decoder, FrameError, Limits, Message, Raw, ReadError};

/// How long a connection may take.
const CONNECT_WAIT: Duration = Duration::from_secs(3);
/// How long a call may take to be sent: a simulator that reads nothing is treated like one that has gone.
const SEND_WAIT: Duration = Duration::from_millis(500);
const BUFFER: usize = 1 << 16;

/// Why a call has no result.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RpcError {
    /// There is no connection.
    #[error("cannot connect to {server}")]
    Unreachable {
        /// Host and port.
        server: String,
        /// The operating system's error.
        #[source]
        source: std::io::Error,
    },
    /// The connection has ended.
    #[error("the connection to {server} has ended")]
    Ended {
        /// Host and port.
        server: String,
        /// The operating system's error; `None` if the other side has closed it.
        #[source]
        source: Option<std::io::Error>,
    },
    /// What arrives is no msgpack-rpc.
    #[error("what {server} sends cannot be read")]
    Frame {
        /// Host and port.
        server: String,
        /// What was wrong.
        #[source]
        source: FrameError,
    },
    /// No answer came in time.
    #[error("`{method}` was not answered within {} s", .wait.as_secs_f64())]
    TimedOut {
        /// The call.
        method: &'static str,
        /// How long it was waited for.
        wait: Duration,
    },
    /// The simulator answered with an error.
    #[error("`{method}`: {text}")]
    Refused {
        /// The call.
        method: &'static str,
        /// Its text, of bounded length.
        text: String,
    },
    /// The answer is not of the form that it should have.
    #[error("the answer to `{method}` cannot be read")]
    Unreadable {
        /// The call.
        method: &'static str,
        /// What was wrong.
        #[source]
        source: ReadError,
    },
}

impl RpcError {
    /// Whether the connection can be used on.
    pub(super) fn is_of_call(&self) -> bool {
        matches!(self, Self::TimedOut { .. } | Self::Refused { .. } | Self::Unreadable { .. })
    }
}

/// An answer, with the number of its call.
pub(super) type Numbered<T, E> = (u32, Result<T, E>);

/// A connection.
pub(super) struct Rpc {
    stream: TcpStream,
    server: String,
    decoder: Decoder,
    next: u32,
    buffer: Vec<u8>,
}

impl Rpc {
    /// Connects to a simulator.
    pub(super) fn connect(address: &Address) -> Result<Self, RpcError> {
        let server = address.server();
        let unreachable = |source| RpcError::Unreachable { server: server.clone(), source };
        let mut last = std::io::Error::new(ErrorKind::NotFound, "the name has no address");
        for at in (address.host.as_str(), address.port).to_socket_addrs().map_err(unreachable)? {
            match TcpStream::connect_timeout(&at, CONNECT_WAIT) {
                Ok(stream) => {
                    let set = stream.set_nodelay(true).and_then(|()| stream.set_write_timeout(Some(SEND_WAIT)));
                    set.map_err(unreachable)?;
                    let decoder = Decoder::new(Limits::RESPONSES);
                    return Ok(Self { stream, server, decoder, next: 0, buffer: vec![0; BUFFER] });
                }
                Err(error) => last = error,
            }
        }
        Err(unreachable(last))
    }

    /// Sends a call with this number, whose answer [`receive`](Self::receive) returns.
    pub(super) fn send(&mut self, number: u32, method: &str, params: Vec<Raw>) -> Result<(), RpcError> {
        let bytes = Message::request(number, method, params).encode();
        self.stream.write_all(&bytes).map_err(|error| self.ended(Some(error)))
    }

    /// The next answer, with the number of its call; `None` if none comes within `wait`, which must not be zero.
    pub(super) fn receive(&mut self, wait: Duration) -> Result<Option<Numbered<Raw, Raw>>, RpcError> {
        let until = Instant::now() + wait;
        let mut late = false;
        loop {
            loop {
                match self.decoder.next_message() {
                    Ok(Some(Message::Response { id, outcome })) => return Ok(Some((id, outcome))),
                    // A simulator asks nothing of its clients.
                    Ok(Some(_)) if Instant::now() >= until => return Ok(None),
                    Ok(Some(_)) => {}
                    // Bytes that keep coming without an end are no answer in time.
                    Ok(None) if late => return Ok(None),
                    Ok(None) => break,
                    Err(source) => return Err(RpcError::Frame { server: self.server.clone(), source }),
                }
            }
            let left = until.saturating_duration_since(Instant::now()).max(Duration::from_micros(100));
            self.stream.set_read_timeout(Some(left)).map_err(|error| self.ended(Some(error)))?;
            match self.stream.read(&mut self.buffer) {
                Ok(0) => return Err(self.ended(None)),
                Ok(length) => {
                    self.decoder.push(&self.buffer[..length]);
                    late = Instant::now() >= until;
                }
                Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                    if Instant::now() >= until {
                        return Ok(None);
                    }
                }
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(self.ended(Some(error))),
            }
        }
    }

    /// Calls a method and waits for its result. Answers to earlier calls, which were given up, are skipped.
    pub(super) fn call(&mut self, method: &'static str, params: Vec<Raw>, wait: Duration) -> Result<Raw, RpcError> {
        const LONGEST_TEXT: usize = 500;
        let number = self.next;
        self.next = (number + 1) % NUMBERS;
        self.send(number, method, params)?;
        let until = Instant::now() + wait;
        loop {
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Err(RpcError::TimedOut { method, wait });
            }
            match self.receive(left)? {
                Some((answered, outcome)) if answered == number => {
                    return outcome
                        .map_err(|error| RpcError::Refused { method, text: error.text().chars().take(LONGEST_TEXT).collect() });
                }
                Some(_) | None => {}
            }
        }
    }

    fn ended(&self, source: Option<std::io::Error>) -> RpcError {
        RpcError::Ended { server: self.server.clone(), source }
    }
}

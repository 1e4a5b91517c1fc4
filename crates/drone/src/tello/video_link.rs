//! The video of a Tello without a pilot, for a program that only looks. Nothing here moves the drone. As any command does, those that
//! start the video and request a key frame restart its own timer, which lands it 15 s after the last command.

use std::net::{SocketAddr, UdpSocket};
use std::time::Instant;

use spf_core::time::Duration;

use super::answer::{Answer, explain};
use super::intake;
use super::opening::{ConnectError, bind, command_socket, enter, receive};
use super::settings::TelloSettings;

/// Receive buffer for more than half a second of video, bytes.
pub(super) const VIDEO_BUFFER: usize = 4 << 20;
/// Tries to start the video, and how long each is answered.
const TRIES: u32 = 3;
const ANSWER_WAIT: Duration = Duration::from_secs(1);
/// Timeout of the sockets.
const POLL_INTERVAL: Duration = Duration::from_millis(20);
/// Interval between requests for a key frame.
const REQUEST_INTERVAL: Duration = Duration::from_millis(500);
const START: &[u8] = b"streamon";

/// A Tello that sends its video.
pub struct VideoLink {
    command: UdpSocket,
    video: UdpSocket,
    drone: SocketAddr,
    requested: Instant,
    buffer: [u8; intake::BUFFER],
}

impl VideoLink {
    /// Enters SDK mode and starts the video.
    ///
    /// # Errors
    /// [`ConnectError`] if the drone cannot be reached or refuses, or if another program uses the port of the video.
    pub fn connect(drone: SocketAddr, settings: &TelloSettings) -> Result<Self, ConnectError> {
        let video = video_socket(settings)?;
        video.set_read_timeout(Some(POLL_INTERVAL)).map_err(ConnectError::Start)?;
        let command = command_socket(settings.local)?;
        command.connect(drone).map_err(|source| ConnectError::Unreachable { drone, source })?;
        command.set_read_timeout(Some(POLL_INTERVAL)).map_err(ConnectError::Start)?;
        enter(&command, drone)?;
        for _ in 0..TRIES {
            command.send(START).map_err(|source| ConnectError::Unreachable { drone, source })?;
            let mut answer = Answer::Noise;
            receive(&command, drone.ip(), ANSWER_WAIT, |bytes| {
                answer = Answer::read(bytes);
                matches!(answer, Answer::Ok | Answer::Refused(_))
            });
            match answer {
                Answer::Ok => {
                    return Ok(Self { command, video, drone, requested: Instant::now(), buffer: [0; intake::BUFFER] });
                }
                Answer::Refused(answer) => {
                    let meaning = explain(&answer);
                    return Err(ConnectError::Refused { command: "streamon", answer, meaning });
                }
                _ => {}
            }
        }
        Err(ConnectError::NoAnswer { drone })
    }

    /// The next datagram of the video; `None` if none came for a moment.
    pub fn receive(&mut self) -> Option<&[u8]> {
        intake::receive(&self.video, self.drone.ip(), intake::VIDEO, &mut self.buffer)
    }

    /// Requests a key frame after a loss, as [`Tello`](super::Tello) does, at most twice a second.
    pub fn request_key_frame(&mut self) {
        if self.requested.elapsed() >= REQUEST_INTERVAL {
            self.requested = Instant::now();
            // One that is lost is followed by another.
            drop(self.command.send(START));
        }
    }
}

impl Drop for VideoLink {
    fn drop(&mut self) {
        // Nobody is listening any more.
        drop(self.command.send(b"streamoff"));
    }
}

/// The local socket of the video.
pub(super) fn video_socket(settings: &TelloSettings) -> Result<UdpSocket, ConnectError> {
    let video = bind(settings.local, settings.video_port, "video")?;
    // A small buffer loses video when this machine is busy; a system that grants less reports it nowhere else.
    if let Err(error) = socket2::SockRef::from(&video).set_recv_buffer_size(VIDEO_BUFFER) {
        tracing::debug!(%error, "cannot enlarge the receive buffer of the video socket");
    }
    Ok(video)
}

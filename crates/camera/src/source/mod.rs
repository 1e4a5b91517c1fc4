//! Where images come from. Each source receives until it is stopped or fails.

pub(crate) mod file;
mod http;
mod rtsp;
mod udp;

use std::future::Future;
use std::time::Duration;

use crate::address::CameraUrl;
use crate::feed::Feed;
use crate::film::FilmError;

/// Why a source failed. The texts contain neither passwords nor addresses.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub(crate) enum SourceError {
    /// The connection was closed.
    #[error("the camera closed the connection")]
    Ended,
    /// Nothing arrives.
    #[error("no images for {0} s")]
    Silent(u64),
    /// The socket at which packets are to arrive.
    #[error("cannot receive at {address}: {error}")]
    Socket {
        /// Address of this machine, or a multicast group.
        address: std::net::SocketAddr,
        /// The operating system's error.
        error: std::io::Error,
    },
    /// Another codec.
    #[error("the video is {0}, which cannot be decoded: set the camera to H.264 or MJPEG")]
    Codec(String),
    /// Not a stream of images.
    #[error("the server sends `{0}`, not a stream of JPEG images")]
    NoImages(String),
    /// The server's answer.
    #[error("the server answers {0}")]
    Status(String),
    /// User name or password.
    #[error("the server refuses the user name or the password")]
    Refused,
    /// The connection.
    #[error("{0}")]
    Connection(String),
    /// A file that cannot be read.
    #[error("cannot read the video: {0}")]
    File(std::io::Error),
    /// A file that cannot be decoded.
    #[error(transparent)]
    Film(#[from] FilmError),
}

/// Receives from a camera until it is stopped.
pub(crate) fn run(url: &CameraUrl, feed: &mut Feed) -> Result<(), SourceError> {
    match url {
        CameraUrl::UdpRtp(address) => udp::rtp(*address, feed),
        CameraUrl::UdpTs(address) => udp::ts(*address, feed),
        CameraUrl::Mjpeg(server) => http::mjpeg(server, feed),
        CameraUrl::Rtsp { server, transport } => rtsp::receive(server, *transport, feed),
        // It is played, not received.
        CameraUrl::File(_) => Ok(()),
    }
}

/// Longest pause of a connection. A camera that sends nothing for this long is connected anew.
const SILENCE: Duration = Duration::from_secs(5);
/// Interval at which it is checked whether to stop.
const POLL_INTERVAL: Duration = Duration::from_millis(50);

/// A runtime for one connection.
fn runtime() -> Result<tokio::runtime::Runtime, SourceError> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
    runtime.map_err(|error| SourceError::Connection(error.to_string()))
}

/// Waits for a result: `None` if the camera was stopped, `Some(None)` if nothing came within `time`.
async fn unless_stopped<T>(feed: &Feed, work: impl Future<Output = T>, time: Duration) -> Option<Option<T>> {
    let mut work = std::pin::pin!(work);
    let deadline = tokio::time::Instant::now() + time;
    loop {
        match tokio::time::timeout(POLL_INTERVAL, &mut work).await {
            Ok(result) => return Some(Some(result)),
            Err(_) if feed.stopped() => return None,
            Err(_) if tokio::time::Instant::now() >= deadline => return Some(None),
            Err(_) => {}
        }
    }
}

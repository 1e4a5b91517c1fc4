//! Where images come from. Each source receives until it is stopped or fails.

pub(crate) mod file;
mod http;
mod rtsp;
mod udp;

use std::future::Future;
use std::time::Duration;

use crate::address::CameraUrl;
use crate::failure::SourceError;
use crate::feed::Feed;

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

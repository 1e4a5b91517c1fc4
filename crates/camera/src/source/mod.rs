//! Where images come from. Each source receives until it is stopped or fails.

pub(crate) mod file;
#[cfg(feature = "gstreamer")]
mod gstreamer;
mod http;
mod rtsp;
mod tello;
mod udp;
// The library knows the kernel's structures as these processors lay them out.
#[cfg(all(target_os = "linux", any(target_arch = "x86_64", target_arch = "aarch64", target_arch = "riscv64")))]
mod v4l2;
#[cfg(not(all(target_os = "linux", any(target_arch = "x86_64", target_arch = "aarch64", target_arch = "riscv64"))))]
mod v4l2 {
    //! Elsewhere.

    use crate::address::LocalCamera;
    use crate::failure::SourceError;
    use crate::feed::Feed;

    /// What is known of a camera between two connections.
    #[derive(Default)]
    pub(crate) struct Known;

    pub(super) fn receive(_: &LocalCamera, _: &mut Known, _: &mut Feed) -> Result<(), SourceError> {
        Err(SourceError::Missing(
            "v4l2: cameras are read on Linux with 64 bits only; let ffmpeg or GStreamer send the camera (docs/guide/cameras.md)",
        ))
    }
}

use std::future::Future;
use std::time::Duration;

use spf_drone::tello::TelloSettings;

use crate::address::CameraUrl;
use crate::failure::SourceError;
use crate::feed::Feed;

pub(crate) use v4l2::Known;

/// Receives from a camera until it is stopped. A local camera that was opened before is `known`.
pub(crate) fn run(url: &CameraUrl, settings: &TelloSettings, known: &mut Known, feed: &mut Feed) -> Result<(), SourceError> {
    match url {
        CameraUrl::UdpRtp(address) => udp::rtp(*address, feed),
        CameraUrl::UdpTs(address) => udp::ts(*address, feed),
        CameraUrl::Mjpeg(server) => http::mjpeg(server, feed),
        CameraUrl::Rtsp { server, transport } => rtsp::receive(server, *transport, feed),
        CameraUrl::V4l2(camera) => v4l2::receive(camera, known, feed),
        CameraUrl::Tello(address) => tello::receive(*address, settings, feed),
        #[cfg(feature = "gstreamer")]
        CameraUrl::Gstreamer(pipeline) => gstreamer::receive(pipeline, feed),
        #[cfg(not(feature = "gstreamer"))]
        CameraUrl::Gstreamer(_) => Err(SourceError::Missing("this program was built without GStreamer (--features gstreamer)")),
        // It is played, not received.
        CameraUrl::File { .. } => Ok(()),
    }
}

/// Longest pause of a connection. A camera that sends nothing for this long is connected anew.
const SILENCE: Duration = Duration::from_secs(5);
/// Interval at which it is checked whether to stop.
const POLL_INTERVAL: Duration = Duration::from_millis(50);

/// A runtime for one connection.
fn runtime() -> Result<tokio::runtime::Runtime, SourceError> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
    runtime.map_err(|error| SourceError::connection(error.to_string(), Some(&error)))
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

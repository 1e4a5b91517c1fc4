//! The view of a served drone as an IP camera.

use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Instant;

use spf_flight::sim::SimWorld;
use spf_serve::live_camera::{LiveCamera, LiveCameraPlan};
use spf_serve::rtsp::RtspError;
use spf_serve::tello::VideoQuality;
use spf_serve::vlm::OnboardCamera;

use crate::args::Serve;
use crate::error::CliError;
use crate::printer::Printer;

/// Starts the camera; it is served until the result is dropped. `onboard` receives its images.
pub(super) fn start(
    args: &Serve,
    listen: &str,
    (world, start): (SimWorld, Instant),
    onboard: Option<Arc<OnboardCamera>>,
    printer: &Printer,
) -> Result<LiveCamera, CliError> {
    let address: SocketAddr = listen.parse().map_err(|_| {
        CliError::usage(format!("--rtsp: expected an address and a port, found `{listen}`")).hint("--rtsp=127.0.0.1:8554")
    })?;
    let optics = *world.camera();
    // The name was checked when the drone was started.
    let quality = VideoQuality::from_name(&args.quality).unwrap_or_default();
    let plan = LiveCameraPlan { quality, onboard, ..LiveCameraPlan::new(world, start, address) };
    let camera = LiveCamera::start(plan).map_err(|error| {
        let failure = CliError::usage("cannot serve the camera").because(&error);
        match error {
            RtspError::Listen { .. } => failure.hint("--rtsp=127.0.0.1:0 picks a free port"),
            _ => failure,
        }
    })?;
    printer.result(&camera.url());
    let (across, down) = optics.half_fov();
    printer.log(&format!(
        "Serving the drone's view as a camera: spf fly … --camera {} --camera-fov {:.1} --camera-tilt {:.0} ({:.1}° × {:.1}°).",
        camera.url(),
        2.0 * across.to_degrees(),
        optics.tilt.to_degrees(),
        2.0 * across.to_degrees(),
        2.0 * down.to_degrees(),
    ));
    if !address.ip().is_loopback() {
        printer.log("warning: anyone who can reach this address can watch the video");
    }
    Ok(camera)
}

//! Tello settings.

use std::net::{IpAddr, Ipv4Addr};

use spf_core::time::Duration;

use super::sticks::Calibration;

/// The drone's command port. Clients bind the same local port if possible: some firewalls only let responses through to
/// it.
pub const COMMAND_PORT: u16 = 8889;

/// How a Tello is moved.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TelloMotion {
    /// By velocities (`rc`), which it holds when the link is lost.
    #[default]
    Rc,
    /// By moves that it ends by itself (`go`).
    Go,
}

/// Tello settings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TelloSettings {
    /// Local address; unspecified for any.
    pub local: IpAddr,
    /// Local port for its state.
    pub state_port: u16,
    /// Local port for its video.
    pub video_port: u16,
    /// Velocities at full stick.
    pub calibration: Calibration,
    /// Time from the shutter to the last datagram.
    pub video_latency: Duration,
    /// How it is moved.
    pub motion: TelloMotion,
    /// Whether its own video is started and received. Without it, the port of the video stays free.
    pub own_video: bool,
}

impl Default for TelloSettings {
    /// Factory settings.
    fn default() -> Self {
        Self {
            local: IpAddr::V4(Ipv4Addr::UNSPECIFIED),
            state_port: 8890,
            video_port: 11_111,
            calibration: Calibration::default(),
            video_latency: Duration::from_millis(150),
            motion: TelloMotion::default(),
            own_video: true,
        }
    }
}

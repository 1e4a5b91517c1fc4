//! How a Tello is reached and flown.

use std::net::{IpAddr, Ipv4Addr};

use spf_core::time::Duration;

use super::sticks::Calibration;

/// The drone's command port, which clients bind too where they can: some firewalls let answers pass only there.
pub const COMMAND_PORT: u16 = 8889;

/// How a Tello moves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TelloMotion {
    /// By velocities (`rc`), which it holds when the link is cut.
    #[default]
    Rc,
    /// Each step as moves that it ends by itself (`go`).
    Go,
}

/// How a Tello is reached and flown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TelloSettings {
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
    /// How it moves.
    pub motion: TelloMotion,
}

impl Default for TelloSettings {
    /// As it comes out of the box.
    fn default() -> Self {
        Self {
            local: IpAddr::V4(Ipv4Addr::UNSPECIFIED),
            state_port: 8890,
            video_port: 11_111,
            calibration: Calibration::default(),
            video_latency: Duration::from_millis(150),
            motion: TelloMotion::default(),
        }
    }
}

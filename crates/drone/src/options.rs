//! Driver options.

use crate::airsim::settings::AirSimSettings;
use crate::mavlink::settings::MavlinkSettings;
use crate::screen::settings::ScreenSettings;
use crate::tello::settings::TelloSettings;

/// The options of all drivers.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Options {
    /// Tello options.
    pub tello: TelloSettings,
    /// MAVLink options.
    pub mavlink: MavlinkSettings,
    /// Options of games.
    pub screen: ScreenSettings,
    /// Options of AirSim and Colosseum.
    pub airsim: AirSimSettings,
}

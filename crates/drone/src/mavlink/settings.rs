//! MAVLink settings.

/// How a vehicle is flown by MAVLink.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MavlinkSettings {
    /// Our system number; `None` for that of the vehicle, of which this program is then an onboard computer.
    pub system: Option<u8>,
}

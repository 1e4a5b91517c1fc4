//! The registration of the MAVLink driver.

use std::time::Instant;

use spf_core::craft::Craft;
use spf_envelope::Limits;
use spf_mavlink::url::MavlinkUrl;

use super::craft::MavlinkCraft;
use super::limits::craft;
use super::opening::ConnectError;
use super::settings::MavlinkSettings;
use super::vehicle::Facts;
use super::{doctor, fencing};
use crate::driver::{self, Driver, Target};
use crate::examine::Check;
use crate::options::Options;

/// The driver.
pub const DRIVER: Driver = Driver {
    scheme: "mavlink",
    form: "mavlink[@URL[?sysid=N]]",
    about: "a PX4 or ArduPilot multicopter, with --camera; URL: udpin:HOST:PORT (default: udpin:0.0.0.0:14540), udpout:, tcpout:, \
            tcpin: or serial:DEVICE:RATE; see docs/guide/px4.md and ardupilot.md",
    target: |rest| {
        let (rest, system) = match rest.split_once("?sysid=") {
            Some((rest, number)) => (rest, Some(number.parse().ok().filter(|number| *number > 0)?)),
            None => (rest, None),
        };
        let url = if rest.is_empty() { MavlinkUrl::default() } else { rest.strip_prefix('@')?.parse().ok()? };
        Some(Box::new(NamedVehicle { url, system }) as Box<dyn Target>)
    },
};

/// A vehicle at an address, of this system if its number is given.
struct NamedVehicle {
    url: MavlinkUrl,
    system: Option<u8>,
}

impl NamedVehicle {
    fn settings(&self, options: &Options) -> MavlinkSettings {
        MavlinkSettings { vehicle: self.system, ..options.mavlink.clone() }
    }
}

impl Target for NamedVehicle {
    fn craft(&self) -> Craft {
        craft()
    }

    fn limits(&self) -> Limits {
        Limits { take_off_checks: true, ..Limits::for_craft(&self.craft()) }
    }

    fn takes_fence(&self) -> bool {
        true
    }

    /// Its video travels apart from MAVLink.
    fn has_camera(&self) -> bool {
        false
    }

    fn connect(&self, options: &Options, start: Instant) -> Result<driver::Connected, driver::ConnectError> {
        let drone = MavlinkCraft::connect(&self.url, &self.settings(options), start).map_err(explained)?;
        let fence = options.mavlink.fence.as_ref();
        fence.map_or(Ok(()), |fence| fencing::upload(&drone, fence)).map_err(|error| explained(ConnectError::Fence(error)))?;
        drone.engage();
        let facts = drone.facts();
        Ok(driver::Connected {
            summary: format!("Connected to {} at {}.", doctor::vehicle(&facts), self.url),
            warning: warning(&facts),
            drone: Box::new(drone),
        })
    }

    fn examine(&self, options: &Options) -> Vec<Check> {
        doctor::examine(&self.url, &self.settings(options))
    }
}

/// What happens when this program or the link dies, for the user before take-off.
fn warning(facts: &Facts) -> String {
    format!(
        "If this program or the link dies: {}. A change of the flight mode by the RC transmitter or another station takes control away at \
         once; T gives it back. Ctrl-C lands; a second Ctrl-C lands without finishing the files. {}",
        facts.on_loss(),
        fence(facts)
    )
}

/// The autopilot's own fence.
fn fence(facts: &Facts) -> String {
    match facts.fence_in_words() {
        parts if parts.is_empty() => "The autopilot has no fence of its own.".to_owned(),
        parts => format!("The autopilot's own fence: {}.", parts.join(", ")),
    }
}

/// The error with a hint on what to do.
fn explained(error: ConnectError) -> driver::ConnectError {
    driver::ConnectError { craft: "the vehicle", hint: error.hint(), source: error.into() }
}

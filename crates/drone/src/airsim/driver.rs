//! The registration of the driver of AirSim and Colosseum.

use std::time::Instant;

use spf_core::craft::Craft;
use spf_envelope::Limits;

use super::address::Address;
use super::craft::{AirSimCraft, Facts, craft};
use super::doctor;
use super::lockstep::LockstepCraft;
use super::opening::ConnectError;
use super::settings::AirSimSettings;
use crate::Drone;
use crate::driver::{self, Driver, Target};
use crate::examine::Check;
use crate::options::Options;

/// The driver.
pub const DRIVER: Driver = Driver {
    scheme: "airsim",
    form: "airsim[@HOST[:PORT][/VEHICLE]]",
    about: "a multirotor of AirSim 1.8, its forks, or Colosseum, at 127.0.0.1:41451 and the first vehicle unless said; see \
            docs/guide/airsim.md",
    target: |rest| {
        let address = if rest.is_empty() { Address::default() } else { rest.strip_prefix('@')?.parse().ok()? };
        Some(Box::new(NamedVehicle(address)))
    },
};

/// A vehicle at an address.
struct NamedVehicle(Address);

impl Target for NamedVehicle {
    fn craft(&self) -> Craft {
        craft()
    }

    /// A simulated craft has no battery that could be told.
    fn limits(&self) -> Limits {
        Limits::for_craft(&self.craft())
    }

    fn has_depth_sensor(&self) -> bool {
        true
    }

    fn is_simulated(&self) -> bool {
        self.0.is_here()
    }

    fn runs_in_lockstep(&self, options: &Options) -> bool {
        options.airsim.lockstep
    }

    fn connect(&self, options: &Options, start: Instant) -> Result<driver::Connected, driver::ConnectError> {
        let settings = &options.airsim;
        let (drone, facts): (Box<dyn Drone>, Facts) = if settings.lockstep {
            LockstepCraft::connect(&self.0, settings).map(|(drone, facts)| (Box::new(drone) as Box<dyn Drone>, facts))
        } else {
            AirSimCraft::connect(&self.0, settings, start).map(|(drone, facts)| {
                drone.engage();
                (Box::new(drone) as Box<dyn Drone>, facts)
            })
        }
        .map_err(explained)?;
        Ok(driver::Connected { drone, summary: summary(&self.0, &facts), warning: warning(&facts, settings) })
    }

    fn examine(&self, options: &Options) -> Vec<Check> {
        doctor::examine(&self.0, &options.airsim)
    }
}

fn summary(address: &Address, facts: &Facts) -> String {
    let (camera, (horizontal, _)) = (facts.camera, facts.camera.half_fov());
    format!(
        "Connected to {} at {address}: camera {}×{}, field of view {:.0}°, tilt {:.0}°.",
        facts.dialect(),
        camera.width,
        camera.height,
        2.0 * horizontal.to_degrees(),
        camera.tilt.to_degrees() + 0.0
    )
}

/// What happens when this program dies, and what the pilot is told, for the user before take-off.
fn warning(facts: &Facts, settings: &AirSimSettings) -> String {
    let pose = if settings.true_pose {
        "The pilot gets the simulator's exact pose (--true-pose), which no real craft has."
    } else {
        "The simulator's exact pose is given to the pilot with the errors of satellite navigation (--true-pose leaves them out)."
    };
    let small = match (facts.camera.width, facts.camera.height) {
        (width, height) if width < doctor::WIDE_ENOUGH => {
            format!(" Images of {width}×{height} show small targets badly: {}.", doctor::LARGER)
        }
        _ => String::new(),
    };
    let dies = if settings.lockstep {
        "The simulator is paused while the pilot thinks, and after the flight its time runs on. If this program or the connection \
         dies, it stays paused."
    } else {
        "If this program or the connection dies, the simulated craft stops being driven within a quarter of a second, brakes and hovers."
    };
    format!("{dies} Ctrl-C lands; a second Ctrl-C lands without finishing the files. {pose}{small}")
}

/// The error with a hint on what to do.
fn explained(error: ConnectError) -> driver::ConnectError {
    driver::ConnectError { craft: "the simulator", hint: error.hint(), source: error.into() }
}

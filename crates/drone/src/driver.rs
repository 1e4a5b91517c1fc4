//! Driver registration: how the craft of a driver are named, connected and examined.

use std::error::Error;
use std::time::Instant;

use spf_core::craft::Craft;
use spf_envelope::Limits;
use spf_motion::executor::Motion;

use crate::Drone;
use crate::examine::Check;
use crate::options::Options;

/// A kind of drone.
#[derive(Debug)]
pub struct Driver {
    /// Scheme at the start of a drone's name, such as `tello`.
    pub scheme: &'static str,
    /// Form of a drone's name, such as `tello[@ADDRESS]`, for help texts and errors.
    pub form: &'static str,
    /// Description of the drone and its default address, without a final period, for help texts (shown in parentheses).
    pub about: &'static str,
    /// Parses the part of a name after the scheme (`@ADDRESS`, or nothing); `None` if it is not a valid address.
    pub target: fn(&str) -> Option<Box<dyn Target>>,
}

/// A craft named by the user, not connected yet.
pub trait Target: Send + Sync {
    /// Its parameters, those of [`Capabilities::craft`](crate::Capabilities::craft).
    fn craft(&self) -> Craft;

    /// Default envelope limits for it.
    fn limits(&self) -> Limits {
        Limits::for_craft(&self.craft())
    }

    /// The motion that its settings require, if any.
    fn motion(&self, options: &Options) -> Option<Motion> {
        let _ = options;
        None
    }

    /// Whether it has a fence of its own that can be replaced (`options.mavlink.fence`).
    fn takes_fence(&self) -> bool {
        false
    }

    /// Whether it sends the video of a camera of its own. Without one a flight needs another camera.
    fn has_camera(&self) -> bool {
        true
    }

    /// Whether its time stands still while the pilot thinks, and runs when the pilot asks what happens next: a flight in virtual time.
    fn runs_in_lockstep(&self, _options: &Options) -> bool {
        false
    }

    /// Whether it has a depth sensor that can be switched on.
    fn has_depth_sensor(&self) -> bool {
        false
    }

    /// Whether its address is one of this machine alone, so that it is a program and no craft that could hurt anybody. `false` if a
    /// program there may pass the commands on.
    fn is_simulated(&self) -> bool {
        false
    }

    /// Connects to the craft. `start` is flight time zero.
    ///
    /// # Errors
    /// [`ConnectError`] if the craft cannot be reached or refuses.
    fn connect(&self, options: &Options, start: Instant) -> Result<Connected, ConnectError>;

    /// Checks the craft on the ground for `spf doctor`: network path, telemetry, images. The checks that apply to any craft
    /// are in [`examine`](crate::examine); `tello/doctor.rs` is an example.
    fn examine(&self, options: &Options) -> Vec<Check>;
}

/// A connected craft.
pub struct Connected {
    /// The craft.
    pub drone: Box<dyn Drone>,
    /// A sentence describing what was found.
    pub summary: String,
    /// A warning to show to the user before take-off.
    pub warning: String,
}

/// Why the connection failed.
#[derive(Debug, thiserror::Error)]
#[error("cannot connect to {craft}")]
pub struct ConnectError {
    /// The craft, in words.
    pub craft: &'static str,
    /// The driver's error.
    #[source]
    pub source: Box<dyn Error + Send + Sync>,
    /// Remedy for the error.
    pub hint: Option<String>,
}

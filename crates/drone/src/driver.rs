//! What a driver says of itself, for the registry: how its craft are named, connected and looked at.

use std::error::Error;
use std::time::Instant;

use spf_core::craft::Craft;
use spf_core::envelope::Limits;
use spf_core::executor::Motion;

use crate::Drone;
use crate::examine::Check;
use crate::options::Options;

/// A kind of drone.
#[derive(Debug)]
pub struct Driver {
    /// The word that its names begin with.
    pub scheme: &'static str,
    /// What it is.
    pub about: &'static str,
    /// How it is named, for people.
    pub form: &'static str,
    /// The craft that is meant by what follows the scheme (`@ADDRESS`, or nothing); none when that is no address of such a craft.
    pub target: fn(&str) -> Option<Box<dyn Target>>,
}

/// A craft that was named and is not connected yet.
pub trait Target: Send + Sync {
    /// Its figures.
    fn craft(&self) -> Craft;

    /// The envelope's default figures for it.
    fn limits(&self) -> Limits {
        Limits::for_craft(&self.craft())
    }

    /// How it is to be flown, where its settings leave no choice.
    fn motion(&self, options: &Options) -> Option<Motion> {
        let _ = options;
        None
    }

    /// Connects. `start` is when flight time was zero.
    ///
    /// # Errors
    /// [`ConnectError`].
    fn connect(&self, options: &Options, start: Instant) -> Result<Connected, ConnectError>;

    /// Looks at it, on the ground: the way to it, what it tells, its images.
    fn examine(&self, options: &Options) -> Vec<Check>;
}

/// A craft that answers.
pub struct Connected {
    /// The craft.
    pub drone: Box<dyn Drone>,
    /// A sentence about what answered.
    pub told: String,
    /// What the person must know before it takes off.
    pub warning: &'static str,
}

/// Why there is no connection.
#[derive(Debug, thiserror::Error)]
#[error("{craft} cannot be flown")]
pub struct ConnectError {
    /// What was to be flown, in words.
    pub craft: &'static str,
    /// The driver's own reason.
    #[source]
    pub source: Box<dyn Error + Send + Sync>,
    /// What to do about it.
    pub hint: Option<String>,
}

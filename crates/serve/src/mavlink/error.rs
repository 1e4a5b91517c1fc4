//! Errors of the virtual vehicle's server.

use spf_mavlink::link::LinkError;
use spf_mavlink::url::MavlinkUrl;

use crate::fault::FaultError;
use crate::tello::ServerError;

/// Why a server could not start.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum VehicleServerError {
    /// A port could not be bound.
    #[error("cannot bind {url}")]
    Bind {
        /// The address.
        url: MavlinkUrl,
        /// The cause.
        #[source]
        source: std::io::Error,
    },
    /// A serial port could not be opened.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// A vehicle does not connect to others.
    #[error("a vehicle serves on tcpin, udpin, udpout and serial, not on {url}")]
    Unserved {
        /// The address.
        url: MavlinkUrl,
    },
    /// A thread could not be started.
    #[error("cannot start a thread")]
    Thread(#[source] std::io::Error),
    /// An invalid fault rule.
    #[error(transparent)]
    Fault(#[from] FaultError),
    /// The fault file is unusable.
    #[error(transparent)]
    Faults(#[from] ServerError),
}

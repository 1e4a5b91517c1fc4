//! Errors of the virtual Tello server.

use std::net::SocketAddr;
use std::path::PathBuf;

use crate::fault::FaultError;

/// Why a server could not start.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ServerError {
    /// A socket could not be bound.
    #[error("cannot bind UDP {address}")]
    Bind {
        /// The address.
        address: SocketAddr,
        /// The cause.
        #[source]
        source: std::io::Error,
    },
    /// A thread could not be started.
    #[error("cannot start a thread")]
    Thread(#[source] std::io::Error),
    /// The fault file could not be read.
    #[error("cannot read the fault file `{}`", path.display())]
    FaultFile {
        /// The file.
        path: PathBuf,
        /// The cause.
        #[source]
        source: std::io::Error,
    },
    /// The fault file has invalid TOML or keys.
    #[error("invalid fault file `{}`", path.display())]
    FaultSyntax {
        /// The file.
        path: PathBuf,
        /// The cause.
        #[source]
        source: Box<toml::de::Error>,
    },
    /// An invalid rule.
    #[error(transparent)]
    Fault(#[from] FaultError),
}

//! Errors of the virtual Tello server.

use std::net::SocketAddr;
use std::path::PathBuf;

use spf_core::fault::FaultError;

/// Why a server could not start.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ServerError {
    /// A socket could not be bound.
    #[error("UDP {address} cannot be had")]
    Bind {
        /// The address.
        address: SocketAddr,
        /// The cause.
        #[source]
        source: std::io::Error,
    },
    /// A thread could not be started.
    #[error("no thread can be started")]
    Thread(#[source] std::io::Error),
    /// The fault file could not be read.
    #[error("the faults in `{}` cannot be read", path.display())]
    FaultFile {
        /// The file.
        path: PathBuf,
        /// The cause.
        #[source]
        source: std::io::Error,
    },
    /// The fault file has invalid TOML or keys.
    #[error("the faults in `{}` are refused", path.display())]
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

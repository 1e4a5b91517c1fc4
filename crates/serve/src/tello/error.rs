//! Why a virtual Tello is not served.

use std::net::SocketAddr;
use std::path::PathBuf;

use spf_core::fault::FaultError;

/// Why a server does not begin.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ServerError {
    /// A socket.
    #[error("UDP {address} cannot be had")]
    Bind {
        /// Which.
        address: SocketAddr,
        /// Why.
        #[source]
        source: std::io::Error,
    },
    /// A thread.
    #[error("no thread can be started")]
    Thread(#[source] std::io::Error),
    /// The file of faults cannot be read.
    #[error("the faults in `{}` cannot be read", path.display())]
    FaultFile {
        /// Which.
        path: PathBuf,
        /// Why.
        #[source]
        source: std::io::Error,
    },
    /// The file of faults is no TOML, or its keys are wrong.
    #[error("the faults in `{}` are refused", path.display())]
    FaultSyntax {
        /// Which.
        path: PathBuf,
        /// Why.
        #[source]
        source: Box<toml::de::Error>,
    },
    /// A rule makes no sense.
    #[error(transparent)]
    Fault(#[from] FaultError),
}

//! Why nothing is received.

use crate::film::FilmError;

/// Why a source failed. The texts contain neither passwords nor addresses.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub(crate) enum SourceError {
    /// The connection was closed.
    #[error("the camera closed the connection")]
    Ended,
    /// Nothing arrives.
    #[error("no images for {0} s")]
    Silent(u64),
    /// The socket at which packets are to arrive.
    #[error("cannot receive at {address}: {error}")]
    Socket {
        /// Address of this machine, or a multicast group.
        address: std::net::SocketAddr,
        /// The operating system's error.
        error: std::io::Error,
    },
    /// Another codec.
    #[error("the video is {0}, which cannot be decoded: set the camera to H.264 or MJPEG")]
    Codec(String),
    /// Not a stream of images.
    #[error("the server sends `{0}`, not a stream of JPEG images")]
    NoImages(String),
    /// The server's answer.
    #[error("the server answers {0}")]
    Status(String),
    /// User name or password.
    #[error("the server refuses the user name or the password")]
    Refused,
    /// The connection.
    #[error("{0}")]
    Connection(String),
    /// A file that cannot be read.
    #[error("cannot read the video: {0}")]
    File(std::io::Error),
    /// A device of this machine.
    #[allow(dead_code, reason = "Video4Linux is not there")]
    #[error("{}: {why}", path.display())]
    Device {
        /// Its file.
        path: std::path::PathBuf,
        /// Why, and what to do.
        why: String,
        /// Whether it may pass by itself, such as when it is plugged in again.
        passes: bool,
    },
    /// A Tello.
    #[error("{why}")]
    Tello {
        /// Why, and what to do.
        why: String,
        /// Whether somebody flies it, so that it must be left alone.
        flies: bool,
    },
    /// A pipeline that cannot be built.
    #[cfg(feature = "gstreamer")]
    #[error("the pipeline cannot be used: {0}")]
    Pipeline(String),
    /// What this program, as it was built, cannot receive.
    #[error("{0}")]
    #[allow(dead_code, reason = "a program with GStreamer, on Linux, lacks nothing")]
    Missing(&'static str),
    /// A file that cannot be decoded.
    #[error(transparent)]
    Film(#[from] FilmError),
}

impl SourceError {
    /// Whether it does not pass by itself.
    pub(crate) fn needs_attention(&self) -> bool {
        match self {
            Self::Codec(_) | Self::NoImages(_) | Self::Refused | Self::File(_) | Self::Film(_) | Self::Missing(_) => true,
            #[cfg(feature = "gstreamer")]
            Self::Pipeline(_) => true,
            Self::Device { passes, .. } => !passes,
            Self::Tello { flies, .. } => *flies,
            _ => false,
        }
    }
}

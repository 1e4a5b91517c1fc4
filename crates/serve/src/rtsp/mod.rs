//! An RTSP server (RFC 2326) that sends H.264 video to any number of viewers: the pictures of a simulated camera, as an IP camera
//! sends them.
//!
//! [`Server`] takes encoded images and sends them to those who play the stream, in RTP packets ([`packet`]) by UDP or within the
//! RTSP connection. [`LiveCamera`](crate::live_camera::LiveCamera) feeds it with the view of a simulated craft.
//!
//! Messages are read here rather than by the crate `rtsp-types`, whose parser of the `Transport` header refuses the unquoted
//! `mode=play` that clients send.

pub mod packet;
mod request;
mod server;
mod session;

pub use server::{RtspError, Server, Unit};

/// What the standards forbid, and cameras do.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Quirks {
    /// The answer to `SETUP` does not tell the channels of packets within the connection.
    pub no_channels: bool,
    /// It tells another source number (SSRC) than that of the packets.
    pub other_source: bool,
    /// Two packets of another source come within the connection: before the first image, and before its last packet.
    pub stray_packets: bool,
    /// Bytes that are no packet come before each image within the connection.
    pub noise: bool,
    /// The timestamp of every second image is this much earlier, 1/90000 s.
    pub back: u16,
    /// For every second five images the clock of the timestamps is off by this much, seconds.
    pub jump: i16,
}

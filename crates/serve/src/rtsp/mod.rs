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

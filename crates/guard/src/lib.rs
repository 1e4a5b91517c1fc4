//! What every server of this project checks (`docs/explanation/security.md`).
//!
//! [`Access`] decides by a request's headers whether its sender may ask at all. [`ConnectionSlots`] bounds the number of
//! connections. [`serve`] is an HTTP server with both, and with limits on the time and the size of requests; a server
//! with blocking sockets uses them together with [`DeadlineStream`].

mod access;
mod connection_slots;
mod deadline_stream;
mod headers;
mod http1;
mod secret;
mod socket;

use std::time::Duration;

pub use access::{Access, OriginError, Refusal};
pub use connection_slots::{ConnectionSlots, Place};
pub use deadline_stream::DeadlineStream;
pub use headers::with_headers;
pub use http1::{Manner, Peer, TurnedOut, serve};
pub use secret::Secret;

/// Maximum number of connections of one server.
pub const CONNECTIONS: usize = 8;
/// Time limit for the head of a request, from the start of the connection.
pub const HEAD_TIME: Duration = Duration::from_secs(5);
/// Time limit for the body of a request.
pub const BODY_TIME: Duration = Duration::from_secs(20);
/// Time limit for a client to accept data: then it is disconnected.
pub const SEND_TIME: Duration = Duration::from_secs(20);
/// Maximum size of the head of a request, bytes.
pub const HEAD_BYTES: usize = 32 << 10;
/// Maximum size of the body of a request, bytes.
pub const BODY_BYTES: usize = 8 << 20;
/// Maximum size of an image in a request, pixels; checked before it is decoded.
pub const MAX_PIXELS: u64 = 16_000_000;

//! The wire of AirSim 1.8.1 and Colosseum: msgpack-rpc over TCP, and the structs that are sent by it.
//!
//! [`Decoder`] cuts a stream of bytes, in any chunking, into [`Message`]s and bounds what a peer can make it keep. Parameters and
//! results stay [`Raw`] until somebody asks for a type. AirSim sends structs as maps with the names of their fields, Colosseum
//! since July 2024 as arrays ([`Encoding`]); every struct of [`structs`] is read from both, and is written as either.
//!
//! Frames are those of AirSim: world NED (north, east, down) in metres, its origin at the vehicle's start, body FRD. No conversion
//! happens here.
//!
//! Sources: the MessagePack specification, the msgpack-rpc specification, and AirSim's `RpcLibAdaptorsBase.hpp`,
//! `MultirotorRpcLibAdaptors.hpp` and `PythonClient/airsim/types.py`. The server's error texts are those of rpclib's
//! `dispatcher.cc`.

pub mod errors;
mod message;
mod number;
mod raw;
mod scan;
pub mod structs;

#[cfg(test)]
mod tests;

pub use message::{Decoder, Message};
pub use raw::{Encoding, Raw, ReadError};
pub use scan::{FrameError, Limits};

/// The port of AirSim and of Colosseum.
pub const PORT: u16 = 41451;
/// A timeout that is none: clients send it as the largest number of a C++ `float`, in `f64`.
pub const NO_TIMEOUT: f64 = 3e38;

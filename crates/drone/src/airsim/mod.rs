//! AirSim and its heirs (`docs/guide/airsim.md`): what is said on the wire, and the driver of their multirotors.
//!
//! [`wire`] reads and writes messages and structs in both encodings. `Control` is the logic of the driver, without
//! sockets and clocks; [`AirSimCraft`](craft::AirSimCraft) has connections and threads: one for motion, one for the state, one for images,
//! since a simulator answers the calls of one connection one after the other as far as a client can rely on it.

pub mod address;
mod axes;
mod clock;
mod control;
pub mod craft;
mod doctor;
pub mod driver;
#[cfg(test)]
mod fake;
pub mod lockstep;
mod opening;
mod pictures;
mod reporting;
mod rpc;
mod senses;
mod session;
pub mod settings;
mod shared;
#[cfg(test)]
mod tests;
pub mod wire;

pub use opening::ConnectError;
pub use rpc::RpcError;

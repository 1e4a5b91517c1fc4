//! A virtual PX4 or ArduPilot: the simulated craft behind MAVLink, so that third-party clients can fly it, and the project's own
//! driver is tested over real sockets (`docs/guide/px4.md`, `docs/guide/ardupilot.md`).
//!
//! [`VirtualVehicle`] is sans-IO: given packets and the time, it flies a [`SimCraft`](spf_sim::craft::SimCraft) and returns
//! messages to send. [`VehicleServer`] adds links and a clock; [`VehicleService`] a scene and a judge.

mod error;
mod machine;
mod parameters;
mod server;
mod service;
mod transport;

pub use error::VehicleServerError;
pub use machine::{Peer, VirtualVehicle};
pub use server::{Equipment, VehicleServer, VehicleSetup};
pub use service::{VehiclePlan, VehicleService};

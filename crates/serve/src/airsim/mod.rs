//! An AirSim without Unreal: msgpack-rpc on loopback, so that AirSim's own clients fly the simulated craft through our scenes
//! (`docs/guide/airsim.md`).
//!
//! [`AirSimServer`] has the sockets and the clock. Behind it a simulator without either answers calls: it has vehicles, each with
//! at most one motion under way, whose response waits until the motion has ended. [`Settings`] is AirSim's `settings.json`.

mod calls;
mod city;
mod frames;
mod images;
mod palette;
mod sensors;
mod server;
mod settings;
mod task;
mod vehicle;

pub use server::{AirSimError, AirSimPlan, AirSimServer};
pub use settings::{CameraMount, Capture, RangeMount, Settings, SettingsError, VehicleSettings};

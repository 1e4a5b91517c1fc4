//! Flying in the embedded simulator: adapters that put its craft behind `Drone` and its oracle behind `Vlm`, and ground
//! truth for evaluating a flight.

mod drone;
mod following;
mod frame_source;
mod frames;
mod loaded_scene;
mod oracle;
mod outline;
mod site;
mod truth;
mod vlm_factory;
mod world;

pub use drone::SimDrone;
pub use following::Followed;
pub use frames::SimFrames;
pub(crate) use frames::photo;
pub use loaded_scene::{LoadedScene, SceneLoadError, WorldSnapshot};
pub use oracle::OracleVlm;
pub use site::{Simulated, StartError};
pub use truth::{Verdict, judge, sighted};
pub use vlm_factory::{VlmFactory, VlmFactoryError, oracle_factory};
pub use world::{CameraTilt, FlightConditions, SimWorld, Teleport};

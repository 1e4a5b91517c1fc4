//! Flying in the embedded simulator: the adapters that put its craft behind `Drone` and its oracle behind `Vlm`, the truth about
//! a flight, and whole flights.

mod drone;
mod flight;
mod frames;
mod oracle;
mod policy;
mod stage;
mod truth;
mod world;

pub use drone::SimDrone;
pub use flight::{FlightError, FlightPlan, Flown, RecordPlan, WhoError, WhoPoints, fly, oracle_points};
pub use frames::SimFrames;
pub(crate) use frames::photo;
pub use oracle::OracleVlm;
pub use policy::PolicyKind;
pub use stage::{Moment, Stage, StageError};
pub use truth::{Verdict, judge, sighted};
pub use world::{Circumstances, SimWorld};

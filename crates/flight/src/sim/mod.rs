//! Flying in the embedded simulator: the adapters that put its craft behind `Drone` and its oracle behind `Vlm`, the truth about
//! a flight, and whole flights.

mod flight;
mod oracle;
mod pictures;
mod stage;
mod truth;
mod world;

pub use flight::{FlightError, FlightPlan, Flown, PolicyKind, RecordPlan, WhoError, WhoPoints, fly, oracle_points};
pub use oracle::OracleVlm;
pub(crate) use pictures::SimPicture;
pub use pictures::SimPictures;
pub use stage::{Moment, Stage, StageError};
pub use truth::Verdict;
pub use world::{Circumstances, SimDrone, SimWorld};

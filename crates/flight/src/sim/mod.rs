//! Flying in the embedded simulator: the adapters that put its craft behind `Drone` and its oracle behind `Vlm`, the truth about
//! a flight, and whole flights.

mod flight;
mod oracle;
mod pictures;
mod policy;
mod stage;
mod truth;
mod world;

pub use flight::{FlightError, FlightPlan, Flown, RecordPlan, WhoError, WhoPoints, fly, oracle_points};
pub use oracle::OracleVlm;
pub use pictures::SimPictures;
pub(crate) use pictures::sim_picture;
pub use policy::PolicyKind;
pub use stage::{Moment, Stage, StageError};
pub use truth::{Verdict, judge, sighted};
pub use world::{Circumstances, SimDrone, SimWorld};

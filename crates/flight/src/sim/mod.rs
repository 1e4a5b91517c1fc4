//! Flying in the embedded simulator: the adapters that put its craft behind `Drone` and its oracle behind `Vlm`, the truth about
//! a flight, and what they give to one as its site.

mod drone;
mod frames;
mod oracle;
mod outline;
mod site;
mod stage;
mod truth;
mod who;
mod witness;
mod world;

pub use drone::SimDrone;
pub use frames::SimFrames;
pub(crate) use frames::photo;
pub use oracle::OracleVlm;
pub use site::{Simulated, StartError};
pub use stage::{Moment, Stage, StageError};
pub use truth::{Verdict, judge, sighted};
pub use who::{WhoError, WhoPoints, oracle_points};
pub use world::{Circumstances, SimWorld};

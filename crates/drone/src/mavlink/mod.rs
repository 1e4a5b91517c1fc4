//! PX4 and ArduPilot by MAVLink.
//!
//! [`Vehicle`](vehicle::Vehicle) is the logic, without sockets; [`MavlinkCraft`](craft::MavlinkCraft) has a link and threads.

pub mod craft;
mod doctor;
pub mod driver;
pub mod fence_error;
pub mod fencing;
mod limits;
pub mod opening;
pub mod settings;
mod telling;
pub mod vehicle;

//! Servers that expose the simulator over the interfaces of real systems (`spf sim serve`).
//!
//! [`tello`] and [`mavlink`] are virtual drones for third-party clients and for the project's own drivers; [`airsim`] is a
//! simulator for AirSim's clients. [`vlm`] is an endpoint
//! compatible with vision-language model APIs. [`live_camera`] sends the view of a simulated craft by [`rtsp`]. All run on the
//! wall clock and use the same
//! [`SimWorld`](spf_flight::sim::SimWorld), whose behaviour still depends on the seed. [`truth`] evaluates flights made
//! by others. [`fault`] disturbs the links of virtual drones.
//!
//! This crate contains no pilot; complete flights are in `spf_flight`.

pub mod airsim;
pub mod fault;
pub mod live_camera;
pub mod mavlink;
pub mod rtsp;
pub mod tello;
pub mod truth;
pub mod vlm;

//! A virtual Tello: the simulated craft behind the text SDK of DJI and Ryze (SDK 1.3, 2.0 and 3.0), so that third-party
//! clients can fly it, and the project's own driver is tested over real sockets (`docs/guide/tello.md`).
//!
//! [`VirtualTello`] is sans-IO: given datagrams and the time, it flies a [`SimCraft`](spf_sim::craft::SimCraft) and
//! returns datagrams to send. [`Server`] adds sockets, a clock and a camera; [`TelloService`] a scene and a judge.

pub mod command;
mod error;
pub(crate) mod faults;
mod figures;
mod film;
pub mod lens;
pub(crate) mod link;
mod machine;
mod manoeuvre;
pub(crate) mod pace;
pub(crate) mod photograph;
mod server;
mod service;
pub(crate) mod shared;
mod state;
pub mod video;

pub use error::ServerError;
pub use faults::FaultSource;
pub use figures::{Firmware, ProtocolParameters};
pub use film::FrameRenderer;
pub use machine::{Output, VideoRequest, VirtualTello};
pub use pace::{RenderQuality, VideoQuality};
pub use server::{Server, Setup};
pub use service::{TelloPlan, TelloService};
pub use shared::SendStats;

//! The driver of the DJI/Ryze Tello over its text SDK 1.3, 2.0 and 3.0 (`docs/guide/tello.md`).
//!
//! [`Link`](link::Link) is sans-IO: it is told what came on the command and the state socket and what the pilot wants, and says
//! what to send. [`Tello`] gives it sockets and threads, and [`video`] and [`camera`] turn the third socket into frames.

pub mod answer;
pub mod camera;
pub mod conversation;
pub mod craft;
mod doctor;
pub mod driver;
mod inlet;
pub mod link;
mod manoeuvre;
mod opening;
pub mod settings;
pub mod state;
pub mod sticks;
pub mod video;

pub use craft::{Connected, Tello};
pub use opening::{ConnectError, Firmware};
pub use settings::{TelloMotion, TelloSettings};

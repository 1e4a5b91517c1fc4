//! The driver of the DJI/Ryze Tello over its text SDK 1.3, 2.0 and 3.0 (`docs/guide/tello.md`).
//!
//! [`Link`](link::Link) is the sans-IO protocol logic: it takes datagrams of the command and state sockets and cleared
//! commands, and returns datagrams to send. [`Tello`] adds sockets and threads; [`video`] and [`camera`] turn the video
//! socket into frames.

pub mod answer;
pub mod camera;
pub mod conversation;
pub mod craft;
mod doctor;
pub mod driver;
mod ground;
mod imu;
mod inlet;
pub mod intake;
pub mod link;
mod manoeuvre;
mod opening;
pub mod rescue;
pub mod settings;
pub mod state;
pub mod sticks;
pub mod video;
pub mod video_link;

pub use craft::{Connected, Tello};
pub use opening::{ConnectError, Firmware};
pub use settings::{TelloMotion, TelloSettings};

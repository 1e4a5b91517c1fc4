//! A game or simulator flown through its window: frames from the screen, velocities by keys and mouse, and no telemetry.
//!
//! What a profile ([`spf_screen::profile`]) says of the keys turns a velocity setpoint into pulses. Since nothing is measured, the pose is
//! reckoned: velocities from what was commanded, the heading from the optical flow of the pictures. No position is reported, so
//! that the pilot's own dead reckoning applies, with its growing spread.
//!
//! Keys are pressed only while the window has the focus; a focus that somebody takes is somebody who takes over. They are
//! released when the window cannot be seen, when the picture does not answer to the keys, and however the program ends but by
//! SIGKILL, an abort, and a third Ctrl-C.

pub mod calibrate;
mod control;
mod craft;
mod doctor;
pub mod driver;
mod flow;
mod motion;
mod pressing;
mod reckoning;
pub mod settings;
mod shared;
mod stillness;
mod turn_check;
pub mod turning;
mod watching;

pub use craft::ScreenCraft;

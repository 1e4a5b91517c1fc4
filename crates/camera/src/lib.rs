//! Cameras that are not part of a drone: an address, a receiver, the newest frame.
//!
//! [`CameraUrl`] parses an address, and [`Camera`] receives what it names. The parsers ([`rtp`], [`ts`], [`mjpeg`],
//! [`yuyv`], [`film`]) do no I/O.

pub mod address;
pub mod arrivals;
pub mod calibration;
pub mod camera;
pub mod clock;
pub mod clock_code;
pub mod craft;
mod decode;
pub mod diagnosis;
mod failure;
mod feed;
pub mod film;
mod inlet;
pub mod intact;
pub mod latency;
pub mod mjpeg;
pub mod modes;
pub mod profile;
pub mod rtp;
mod shared;
mod source;
pub mod ts;
pub mod unit;
pub mod yuyv;

#[cfg(test)]
mod testing;

pub use address::CameraUrl;
pub use calibration::Calibration;
pub use camera::{Camera, CameraSettings};
pub use craft::WithCamera;
pub use shared::{CameraReport, CameraState, Failure};

/// The examples of the README, run as tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

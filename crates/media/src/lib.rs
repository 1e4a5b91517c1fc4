//! Images and video in memory: resizing, JPEG and PNG, marks, H.264, and following many points from image to image.
//!
//! This crate does no I/O. Equal inputs give equal bytes on every x86-64 machine, whatever its vector units, because
//! recorded frames are compared byte for byte between runs.
//!
//! The main types are [`Rgb`], an image, and [`marks::Canvas`], which draws on one.
//!
//! ```
//! use spf_core::query::{ImagePoint, Mark};
//! use spf_media::{Jpeg, Rgb, marks};
//!
//! let mut image = Rgb::new(960, 720);
//! marks::draw(&mut image, &[Mark::Number { at: ImagePoint { u: 0.5, v: 0.4 }, number: 3 }]);
//! let jpeg = Jpeg::encode(&image, 90)?;
//! assert_eq!(&jpeg.bytes()[..2], &[0xff, 0xd8]);
//! # Ok::<(), spf_media::EncodeError>(())
//! ```

pub mod file;
pub mod frame;
pub mod h264;
pub mod jpeg;
pub mod marks;
mod pixels;
pub mod png;
pub mod points;
pub mod resize;
pub mod track;

pub use frame::{FrameError, Rgb};
pub use jpeg::{EncodeError, Jpeg};
pub use resize::{Scaler, enlarged, resize};

/// The examples of the README, run as tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

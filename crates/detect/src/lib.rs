//! Neural networks in ONNX format, provided by the user: object detectors (docs/guide/detector.md), and networks that estimate the
//! depth of a frame (docs/guide/obstacles.md).
//!
//! A [`Detector`] returns the objects in an image, a [`DepthNetwork`] its depths. The network itself needs the feature `onnx`, and runs
//! in a process of its own, with bounded memory and time ([`Place`]). The parts around it are common to models of a kind: for
//! detectors the [`letterbox`], which converts an image to the network's input, and [`decode`], which converts its output to boxes;
//! for depth networks the scale of their depth, [`mono_depth`]. No model is
//! included.

#![cfg_attr(not(feature = "onnx"), allow(dead_code, reason = "pre- and postprocessing are only used with a network"))]

mod bounds;
pub mod decode;
mod depth;
mod detector;
mod error;
mod exchange;
pub mod letterbox;
mod model;
pub mod mono_depth;
mod names;
#[cfg(feature = "onnx")]
mod network;
#[cfg(not(feature = "onnx"))]
#[path = "no_network.rs"]
mod network;
mod output_kind;
mod process;
pub mod published;
mod trial;
pub mod windows;
mod wire;
pub mod worker;

pub use bounds::{Bounds, MAX_MODEL, MAX_SIDE};
pub use depth::{DepthNetwork, DepthOptions};
pub use detector::Detector;
pub use error::NetworkError;
pub use output_kind::{KINDS, OutputKind, WrongKind};
pub use process::Place;

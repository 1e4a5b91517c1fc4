//! H.264: encoding, and cutting a byte stream into NAL units.

pub mod encode;
pub mod split;

pub use encode::{AccessUnit, Encoder, EncoderError, EncoderSettings};
pub use split::{NalKind, nal_units};

//! H.264: encoding, decoding, and splitting a byte stream into NAL units.

pub mod decode;
pub mod encode;
pub mod split;

pub use decode::{Decoder, DecoderError};
pub use encode::{AccessUnit, Encoder, EncoderError, EncoderSettings};
pub use split::{NalKind, nal_units};

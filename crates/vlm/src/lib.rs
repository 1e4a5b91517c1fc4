//! The `Vlm` interface, and the clients of the vision-language models of several vendors behind it (docs/guide/vlm.md).
//!
//! A reply is *text*, whatever its source: the oracle's replies pass through the same parser as a model's. This crate
//! is independent of drones and flights.
//!
//! [`table::Table`] lists the known models and how to query each of them. [`setup`] turns a name from the command line
//! into a [`Remote`], which sends queries over HTTP. Differences between vendors are data (`models.toml`) or handled in
//! [`wire`].

mod backend;
pub mod cassette;
pub mod check;
mod client;
mod day;
mod destination;
mod error;
pub mod exec;
pub mod folder;
mod hedge;
pub mod human;
mod image;
mod key;
mod paced;
pub mod refusal;
mod remote;
mod request;
pub mod service;
pub mod setup;
pub mod table;
mod transport;
mod upload;
mod usage;
pub mod wire;

use std::sync::Arc;

use serde::{Deserialize, Serialize};
use spf_core::grounding::GroundingProfile;
use spf_core::query::ImageBox;
use spf_core::time::Duration;
use spf_media::Rgb;

pub use day::today;
pub use error::{Trouble, VlmError};
pub use hedge::Hedge;
pub use image::{ImageRule, SentSize};
pub use key::ApiKey;
pub use paced::Paced;
pub use remote::{Remote, RequestOptions};
pub use request::{Cancel, QueryRequest};
pub use transport::TransportError;
pub use usage::{StageTimes, Tokens, Usage};

/// The image of a query, created only on request: the oracle needs none, and rendering is expensive.
pub trait QueryImage {
    /// Width and height of the camera's frame, pixels.
    fn size(&self) -> (u32, u32);

    /// Prepares the frame at a size, before the latency measurement starts.
    fn prepare(&mut self, size: (u32, u32)) {
        let _ = size;
    }

    /// The frame's pixels at its own size, with the query's marks overlaid; for local use.
    ///
    /// # Errors
    /// [`VlmError::Image`] if the frame is not available.
    fn pixels(&mut self) -> Result<Rgb, VlmError> {
        let jpeg = self.jpeg(self.size(), 95)?;
        spf_media::jpeg::decode(&jpeg).map_err(|error| VlmError::Image(error.to_string()))
    }

    /// The frame's pixels at its own size, without marks; for a detector.
    ///
    /// # Errors
    /// [`VlmError::Image`] if the frame is not available.
    fn frame(&mut self) -> Result<Rgb, VlmError> {
        self.pixels()
    }

    /// A part of the frame, cut out of its own pixels and enlarged to `size`, as JPEG.
    ///
    /// # Errors
    /// [`VlmError::Image`] if the frame is not available or cannot be encoded.
    fn close_up(&mut self, area: ImageBox, size: (u32, u32), quality: u8) -> Result<Arc<[u8]>, VlmError> {
        let enlarged = spf_media::enlarged(&self.pixels()?, [area.left, area.top, area.right, area.bottom], size);
        let jpeg = spf_media::Jpeg::encode(&enlarged, quality);
        Ok(jpeg.map_err(|error| VlmError::Image(error.to_string()))?.shared())
    }

    /// The frame as JPEG at a size and quality (1..=100), with the query's marks overlaid; encoded once, even if
    /// requested several times.
    ///
    /// # Errors
    /// [`VlmError::Image`] if the frame is not available or cannot be encoded.
    fn jpeg(&mut self, size: (u32, u32), quality: u8) -> Result<Arc<[u8]>, VlmError>;
}

/// The model that `spf sim serve --vlm` names in its replies, in every format: the oracle, whose answers cost nothing.
pub const ORACLE_SERVED: &str = "spf-oracle";

/// The result of a query.
#[derive(Clone, Debug, PartialEq)]
pub struct Answer {
    /// The reply text as received, or why there is none.
    pub text: Result<String, VlmError>,
    /// Time from the query to the complete reply or the failure.
    pub latency: Duration,
    /// The model that replied, as it names itself; the model queried, if there was no reply.
    pub model: String,
    /// Resources used.
    pub account: Usage,
}

/// How a model receives a camera's images.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ImageSpec {
    /// Its coordinate convention.
    pub grounding: GroundingProfile,
    /// The size at which images are sent, if not the camera's.
    pub image_size: Option<(u32, u32)>,
}

/// Answers queries: a vision-language model, or a stand-in for one.
///
/// ```
/// use spf_core::time::Duration;
/// use spf_vlm::{Usage, Answer, QueryImage, QueryRequest, Vlm};
///
/// /// Points at the middle of every image.
/// struct Centre;
///
/// impl Vlm for Centre {
///     fn name(&self) -> &str {
///         "centre"
///     }
///
///     fn answer(&mut self, _: &QueryRequest<'_>, _: &mut dyn QueryImage) -> Answer {
///         let text = Ok(r#"{"status": "navigating", "point": [500, 500], "depth": 5}"#.to_owned());
///         Answer { text, latency: Duration::from_secs(1), model: "centre".to_owned(), account: Usage::default() }
///     }
/// }
/// ```
pub trait Vlm: Send {
    /// Its name as on the command line.
    fn name(&self) -> &str;

    /// How it receives the images of a camera with frames of `camera` pixels (width, height). Queries must be written
    /// for this.
    fn image_spec(&self, camera: (u32, u32)) -> ImageSpec {
        let _ = camera;
        ImageSpec::default()
    }

    /// The sampling temperature requested; `None` for the vendor's default.
    fn temperature(&self) -> Option<f64> {
        None
    }

    /// Answers a query; blocks until the reply is complete, the time is up or the query is cancelled. The reported
    /// latency is the time that the flight waits, also in virtual time.
    fn answer(&mut self, request: &QueryRequest<'_>, image: &mut dyn QueryImage) -> Answer;
}

/// The examples of the README, run as tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

//! The `Vlm` interface, and the clients of the vision-language models of several vendors behind it (docs/vlm.md).
//!
//! An answer is *text*, whoever gives it: the oracle's words go through the same parser as a model's. This crate knows nothing
//! of drones and flights.
//!
//! [`table::Table`] says which models there are and how each is to be asked; [`setup`] turns a name from the command line into
//! a [`Remote`], which asks over HTTP. What differs between vendors is data (`models.toml`) or lies in [`wire`].

mod account;
mod asked;
mod backend;
pub mod cassette;
pub mod check;
mod client;
mod day;
mod error;
mod image;
mod key;
mod remote;
pub mod setup;
pub mod table;
mod transport;
mod upload;
pub mod wire;

use std::sync::Arc;

use serde::{Deserialize, Serialize};
use spf_core::grounding::GroundingProfile;
use spf_core::time::Duration;
use spf_media::Rgb;

pub use account::{Account, Parts, Tokens};
pub use asked::{Asked, Cancel};
pub use day::today;
pub use error::VlmError;
pub use image::{ImageRule, SentSize};
pub use key::ApiKey;
pub use remote::{Remote, Strategy};
pub use transport::TransportError;

/// The image a query is about, made only when it is asked for: the oracle needs none, and drawing is the costly part.
pub trait Picture {
    /// Width and height of the camera's frame, pixels.
    fn size(&self) -> (u32, u32);

    /// Has the frame at hand at a size, before the time of the question begins to count.
    fn prepare(&mut self, size: (u32, u32)) {
        let _ = size;
    }

    /// The frame's pixels at its own size, with the query's marks drawn on it: for who looks at them here and sends nothing.
    ///
    /// # Errors
    /// [`VlmError::Picture`] when the frame cannot be had.
    fn pixels(&mut self) -> Result<Rgb, VlmError> {
        let jpeg = self.jpeg(self.size(), 95)?;
        spf_media::jpeg::decode(&jpeg).map_err(|error| VlmError::Picture(error.to_string()))
    }

    /// The frame as JPEG at a size and quality (1..=100), with the query's marks drawn on it; encoded once, however often it
    /// is asked for.
    ///
    /// # Errors
    /// [`VlmError::Picture`] when the frame cannot be had or encoded.
    fn jpeg(&mut self, size: (u32, u32), quality: u8) -> Result<Arc<[u8]>, VlmError>;
}

/// What became of a question.
#[derive(Clone, Debug, PartialEq)]
pub struct Answer {
    /// The text as it came, or why there is none.
    pub text: Result<String, VlmError>,
    /// From the question to the whole answer, or to giving up.
    pub latency: Duration,
    /// Who answered, as it called itself; who was asked, when nobody answered.
    pub model: String,
    /// What it took.
    pub account: Account,
}

/// How a model sees a camera's images.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Eyesight {
    /// The coordinates it is asked for and answers in.
    pub grounding: GroundingProfile,
    /// The size at which images are sent, if not the camera's.
    pub image_size: Option<(u32, u32)>,
}

/// Whoever answers queries: a vision-language model, or a stand-in for one.
pub trait Vlm: Send {
    /// Its name as on the command line.
    fn name(&self) -> &str;

    /// How it sees the images of a camera with frames of `camera` pixels, width first. Queries are to be written for this.
    fn eyesight(&self, camera: (u32, u32)) -> Eyesight {
        let _ = camera;
        Eyesight::default()
    }

    /// The temperature that it is asked to answer at; none where that is left to whoever answers.
    fn temperature(&self) -> Option<f64> {
        None
    }

    /// Answers a query; blocks until the whole answer is there, the time is up or the question is cancelled. The latency told
    /// is what the flight waits, in virtual time too.
    fn answer(&mut self, asked: &Asked<'_>, picture: &mut dyn Picture) -> Answer;
}

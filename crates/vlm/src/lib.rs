//! The `Vlm` interface: whoever answers queries about camera frames.
//!
//! An answer is *text*, whoever gives it: the oracle's words go through the same parser as a model's. This crate knows nothing
//! of drones and flights.

use std::sync::Arc;

use spf_core::query::Query;
use spf_core::time::Duration;

/// The picture a query is about, made only when it is asked for: the oracle needs none, and drawing is the costly part.
pub trait Picture {
    /// The frame as JPEG, with the query's marks drawn on it, encoded once.
    ///
    /// # Errors
    /// [`VlmError::Picture`] when the frame cannot be had or encoded.
    fn jpeg(&mut self) -> Result<Arc<[u8]>, VlmError>;
}

/// An answer to a query.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Answer {
    /// The text as it came.
    pub text: String,
    /// From the question to the whole answer.
    pub latency: Duration,
    /// Who answered, as it called itself.
    pub model: String,
}

/// Why there is no answer.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum VlmError {
    /// The picture could not be had.
    #[error("the camera frame could not be prepared: {0}")]
    Picture(String),
    /// The one asked cannot answer this kind of question.
    #[error("`{model}` cannot answer: {reason}")]
    Refused {
        /// Who was asked.
        model: String,
        /// Why.
        reason: String,
    },
}

/// Whoever answers queries: a vision-language model, or a stand-in for one.
pub trait Vlm: Send {
    /// Its name as on the command line.
    fn name(&self) -> &str;

    /// Answers a query; blocks until the whole answer is there. The latency told is what the flight waits, in virtual time too.
    ///
    /// # Errors
    /// [`VlmError`] when there is no answer; the pilot counts it and holds.
    fn answer(&mut self, query: &Query, picture: &mut dyn Picture) -> Result<Answer, VlmError>;
}

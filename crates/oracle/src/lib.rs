//! The oracle: a stand-in for a VLM (`docs/oracle.md`).
//!
//! It is a pure function of the query, the id and depth images, the tags of visible objects, the scene's `near`, the error
//! file, the seed and the frame number. It has no state, no pose, no task and no access to the judge; an object without a
//! visible pixel does not exist for it. It forms one [`Percept`] a frame and answers every kind of query from it, as text
//! that goes through the same parser as any model's. No number made with it is ever presented as a VLM's.
//!
//! The two types to know are [`Oracle`] and [`Percept`]. It knows words only out of its own lists and the tags of what is seen; it
//! refuses error files with a key that it does not know or a figure out of its range ([`ErrorFileError`]).
//!
//! The truth that judges flights by `verified` shares its language, without errors and over all objects: [`resolve_truth`].
#![forbid(unsafe_code)]

mod act;
mod answer;
mod corridor;
mod errors;
mod kinds;
pub mod language;
mod masks;
mod percept;
mod place;
mod reading;
mod stages;
mod truth;

use spf_core::frame::FrameId;
use spf_core::query::{Query, QueryKind};
use spf_core::rng::Draw;
use spf_core::tags::Tagged;
use spf_core::time::{Duration, duration_from_secs};

pub use errors::{
    ActErrors, BoxErrors, DoneErrors, ErrorFile, ErrorFileError, LabelErrors, LatencyErrors, PointErrors, RangeErrors, Reading,
    SeenErrors, WhichErrors,
};
pub use masks::{Mask, masks};
pub use percept::{Percept, SIZE_SENT, Sight, Thing};
pub use place::{Place, Placed, Viewpoint};
pub use reading::{Correction, InstructionReading, ReadStep, UnknownWord, read_instruction};
pub use truth::{TruthTarget, resolve_truth};

/// What a list of detections takes: no VLM makes it, but a detector, of which a small one on a processor is meant.
const DETECTOR_LATENCY: Duration = Duration::from_millis(100);

/// A stand-in for a VLM. Clone it freely: it has no state.
#[derive(Clone, Debug, PartialEq)]
pub struct Oracle {
    errors: ErrorFile,
    near: f64,
    seed: u64,
}

/// What the oracle answers to one query.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OracleAnswer {
    /// The text, for the reply parser; coordinates in the default grounding profile.
    pub text: String,
    /// How long it takes to answer.
    pub latency: Duration,
}

impl Oracle {
    /// An oracle that errs as `errors` say. `near` is the scene's: the range in metres at which *done* is even odds.
    #[must_use]
    pub fn new(errors: ErrorFile, near: f64, seed: u64) -> Self {
        Self { errors, near, seed }
    }

    /// Its error file.
    #[must_use]
    pub fn errors(&self) -> &ErrorFile {
        &self.errors
    }

    /// What it takes in of one frame, drawn by the frame's number. `tags` are those of the scene's objects; those without a
    /// visible pixel are not looked at.
    #[must_use]
    pub fn percept(&self, frame: FrameId, sight: &Sight<'_>, tags: &[Tagged]) -> Percept {
        Percept::draw(&self.errors, self.seed, frame, sight, tags)
    }

    /// Its answer to a query about the frame of `percept`. Latency and the errors of one answer are drawn by the query's
    /// number.
    #[must_use]
    pub fn answer(&self, query: &Query, percept: &Percept) -> OracleAnswer {
        OracleAnswer { text: answer::text(self, query, percept), latency: self.latency(query) }
    }

    /// Log-normal with the error file's median and 95th percentile, which lies 1.6449 deviations above; a list of detections takes
    /// what a detector takes.
    fn latency(&self, query: &Query) -> Duration {
        if matches!(query.kind, QueryKind::Detect { .. }) {
            return DETECTOR_LATENCY;
        }
        let latency = &self.errors.latency;
        let deviation = libm::log(latency.p95_s / latency.median_s) / 1.644_853_626_951_472_7;
        let normal = self.by_query("latency", query).normal();
        duration_from_secs(latency.median_s * libm::exp(deviation * normal))
    }

    /// A generator for one answer. The instruction is part of its name: flights of two tasks with one seed share no luck here.
    fn by_query(&self, purpose: &str, query: &Query) -> Draw {
        Draw::new(self.seed, &format!("oracle answer {purpose}: {}", query.instruction), &[query.id.0])
    }
}

#[cfg(test)]
mod tests;

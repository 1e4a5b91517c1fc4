//! The oracle: a stand-in for a VLM (`docs/explanation/oracle.md`).
//!
//! It is a pure function of the query, the id and depth images, the tags of visible objects, the words of all the scene's
//! tags, the scene's `near`, the error file, the seed and the frame number. It has no state, and no access to the pose
//! or the judge; an object without a visible pixel does not exist for it. It forms one [`Percept`] per frame and
//! answers every kind of query from it, as text that goes through the same parser as a model's reply. Its results are
//! never presented as those of a VLM.
//!
//! The main types are [`Oracle`] and [`Percept`]; [`read_instruction`] shows how an instruction is understood before a
//! flight. The vocabulary consists of the crate's own word lists and the scene's tags. Error files with unknown keys or
//! values out of range are rejected ([`ErrorFileError`]).
//!
//! For a task of the bench the stages and the ids of their objects are given as data ([`Brief`]), and no instruction is read.
//!
//! The ground truth behind `verified` uses the same language parser, without errors and over all objects:
//! [`resolve_truth`].
#![forbid(unsafe_code)]

mod account;
mod act;
mod answer;
mod brief;
mod chatter;
mod corridor;
mod errors;
mod extent;
mod kinds;
pub mod language;
pub mod limits;
mod masks;
mod obedience;
mod obstacles;
mod percept;
mod place;
mod reading;
pub mod refusal;
mod sight;
mod signs;
mod slope;
mod stages;
mod truth;

use std::sync::Arc;

use spf_core::frame::FrameId;
use spf_core::query::{Query, QueryKind};
use spf_core::rng::RandomStream;
use spf_core::tags::Tagged;
use spf_core::time::{Duration, duration_from_secs};

pub use account::{Account, account};
pub use brief::{Brief, BriefSign, BriefStage, SignDemand};
pub use errors::{
    ActErrors, BoxErrors, DoneErrors, ErrorFile, ErrorFileError, LabelErrors, LatencyErrors, PointErrors, RangeErrors, Reading,
    SeenErrors, WhichErrors,
};
pub use masks::{Mask, masks};
pub use obedience::{Obedience, Per};
pub use percept::{LETTER_PX, PerceivedSign, Percept};
pub use place::{Place, Placed, Viewpoint};
pub use reading::{Correction, InstructionReading, ReadStep, UnknownWord, read_instruction};
pub use sight::{GroundTruthView, PerceivedObject, SIZE_SENT};
pub use truth::{TruthTarget, resolve_truth};

/// Latency of a list of detections, which comes from a detector instead of a VLM: that of a small one on a CPU.
pub const DETECTOR_LATENCY: Duration = Duration::from_millis(100);

/// A stand-in for a VLM. It is stateless, so clones are independent.
///
/// ```
/// use std::collections::BTreeMap;
///
/// use spf_core::camera::Camera;
/// use spf_core::frame::FrameId;
/// use spf_core::geometry::Attitude;
/// use spf_core::query::{Query, QueryId, QueryKind};
/// use spf_core::tags::Tagged;
/// use spf_oracle::{ErrorFile, Oracle, GroundTruthView};
///
/// // An image of 96×72 pixels whose right half shows object 1 at 10 m.
/// let (width, height, camera) = (96, 72, Camera::quad().resized(96, 72));
/// let ids: Vec<u16> = (0..width * height).map(|pixel| u16::from(pixel % width >= width / 2)).collect();
/// let depth: Vec<f32> = ids.iter().map(|id| 10.0 * f32::from(*id)).collect();
/// let (in_frame, light) = (BTreeMap::new(), BTreeMap::new());
/// let sight = GroundTruthView {
///     width, height, ids: &ids, depth: &depth, opening_ids: &[], opening_depth: &[], camera: &camera,
///     piece_ids: &[], pieces: &[], in_frame: &in_frame, light: &light, signs: &[],
///     attitude: Attitude::default(),
/// };
/// let wall = Tagged { id: 1, key: "wall".into(), names: vec!["wall".into()], kind: "wall".into(), ..Tagged::default() };
///
/// let oracle = Oracle::new(ErrorFile::named("perfect")?, 3.0, 0);
/// let percept = oracle.percept(FrameId(0), &sight, &[wall]);
/// let mut query = Query::new(QueryId(0), FrameId(0), QueryKind::point(false));
/// query.instruction = "fly to the wall".to_owned();
/// let answer = oracle.answer(&query, &percept);
/// assert!(answer.text.contains("navigating"), "{}", answer.text);
/// # Ok::<(), spf_oracle::ErrorFileError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Oracle {
    errors: ErrorFile,
    near: f64,
    seed: u64,
    brief: Option<Arc<Brief>>,
}

/// The oracle's answer to a query.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OracleAnswer {
    /// The reply text, with coordinates in the default grounding profile.
    pub text: String,
    /// The simulated latency.
    pub latency: Duration,
}

impl Oracle {
    /// An oracle with the given errors. `near` is the scene's: the range in metres at which *done* has a probability of
    /// one half.
    #[must_use]
    pub fn new(errors: ErrorFile, near: f64, seed: u64) -> Self {
        Self { errors, near, seed, brief: None }
    }

    /// The same, which flies a brief, whatever the words of the instruction are; with `None`, it reads these.
    #[must_use]
    pub fn with_brief(self, brief: Option<Arc<Brief>>) -> Self {
        Self { brief, ..self }
    }

    /// Its error file.
    #[must_use]
    pub fn errors(&self) -> &ErrorFile {
        &self.errors
    }

    /// The percept of a frame; random values depend on the frame number. `tags` are those of the scene's objects; those
    /// without a visible pixel are ignored.
    #[must_use]
    pub fn percept(&self, frame: FrameId, sight: &GroundTruthView<'_>, tags: &[Tagged]) -> Percept {
        Percept::draw(&self.errors, self.seed, frame, sight, tags)
    }

    /// Answers a query about the frame of `percept`. Latency and the errors of a single answer depend on the query's
    /// number.
    #[must_use]
    pub fn answer(&self, query: &Query, percept: &Percept) -> OracleAnswer {
        OracleAnswer { text: answer::text(self, query, percept), latency: self.latency(query) }
    }

    /// Log-normal with the error file's median and 95th percentile (1.6449 standard deviations above it); a detector's
    /// latency for a list of detections.
    fn latency(&self, query: &Query) -> Duration {
        if matches!(query.kind, QueryKind::Detect { .. }) {
            return DETECTOR_LATENCY;
        }
        let latency = &self.errors.latency;
        let deviation = libm::log(latency.p95_s / latency.median_s) / 1.644_853_626_951_472_7;
        let normal = self.by_query("latency", query).normal();
        duration_from_secs(latency.median_s * libm::exp(deviation * normal))
    }

    /// The generator for one answer. The instruction is part of its key, so that flights of two tasks with equal seeds
    /// are independent.
    fn by_query(&self, purpose: &str, query: &Query) -> RandomStream {
        RandomStream::new(self.seed, &format!("oracle answer {purpose}: {}", query.instruction), &[query.id.0])
    }
}

/// The examples of the README, run as tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

#[cfg(test)]
mod tests;

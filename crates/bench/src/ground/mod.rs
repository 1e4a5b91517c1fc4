//! Pointing, measured: pictures and instructions, who points where, and how well (docs/guide/grounding.md).
//!
//! [`source`] reads images with their truth, [`ask`] asks [`Answerer`]s about them, [`grade`] compares an answer with the truth,
//! [`measure`] sums up with intervals, [`page`] shows it. Where there is no truth there are no grades, and no rate is made up.

mod answer;
pub mod ask;
pub mod expected;
pub mod grade;
pub mod measure;
mod oracle;
pub mod page;
pub mod photo;
pub mod source;
pub mod table;
mod truth;

pub use answer::{AnswerRow, Said};
pub use ask::{Answerer, CENTRE};
pub use truth::{Mask, Outline, Shape, Target, Truth, TruthError};

use std::path::PathBuf;

use source::SimExample;

/// One image, what is said about it, and what that means in it.
#[derive(Clone, Debug, PartialEq)]
pub struct Item {
    /// What it is called in `answers.jsonl`; no two of one source share it.
    pub key: String,
    /// What is said.
    pub instruction: String,
    /// The image's file.
    pub picture: PathBuf,
    /// What is meant.
    pub truth: Truth,
    /// What the oracle reads; none for photographs.
    pub sim: Option<SimExample>,
}

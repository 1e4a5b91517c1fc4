//! Pointing accuracy: images with instructions, answers and their grades (docs/guide/grounding.md).
//!
//! [`source`] reads images with their ground truth, [`ask`] sends them to [`Answerer`]s, [`grade`] compares an answer
//! with the ground truth, [`measure`] computes statistics, and [`page`] displays them. Without ground truth there are
//! no grades and no rates.

mod answer;
pub mod ask;
pub mod expected;
pub mod grade;
pub mod measure;
mod oracle;
pub mod page;
pub mod photo;
pub mod signs;
pub mod source;
pub mod table;
mod truth;

pub use answer::{AnswerRow, ParsedReply};
pub use ask::{Answerer, CENTRE};
pub use truth::{Mask, Outline, Shape, Target, Truth, TruthError};

use std::path::PathBuf;

use source::SimExample;

/// An image with an instruction and its ground truth.
#[derive(Clone, Debug, PartialEq)]
pub struct Item {
    /// Its key in `answers.jsonl`, unique within a source.
    pub key: String,
    /// The instruction.
    pub instruction: String,
    /// Path of the image.
    pub image: PathBuf,
    /// The ground truth.
    pub truth: Truth,
    /// Data for the oracle; `None` for photographs.
    pub sim: Option<SimExample>,
}

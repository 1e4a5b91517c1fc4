//! Printed words: what is written on an object, as it appears in a frame.

use serde::{Deserialize, Serialize};

/// The direction of an arrow as its reader sees it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Arrow {
    /// To the reader's left.
    Left,
    /// To the reader's right.
    Right,
    /// Upwards.
    Up,
    /// Downwards.
    Down,
}

/// The writing on an object as seen from a camera, apart from its distance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SignView {
    /// Id of the object.
    pub id: u16,
    /// The text, lines separated by `\n`; empty for an arrow alone.
    pub text: String,
    /// An arrow.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub arrow: Option<Arrow>,
    /// Height of a capital letter, or of the arrow where there is no text, metres.
    pub letter_m: f64,
    /// Area of the board, or of the strokes where there is none, square metres.
    pub area_m2: f64,
    /// Cosine of the angle between the sign's front and the direction to the camera; 0 from behind.
    pub facing: f64,
}

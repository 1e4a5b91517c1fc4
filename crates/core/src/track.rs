//! The target's box between two answers, kept by a tracker from pixels alone (`docs/explanation/between-answers.md`).
//!
//! The pilot sees no pixels. It asks for a track of the box that a reply has given ([`TrackStart`]), and whoever has the images
//! reports where that box is in each later frame ([`TrackReport`]).

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::frame::FrameId;
use crate::query::{ImageBox, QueryId};
use crate::time::Time;

/// A request to track a box, from the frame in which a reply has seen it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct TrackStart {
    /// The query whose reply gave the box; names the track.
    pub id: QueryId,
    /// The frame that was asked about, which is older than the reply.
    pub frame: FrameId,
    /// The box in that frame.
    pub area: ImageBox,
}

/// How far a track can be trusted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum TrackQuality {
    /// The box is on the target.
    Good,
    /// The target was not recognised for a moment; the box is where it is expected.
    Coasting,
    /// The target is hidden, gone or changed; the box means nothing. It may become good again.
    Lost,
    /// The target is too small in the image, less than 12 pixels; nothing is tracked any more.
    TooSmall,
}

/// Where a tracked target is in a frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct TrackReport {
    /// The track: the query that started it.
    pub id: QueryId,
    /// The frame.
    pub frame: FrameId,
    /// When that frame was captured.
    pub captured: Time,
    /// The box in it; it may extend beyond the image.
    pub area: ImageBox,
    /// The target's size in the image divided by its size in the frame of the start.
    pub scale: f64,
    /// How far this can be trusted.
    pub quality: TrackQuality,
}

impl TrackReport {
    /// Whether all values are finite numbers, the box is in order and the scale is positive. Other reports are ignored.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        let ImageBox { left, top, right, bottom } = self.area;
        let edges = [left, top, right, bottom];
        edges.iter().all(|edge| edge.is_finite()) && left <= right && top <= bottom && self.scale.is_finite() && self.scale > 0.0
    }
}

//! What the core knows of a camera image: when and where it was taken, never its pixels.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::time::Time;

/// Number of a camera frame within a flight, counting up from 0 in order of capture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct FrameId(pub u64);

/// A camera frame as the pilot knows it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct FrameMeta {
    /// Its number.
    pub id: FrameId,
    /// Flight time at which the shutter opened.
    pub captured: Time,
    /// Flight time at which it reached the pilot; never before `captured`.
    pub received: Time,
    /// The camera's own capture counter. Two frames with the same counter are one picture delivered twice: a frozen camera
    /// is judged by this and not by equal pixels, since a hovering drone may well see the same picture twice.
    pub capture_counter: u64,
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// True when the source knows the picture to be blank, a placeholder or undecodable; such a frame is never shown to a VLM.
    pub unusable: bool,
}

//! Camera frame metadata: when and where a frame was taken, never its pixels.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::time::Time;

/// Number of a camera frame within a flight, from 0 in order of capture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct FrameId(pub u64);

/// Metadata of a camera frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct FrameMeta {
    /// Its number.
    pub id: FrameId,
    /// Flight time at which the shutter opened.
    pub captured: Time,
    /// Flight time at which the frame reached the pilot; never before `captured`.
    pub received: Time,
    /// The camera's own capture counter. Two frames with the same counter are the same image delivered twice. A frozen
    /// camera is detected by this and not by equal pixels, since a hovering drone may capture identical images.
    pub capture_counter: u64,
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// Why the frame is unusable, if its source knows that it is; such a frame is never sent to a VLM. Logs record only
    /// whether it is usable.
    #[serde(with = "whether")]
    #[schemars(
        with = "bool",
        description = "True if the frame is known to be blank, covered, smeared, damaged, a placeholder or undecodable; such a frame is never sent to a VLM."
    )]
    pub unusable: Option<Unusable>,
}

/// Why a frame is unusable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unusable {
    /// A single colour, or empty.
    Blank,
    /// Dark and without any structure: the lens is covered, or the camera shows black.
    Covered,
    /// Rows or columns repeated over a large part of it.
    Smeared,
    /// A large part of it is missing or concealed after a loss in transmission.
    Damaged,
    /// A placeholder shown instead of the camera image.
    Placeholder,
    /// It could not be decoded.
    Undecodable,
    /// It has another shape than the camera's images had when the flight began.
    Resized,
    /// The window that shows it is covered, minimised or gone, so that it is an old one.
    Hidden,
    /// It has not changed although the craft was to move: the game that shows it is paused, frozen or ended.
    Frozen,
    /// The gimbal of its camera looks aside, or where it looks is unknown.
    Aside,
    /// The reason is unknown: read from a log, which does not record it.
    Unrecorded,
}

/// Serialises as a boolean, as logs have it.
mod whether {
    use serde::{Deserialize, Deserializer, Serializer};

    use super::Unusable;

    pub(super) fn serialize<S: Serializer>(unusable: &Option<Unusable>, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_bool(unusable.is_some())
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<Unusable>, D::Error> {
        Ok(bool::deserialize(deserializer)?.then_some(Unusable::Unrecorded))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_log_records_whether_a_frame_is_usable() {
        let frame = FrameMeta {
            id: FrameId(7),
            captured: Time::ZERO,
            received: Time::ZERO,
            capture_counter: 7,
            width: 4,
            height: 3,
            unusable: Some(Unusable::Blank),
        };
        let json = serde_json::to_string(&frame).unwrap();
        assert!(json.ends_with(r#""unusable":true}"#), "{json}");
        assert_eq!(serde_json::from_str::<FrameMeta>(&json).unwrap().unusable, Some(Unusable::Unrecorded));
        let usable = FrameMeta { unusable: None, ..frame };
        assert_eq!(serde_json::from_str::<FrameMeta>(&serde_json::to_string(&usable).unwrap()).unwrap(), usable);
    }
}

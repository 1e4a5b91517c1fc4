//! Points followed through the camera's frames, reported to the pilot (`docs/explanation/between-answers.md`).
//!
//! The pilot sees no pixels. Whoever has the images follows corners from frame to frame, and reports where they are in each frame.
//! What they tell about the surroundings is computed by [`triangulation`](crate::triangulation).

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::frame::FrameId;
use crate::query::ImagePoint;
use crate::time::Time;

/// Steps of a coordinate across the image: 1/136 pixel of an image 480 pixels wide.
const STEPS: f64 = 65_535.0;

/// A point in a frame, in a few bytes of a flight log: its number, and how far it is from the left and the upper edge of the image,
/// as fractions of width and height in steps of 1/65535.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
pub struct TrackedPoint(pub u32, pub u16, pub u16);

impl TrackedPoint {
    /// The point with this number at a place of the image; `None` for a place outside, or no place.
    #[must_use]
    pub fn new(id: u32, at: ImagePoint) -> Option<Self> {
        // The bounds have been checked.
        let steps = |x: f64| libm::round(x * STEPS) as u16;
        at.is_in_image().then(|| Self(id, steps(at.u), steps(at.v)))
    }

    /// Its number, which it keeps from frame to frame. A lost point's number is not used again.
    #[must_use]
    pub fn id(self) -> u32 {
        self.0
    }

    /// Its place in the image.
    #[must_use]
    pub fn at(self) -> ImagePoint {
        ImagePoint { u: f64::from(self.1) / STEPS, v: f64::from(self.2) / STEPS }
    }
}

/// Where the points that are followed are in a frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PointReport {
    /// The frame.
    pub frame: FrameId,
    /// When that frame was captured.
    pub captured: Time,
    /// The points; those that the frame does not show are left out.
    pub points: Vec<TrackedPoint>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_takes_few_bytes_and_keeps_its_place_to_a_hundredth_of_a_pixel() {
        let at = ImagePoint { u: 0.123_456, v: 1.0 };
        let point = TrackedPoint::new(7, at).unwrap();
        assert!((point.at().u - at.u).abs() * 480.0 < 0.01 && point.at().v == 1.0);
        assert_eq!(serde_json::to_string(&point).unwrap(), "[7,8091,65535]");
        assert_eq!(TrackedPoint::new(7, ImagePoint { u: 1.01, v: 0.5 }), None);
        assert_eq!(TrackedPoint::new(7, ImagePoint { u: f64::NAN, v: 0.5 }), None);
    }
}

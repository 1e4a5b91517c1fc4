//! The newest picture, for an assistant.

use std::time::Instant;

use spf_core::query::ImagePoint;
use spf_media::marks::{Colour, draw_waypoint};
use spf_media::{Jpeg, Scaler};

use crate::watch::{Mark, Newest};

/// The longest side of a picture, pixels: larger ones are made smaller by the models that look at them.
const LONGEST: u32 = 768;
const QUALITY: u8 = 80;

/// A picture with what is marked on it.
pub struct Picture {
    /// JPEG.
    pub jpeg: Vec<u8>,
    /// Number of the frame.
    pub frame: u64,
    /// Width and height, pixels.
    pub size: (u32, u32),
    /// Seconds since it was captured.
    pub age_s: f64,
    /// Where the craft flies to: a ring.
    pub goal: Option<Mark>,
}

impl Picture {
    /// Encodes the newest frame.
    ///
    /// # Errors
    /// Why it cannot be encoded.
    pub fn of(newest: &Newest) -> Result<Self, String> {
        let Newest { frame, captured, photo, goal, .. } = newest;
        let size = within(photo.size(), LONGEST);
        let mut image = photo.at(size, &mut Scaler::default());
        if let Some(Mark { u, v, metres }) = goal {
            draw_waypoint(&mut image, ImagePoint { u: *u, v: *v }, &format!("{metres:.1} m"), Colour::WAYPOINT);
        }
        let jpeg = Jpeg::encode(&image, QUALITY).map_err(|error| format!("the picture cannot be encoded: {error}"))?;
        let age_s = Instant::now().saturating_duration_since(*captured).as_secs_f64();
        Ok(Self { jpeg: jpeg.bytes().to_vec(), frame: *frame, size, age_s, goal: *goal })
    }
}

/// A size in the same shape whose longer side is at most this.
fn within((width, height): (u32, u32), longest: u32) -> (u32, u32) {
    let longer = width.max(height).max(1);
    if longer <= longest {
        return (width, height);
    }
    let side = |side: u32| (side * longest / longer).max(1);
    (side(width), side(height))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_keep_their_shape() {
        assert_eq!(within((960, 720), LONGEST), (768, 576));
        assert_eq!(within((640, 480), LONGEST), (640, 480));
        assert_eq!(within((100, 4000), LONGEST), (19, 768));
        assert_eq!(within((1, 100_000), LONGEST), (1, 768));
    }
}

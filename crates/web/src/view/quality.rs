//! Image size and quality: as good as can be rendered smoothly while moving, full quality at rest.

use std::time::Duration;

use spf_render::Quality;

use super::message::Detail;

/// Widths of a moving image, in sixths of the camera's.
const SIXTHS: [u32; 4] = [6, 4, 3, 2];
/// Maximum time for rendering and encoding a moving image.
const FLUENT: Duration = Duration::from_millis(42);
/// Weight of a new measurement in the average.
const WEIGHT: f64 = 0.2;

/// Rendering parameters of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct FrameQuality {
    /// Width and height, pixels.
    pub(super) size: (u32, u32),
    pub(super) quality: Quality,
}

/// Chooses parameters from measured times.
#[derive(Debug, Default)]
pub(super) struct Budget {
    pub(super) detail: Detail,
    /// Nanoseconds per pixel with and without anti-aliasing; `None` before the first measurement.
    smooth: Option<f64>,
    jagged: Option<f64>,
}

impl Budget {
    /// Parameters of the next image, for a camera of this size.
    pub(super) fn frame_quality(&self, (width, height): (u32, u32), moving: bool) -> FrameQuality {
        let frame_quality = |sixths: u32, quality| FrameQuality { size: (width * sixths / 6, height * sixths / 6), quality };
        match self.detail {
            Detail::Low => frame_quality(2, Quality::Full),
            Detail::Medium => frame_quality(4, Quality::Full),
            Detail::High => frame_quality(6, Quality::Full),
            Detail::Auto if !moving => frame_quality(6, Quality::Full),
            Detail::Auto => {
                // Full size with anti-aliasing if fast enough; otherwise without, as large as possible.
                let jagged = SIXTHS.into_iter().map(|sixths| frame_quality(sixths, Quality::Live));
                let fluent = [frame_quality(6, Quality::Full)]
                    .into_iter()
                    .chain(jagged)
                    .find(|frame_quality| self.is_fluent(frame_quality));
                fluent.unwrap_or(frame_quality(SIXTHS[SIXTHS.len() - 1], Quality::Live))
            }
        }
    }

    fn is_fluent(&self, frame_quality: &FrameQuality) -> bool {
        let cost = match frame_quality.quality {
            Quality::Full => self.smooth,
            Quality::Live => self.jagged,
        };
        cost.is_none_or(|cost| cost * pixels(frame_quality.size) <= FLUENT.as_nanos() as f64)
    }

    /// Records the time of an image.
    pub(super) fn took(&mut self, frame_quality: &FrameQuality, time: Duration) {
        let cost = time.as_nanos() as f64 / pixels(frame_quality.size).max(1.0);
        let mean = match frame_quality.quality {
            Quality::Full => &mut self.smooth,
            Quality::Live => &mut self.jagged,
        };
        *mean = Some(mean.map_or(cost, |mean| mean + (cost - mean) * WEIGHT));
    }
}

fn pixels((width, height): (u32, u32)) -> f64 {
    f64::from(width) * f64::from(height)
}

#[cfg(test)]
mod tests {
    use super::*;

    const WHOLE: FrameQuality = FrameQuality { size: (960, 720), quality: Quality::Full };
    const JAGGED: FrameQuality = FrameQuality { size: (960, 720), quality: Quality::Live };

    #[test]
    fn a_slow_machine_renders_less_while_moving() {
        let mut budget = Budget::default();
        let moving = |budget: &Budget| {
            assert_eq!(budget.frame_quality((960, 720), false), WHOLE);
            budget.frame_quality((960, 720), true)
        };
        assert_eq!(moving(&budget), WHOLE);
        budget.took(&WHOLE, Duration::from_millis(90));
        assert_eq!(moving(&budget), JAGGED);
        // 90 ms for the whole: 42 ms have room for four ninths of it.
        budget.took(&JAGGED, Duration::from_millis(90));
        assert_eq!(moving(&budget), FrameQuality { size: (640, 480), quality: Quality::Live });
        for _ in 0..50 {
            budget.took(&JAGGED, Duration::from_secs(5));
        }
        assert_eq!(moving(&budget), FrameQuality { size: (320, 240), quality: Quality::Live });
        for _ in 0..50 {
            budget.took(&WHOLE, Duration::from_millis(20));
        }
        assert_eq!(moving(&budget), WHOLE);
    }

    #[test]
    fn a_chosen_size_stays() {
        let budget = Budget { detail: Detail::Low, smooth: Some(1e9), jagged: None };
        assert_eq!(budget.frame_quality((960, 720), true), FrameQuality { size: (320, 240), quality: Quality::Full });
    }
}

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
pub(super) struct Manner {
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
    pub(super) fn manner(&self, (width, height): (u32, u32), moving: bool) -> Manner {
        let manner = |sixths: u32, quality| Manner { size: (width * sixths / 6, height * sixths / 6), quality };
        match self.detail {
            Detail::Low => manner(2, Quality::Full),
            Detail::Medium => manner(4, Quality::Full),
            Detail::High => manner(6, Quality::Full),
            Detail::Auto if !moving => manner(6, Quality::Full),
            Detail::Auto => {
                // Full size with anti-aliasing if fast enough; otherwise without, as large as possible.
                let jagged = SIXTHS.into_iter().map(|sixths| manner(sixths, Quality::Live));
                let fluent = [manner(6, Quality::Full)].into_iter().chain(jagged).find(|manner| self.is_fluent(manner));
                fluent.unwrap_or(manner(SIXTHS[SIXTHS.len() - 1], Quality::Live))
            }
        }
    }

    fn is_fluent(&self, manner: &Manner) -> bool {
        let cost = match manner.quality {
            Quality::Full => self.smooth,
            Quality::Live => self.jagged,
        };
        cost.is_none_or(|cost| cost * pixels(manner.size) <= FLUENT.as_nanos() as f64)
    }

    /// Records the time of an image.
    pub(super) fn took(&mut self, manner: &Manner, time: Duration) {
        let cost = time.as_nanos() as f64 / pixels(manner.size).max(1.0);
        let mean = match manner.quality {
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

    const WHOLE: Manner = Manner { size: (960, 720), quality: Quality::Full };
    const JAGGED: Manner = Manner { size: (960, 720), quality: Quality::Live };

    #[test]
    fn a_slow_machine_draws_less_while_moving() {
        let mut budget = Budget::default();
        let moving = |budget: &Budget| {
            assert_eq!(budget.manner((960, 720), false), WHOLE);
            budget.manner((960, 720), true)
        };
        assert_eq!(moving(&budget), WHOLE);
        budget.took(&WHOLE, Duration::from_millis(90));
        assert_eq!(moving(&budget), JAGGED);
        // 90 ms for the whole: 42 ms have room for four ninths of it.
        budget.took(&JAGGED, Duration::from_millis(90));
        assert_eq!(moving(&budget), Manner { size: (640, 480), quality: Quality::Live });
        for _ in 0..50 {
            budget.took(&JAGGED, Duration::from_secs(5));
        }
        assert_eq!(moving(&budget), Manner { size: (320, 240), quality: Quality::Live });
        for _ in 0..50 {
            budget.took(&WHOLE, Duration::from_millis(20));
        }
        assert_eq!(moving(&budget), WHOLE);
    }

    #[test]
    fn a_chosen_size_stays() {
        let budget = Budget { detail: Detail::Low, smooth: Some(1e9), jagged: None };
        assert_eq!(budget.manner((960, 720), true), Manner { size: (320, 240), quality: Quality::Full });
    }
}

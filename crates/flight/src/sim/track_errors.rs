//! What a tracker makes of a target that it could see: the error model of the stand-in for the tracker.
//!
//! Pure given the true boxes and the seed, so that it can be compared with the tracker itself on clips
//! (`crates/flight/tests/it/clips`).

use spf_core::query::ImageBox;
use spf_core::rng::RandomStream;
use spf_core::track::TrackQuality;

/// Probability per second that a visible target is lost for good.
const LOSS_PER_S: f64 = 0.045;
/// Error of each edge that stays the same for a track, standard deviation as a fraction of the box's side.
const BIAS: f64 = 0.02;
/// Error of each edge in each frame, in the same unit.
const NOISE: f64 = 0.01;
/// Frames without the target until it counts as lost.
const COAST: u32 = 5;
/// Frames in which a target that was lost must be visible again until it is found.
const FIND: u32 = 3;
/// The smallest side of a box that can be tracked, as a fraction of the image's width: 12 of 480 pixels.
const SMALLEST: f64 = 12.0 / 480.0;

/// What a frame shows of the target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TargetSeen {
    /// The box of its pixels.
    pub area: ImageBox,
    /// Its size divided by that at the start, by the distances; `None` if they are not known.
    pub growth: Option<f64>,
}

/// The errors of one track.
#[derive(Clone, Debug)]
pub struct TrackErrors {
    seed: u64,
    id: u64,
    area: ImageBox,
    scale: f64,
    /// Error of each edge, as a fraction of the side.
    bias: [f64; 4],
    /// Frames since the target was last visible, and since it is visible again.
    missing: u32,
    back: u32,
    lost: bool,
}

impl TrackErrors {
    /// The track `id`, which starts with the target in `area`. Equal seeds and ids give equal errors.
    #[must_use]
    pub fn new(seed: u64, id: u64, area: ImageBox) -> Self {
        let mut bias = RandomStream::new(seed, "track bias", &[id]);
        let bias = [(); 4].map(|()| BIAS * bias.normal());
        Self { seed, id, area, scale: 1.0, bias, missing: 0, back: 0, lost: false }
    }

    /// Follows the target into the frame with the number `frame`, `passed` seconds after the last one. `seen` is `None` if the
    /// frame does not show it.
    pub fn next(&mut self, frame: u64, passed: f64, seen: Option<TargetSeen>) {
        let Some(TargetSeen { area, growth }) = seen else {
            self.missing += 1;
            self.back = 0;
            return;
        };
        self.back += 1;
        if self.missing > COAST && self.back < FIND {
            return;
        }
        self.missing = 0;
        let key = [self.id, frame];
        let mut noise = RandomStream::new(self.seed, "track error", &key);
        let [left, top, right, bottom] = self.bias.map(|bias| bias + NOISE * noise.normal());
        let (width, height) = (area.right - area.left, area.bottom - area.top);
        self.area = ImageBox {
            left: area.left + left * width,
            top: area.top + top * height,
            right: area.right + right * width,
            bottom: area.bottom + bottom * height,
        };
        // From the distances: the edge of the image cuts off the mask, but not the points that a tracker follows.
        if let Some(growth) = growth {
            self.scale = growth * (1.0 + right - left);
        }
        self.lost |= RandomStream::new(self.seed, "track loss", &key).chance(LOSS_PER_S * passed);
    }

    /// The box that is reported.
    #[must_use]
    pub const fn area(&self) -> ImageBox {
        self.area
    }

    /// The target's size divided by that at the start, as reported.
    #[must_use]
    pub const fn scale(&self) -> f64 {
        self.scale
    }

    /// The quality that is reported.
    #[must_use]
    pub fn quality(&self) -> TrackQuality {
        if self.lost || self.missing > COAST {
            TrackQuality::Lost
        } else if side(&self.area) < SMALLEST {
            TrackQuality::TooSmall
        } else if self.missing > 0 {
            TrackQuality::Coasting
        } else {
            TrackQuality::Good
        }
    }

    /// Whether it is lost for good.
    #[must_use]
    pub const fn is_lost(&self) -> bool {
        self.lost
    }
}

/// The shorter side, as a fraction of the image's width, for images of 4:3.
fn side(area: &ImageBox) -> f64 {
    (area.right - area.left).min(0.75 * (area.bottom - area.top))
}

//! What a tracker makes of a target that it could see: the error model of the stand-in for the tracker.
//!
//! Pure given the true boxes and the seed, so that it can be compared with the tracker itself on clips
//! (`crates/flight/tests/it/clips`). The constants are fitted to the tracker on such clips
//! (`docs/studies/2026-11-26-tracker-filter.md`).

use spf_core::query::ImageBox;
use spf_core::rng::RandomStream;
use spf_core::track::TrackQuality;

/// The errors of the tracker with one sort of target.
#[derive(Debug)]
struct Constants {
    /// Probability per second that a visible target is lost for good.
    loss_per_s: f64,
    /// Error of the left and right, and of the upper and lower edges, that stays the same for a track: standard deviation as a
    /// fraction of the box's side.
    bias: [f64; 2],
    /// Error of these edges that comes and goes within [`DRIFT_S`], in the same unit.
    drift: [f64; 2],
    /// Error of the logarithm of the scale, which comes and goes too.
    scale: f64,
}

/// Things, which keep their shape.
const THING: Constants = Constants { loss_per_s: 0.01, bias: [0.035, 0.03], drift: [0.043, 0.043], scale: 0.045 };
/// People, whose limbs swing.
const PERSON: Constants = Constants { loss_per_s: 0.035, bias: [0.06, 0.043], drift: [0.104, 0.053], scale: 0.055 };

/// How long an error that comes and goes lasts, seconds.
const DRIFT_S: f64 = 1.0;
/// The part of the target's box, of the size expected by the distance, below which the target counts as hidden.
const HIDDEN: f64 = 0.4;
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
    constants: &'static Constants,
    first: ImageBox,
    area: ImageBox,
    scale: f64,
    /// Errors of the left, upper, right and lower edge, as fractions of the side: what stays, and what comes and goes; and that
    /// of the scale.
    bias: [f64; 4],
    drift: [f64; 4],
    scale_drift: f64,
    /// Frames since the target was last visible, and since it is visible again.
    missing: u32,
    back: u32,
    lost: bool,
}

impl TrackErrors {
    /// The track `id`, which starts with the target in `area`. Equal seeds and ids give equal errors.
    #[must_use]
    pub fn new(seed: u64, id: u64, area: ImageBox, is_person: bool) -> Self {
        let constants = if is_person { &PERSON } else { &THING };
        let mut bias = RandomStream::new(seed, "track bias", &[id]);
        let [across, down] = constants.bias;
        let bias = [across, down, across, down].map(|size| size * bias.normal());
        Self {
            seed,
            id,
            constants,
            first: area,
            area,
            scale: 1.0,
            bias,
            drift: [0.0; 4],
            scale_drift: 0.0,
            missing: 0,
            back: 0,
            lost: false,
        }
    }

    /// Follows the target into the frame with the number `frame`, `passed` seconds after the last one. `seen` is `None` if the
    /// frame does not show it.
    pub fn next(&mut self, frame: u64, passed: f64, seen: Option<TargetSeen>) {
        let key = [self.id, frame];
        let mut noise = RandomStream::new(self.seed, "track error", &key);
        let kept = libm::exp(-passed.max(0.0) / DRIFT_S);
        let [across, down] = self.constants.drift;
        let mut moved = |value: f64, size: f64| value * kept + size * libm::sqrt(1.0 - kept * kept) * noise.normal();
        for (drift, size) in self.drift.iter_mut().zip([across, down, across, down]) {
            *drift = moved(*drift, size);
        }
        self.scale_drift = moved(self.scale_drift, self.constants.scale);
        let Some(TargetSeen { area, growth }) = seen.filter(|seen| !self.is_hidden(seen)) else {
            self.missing += 1;
            self.back = 0;
            return;
        };
        self.back += 1;
        if self.missing > COAST && self.back < FIND {
            return;
        }
        self.missing = 0;
        let (width, height) = (area.right - area.left, area.bottom - area.top);
        let error = |edge: usize, side: f64| (self.bias[edge] + self.drift[edge]) * side;
        let (left, right) = (area.left + error(0, width), area.right + error(2, width));
        let (top, bottom) = (area.top + error(1, height), area.bottom + error(3, height));
        // However large the errors: a box.
        self.area = ImageBox { left: left.min(right), top: top.min(bottom), right: right.max(left), bottom: bottom.max(top) };
        // From the distances: the edge of the image cuts off the mask, but not the points that a tracker follows.
        if let Some(growth) = growth {
            self.scale = growth * libm::exp(self.scale_drift);
        }
        self.lost |= RandomStream::new(self.seed, "track loss", &key).chance(self.constants.loss_per_s * passed);
    }

    /// Whether most of the target is hidden, or outside the image.
    fn is_hidden(&self, seen: &TargetSeen) -> bool {
        let growth = seen.growth.unwrap_or(1.0);
        size(&seen.area) < HIDDEN * size(&self.first) * growth * growth
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

/// The area of a box.
fn size(area: &ImageBox) -> f64 {
    (area.right - area.left) * (area.bottom - area.top)
}

/// The shorter side, as a fraction of the image's width, for images of 4:3.
fn side(area: &ImageBox) -> f64 {
    (area.right - area.left).min(0.75 * (area.bottom - area.top))
}

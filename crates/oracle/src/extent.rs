//! How far an obstacle extends in the image and away from the camera, and the openings in it.

use libm::sqrt;
use spf_core::query::{ImageBox, ImagePoint};
use spf_core::rng::RandomStream;

use super::errors::ErrorFile;
use super::sight::{GroundTruthView, PerceivedObject, SIZE_SENT, slopes};

/// How much farther than an opening something is that is seen through it; how much nearer, past which it is seen.
pub(super) const BEHIND: f64 = 1.15;

/// Something solid in the image.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Obstacle {
    /// The object to which it belongs, an id.
    pub(super) object: u16,
    /// Its name.
    pub(super) name: String,
    /// Smallest rectangle around its visible pixels.
    pub(super) area: ImageBox,
    /// Distance to its nearest visible surface, with the noise of the object's range, metres.
    pub(super) nearest: f64,
    /// Square root of its visible pixels at [`SIZE_SENT`], reduced by darkness.
    pub(super) size: f64,
    /// Uniform random number that decides whether its box is reported.
    pub(super) box_luck: f64,
    /// Whether it is rising ground.
    pub(super) slope: bool,
}

/// Boxes along one thing; the last one holds the rest.
pub(super) const BANDS: usize = 4;

/// Where a pixel of something that surrounds an opening lies.
pub(super) const SIDES: usize = 5;

/// A visible opening.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hole {
    pub(super) area: ImageBox,
    /// Straight-line distance to its farthest edge, about, metres.
    pub(super) range: f64,
}

/// The straight-line distance squared to the surface at each pixel.
pub(super) struct Distances {
    /// Metres to the right per metre along the optical axis, by column.
    pub(super) aside: Vec<f64>,
    /// Metres up, by row.
    pub(super) up: Vec<f64>,
}

impl Distances {
    pub(super) fn of(sight: &GroundTruthView<'_>) -> Self {
        let (w, h) = (sight.width, sight.height);
        let at = |x: usize, y: usize| ImagePoint { u: (x as f64 + 0.5) / w as f64, v: (y as f64 + 0.5) / h as f64 };
        let aside = (0..w).map(|x| slopes(sight.camera, at(x, 0)).0).collect();
        let up = (0..h).map(|y| slopes(sight.camera, at(0, y)).1).collect();
        Self { aside, up }
    }

    pub(super) fn squared(&self, x: usize, y: usize, along: f64) -> f64 {
        along * along * (1.0 + self.aside[x] * self.aside[x] + self.up[y] * self.up[y])
    }
}

/// Which part of the range of a thing, whose nearest surface is at `nearest`, a surface is in; both squared. Up to a metre everything
/// has one label, and from 100 m on.
pub(super) fn band(squared: f64, nearest: f64) -> usize {
    let (squared, from) = (squared.min(1e4), nearest.clamp(1.0, 1e4));
    let mut end = from;
    (1..BANDS)
        .take_while(|_| {
            end *= BAND;
            squared >= end
        })
        .count()
}

/// Squared distance at the end of a band relative to its start. One box spans two depth labels, of which there are 4.5 to a decade of
/// distance: 10 to the power of 2 · 2 / 4.5.
pub(super) const BAND: f64 = 7.742_636_826_811_27;

/// The side of an opening on which a point of what surrounds it lies: left, right, above, below, or seen through it; `None` for the
/// frame's own corners inside the opening's box.
pub(super) fn side(hole: &Hole, point: ImagePoint, squared: f64) -> Option<usize> {
    let area = &hole.area;
    if point.u < area.left {
        Some(0)
    } else if point.u > area.right {
        Some(1)
    } else if point.v < area.top {
        Some(2)
    } else if point.v > area.bottom {
        Some(3)
    } else {
        (sqrt(squared) > BEHIND * hole.range).then_some(4)
    }
}

/// The largest opening that something within `area` of the image, at these squared distances, surrounds, by its place in the list. An
/// opening that is seen past it is farther away than all of it.
pub(super) fn surrounded(area: &ImageBox, (nearest, farthest): (f64, f64), holes: &[Hole]) -> Option<usize> {
    let encloses =
        |hole: &ImageBox| area.left <= hole.left && area.right >= hole.right && area.top <= hole.top && area.bottom > hole.top;
    let (from, to) = (sqrt(nearest) / BEHIND, sqrt(farthest) * BEHIND);
    let is_surrounded = |hole: &Hole| encloses(&hole.area) && (from..=to).contains(&hole.range);
    let size = |hole: &Hole| (hole.area.right - hole.area.left) * (hole.area.bottom - hole.area.top);
    let around = holes.iter().enumerate().filter(|(_, hole)| is_surrounded(hole));
    around.max_by(|a, b| size(a.1).total_cmp(&size(b.1))).map(|(place, _)| place)
}

/// Something of an object, by its squared distance and its visible pixels; `key` identifies its box among all boxes of all frames.
pub(super) fn obstacle_of(
    (errors, seed, frame): (&ErrorFile, u64, u64),
    sight: &GroundTruthView<'_>,
    thing: &PerceivedObject,
    area: ImageBox,
    (nearest, pixels): (f64, u64),
    key: &[u64],
) -> Obstacle {
    let slip = libm::exp(errors.range.log_sd * RandomStream::new(seed, "oracle range", &[frame, u64::from(thing.id)]).normal());
    let sent = f64::from(SIZE_SENT.0) * f64::from(SIZE_SENT.1);
    let light = f64::from(*sight.light.get(&thing.id).unwrap_or(&1.0)).clamp(0.0, 1.0);
    Obstacle {
        object: thing.id,
        name: thing.tags.words(),
        area,
        nearest: sqrt(nearest) * slip,
        size: sqrt(pixels as f64 * sent / (sight.width * sight.height) as f64) * light,
        box_luck: RandomStream::new(seed, "oracle box", key).uniform(),
        slope: false,
    }
}

//! Whether a box shows what it showed before: zero-mean normalised cross-correlation of small patches, in integers.

use spf_media::track::grey::{FRACTION, Pyramid, Tap};
use spf_media::track::{PixelBox, Shift};

/// Samples of a patch across and down.
const FINE: usize = 24;

/// The patch in a box, resampled to a fixed number of samples.
#[derive(Clone, Debug)]
pub(super) struct Template {
    fine: Patch<FINE>,
}

/// A place found, and how much it resembles the template (1: equal up to brightness and contrast).
#[derive(Clone, Copy, Debug)]
pub(super) struct Match {
    pub(super) area: PixelBox,
    pub(super) score: f64,
}

impl Template {
    pub(super) fn of(image: &Pyramid, area: &PixelBox) -> Self {
        Self { fine: Patch::of(image, area) }
    }

    /// Standard deviation of the patch, grey levels.
    pub(super) fn contrast(&self) -> f64 {
        self.fine.deviation() / f64::from(1_u32 << FRACTION)
    }

    pub(super) fn score(&self, image: &Pyramid, area: &PixelBox) -> f64 {
        self.fine.correlation(&Patch::of(image, area))
    }

    /// The best place near a box: steps of a sixteenth of the box and less, and of its size.
    pub(super) fn align(&self, image: &Pyramid, area: &PixelBox) -> Match {
        let mut best = Match { area: *area, score: self.score(image, area) };
        for part in [16.0, 32.0, 64.0] {
            let (x, y, growth) = (area.width() / part, area.height() / part, 1.0 + 0.64 / part);
            let steps = [
                (Shift { x, y: 0.0 }, 1.0),
                (Shift { x: -x, y: 0.0 }, 1.0),
                (Shift { x: 0.0, y }, 1.0),
                (Shift { x: 0.0, y: -y }, 1.0),
                (Shift::default(), growth),
                (Shift::default(), 1.0 / growth),
            ];
            for _ in 0..3 {
                let from = best.area;
                let mut moved = false;
                for (shift, scale) in steps {
                    let area = from.moved(shift, scale);
                    let score = self.score(image, &area);
                    if score > best.score {
                        best = Match { area, score };
                        moved = true;
                    }
                }
                if !moved {
                    break;
                }
            }
        }
        best
    }
}

/// `SIDE` × `SIDE` samples of a box.
#[derive(Clone, Debug)]
struct Patch<const SIDE: usize> {
    values: [[i32; SIDE]; SIDE],
    /// Weighted mean, rounded.
    mean: i32,
    /// Weighted sum of the squared differences from the mean.
    power: i64,
}

impl<const SIDE: usize> Patch<SIDE> {
    const WEIGHTS: [i32; SIDE] = weights();
    /// The sum of all samples' weights.
    const WEIGHT: i32 = {
        let (weights, mut sum, mut place) = (Self::WEIGHTS, 0, 0);
        while place < SIDE {
            sum += weights[place];
            place += 1;
        }
        sum * sum
    };

    fn of(image: &Pyramid, area: &PixelBox) -> Self {
        // A level on which samples lie at most about one and a half pixels apart.
        let mut level = 0;
        while level < image.top() && area.side() / (SIDE as f64) > 1.5 * f64::from(1_u32 << level) {
            level += 1;
        }
        let grey = image.level(level);
        let size = f64::from(1_u32 << level);
        let taps = |low: f64, length: f64, pixels: u32| {
            let mut taps = [Tap::default(); SIDE];
            for (number, tap) in taps.iter_mut().enumerate() {
                let place = low + (number as f64 + 0.5) / SIDE as f64 * length - 0.5;
                *tap = Tap::at(place / size, pixels as usize);
            }
            taps
        };
        let (width, height) = grey.size();
        let columns = taps(area.left, area.width(), width);
        let rows = taps(area.top, area.height(), height);
        let mut values = [[0; SIDE]; SIDE];
        grey.grid(&columns, &rows, values.as_flattened_mut());
        let mut patch = Self { values, mean: 0, power: 0 };
        let mut total = 0;
        for (values, weight) in patch.values.iter().zip(Self::WEIGHTS) {
            let of_row: i32 = values.iter().zip(Self::WEIGHTS).map(|(value, weight)| value * weight).sum();
            total += weight * of_row;
        }
        // At most 76² weights of 8160 each: 32 bits hold the sum.
        patch.mean = (total + Self::WEIGHT / 2) / Self::WEIGHT;
        patch.power = patch.product(&patch);
        patch
    }

    fn product(&self, other: &Self) -> i64 {
        let mut total = 0;
        for ((one, other_row), of_this) in self.values.iter().zip(&other.values).zip(Self::WEIGHTS) {
            // In sixteens, so that a row fits 32 bits (at most 76 × 8160² / 16 < 2³¹).
            let products = one.iter().zip(other_row).zip(Self::WEIGHTS);
            let of_row: i32 = products.map(|((a, b), weight)| (((a - self.mean) * (b - other.mean)) >> 4) * weight).sum();
            total += i64::from(of_this) * i64::from(of_row);
        }
        total
    }

    /// Standard deviation, in the unit of the values.
    fn deviation(&self) -> f64 {
        // Products are kept in sixteens.
        (16.0 * self.power as f64 / f64::from(Self::WEIGHT)).sqrt()
    }

    /// Zero-mean normalised cross-correlation; 0 with a patch of far less contrast, in which there is nothing but noise.
    fn correlation(&self, other: &Self) -> f64 {
        if self.power <= 0 || other.power * 16 < self.power {
            return 0.0;
        }
        self.product(other) as f64 / (self.power as f64 * other.power as f64).sqrt()
    }
}

/// The weights of rows and columns: the middle counts most, since a box's edges show what is behind the target.
const fn weights<const SIDE: usize>() -> [i32; SIDE] {
    let mut weights = [1; SIDE];
    let mut place = 0;
    while place < SIDE {
        let (from_start, from_end) = (place + 1, SIDE - place);
        let nearer = if from_start < from_end { from_start } else { from_end };
        // From 1 at the edges to 4 at a third of the way.
        let weight = nearer * 12 / SIDE;
        weights[place] = if weight < 1 {
            1
        } else if weight > 4 {
            4
        } else {
            weight as i32
        };
        place += 1;
    }
    weights
}

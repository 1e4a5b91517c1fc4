//! Where the target is, by a correlation filter that is learnt on the way: the weights with which a window's features add up to
//! a peak on the target, and to nothing beside it (Bolme et al. 2010, "Visual object tracking using adaptive correlation
//! filters"; of several features, Danelljan et al. 2014, "Accurate scale estimation for robust visual tracking"). Unlike a
//! patch it learns how the target changes, as with the steps of somebody who walks, and unlike the flow of corners it does not
//! forget the whole.
//!
//! Features of a cell are its slopes by direction (Dalal and Triggs 2005, histograms of oriented gradients), its brightness and
//! its colour. Their sums are integers; the rest is IEEE arithmetic in a fixed order.

use microfft::Complex32;

use spf_media::track::grey::{Grey, Pyramid, Tap};
use spf_media::track::{PixelBox, Shift};

/// Cells of a window across and down.
const CELLS: usize = 32;
const AREA: usize = CELLS * CELLS;
/// Samples of a cell across and down.
const SIDE: usize = 4;
const SAMPLES: usize = CELLS * SIDE;
/// Directions of slopes, over half a turn.
const DIRECTIONS: usize = 8;
/// Cosine and sine of the directions, of 256.
const AXES: [(i32, i32); DIRECTIONS] =
    [(256, 0), (237, 98), (181, 181), (98, 237), (0, 256), (-98, 237), (-181, 181), (-237, 98)];
/// How much wider and higher than the box a window is, as a fraction of its mean side.
const PADDING: f64 = 1.0;
/// Width of the peak, as a fraction of the box's mean side.
const PEAK: f64 = 0.08;
/// Cells from the peak from which on the rest is compared with it.
const BESIDE: i32 = 4;
/// Keeps frequencies that hardly occur from counting.
const REGULAR: f32 = 0.01;

/// A plane of numbers per cell, in rows.
type Plane = Vec<Complex32>;

/// The filter of a target.
#[derive(Clone, Debug)]
pub(super) struct Filter {
    /// Per feature, and in common, as frequencies.
    numerators: Vec<Plane>,
    denominator: Vec<f32>,
    /// The wanted response, as frequencies.
    peak: Plane,
    /// The weights of cells across and down: the window is as wide as the box and its padding, and fades out to the edges.
    weights: [[f32; CELLS]; 2],
    /// Side of the window, as a multiple of the box's width.
    side: f64,
}

/// Where the response is strongest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Response {
    pub(super) area: PixelBox,
    /// 1 where everything is as it was learnt.
    pub(super) peak: f64,
    /// The same, less the mean beside the peak, in standard deviations of what is beside it.
    pub(super) above: f64,
}

impl Filter {
    /// Learns a box.
    pub(super) fn of(image: &Pyramid, tints: Option<&[Grey; 2]>, area: &PixelBox) -> Self {
        let mean = (area.width() + area.height()) / 2.0;
        let (wide, high) = (area.width() + PADDING * mean, area.height() + PADDING * mean);
        let side = wide.max(high);
        let weights = [wide, high].map(|length| {
            core::array::from_fn(|cell| {
                let place = (cell as f64 + 0.5) / CELLS as f64 - 0.5;
                let part = place * side / length;
                if part.abs() >= 0.5 { 0.0 } else { (0.5 + 0.5 * libm::cos(core::f64::consts::TAU * part)) as f32 }
            })
        });
        let spread = PEAK * mean / side * CELLS as f64;
        let mut peak: Plane = (0..AREA)
            .map(|at| {
                let away = |place: usize| if place > CELLS / 2 { place as f64 - CELLS as f64 } else { place as f64 };
                let (x, y) = (away(at % CELLS), away(at / CELLS));
                Complex32::new(libm::exp(-(x * x + y * y) / (2.0 * spread * spread)) as f32, 0.0)
            })
            .collect();
        transform(&mut peak);
        let mut filter = Self { numerators: Vec::new(), denominator: Vec::new(), peak, weights, side: side / area.width() };
        let window = filter.window(image, tints, area);
        (filter.numerators, filter.denominator) = filter.terms(&window);
        filter
    }

    /// Learns from a further image, with a weight of up to 1.
    pub(super) fn learn(&mut self, image: &Pyramid, tints: Option<&[Grey; 2]>, area: &PixelBox, weight: f32) {
        let window = self.window(image, tints, area);
        let (numerators, denominator) = self.terms(&window);
        for (old, new) in self.numerators.iter_mut().zip(&numerators) {
            old.iter_mut().zip(new).for_each(|(old, new)| *old = *old * (1.0 - weight) + *new * weight);
        }
        self.denominator.iter_mut().zip(&denominator).for_each(|(old, new)| *old = *old * (1.0 - weight) + *new * weight);
    }

    /// The strongest response in the window about a box, at most `reach` of the window's sides from its middle.
    pub(super) fn respond(&self, image: &Pyramid, tints: Option<&[Grey; 2]>, area: &PixelBox, reach: f64) -> Response {
        let window = self.window(image, tints, area);
        let mut sum = vec![Complex32::default(); AREA];
        for (numerator, feature) in self.numerators.iter().zip(&window) {
            sum.iter_mut().zip(numerator).zip(feature).for_each(|((sum, numerator), value)| *sum += numerator.conj() * value);
        }
        sum.iter_mut().zip(&self.denominator).for_each(|(sum, power)| *sum /= power + REGULAR);
        inverse(&mut sum);
        let value = |x: i32, y: i32| {
            let wrap = |place: i32| place.rem_euclid(CELLS as i32) as usize;
            f64::from(sum[wrap(y) * CELLS + wrap(x)].re)
        };
        let half = CELLS as i32 / 2;
        let places = || (-half..half).flat_map(|y| (-half..half).map(move |x| (x, y)));
        let most = (reach * CELLS as f64) as i32;
        let (mut best, mut place) = (f64::NEG_INFINITY, (0, 0));
        for (x, y) in places().filter(|(x, y)| x.abs().max(y.abs()) <= most) {
            if value(x, y) > best {
                (best, place) = (value(x, y), (x, y));
            }
        }
        // The top of a parabola through three cells.
        let top = |before: f64, at: f64, after: f64| {
            let bend = before + after - 2.0 * at;
            if bend < 0.0 { (0.5 * (before - after) / bend).clamp(-0.5, 0.5) } else { 0.0 }
        };
        let (x, y) = place;
        let cell = self.side * area.width() / CELLS as f64;
        let shift = Shift {
            x: cell * (f64::from(x) + top(value(x - 1, y), best, value(x + 1, y))),
            y: cell * (f64::from(y) + top(value(x, y - 1), best, value(x, y + 1))),
        };
        let (mut count, mut total, mut squares) = (0.0, 0.0, 0.0);
        for (column, row) in places().filter(|(column, row)| (row - y).abs().max((column - x).abs()) > BESIDE) {
            let value = value(column, row);
            (count, total, squares) = (count + 1.0, total + value, squares + value * value);
        }
        let mean = total / count;
        let deviation = (squares / count - mean * mean).max(1e-12).sqrt();
        Response { area: area.moved(shift, 1.0), peak: best, above: (best - mean) / deviation }
    }

    fn terms(&self, window: &[Plane]) -> (Vec<Plane>, Vec<f32>) {
        let mut power = vec![0.0; AREA];
        for feature in window {
            power.iter_mut().zip(feature).for_each(|(power, value)| *power += value.norm_sqr());
        }
        let numerators =
            window.iter().map(|feature| feature.iter().zip(&self.peak).map(|(value, peak)| peak.conj() * value).collect());
        (numerators.collect(), power)
    }

    /// The features of the window about a box, as frequencies.
    fn window(&self, image: &Pyramid, tints: Option<&[Grey; 2]>, area: &PixelBox) -> Vec<Plane> {
        let side = self.side * area.width();
        let centre = area.centre();
        let (left, top) = (centre.0 - side / 2.0, centre.1 - side / 2.0);
        let spacing = side / SAMPLES as f64;
        let mut level = 0;
        while level < image.top() && spacing > 1.5 * f64::from(1_u32 << level) {
            level += 1;
        }
        let mut features = slopes(image.level(level), (left, top), spacing, f64::from(1_u32 << level));
        if let Some(tints) = tints {
            let scale = f64::from(image.size().0) / f64::from(tints[0].size().0);
            features.extend(tints.iter().map(|tint| colour(tint, (left, top), side / CELLS as f64, scale)));
        }
        let mut planes = Vec::with_capacity(features.len());
        for two in features.chunks(2) {
            let (first, second) = self.frequencies(&two[0], two.get(1).map(Vec::as_slice));
            planes.push(first);
            planes.extend(second);
        }
        planes
    }

    /// Two real features at once, as the two parts of complex numbers; the symmetry of real functions parts them again.
    fn frequencies(&self, first: &[f32], second: Option<&[f32]>) -> (Plane, Option<Plane>) {
        let [across, down] = &self.weights;
        let mut plane: Plane = (0..AREA)
            .map(|at| {
                let weight = across[at % CELLS] * down[at / CELLS];
                Complex32::new(first[at] * weight, second.map_or(0.0, |second| second[at] * weight))
            })
            .collect();
        transform(&mut plane);
        if second.is_none() {
            return (plane, None);
        }
        let mirrored = |at: usize| plane[(CELLS - at / CELLS) % CELLS * CELLS + (CELLS - at % CELLS) % CELLS].conj();
        let first = (0..AREA).map(|at| (plane[at] + mirrored(at)) * 0.5).collect();
        // Half of the difference, divided by i.
        let second = (0..AREA).map(|at| (plane[at] - mirrored(at)) * 0.5).map(|value| Complex32::new(value.im, -value.re));
        (first, Some(second.collect()))
    }
}

/// Places of samples between pixels: `from` in pixels of the whole image, of which one pixel here has `size`.
fn taps<const COUNT: usize>(from: f64, spacing: f64, size: f64, pixels: u32) -> [Tap; COUNT] {
    core::array::from_fn(|sample| Tap::at((from + (sample as f64 + 0.5) * spacing - 0.5) / size, pixels as usize))
}

/// The slopes of each cell by direction, compared with those of its neighbours, and its brightness.
fn slopes(grey: &Grey, (left, top): (f64, f64), spacing: f64, size: f64) -> Vec<Vec<f32>> {
    let (width, height) = grey.size();
    let columns: [Tap; SAMPLES] = taps(left, spacing, size, width);
    let rows: [Tap; SAMPLES] = taps(top, spacing, size, height);
    let mut values = vec![0; SAMPLES * SAMPLES];
    grey.grid(&columns, &rows, &mut values);
    let mut sums = vec![[0_i32; DIRECTIONS]; AREA];
    let mut light = vec![0_i32; AREA];
    for y in 0..SAMPLES {
        let (above, below) = (y.saturating_sub(1) * SAMPLES, (y + 1).min(SAMPLES - 1) * SAMPLES);
        for x in 0..SAMPLES {
            let at = y * SAMPLES + x;
            let cell = y / SIDE * CELLS + x / SIDE;
            light[cell] += values[at];
            let across = values[y * SAMPLES + (x + 1).min(SAMPLES - 1)] - values[y * SAMPLES + x.saturating_sub(1)];
            let down = values[below + x] - values[above + x];
            let (mut best, mut direction) = (0, 0);
            for (number, (cos, sin)) in AXES.iter().enumerate() {
                let along = (across * cos + down * sin).abs();
                if along > best {
                    (best, direction) = (along, number);
                }
            }
            sums[cell][direction] += best >> 8;
        }
    }
    let smooth = smoothed(&sums);
    // Of 3×3 cells together.
    let powers: Vec<f32> = smooth.iter().map(|cell| cell.iter().map(|value| value * value).sum()).collect();
    let mut features = vec![vec![0.0; AREA]; DIRECTIONS + 1];
    let whole: i64 = light.iter().map(|light| i64::from(*light)).sum();
    let mean = whole as f32 / AREA as f32;
    for y in 0..CELLS {
        for x in 0..CELLS {
            let at = y * CELLS + x;
            let mut power = 0.0;
            for row in y.saturating_sub(1)..=(y + 1).min(CELLS - 1) {
                for column in x.saturating_sub(1)..=(x + 1).min(CELLS - 1) {
                    power += powers[row * CELLS + column];
                }
            }
            // A grey level per sample.
            let unit = (power / 9.0).sqrt() + 4.0 * 32.0;
            for (feature, value) in features.iter_mut().zip(smooth[at]) {
                feature[at] = 0.5 * (value / unit).min(1.0);
            }
            features[DIRECTIONS][at] = (light[at] as f32 - mean) / ((SIDE * SIDE) as f32 * 32.0 * 255.0);
        }
    }
    features
}

/// Each cell counts for its neighbours too.
fn smoothed(sums: &[[i32; DIRECTIONS]]) -> Vec<[f32; DIRECTIONS]> {
    let pass = |from: &[[i32; DIRECTIONS]], stride: usize, place: &dyn Fn(usize) -> usize| -> Vec<[i32; DIRECTIONS]> {
        (0..AREA)
            .map(|at| {
                let before = if place(at) > 0 { from[at - stride] } else { [0; DIRECTIONS] };
                let after = if place(at) + 1 < CELLS { from[at + stride] } else { [0; DIRECTIONS] };
                core::array::from_fn(|number| before[number] + after[number] + 2 * from[at][number])
            })
            .collect()
    };
    let across = pass(sums, 1, &|at| at % CELLS);
    let down = pass(&across, CELLS, &|at| at / CELLS);
    down.into_iter().map(|cell| cell.map(|value| value as f32 / 16.0)).collect()
}

fn colour(tint: &Grey, (left, top): (f64, f64), spacing: f64, scale: f64) -> Vec<f32> {
    let (width, height) = tint.size();
    let columns: [Tap; CELLS] = taps(left, spacing, scale, width);
    let rows: [Tap; CELLS] = taps(top, spacing, scale, height);
    let mut values = vec![0; AREA];
    tint.grid(&columns, &rows, &mut values);
    values.into_iter().map(|value| (value - 128 * 32) as f32 / (32.0 * 64.0)).collect()
}

fn transform(plane: &mut [Complex32]) {
    through(plane, |line| {
        let _ = microfft::complex::cfft_32(line);
    });
}

fn inverse(plane: &mut [Complex32]) {
    through(plane, |line| {
        let _ = microfft::inverse::ifft_32(line);
    });
}

/// Rows, then columns.
fn through(plane: &mut [Complex32], line: impl Fn(&mut [Complex32; CELLS])) {
    let (rows, _) = plane.as_chunks_mut::<CELLS>();
    rows.iter_mut().for_each(&line);
    let mut column = [Complex32::default(); CELLS];
    for x in 0..CELLS {
        for (y, value) in column.iter_mut().enumerate() {
            *value = plane[y * CELLS + x];
        }
        line(&mut column);
        for (y, value) in column.iter().enumerate() {
            plane[y * CELLS + x] = *value;
        }
    }
}

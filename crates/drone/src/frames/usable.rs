//! Whether a camera image carries information: covered, blank and smeared images do not.
//!
//! The luma of about 240 × 180 pixels is sampled on a regular grid and averaged over 16 × 12 cells. A cell has some 225
//! samples, so that the noise of a sensor at night (8 of 255 levels, one standard deviation) is half a level in its
//! mean, and 0.75 in the difference of two cells. The remaining differences are surfaces, lights and shadows. The
//! thresholds are chosen so that an image is rejected only if it shows nothing: a rejected image makes the craft hold
//! and, after a while, land.
//!
//! | | condition |
//! |---|---|
//! | [`Unusable::Blank`] | all cell means within 2 levels, whatever the brightness |
//! | [`Unusable::Covered`] | mean of at most 40 levels, and fewer than 4 pairs of neighbouring cells that differ by 3 levels |
//! | [`Unusable::Smeared`] | a third of the rows, or of the columns, in one piece, repeats its neighbour though it has structure |
//! | [`Unusable::Damaged`] | a third of the image is exactly the grey or the green that decoders write for missing blocks |
//!
//! A dark room is an image: one lamp, one window or the outline of one piece of furniture makes more than four pairs of
//! cells differ. Light that passes a finger or a cloth on the lens makes a smooth gradient, with small steps from cell to
//! cell. A white wall is an image as well: its illumination and the fall-off of the lens differ by more than 2 levels
//! between centre and corners. `crates/serve/tests/it/images.rs` measures these figures over the simulator's scenes.

use spf_core::frame::Unusable;
use spf_media::Rgb;

/// Samples along the longer side of the grid, at most about twice that.
const SAMPLES: usize = 240;
/// Cells across and down.
const CELLS: (usize, usize) = (16, 12);
/// A range of cell means below this is a single colour, levels.
const BLANK_RANGE: f32 = 2.0;
/// A covered lens is at most this bright on average, levels.
const DARK: f32 = 40.0;
/// Difference between neighbouring cells that counts as structure, levels: four standard deviations of the noise.
const STEP: f32 = 3.0;
/// Number of such pairs that make an image: a small lamp within one cell has four neighbours.
const STEPS: usize = 4;
/// Samples of a smeared line differ from those of the line before by at most this, levels. A decoder that conceals a loss
/// copies exactly. With 2 levels, and 4 % of other samples, planks and window frames 0.5 m away count as smeared.
const SAME: u8 = 1;
/// Neighbouring samples in a line that differ by this many levels are structure; a line has some if there are this many.
const EDGE: u8 = 12;
const EDGES: usize = 8;
/// Fraction of an image that must be smeared or missing: one line in this many.
const PART: usize = 3;

/// Colours that decoders write for missing blocks: zero in all three planes, and the middle of their range, by BT.601
/// and BT.709, full and limited range.
const MISSING: [[u8; 3]; 5] = [[0, 135, 0], [0, 77, 0], [0, 154, 0], [128, 128, 128], [130, 130, 130]];

/// Statistics of an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImageStatistics {
    /// Mean luma, 0..=255.
    pub mean: f32,
    /// Largest minus smallest mean of a cell, levels.
    pub range: f32,
    /// Pairs of neighbouring cells that differ by 3 levels or more.
    pub steps: usize,
    /// The longest run of rows (or columns) that repeat their neighbour although they have structure, as a fraction of all
    /// rows (or columns).
    pub repeated: f32,
    /// Fraction of the image that has exactly a colour written for missing blocks.
    pub missing: f32,
}

/// Why an image carries no information; `None` if it may be used.
#[must_use]
pub fn why_unusable(image: &Rgb) -> Option<Unusable> {
    let Some(statistics) = statistics(image) else { return Some(Unusable::Blank) };
    let part = 1.0 / PART as f32;
    if statistics.missing >= part {
        Some(Unusable::Damaged)
    } else if statistics.range < BLANK_RANGE {
        Some(if statistics.mean <= DARK { Unusable::Covered } else { Unusable::Blank })
    } else if statistics.mean <= DARK && statistics.steps < STEPS {
        Some(Unusable::Covered)
    } else if statistics.repeated >= part {
        Some(Unusable::Smeared)
    } else {
        None
    }
}

/// Statistics of an image; `None` if it has no pixels.
#[must_use]
pub fn statistics(image: &Rgb) -> Option<ImageStatistics> {
    let grid = Grid::of(image)?;
    let cells = grid.cells();
    let (low, high) = cells.iter().fold((f32::MAX, f32::MIN), |(low, high), &mean| (low.min(mean), high.max(mean)));
    let across = cells.chunks_exact(CELLS.0).flat_map(|row| row.windows(2)).filter(|pair| differ(pair[0], pair[1]));
    let down = cells.iter().zip(&cells[CELLS.0..]).filter(|(upper, lower)| differ(**upper, **lower));
    Some(ImageStatistics {
        mean: cells.iter().sum::<f32>() / cells.len() as f32,
        range: high - low,
        steps: across.count() + down.count(),
        repeated: grid.repeated_rows().max(grid.transposed().repeated_rows()),
        missing: grid.missing as f32 / grid.luma.len() as f32,
    })
}

fn differ(a: f32, b: f32) -> bool {
    (a - b).abs() >= STEP
}

/// Luma of an image, sampled at regular distances.
struct Grid {
    columns: usize,
    luma: Vec<u8>,
    /// Samples with a colour of missing blocks.
    missing: usize,
}

impl Grid {
    fn of(image: &Rgb) -> Option<Self> {
        let (width, height) = (image.width() as usize, image.height() as usize);
        let step = (width.max(height) / SAMPLES).max(1);
        let columns = width.div_ceil(step);
        let mut luma = Vec::with_capacity(columns * height.div_ceil(step));
        let mut missing = 0;
        for row in image.data().chunks_exact((width * 3).max(1)).step_by(step) {
            for pixel in row.as_chunks::<3>().0.iter().step_by(step) {
                // BT.709, in 1/256.
                let [red, green, blue] = pixel.map(u32::from);
                luma.push(((54 * red + 183 * green + 19 * blue) >> 8) as u8);
                missing += usize::from(MISSING.contains(pixel));
            }
        }
        (!luma.is_empty()).then_some(Self { columns, luma, missing })
    }

    fn rows(&self) -> usize {
        self.luma.len() / self.columns
    }

    /// Mean of each cell, row by row.
    fn cells(&self) -> Vec<f32> {
        let (across, down) = CELLS;
        let (mut sums, mut counts) = (vec![0_u32; across * down], vec![0_u32; across * down]);
        let rows = self.rows();
        for (y, row) in self.luma.chunks_exact(self.columns).enumerate() {
            let first = y * down / rows * across;
            // Only a grid with fewer samples than cells leaves cells empty.
            for cell in 0..across {
                let (from, to) = ((cell * self.columns).div_ceil(across), ((cell + 1) * self.columns).div_ceil(across));
                sums[first + cell] += row[from..to].iter().map(|luma| u32::from(*luma)).sum::<u32>();
                counts[first + cell] += (to - from) as u32;
            }
        }
        let mean = self.luma.iter().map(|luma| f32::from(*luma)).sum::<f32>() / self.luma.len() as f32;
        sums.iter().zip(counts).map(|(sum, count)| if count > 0 { *sum as f32 / count as f32 } else { mean }).collect()
    }

    /// The longest run of rows that repeat the one before though they have structure, as a fraction of all rows. A row
    /// without structure, such as sky or floor, looks like its neighbour anyway, and ends a run.
    fn repeated_rows(&self) -> f32 {
        let (mut run, mut longest) = (0, 0);
        for (before, row) in self.luma.chunks_exact(self.columns).zip(self.luma.chunks_exact(self.columns).skip(1)) {
            let same = before.iter().zip(row).all(|(a, b)| a.abs_diff(*b) <= SAME);
            let repeats = same && row.windows(2).filter(|pair| pair[0].abs_diff(pair[1]) >= EDGE).count() >= EDGES;
            run = if repeats { run + 1 } else { 0 };
            longest = longest.max(run);
        }
        longest as f32 / self.rows() as f32
    }

    fn transposed(&self) -> Self {
        let rows = self.rows();
        let luma = (0..self.columns).flat_map(|x| (0..rows).map(move |y| self.luma[y * self.columns + x])).collect();
        Self { columns: rows, luma, missing: self.missing }
    }
}

#[cfg(test)]
mod tests;

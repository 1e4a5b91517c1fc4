//! Where the colours of a target are: of each colour it is learnt how much more often it shows on the target than around it
//! (Possegger, Mauthner and Bischof 2015, "In defense of color-based model-free tracking"). Clothes without a pattern have no
//! corners, but a colour.
//!
//! Counts and sums are integers; what is computed with them is IEEE arithmetic in a fixed order.

use super::area::{PixelBox, Shift};
use crate::frame::Rgb;

/// Width up to which an image is kept; larger ones are averaged over blocks.
const MOST: u32 = 120;
/// Bins of brightness, and of each of the two colour differences.
const LIGHTS: usize = 10;
const TINTS: usize = 11;
const BINS: usize = LIGHTS * TINTS * TINTS;
/// Width of a bin of a colour difference.
const TINT: i32 = 12;
/// The sum of a histogram.
const WHOLE: u32 = 1 << 20;
/// What every colour counts in addition: of what was hardly seen nothing is known.
const UNKNOWN: u32 = WHOLE / 1500;
/// How much larger than the box its surroundings are, across and down.
const AROUND: (f64, f64) = (2.0, 1.4);
/// The part of a box that shows the target, for learning.
const CORE: f64 = 0.7;
/// Weight of a new image, as a shift: of the surroundings, which change, and of the target.
const NEW_AROUND: u32 = 3;
const NEW_ON: u32 = 7;
/// The most by which a box grows or shrinks from one image to the next.
const GROWTH: f64 = 1.05;
/// Least gain of a step in the search for a box's edges.
const GAIN: f64 = 0.002;

/// The colours of an image.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Colours {
    width: usize,
    height: usize,
    /// Side of a block, pixels.
    block: u32,
    bins: Vec<u16>,
}

impl Colours {
    pub(super) fn of(image: &Rgb) -> Self {
        let block = image.width().div_ceil(MOST).max(1);
        let (width, height) = ((image.width() / block) as usize, (image.height() / block) as usize);
        let (side, row) = (block as usize, image.width() as usize * 3);
        let mut bins = Vec::with_capacity(width * height);
        for y in 0..height {
            for x in 0..width {
                let mut sum = [0_i32; 3];
                for line in 0..side {
                    let start = (y * side + line) * row + x * side * 3;
                    for pixel in image.data()[start..start + 3 * side].chunks_exact(3) {
                        for (sum, value) in sum.iter_mut().zip(pixel) {
                            *sum += i32::from(*value);
                        }
                    }
                }
                bins.push(bin(sum.map(|sum| sum / (block * block) as i32)));
            }
        }
        Self { width, height, block, bins }
    }

    /// How often each colour shows in the image, of [`WHOLE`].
    pub(super) fn shares(&self) -> Vec<u32> {
        histogram(self, [0, 0, self.width, self.height], None).unwrap_or_else(|| vec![0; BINS])
    }

    /// A box in blocks, within the image: left, top, right, bottom.
    fn cells(&self, area: &PixelBox) -> [usize; 4] {
        let to = |place: f64, most: usize| ((place / f64::from(self.block)).round().max(0.0) as usize).min(most);
        [to(area.left, self.width), to(area.top, self.height), to(area.right, self.width), to(area.bottom, self.height)]
    }
}

/// The part of two images' colours that both have, 0 to 1.
pub(super) fn in_common(one: &[u32], other: &[u32]) -> f64 {
    let both: u32 = one.iter().zip(other).map(|(one, other)| one.min(other)).sum();
    f64::from(both) / f64::from(WHOLE)
}

fn bin([red, green, blue]: [i32; 3]) -> u16 {
    let light = (77 * red + 150 * green + 29 * blue) >> 8;
    let tint = |difference: i32| (difference.div_euclid(TINT) + TINTS as i32 / 2).clamp(0, TINTS as i32 - 1) as usize;
    let light = (light as usize * LIGHTS / 256).min(LIGHTS - 1);
    ((light * TINTS + tint(red - blue + TINT / 2)) * TINTS + tint(green - (red + blue) / 2 + TINT / 2)) as u16
}

/// The colours of a target, and of what is around it.
#[derive(Clone, Debug)]
pub(super) struct Model {
    on: Vec<u32>,
    around: Vec<u32>,
    /// How sure each colour is the target's, of 255.
    likelihood: Vec<u8>,
}

/// How a box stands out by its colours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Standing {
    pub(super) area: PixelBox,
    /// Mean likelihood in the box less that around it: 1 where only the box has the target's colours.
    pub(super) contrast: f64,
}

impl Model {
    /// Learns the colours of a box; `None` if it or its surroundings are too small or outside the image.
    pub(super) fn of(image: &Colours, area: &PixelBox) -> Option<Self> {
        let (on, around) = histograms(image, area)?;
        let mut model = Self { on, around, likelihood: Vec::new() };
        model.weigh();
        Some(model)
    }

    /// Learns from a further image.
    pub(super) fn learn(&mut self, image: &Colours, area: &PixelBox) {
        let Some((on, around)) = histograms(image, area) else { return };
        let mix = |old: &mut [u32], new: &[u32], shift: u32| {
            for (old, new) in old.iter_mut().zip(new) {
                *old = *old - (*old >> shift) + (*new >> shift);
            }
        };
        mix(&mut self.on, &on, NEW_ON);
        mix(&mut self.around, &around, NEW_AROUND);
        self.weigh();
    }

    fn weigh(&mut self) {
        let (on, around) = (smooth(&self.on), smooth(&self.around));
        let likelihood = |(on, around): (&u32, &u32)| (255 * (on + UNKNOWN) / (on + around + 2 * UNKNOWN)) as u8;
        self.likelihood = on.iter().zip(&around).map(likelihood).collect();
    }

    /// Where the target's colours are in an image.
    pub(super) fn map(&self, image: &Colours) -> Map {
        let (width, height) = (image.width, image.height);
        let mut sums = vec![0_u32; (width + 1) * (height + 1)];
        for y in 0..height {
            let mut row = 0;
            for x in 0..width {
                row += u32::from(self.likelihood[usize::from(image.bins[y * width + x])]);
                sums[(y + 1) * (width + 1) + x + 1] = sums[y * (width + 1) + x + 1] + row;
            }
        }
        Map { width, height, block: f64::from(image.block), sums }
    }
}

/// Sums of the likelihood over all boxes from the upper left corner.
#[derive(Clone, Debug)]
pub(super) struct Map {
    width: usize,
    height: usize,
    block: f64,
    sums: Vec<u32>,
}

impl Map {
    /// Sum of the likelihood in a box, in blocks and parts of them, and its size inside the image.
    fn sum(&self, [left, top, right, bottom]: [f64; 4]) -> (f64, f64) {
        let (width, height) = (self.width as f64, self.height as f64);
        let (left, right) = (left.clamp(0.0, width), right.clamp(0.0, width));
        let (top, bottom) = (top.clamp(0.0, height), bottom.clamp(0.0, height));
        if right <= left || bottom <= top {
            return (0.0, 0.0);
        }
        let sum = self.at(right, bottom) - self.at(left, bottom) - self.at(right, top) + self.at(left, top);
        (sum / 255.0, (right - left) * (bottom - top))
    }

    /// The sum from the upper left corner to a place, between the blocks interpolated.
    fn at(&self, x: f64, y: f64) -> f64 {
        let (column, row) = ((x as usize).min(self.width - 1), (y as usize).min(self.height - 1));
        let (part_x, part_y) = (x - column as f64, y - row as f64);
        let value = |column: usize, row: usize| f64::from(self.sums[row * (self.width + 1) + column]);
        let upper = value(column, row) * (1.0 - part_x) + value(column + 1, row) * part_x;
        let lower = value(column, row + 1) * (1.0 - part_x) + value(column + 1, row + 1) * part_x;
        upper * (1.0 - part_y) + lower * part_y
    }

    fn contrast(&self, blocks: [f64; 4]) -> f64 {
        let [left, top, right, bottom] = blocks;
        let (inside, count) = self.sum(blocks);
        if count <= 0.0 {
            return -1.0;
        }
        let margin = |low: f64, high: f64, most: f64| ((most - 1.0) / 2.0 * (high - low)).max(2.0);
        let (x, y) = (margin(left, right, AROUND.0), margin(top, bottom, AROUND.1));
        let (outer, all) = self.sum([left - x, top - y, right + x, bottom + y]);
        if all - count < 1.0 {
            return -1.0;
        }
        inside / count - (outer - inside) / (all - count)
    }

    /// A box in blocks: at least three on each side, or its contrast would be chance.
    fn blocks(&self, area: &PixelBox) -> [f64; 4] {
        let [left, top, right, bottom] = [area.left, area.top, area.right, area.bottom].map(|place| place / self.block);
        [left, top, right.max(left + 3.0), bottom.max(top + 3.0)]
    }

    fn standing(&self, blocks: [f64; 4]) -> Standing {
        let [left, top, right, bottom] = blocks.map(|place| place * self.block);
        Standing { area: PixelBox { left, top, right, bottom }, contrast: self.contrast(blocks) }
    }

    /// The box near `area` that stands out most: each edge goes where the contrast grows, by at most a third of the size.
    pub(super) fn fit(&self, area: &PixelBox) -> Standing {
        let begun = self.blocks(area);
        let mut best = (self.contrast(begun), begun);
        let (across, down) = ((begun[2] - begun[0]) / 3.0, (begun[3] - begun[1]) / 3.0);
        for step in [4.0, 2.0, 1.0] {
            for _ in 0..4 {
                let from = best.1;
                for edge in 0..4 {
                    for by in [-step, step] {
                        let mut blocks = best.1;
                        blocks[edge] += by;
                        let far = (blocks[edge] - begun[edge]).abs() > if edge % 2 == 0 { across } else { down };
                        if far || blocks[2] - blocks[0] < 3.0 || blocks[3] - blocks[1] < 3.0 {
                            continue;
                        }
                        let contrast = self.contrast(blocks);
                        if contrast > best.0 + GAIN {
                            best = (contrast, blocks);
                        }
                    }
                }
                if best.1 == from {
                    break;
                }
            }
        }
        self.standing(best.1)
    }

    /// The box of the same shape near `area` that stands out most; `grows`: of a size that differs by at most [`GROWTH`].
    pub(super) fn align(&self, area: &PixelBox, grows: bool) -> Standing {
        let mut best = self.standing(self.blocks(area));
        let (least, most) = if grows { (area.width() / GROWTH, area.width() * GROWTH) } else { (f64::INFINITY, 0.0) };
        for part in [8.0, 16.0, 32.0, 64.0] {
            for _ in 0..3 {
                let from = best.area;
                let (x, y, growth) = (from.width() / part, from.height() / part, 1.0 + 0.64 / part);
                let steps =
                    [(x, 0.0, 1.0), (-x, 0.0, 1.0), (0.0, y, 1.0), (0.0, -y, 1.0), (0.0, 0.0, growth), (0.0, 0.0, 1.0 / growth)];
                for (x, y, scale) in steps {
                    let moved = from.moved(Shift { x, y }, scale);
                    if scale != 1.0 && !(least..=most).contains(&moved.width()) {
                        continue;
                    }
                    let contrast = self.contrast(self.blocks(&moved));
                    if contrast > best.contrast + GAIN / part {
                        best = Standing { area: moved, contrast };
                    }
                }
                if best.area == from {
                    break;
                }
            }
        }
        best
    }

    /// The places of a box of this size that stand out most: the best one within `reach` boxes, and the best one that does not
    /// overlap it.
    pub(super) fn scan(&self, area: &PixelBox, reach: f64) -> (Standing, f64) {
        let [left, top, right, bottom] = self.blocks(area);
        let (width, height) = (right - left, bottom - top);
        let (step_x, step_y) = ((width / 8.0).max(1.0), (height / 8.0).max(1.0));
        let steps = |size: f64, step: f64| (reach * size / step).round().clamp(2.0, 24.0) as i32;
        let (across, down) = (steps(width, step_x), steps(height, step_y));
        let mut places = Vec::new();
        for row in -down..=down {
            for column in -across..=across {
                let (x, y) = (f64::from(column) * step_x, f64::from(row) * step_y);
                let blocks = [left + x, top + y, right + x, bottom + y];
                if 2.0 * self.sum(blocks).1 >= width * height {
                    places.push((self.contrast(blocks), blocks));
                }
            }
        }
        let begun = (-1.0, [left, top, right, bottom]);
        let best = places.iter().fold(begun, |best, place| if place.0 > best.0 { *place } else { best });
        let apart =
            |place: &&(f64, [f64; 4])| (place.1[0] - best.1[0]).abs() >= width || (place.1[1] - best.1[1]).abs() >= height;
        let other = places.iter().filter(apart).fold(-1.0_f64, |most, place| most.max(place.0));
        (self.standing(best.1), other)
    }
}

/// How often each colour shows in the middle of a box, and around it.
fn histograms(image: &Colours, area: &PixelBox) -> Option<(Vec<u32>, Vec<u32>)> {
    let scaled = |x: f64, y: f64| image.cells(&PixelBox::around(area.centre(), x * area.width(), y * area.height()));
    let whole = image.cells(area);
    let on = histogram(image, scaled(CORE, CORE), None)?;
    let around = histogram(image, scaled(AROUND.0, AROUND.1), Some(whole))?;
    Some((on, around))
}

/// How often each colour shows in a box, of [`WHOLE`]; `None` of fewer than nine blocks.
fn histogram(image: &Colours, [left, top, right, bottom]: [usize; 4], without: Option<[usize; 4]>) -> Option<Vec<u32>> {
    let mut counts = vec![0_u32; BINS];
    let mut total = 0_u32;
    for y in top..bottom {
        for x in left..right {
            if without.is_some_and(|[left, top, right, bottom]| (left..right).contains(&x) && (top..bottom).contains(&y)) {
                continue;
            }
            counts[usize::from(image.bins[y * image.width + x])] += 1;
            total += 1;
        }
    }
    (total >= 9)
        .then(|| counts.into_iter().map(|count| (u64::from(count) * u64::from(WHOLE) / u64::from(total)) as u32).collect())
}

/// A histogram in which each colour counts for its neighbours too.
fn smooth(counts: &[u32]) -> Vec<u32> {
    let mut smoothed = counts.to_vec();
    let strides = [TINTS * TINTS, TINTS, 1];
    for (stride, length) in strides.into_iter().zip([LIGHTS, TINTS, TINTS]) {
        let before = smoothed.clone();
        for (at, value) in smoothed.iter_mut().enumerate() {
            let place = at / stride % length;
            let below = if place > 0 { before[at - stride] } else { 0 };
            let above = if place + 1 < length { before[at + stride] } else { 0 };
            *value = (2 * before[at] + below + above) / 4;
        }
    }
    smoothed
}

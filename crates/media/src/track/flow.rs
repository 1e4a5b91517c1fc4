//! How a box moves and grows between two images: sparse optical flow of corners inside it.
//!
//! Corners are those of Shi and Tomasi (1994), tracked by the pyramidal method of Lucas and Kanade (Bouguet 2001), there and
//! back; the box takes the median of the motions and of the ratios of distances (Kalal, Mikolajczyk and Matas 2010, "Median
//! Flow"). Sums are integers; what is solved with them is IEEE arithmetic in a fixed order.

use super::area::{PixelBox, Shift};
use super::grey::{FRACTION, Pyramid};

/// Side of the window around a corner, pixels.
const WINDOW: usize = 11;
/// The window with the border that its slopes need.
const BORDERED: usize = WINDOW + 2;
const AREA: usize = WINDOW * WINDOW;
/// Cells of the grid over the box, each of which gives its best corner.
const CELLS: usize = 8;
/// The weakest corner: smaller eigenvalue of the mean structure tensor, (grey levels per pixel)².
pub(crate) const WEAKEST: f64 = 1.5;
/// The weakest corner, as a share of the box's strongest.
const SHARE: f64 = 0.02;
/// How far a point may end from its start after the way there and back, pixels.
const ROUND_TRIP: f64 = 1.0;
/// The fewest points that are a motion.
pub(super) const FEWEST: usize = 4;

/// A point in one image, and in the next.
type Pair = ((f64, f64), (f64, f64));

/// The motion of a box between two images.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Flow {
    pub(super) shift: Shift,
    pub(super) scale: f64,
    /// Share of the corners that came back to their place and agree with the median.
    pub(super) agreeing: f64,
    /// Number of these corners.
    pub(super) points: usize,
}

/// The motion of a box; `None` without enough corners that agree.
pub(super) fn flow(before: &Pyramid, after: &Pyramid, area: &PixelBox, guess: Shift) -> Option<Flow> {
    let corners = corners(before, area);
    // A window at the top is at most about twice as wide as the box, or it would follow the background.
    let mut top = 0;
    while top < before.top() && (WINDOW << (top + 1)) as f64 <= 2.0 * area.side() {
        top += 1;
    }
    let mut pairs: Vec<Pair> = Vec::with_capacity(corners.len());
    for &from in &corners {
        if let Some(to) = follow_and_return(before, after, from, guess, top, ROUND_TRIP) {
            pairs.push((from, to));
        }
    }
    if pairs.len() < FEWEST {
        return None;
    }
    // Twice: what disagrees with the first median has no part in the second.
    let total = corners.len();
    let mut motion = median_motion(&pairs, area);
    let tolerance = (0.04 * area.side()).max(1.0);
    pairs.retain(|pair| {
        let (x, y) = motion.residual(pair, area);
        x * x + y * y < tolerance * tolerance
    });
    if pairs.len() < FEWEST {
        return None;
    }
    motion = median_motion(&pairs, area);
    Some(Flow { agreeing: pairs.len() as f64 / total as f64, points: pairs.len(), ..motion })
}

impl Flow {
    /// How far a point ends from where the motion puts it.
    fn residual(&self, (from, to): &Pair, area: &PixelBox) -> (f64, f64) {
        let centre = area.centre();
        let x = centre.0 + self.shift.x + (from.0 + 0.5 - centre.0) * self.scale - 0.5;
        let y = centre.1 + self.shift.y + (from.1 + 0.5 - centre.1) * self.scale - 0.5;
        (to.0 - x, to.1 - y)
    }
}

fn median_motion(pairs: &[Pair], area: &PixelBox) -> Flow {
    let distance = |a: (f64, f64), b: (f64, f64)| ((a.0 - b.0) * (a.0 - b.0) + (a.1 - b.1) * (a.1 - b.1)).sqrt();
    let mut ratios = Vec::with_capacity(pairs.len() * pairs.len() / 2);
    for (number, one) in pairs.iter().enumerate() {
        for other in &pairs[..number] {
            let before = distance(one.0, other.0);
            // Of near points the ratio is noise.
            if before > 0.2 * area.side() {
                ratios.push(distance(one.1, other.1) / before);
            }
        }
    }
    let scale = if ratios.len() < FEWEST { 1.0 } else { median(&mut ratios).clamp(0.8, 1.25) };
    // The shift of the centre: what is left of a point's motion without the growth.
    let centre = area.centre();
    let mut across: Vec<f64> = pairs.iter().map(|(from, to)| to.0 - from.0 - (from.0 + 0.5 - centre.0) * (scale - 1.0)).collect();
    let mut down: Vec<f64> = pairs.iter().map(|(from, to)| to.1 - from.1 - (from.1 + 0.5 - centre.1) * (scale - 1.0)).collect();
    Flow { shift: Shift { x: median(&mut across), y: median(&mut down) }, scale, agreeing: 0.0, points: pairs.len() }
}

fn median(values: &mut [f64]) -> f64 {
    let middle = values.len() / 2;
    let (_, value, _) = values.select_nth_unstable_by(middle, f64::total_cmp);
    *value
}

/// Corners inside a box, spread over it: at most [`CELLS`]².
pub(super) fn corners(image: &Pyramid, area: &PixelBox) -> Vec<(f64, f64)> {
    let grey = image.level(0);
    let (width, height) = (grey.size().0 as usize, grey.size().1 as usize);
    let data = grey.data();
    // The sums of a tensor reach over two pixels, the slopes over one more.
    let bounds = |low: f64, high: f64, length: usize| {
        let margin = 0.06 * (high - low);
        let low = (low + margin).max(3.0) as usize;
        let high = (high - margin).max(0.0) as usize;
        (low, high.min(length.saturating_sub(4)))
    };
    let (left, right) = bounds(area.left, area.right, width);
    let (top, bottom) = bounds(area.top, area.bottom, height);
    if right <= left + 4 || bottom <= top + 4 {
        return Vec::new();
    }
    // Cells of four pixels or more, in which a large box is looked at in steps.
    let cells = |low: usize, high: usize| ((high - low) / 4).clamp(1, CELLS);
    let (columns, rows) = (cells(left, right), cells(top, bottom));
    let step = ((right - left).max(bottom - top) / 80).max(1);
    let mut best = vec![(0.0_f64, (0_usize, 0_usize)); columns * rows];
    for y in (top..bottom).step_by(step) {
        for x in (left..right).step_by(step) {
            let score = cornerness(data, width, (x, y));
            let cell = (y - top) * rows / (bottom - top) * columns + (x - left) * columns / (right - left);
            if score > best[cell].0 {
                best[cell] = (score, (x, y));
            }
        }
    }
    let strongest = best.iter().fold(0.0_f64, |most, (score, _)| most.max(*score));
    let weakest = WEAKEST.max(SHARE * strongest);
    best.into_iter().filter(|(score, _)| *score >= weakest).map(|(_, (x, y))| (x as f64, y as f64)).collect()
}

/// How good a corner a pixel is: the smaller eigenvalue of the mean structure tensor of the 5×5 pixels about it, (grey levels per
/// pixel)². The pixel lies at least 3 pixels inside the image.
pub(crate) fn cornerness(data: &[u8], width: usize, (x, y): (usize, usize)) -> f64 {
    let (mut xx, mut xy, mut yy) = (0_i32, 0_i32, 0_i32);
    for row in y - 2..=y + 2 {
        let start = row * width + x - 2;
        for at in start..start + 5 {
            let across = i32::from(data[at + 1]) - i32::from(data[at - 1]);
            let down = i32::from(data[at + width]) - i32::from(data[at - width]);
            xx += across * across;
            xy += across * down;
            yy += down * down;
        }
    }
    // Slopes are twice the difference of neighbours, over 25 pixels.
    smaller_eigenvalue(f64::from(xx), f64::from(xy), f64::from(yy)) / (4.0 * 25.0)
}

fn smaller_eigenvalue(xx: f64, xy: f64, yy: f64) -> f64 {
    let difference = xx - yy;
    (xx + yy - (difference * difference + 4.0 * xy * xy).sqrt()) / 2.0
}

/// Follows a point from one image to the other and back; `None` unless it comes back to within `tolerance` pixels of its start.
pub(crate) fn follow_and_return(
    before: &Pyramid,
    after: &Pyramid,
    from: (f64, f64),
    guess: Shift,
    top: usize,
    tolerance: f64,
) -> Option<(f64, f64)> {
    let to = follow(before, after, from, guess, top)?;
    let back = Shift { x: from.0 - to.0, y: from.1 - to.1 };
    let home = follow(after, before, to, back, top.min(1))?;
    let (x, y) = (home.0 - from.0, home.1 - from.1);
    (x * x + y * y < tolerance * tolerance).then_some(to)
}

/// Follows a point from one image to the other, beginning `guess` away on level `top`.
fn follow(before: &Pyramid, after: &Pyramid, from: (f64, f64), guess: Shift, top: usize) -> Option<(f64, f64)> {
    let mut bordered = [0_i32; BORDERED * BORDERED];
    let mut other = [0_i32; AREA];
    let (mut values, mut across, mut down) = ([0_i32; AREA], [0_i32; AREA], [0_i32; AREA]);
    let size = f64::from(1_u32 << top);
    let (mut dx, mut dy) = (guess.x / size, guess.y / size);
    for level in (0..=top).rev() {
        let size = f64::from(1_u32 << level);
        let (x, y) = (from.0 / size, from.1 / size);
        before.level(level).square((x, y), BORDERED, &mut bordered);
        for row in 0..WINDOW {
            for column in 0..WINDOW {
                let at = (row + 1) * BORDERED + column + 1;
                let to = row * WINDOW + column;
                values[to] = bordered[at];
                across[to] = bordered[at + 1] - bordered[at - 1];
                down[to] = bordered[at + BORDERED] - bordered[at - BORDERED];
            }
        }
        let tensor = Tensor::of(&across, &down);
        if !tensor.is_steep() {
            if level == 0 {
                return None;
            }
            (dx, dy) = (dx * 2.0, dy * 2.0);
            continue;
        }
        let (start_x, start_y) = (dx, dy);
        for _ in 0..8 {
            after.level(level).square((x + dx, y + dy), WINDOW, &mut other);
            let (step_x, step_y) = tensor.step(&values, &other, &across, &down);
            (dx, dy) = (dx + step_x, dy + step_y);
            let (far_x, far_y) = (dx - start_x, dy - start_y);
            // Also false for what is no number.
            let near = far_x * far_x + far_y * far_y < (WINDOW * WINDOW) as f64;
            if !near {
                return None;
            }
            if step_x * step_x + step_y * step_y < 0.03 * 0.03 {
                break;
            }
        }
        if level > 0 {
            (dx, dy) = (dx * 2.0, dy * 2.0);
        }
    }
    let (x, y) = (from.0 + dx, from.1 + dy);
    let (width, height) = after.size();
    let inside = x >= 0.0 && y >= 0.0 && x < f64::from(width) && y < f64::from(height);
    inside.then_some((x, y))
}

/// The structure tensor of a window, about the means: a change of brightness is no motion.
struct Tensor {
    xx: f64,
    xy: f64,
    yy: f64,
    mean_x: f64,
    mean_y: f64,
}

impl Tensor {
    fn of(across: &[i32; AREA], down: &[i32; AREA]) -> Self {
        let count = AREA as f64;
        let (sum_x, sum_y) = (sum(across) as f64, sum(down) as f64);
        Self {
            xx: products(across, across) as f64 - sum_x * sum_x / count,
            xy: products(across, down) as f64 - sum_x * sum_y / count,
            yy: products(down, down) as f64 - sum_y * sum_y / count,
            mean_x: sum_x / count,
            mean_y: sum_y / count,
        }
    }

    /// Whether the window has slopes in both directions.
    fn is_steep(&self) -> bool {
        // Slopes count twice the grey levels per pixel, with FRACTION fractional bits.
        let unit = f64::from(2_u32 << FRACTION);
        smaller_eigenvalue(self.xx, self.xy, self.yy) / (AREA as f64 * unit * unit) > 0.25
    }

    /// The step that reduces the differences most, pixels.
    fn step(&self, values: &[i32; AREA], other: &[i32; AREA], across: &[i32; AREA], down: &[i32; AREA]) -> (f64, f64) {
        let mut differences = [0_i32; AREA];
        for ((difference, value), other) in differences.iter_mut().zip(values).zip(other) {
            *difference = value - other;
        }
        let total = sum(&differences) as f64;
        let bx = products(&differences, across) as f64 - total * self.mean_x;
        let by = products(&differences, down) as f64 - total * self.mean_y;
        let determinant = self.xx * self.yy - self.xy * self.xy;
        // Slopes over two pixels: twice.
        (2.0 * (self.yy * bx - self.xy * by) / determinant, 2.0 * (self.xx * by - self.xy * bx) / determinant)
    }
}

fn sum(values: &[i32; AREA]) -> i64 {
    i64::from(values.iter().sum::<i32>())
}

/// The sum of products: a row's fit 32 bits (11 × 8160² < 2³¹).
fn products(one: &[i32; AREA], other: &[i32; AREA]) -> i64 {
    let rows = one.chunks_exact(WINDOW).zip(other.chunks_exact(WINDOW));
    rows.map(|(one, other)| i64::from(one.iter().zip(other).map(|(a, b)| a * b).sum::<i32>())).sum()
}

//! Corners, and where they have gone in another image: those of Shi and Tomasi (1994), followed by the pyramidal method of Lucas
//! and Kanade (Bouguet 2001), there and back (Kalal, Mikolajczyk and Matas 2010). Sums are integers; what is solved with them is
//! IEEE arithmetic in a fixed order.

use crate::track::Shift;
use crate::track::grey::{FRACTION, Pyramid};

/// Side of the window around a corner, pixels.
const WINDOW: usize = 11;
/// The window with the border that its slopes need.
const BORDERED: usize = WINDOW + 2;
const AREA: usize = WINDOW * WINDOW;
/// The weakest corner: smaller eigenvalue of the mean structure tensor, (grey levels per pixel)².
pub(super) const WEAKEST: f64 = 1.5;

/// How good a corner a pixel is: the smaller eigenvalue of the mean structure tensor of the 5×5 pixels about it, (grey levels per
/// pixel)². The pixel lies at least 3 pixels inside the image.
pub(super) fn cornerness(data: &[u8], width: usize, (x, y): (usize, usize)) -> f64 {
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
pub(super) fn follow_and_return(
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

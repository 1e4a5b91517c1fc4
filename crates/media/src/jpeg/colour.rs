//! Conversion from red, green and blue to luma and chroma (ITU-R T.871), in integers, eight pixels at once.

use fearless_simd::prelude::*;
use fearless_simd::{Simd, i32x8, u8x16, u8x32, u32x8};

use super::tables::BLOCK;
use super::transform::Lanes;

/// Bytes of eight pixels.
const EIGHT: usize = 24;

/// Weights of red, green and blue, times 2¹⁶: each row adds up to 1 or 0.
const LUMA: [i32; 3] = [19595, 38470, 7471];
const BLUE: [i32; 3] = [-11059, -21709, 32768];
const RED: [i32; 3] = [32768, -27439, -5329];
/// Fractional bits of the weights.
const POINT: u32 = 16;
/// Samples lie around zero.
const MIDDLE: i32 = 128 << POINT;

/// Shuffle of the bytes of eight pixels, each into the lower three of four. The upper half reads from the eighth byte
/// on, so that no byte after the 24 is accessed.
const SPREAD: [u8; 32] =
    [0, 1, 2, 2, 3, 4, 5, 5, 6, 7, 8, 8, 9, 10, 11, 11, 4, 5, 6, 6, 7, 8, 9, 9, 10, 11, 12, 12, 13, 14, 15, 15];

/// Red, green and blue of eight pixels, or their sums.
#[derive(Clone, Copy)]
struct Pixels<S: Simd> {
    red: Lanes<S>,
    green: Lanes<S>,
    blue: Lanes<S>,
}

impl<S: Simd> Pixels<S> {
    #[inline(always)]
    fn of(simd: S, bytes: &[u8]) -> Self {
        let (begin, end) = (u8x16::from_slice(simd, &bytes[..16]), u8x16::from_slice(simd, &bytes[EIGHT - 16..EIGHT]));
        let spread = simd.combine_u8x16(begin, end).swizzle_dyn_within_blocks(u8x32::from_slice(simd, &SPREAD));
        let packed: u32x8<S> = spread.bitcast();
        let (byte, green) = (u32x8::splat(simd, 0xff), packed >> 8);
        Self { red: (packed & byte).bitcast(), green: (green & byte).bitcast(), blue: ((packed >> 16) & byte).bitcast() }
    }

    /// Pairwise sums: pixels of two rows, sixteen of each.
    #[inline(always)]
    fn quartered(upper: [Self; 2], lower: [Self; 2]) -> Self {
        let [left, right] = [upper[0].plus(lower[0]), upper[1].plus(lower[1])];
        Self {
            red: neighbours(left.red, right.red),
            green: neighbours(left.green, right.green),
            blue: neighbours(left.blue, right.blue),
        }
    }

    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        Self { red: self.red + other.red, green: self.green + other.green, blue: self.blue + other.blue }
    }

    /// Weighted sum, plus `add`, shifted down.
    #[inline(always)]
    fn mixed(self, simd: S, weights: [i32; 3], add: i32, down: u32) -> Lanes<S> {
        (self.red * weights[0] + self.green * weights[1] + self.blue * weights[2] + i32x8::splat(simd, add)) >> down
    }

    #[inline(always)]
    fn luma(self, simd: S) -> Lanes<S> {
        self.mixed(simd, LUMA, (1 << (POINT - 1)) - MIDDLE, POINT)
    }

    /// A component of pixels that are sums of 2 to the power of `sums`. Halves are rounded down, otherwise the purest
    /// colour would not fit a byte.
    #[inline(always)]
    fn chroma(self, simd: S, weights: [i32; 3], sums: u32) -> Lanes<S> {
        self.mixed(simd, weights, (1 << (POINT + sums - 1)) - 1, POINT + sums)
    }
}

/// Sums of neighbours of sixteen numbers in a row.
#[inline(always)]
fn neighbours<S: Simd>(left: Lanes<S>, right: Lanes<S>) -> Lanes<S> {
    let (even, odd) = left.deinterleave(right);
    even + odd
}

#[inline(always)]
fn store<S: Simd>(lanes: Lanes<S>, block: &mut [i32; BLOCK], row: usize) {
    lanes.store_slice(&mut block[row * 8..row * 8 + 8]);
}

#[inline(always)]
fn sixteen<S: Simd>(simd: S, bytes: &[u8]) -> [Pixels<S>; 2] {
    [Pixels::of(simd, &bytes[..EIGHT]), Pixels::of(simd, &bytes[EIGHT..2 * EIGHT])]
}

/// Eight by eight pixels as three blocks: luma, blue, red. `bytes` begins at the first pixel, with `stride` bytes per
/// row.
#[inline(always)]
pub(super) fn full<S: Simd>(simd: S, bytes: &[u8], stride: usize, blocks: &mut [[i32; BLOCK]; 6]) {
    for row in 0..8 {
        let pixels = Pixels::of(simd, &bytes[row * stride..row * stride + EIGHT]);
        store(pixels.luma(simd), &mut blocks[0], row);
        store(pixels.chroma(simd, BLUE, 0), &mut blocks[1], row);
        store(pixels.chroma(simd, RED, 0), &mut blocks[2], row);
    }
}

/// Sixteen by sixteen pixels as six blocks: luma of the four quarters, blue, red; two by two pixels have one mean
/// chroma.
#[inline(always)]
pub(super) fn halved<S: Simd>(simd: S, bytes: &[u8], stride: usize, blocks: &mut [[i32; BLOCK]; 6]) {
    for pair in 0..8 {
        let rows = [sixteen(simd, &bytes[2 * pair * stride..]), sixteen(simd, &bytes[(2 * pair + 1) * stride..])];
        for (below, pixels) in rows.into_iter().enumerate() {
            let row = 2 * pair + below;
            store(pixels[0].luma(simd), &mut blocks[row / 8 * 2], row % 8);
            store(pixels[1].luma(simd), &mut blocks[row / 8 * 2 + 1], row % 8);
        }
        let mean = Pixels::quartered(rows[0], rows[1]);
        store(mean.chroma(simd, BLUE, 2), &mut blocks[4], pair);
        store(mean.chroma(simd, RED, 2), &mut blocks[5], pair);
    }
}

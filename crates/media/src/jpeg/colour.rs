//! Conversion from red, green and blue to luma and chroma (ITU-R T.871), in integers, eight pixels at once.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use super::tables::BLOCK;
use super::transform::Lanes;
use crate::pixels::{EIGHT, Pixels, sixteen};

/// Weights of red, green and blue, times 2¹⁶: each row adds up to 1 or 0.
const LUMA: [i32; 3] = [19595, 38470, 7471];
const BLUE: [i32; 3] = [-11059, -21709, 32768];
const RED: [i32; 3] = [32768, -27439, -5329];
/// Fractional bits of the weights.
const POINT: u32 = 16;
/// Samples lie around zero.
const MIDDLE: i32 = 128 << POINT;

impl<S: Simd> Pixels<S> {
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

#[inline(always)]
fn store<S: Simd>(lanes: Lanes<S>, block: &mut [i32; BLOCK], row: usize) {
    lanes.store_slice(&mut block[row * 8..row * 8 + 8]);
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

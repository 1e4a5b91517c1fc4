//! Red, green and blue of neighbouring pixels in vectors of integers, for conversion to luma and chroma.

use fearless_simd::prelude::*;
use fearless_simd::{Simd, i32x8, u8x16, u8x32, u32x8};

/// Runs an expression with the machine's vector instructions. On x86-64 it is compiled for AVX2 and for the architecture's baseline; more
/// variants would not be worth their compile time.
macro_rules! with_vectors {
    ($simd:ident => $body:expr) => {{
        let level = fearless_simd::Level::new();
        #[cfg(target_arch = "x86_64")]
        {
            use fearless_simd::Simd as _;
            if let Some($simd) = level.as_avx2() {
                $simd.vectorize(
                    #[inline(always)]
                    || $body,
                )
            } else {
                let $simd = level.as_sse2().expect("the architecture has SSE2");
                $simd.vectorize(
                    #[inline(always)]
                    || $body,
                )
            }
        }
        #[cfg(not(target_arch = "x86_64"))]
        fearless_simd::dispatch!(level, $simd => $body)
    }};
}
pub(crate) use with_vectors;

/// Bytes of eight pixels.
pub(crate) const EIGHT: usize = 24;

/// Shuffle of the bytes of eight pixels, each into the lower three of four. The upper half reads from the eighth byte
/// on, so that no byte after the 24 is accessed.
const SPREAD: [u8; 32] =
    [0, 1, 2, 2, 3, 4, 5, 5, 6, 7, 8, 8, 9, 10, 11, 11, 4, 5, 6, 6, 7, 8, 9, 9, 10, 11, 12, 12, 13, 14, 15, 15];

/// Red, green and blue of eight pixels, or their sums.
#[derive(Clone, Copy)]
pub(crate) struct Pixels<S: Simd> {
    red: i32x8<S>,
    green: i32x8<S>,
    blue: i32x8<S>,
}

impl<S: Simd> Pixels<S> {
    #[inline(always)]
    pub(crate) fn of(simd: S, bytes: &[u8]) -> Self {
        let (begin, end) = (u8x16::from_slice(simd, &bytes[..16]), u8x16::from_slice(simd, &bytes[EIGHT - 16..EIGHT]));
        let spread = simd.combine_u8x16(begin, end).swizzle_dyn_within_blocks(u8x32::from_slice(simd, &SPREAD));
        let packed: u32x8<S> = spread.bitcast();
        let (byte, green) = (u32x8::splat(simd, 0xff), packed >> 8);
        Self { red: (packed & byte).bitcast(), green: (green & byte).bitcast(), blue: ((packed >> 16) & byte).bitcast() }
    }

    /// Pairwise sums: pixels of two rows, sixteen of each.
    #[inline(always)]
    pub(crate) fn quartered(upper: [Self; 2], lower: [Self; 2]) -> Self {
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
    pub(crate) fn mixed(self, simd: S, weights: [i32; 3], add: i32, down: u32) -> i32x8<S> {
        (self.red * weights[0] + self.green * weights[1] + self.blue * weights[2] + i32x8::splat(simd, add)) >> down
    }
}

/// Sums of neighbours of sixteen numbers in a row.
#[inline(always)]
fn neighbours<S: Simd>(left: i32x8<S>, right: i32x8<S>) -> i32x8<S> {
    let (even, odd) = left.deinterleave(right);
    even + odd
}

/// Sixteen pixels of a row, whose bytes come first.
#[inline(always)]
pub(crate) fn sixteen<S: Simd>(simd: S, bytes: &[u8]) -> [Pixels<S>; 2] {
    [Pixels::of(simd, &bytes[..EIGHT]), Pixels::of(simd, &bytes[EIGHT..2 * EIGHT])]
}

//! From eight by eight samples to quantised coefficients: the discrete cosine transform and the division, eight columns
//! at once.
//!
//! The transform is that of Loeffler, Ligtenberg and Moschytz (1989) with constants of 13 bits. Everything is an
//! integer, so that vectors of any width give the same result.

use fearless_simd::prelude::*;
use fearless_simd::{Simd, i32x8};

use super::tables::{BLOCK, ZIGZAG};

/// Eight numbers: one row, with one number per column.
pub(super) type Lanes<S> = i32x8<S>;
/// Eight rows.
type Rows<S> = [Lanes<S>; 8];

/// Fractional bits of the constants.
const POINT: u32 = 13;
/// Fractional bits that the first pass leaves for the second.
const KEPT: u32 = 2;
/// Both passes together give coefficients eight times too large, which the division compensates.
const GAIN: i32 = 8;

/// Constants of the transform, times 2¹³.
const C0_298: i32 = 2446;
const C0_390: i32 = 3196;
const C0_541: i32 = 4433;
const C0_765: i32 = 6270;
const C0_899: i32 = 7373;
const C1_175: i32 = 9633;
const C1_501: i32 = 12299;
const C1_847: i32 = 15137;
const C1_961: i32 = 16069;
const C2_053: i32 = 16819;
const C2_562: i32 = 20995;
const C3_072: i32 = 25172;

/// Fractional bits of a reciprocal: the largest coefficient times the largest reciprocal stays below 2³¹.
const RECIPROCAL: u32 = 20;

/// The divisors as reciprocals, in the order in which the transform leaves its coefficients: column by column.
pub(super) struct Divisors {
    half: [i32; BLOCK],
    reciprocal: [i32; BLOCK],
}

impl Divisors {
    /// From divisors in row order.
    pub(super) fn of(steps: &[u8; BLOCK]) -> Self {
        let divisor = |place: usize| i32::from(steps[place % 8 * 8 + place / 8]) * GAIN;
        Self {
            half: core::array::from_fn(|place| divisor(place) / 2),
            reciprocal: core::array::from_fn(|place| ((1 << RECIPROCAL) + divisor(place) - 1) / divisor(place)),
        }
    }
}

/// Position in file order of each coefficient of [`quantised`].
pub(super) const FILE_ORDER: [u8; BLOCK] = {
    let mut order = [0; BLOCK];
    let mut index = 0;
    while index < BLOCK {
        let place = ZIGZAG[index] as usize;
        order[place % 8 * 8 + place / 8] = index as u8;
        index += 1;
    }
    order
};

/// Shifted down by `down` bits, rounded.
#[inline(always)]
fn scaled<S: Simd>(simd: S, down: u32, lanes: Lanes<S>) -> Lanes<S> {
    (lanes + Lanes::splat(simd, 1 << (down - 1))) >> down
}

/// One pass over eight rows, which transforms columns; its results are [`scaled`] by `down`.
#[inline(always)]
fn pass<S: Simd>(simd: S, rows: Rows<S>, down: u32) -> Rows<S> {
    let [r0, r1, r2, r3, r4, r5, r6, r7] = rows;
    let (sum0, sum1, sum2, sum3) = (r0 + r7, r1 + r6, r2 + r5, r3 + r4);
    let (dif0, dif1, dif2, dif3) = (r0 - r7, r1 - r6, r2 - r5, r3 - r4);

    let (outer, inner) = (sum0 + sum3, sum1 + sum2);
    let (outer_dif, inner_dif) = (sum0 - sum3, sum1 - sum2);
    let turned = (outer_dif + inner_dif) * C0_541;

    let (z1, z2) = ((dif3 + dif0) * -C0_899, (dif2 + dif1) * -C2_562);
    let (z3, z4) = (dif3 + dif1, dif2 + dif0);
    let z5 = (z3 + z4) * C1_175;
    let (z3, z4) = (z5 - z3 * C1_961, z5 - z4 * C0_390);
    [
        scaled(simd, down, (outer + inner) << POINT),
        scaled(simd, down, dif0 * C1_501 + z1 + z4),
        scaled(simd, down, turned + outer_dif * C0_765),
        scaled(simd, down, dif1 * C3_072 + z2 + z3),
        scaled(simd, down, (outer - inner) << POINT),
        scaled(simd, down, dif2 * C2_053 + z2 + z4),
        scaled(simd, down, turned - inner_dif * C1_847),
        scaled(simd, down, dif3 * C0_298 + z1 + z3),
    ]
}

/// Rows to columns: three times each row is interleaved with the one four below it.
#[inline(always)]
fn transposed<S: Simd>(mut rows: Rows<S>) -> Rows<S> {
    for _ in 0..3 {
        let [r0, r1, r2, r3, r4, r5, r6, r7] = rows;
        let (a0, a1) = r0.interleave(r4);
        let (b0, b1) = r1.interleave(r5);
        let (c0, c1) = r2.interleave(r6);
        let (d0, d1) = r3.interleave(r7);
        rows = [a0, a1, b0, b1, c0, c1, d0, d1];
    }
    rows
}

#[inline(always)]
fn at<S: Simd>(simd: S, numbers: &[i32; BLOCK], row: usize) -> Lanes<S> {
    Lanes::from_slice(simd, &numbers[row * 8..row * 8 + 8])
}

/// Coefficients of a block of samples in −128..=127, divided by their steps and rounded, column by column. A bit of the
/// returned mask is set where a coefficient is not zero.
#[inline(always)]
pub(super) fn quantised<S: Simd>(simd: S, samples: &[i32; BLOCK], divisors: &Divisors, into: &mut [i32; BLOCK]) -> u64 {
    let rows = core::array::from_fn(
        #[inline(always)]
        |row| at(simd, samples, row),
    );
    let rows = pass(simd, transposed(pass(simd, rows, POINT - KEPT)), POINT + KEPT);
    let mut found = 0;
    for (row, lanes) in rows.into_iter().enumerate() {
        let sign = lanes >> 31;
        let size = (lanes ^ sign) - sign;
        let divided = ((size + at(simd, &divisors.half, row)) * at(simd, &divisors.reciprocal, row)) >> RECIPROCAL;
        let signed = (divided ^ sign) - sign;
        signed.store_slice(&mut into[row * 8..row * 8 + 8]);
        let zero = signed.simd_eq(Lanes::splat(simd, 0));
        found |= (!zero.to_bitmask() & 0xff) << (row * 8);
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use fearless_simd::Level;
    use proptest::prelude::*;

    /// The transform by its definition, column by column.
    fn defined(samples: &[i32; BLOCK]) -> [f64; BLOCK] {
        let cosine = |x: usize, u: usize| libm::cos((2 * x + 1) as f64 * u as f64 * core::f64::consts::PI / 16.0);
        let weight = |u: usize| if u == 0 { core::f64::consts::FRAC_1_SQRT_2 } else { 1.0 };
        core::array::from_fn(|place| {
            let (u, v) = (place / 8, place % 8);
            let terms = (0..BLOCK).map(|at| f64::from(samples[at]) * cosine(at % 8, u) * cosine(at / 8, v));
            terms.sum::<f64>() * weight(u) * weight(v) / 4.0
        })
    }

    proptest! {
        #[test]
        fn coefficients_are_those_of_the_definition(
            samples in prop::array::uniform32(prop::array::uniform2(-128..=127_i32)),
            step in 1..=255_u8,
        ) {
            let samples: [i32; BLOCK] = core::array::from_fn(|at| samples[at / 2][at % 2]);
            let (divisors, mut found) = (Divisors::of(&[step; BLOCK]), [0; BLOCK]);
            let level = Level::new();
            let mask = fearless_simd::dispatch!(level, simd => quantised(simd, &samples, &divisors, &mut found));
            for (at, exact) in defined(&samples).into_iter().enumerate() {
                let error = f64::from(found[at]) - exact / f64::from(step);
                prop_assert!(error.abs() < 0.5 + 0.6 / f64::from(step), "{} for {exact} at {at}", found[at]);
                prop_assert_eq!(mask >> at & 1 == 1, found[at] != 0);
            }
        }
    }
}

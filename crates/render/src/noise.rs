//! Smooth noise from a table, and random values for lattice cells.

use fearless_simd::prelude::*;

use super::lanes::{F, I, LANES, Simd, U, clamp, each, whole};

/// Side of the noise table; noise repeats after this many cells.
const SIDE: usize = 256;

/// Value noise from a table, −1..=1, with smooth steps between cells.
#[derive(Debug)]
pub(crate) struct Noise {
    /// The values at the four corners of each cell, in steps of 1/127, one byte each: the upper two, then the lower
    /// two.
    cells: Box<[u32; SIDE * SIDE]>,
}

/// A random value 0..1 of a lattice cell.
#[inline]
pub(crate) fn cell_hash(x: i32, y: i32, salt: u32) -> f32 {
    // The finaliser of MurmurHash3 (Appleby): full avalanche of 32 bits.
    let mut h = (x as u32).wrapping_mul(0x9e37_79b1) ^ (y as u32).wrapping_mul(0x85eb_ca77) ^ salt.wrapping_mul(0xc2b2_ae3d);
    h = (h ^ (h >> 16)).wrapping_mul(0x85eb_ca6b);
    h = (h ^ (h >> 13)).wrapping_mul(0xc2b2_ae35);
    (h >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// The greatest integer not above `x`, for |x| < 2³¹: a truncation and a comparison instead of a function call.
#[inline]
pub(crate) fn floor(x: f32) -> i32 {
    let whole = x as i32;
    whole - i32::from(x < whole as f32)
}

/// [`cell_hash`] for eight cells.
#[inline(always)]
pub(crate) fn cell_hashes<S: Simd>(x: I<S>, y: I<S>, salt: u32) -> F<S> {
    let (x, y): (U<S>, U<S>) = (x.bitcast(), y.bitcast());
    let h = (x * 0x9e37_79b1) ^ (y * 0x85eb_ca77) ^ salt.wrapping_mul(0xc2b2_ae3d);
    let h = (h ^ (h >> 16)) * 0x85eb_ca6b;
    let h = (h ^ (h >> 13)) * 0xc2b2_ae35;
    let h: I<S> = (h >> 8).bitcast();
    h.to_float::<F<S>>() * (1.0 / 16_777_216.0)
}

impl Noise {
    pub(crate) fn new() -> Self {
        let value = |x: usize, y: usize| {
            let steps = (cell_hash((x % SIDE) as i32, (y % SIDE) as i32, 77) * 255.0) as i32 - 127;
            u32::from(steps as i8 as u8)
        };
        let mut cells = Box::new([0; SIDE * SIDE]);
        for (i, cell) in cells.iter_mut().enumerate() {
            let (x, y) = (i % SIDE, i / SIDE);
            *cell = value(x, y) | value(x + 1, y) << 8 | value(x, y + 1) << 16 | value(x + 1, y + 1) << 24;
        }
        Self { cells }
    }

    /// Noise at (x, y), in cells.
    #[inline(always)]
    pub(crate) fn at<S: Simd>(&self, x: F<S>, y: F<S>) -> F<S> {
        let (x0, y0) = (x.floor(), y.floor());
        let (fx, fy) = (x - x0, y - y0);
        let (sx, sy) = (fx * fx * (3.0 - fx * 2.0), fy * fy * (3.0 - fy * 2.0));
        let place = ((whole(y0) & (SIDE as i32 - 1)) << SIDE.ilog2()) | (whole(x0) & (SIDE as i32 - 1));
        let place: [i32; LANES] = place.into();
        let cell = each(
            #[inline(always)]
            |lane| self.cells[place[lane] as usize & (SIDE * SIDE - 1)] as i32,
        );
        let cell = I::from_slice(x.token(), &cell);
        // Signed bytes: up to the top, and down again.
        let (a, b): (F<S>, F<S>) = (((cell << 24) >> 24).to_float(), ((cell << 16) >> 24).to_float());
        let (c, d): (F<S>, F<S>) = (((cell << 8) >> 24).to_float(), (cell >> 24).to_float());
        let (top, bottom) = (a + (b - a) * sx, c + (d - c) * sx);
        (top + (bottom - top) * sy) * (1.0 / 127.0)
    }

    /// Noise with this many cells per metre, faded out as the footprint of a pixel approaches the size of a cell.
    #[inline(always)]
    pub(crate) fn faded<S: Simd>(&self, x: F<S>, y: F<S>, cells: f32, footprint: F<S>) -> F<S> {
        let fade = clamp(1.6 - footprint * (1.6 * cells), 0.0, 1.0);
        if fade.simd_gt(0.0).any_true() { self.at(x * cells, y * cells) * fade } else { fade }
    }
}

#[cfg(test)]
mod tests {
    use super::super::lanes::{Instructions, with_instructions};
    use super::*;

    #[test]
    fn floor_is_floor() {
        for x in [-2.0, -1.5, -0.25, 0.0, 0.25, 1.0, 1.75, 1e6] {
            assert_eq!(floor(x), f32::floor(x) as i32);
        }
    }

    #[test]
    fn noise_is_smooth_and_repeats() {
        let noise = Noise::new();
        with_instructions!(Instructions::best(), simd => {
            let at = |x: f32, y: f32| noise.at(F::splat(simd, x), F::splat(simd, y))[5];
            assert!((at(3.0, 4.0) - at(259.0, -252.0)).abs() < 1e-6);
            assert!((at(3.999_9, 4.0) - at(4.0, 4.0)).abs() < 1e-3);
            assert!((0..300).all(|i| at(i as f32 * 0.37, i as f32 * -0.21).abs() <= 1.0));
            let wide = F::splat(simd, 2.0);
            assert_eq!(noise.faded(F::splat(simd, 3.2), F::splat(simd, 4.1), 1.0, wide)[0], 0.0);
        });
    }

    #[test]
    fn eight_hashes_are_the_hash() {
        with_instructions!(Instructions::best(), simd => {
            let (x, y) = (I::from_fn(simd, |i| i as i32 * 977 - 3000), I::from_fn(simd, |i| 5 - 131 * i as i32));
            let found = cell_hashes(x, y, 5);
            (0..8).for_each(|i| assert_eq!(found[i], cell_hash(x[i], y[i], 5)));
        });
    }
}

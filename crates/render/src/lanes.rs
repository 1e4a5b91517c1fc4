//! Eight pixels at once: vectors with one value per pixel, and the instruction sets that compute them.
//!
//! Every operation used is exact by IEEE 754 (addition, multiplication, division, square root, comparison, conversion),
//! so results are identical for all instruction sets. Multiplication and addition are never fused. `max` and `min` take
//! the known number second: it is the result if the first is NaN, on every x86-64 machine.

use core::ops::{Add, Mul, Sub};

use fearless_simd::prelude::*;
use fearless_simd::{Level, f32x8, i32x8, mask32x8, u32x8};
use glam::Vec3;

pub(crate) use fearless_simd::Simd;

/// Pixels shaded together.
pub(crate) const LANES: usize = 8;
/// A real number per pixel.
pub(crate) type F<S> = f32x8<S>;
/// An integer per pixel.
pub(crate) type I<S> = i32x8<S>;
/// Bits per pixel.
pub(crate) type U<S> = u32x8<S>;
/// A truth value per pixel.
pub(crate) type M<S> = mask32x8<S>;

/// Instruction sets that compute images.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Instructions(pub(crate) Level);

impl Instructions {
    /// The widest that this machine has and the renderer supports.
    pub(crate) fn best() -> Self {
        Self(Level::new())
    }

    /// The baseline of this architecture.
    pub(crate) fn plain() -> Self {
        Self(Level::baseline())
    }
}

/// Runs an expression compiled for each instruction set, with the one that `$on` names; `$simd` is the proof that it is
/// available. On x86-64 two are compiled: AVX2, and SSE2 for machines without it.
macro_rules! with_instructions {
    ($on:expr, $simd:ident => $body:expr) => {{
        let level = $on.0;
        #[cfg(target_arch = "x86_64")]
        {
            use fearless_simd::Simd as _;
            match (level.as_avx2(), level.as_sse2()) {
                (Some($simd), _) => $simd.vectorize(
                    #[inline(always)]
                    || $body,
                ),
                (None, Some($simd)) => $simd.vectorize(
                    #[inline(always)]
                    || $body,
                ),
                // The architecture has SSE2.
                (None, None) => fearless_simd::dispatch!(level, $simd => $body),
            }
        }
        #[cfg(not(target_arch = "x86_64"))]
        fearless_simd::dispatch!(level, $simd => $body)
    }};
}
pub(crate) use with_instructions;

/// Three numbers, or three vectors of numbers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct V3<T> {
    pub(crate) x: T,
    pub(crate) y: T,
    pub(crate) z: T,
}

impl From<Vec3> for V3<f32> {
    #[inline(always)]
    fn from(v: Vec3) -> Self {
        Self { x: v.x, y: v.y, z: v.z }
    }
}

impl<T: Copy + Add<Output = T>> Add for V3<T> {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        Self { x: self.x + o.x, y: self.y + o.y, z: self.z + o.z }
    }
}

impl<T: Copy + Sub<Output = T>> Sub for V3<T> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, o: Self) -> Self {
        Self { x: self.x - o.x, y: self.y - o.y, z: self.z - o.z }
    }
}

impl<T: Copy + Mul<Output = T>> Mul<T> for V3<T> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, k: T) -> Self {
        Self { x: self.x * k, y: self.y * k, z: self.z * k }
    }
}

impl<T: Copy + Mul<Output = T> + Add<Output = T>> V3<T> {
    #[inline(always)]
    pub(crate) fn dot(self, o: Self) -> T {
        self.x * o.x + self.y * o.y + self.z * o.z
    }

    /// Applies a function to each component.
    #[inline(always)]
    pub(crate) fn times(self, o: Self) -> Self {
        Self { x: self.x * o.x, y: self.y * o.y, z: self.z * o.z }
    }

    #[inline(always)]
    pub(crate) fn map<U>(self, mut f: impl FnMut(T) -> U) -> V3<U> {
        V3 { x: f(self.x), y: f(self.y), z: f(self.z) }
    }
}

impl<S: Simd> V3<F<S>> {
    /// The same for all pixels.
    #[inline(always)]
    pub(crate) fn splat(simd: S, v: Vec3) -> Self {
        V3::from(v).map(
            #[inline(always)]
            |k| F::splat(simd, k),
        )
    }

    #[inline(always)]
    pub(crate) fn dot_same(self, v: Vec3) -> F<S> {
        self.x * v.x + self.y * v.y + self.z * v.z
    }

    #[inline(always)]
    pub(crate) fn plus_same(self, v: Vec3) -> Self {
        Self { x: self.x + v.x, y: self.y + v.y, z: self.z + v.z }
    }

    /// One vector, scaled by a different number for each pixel.
    #[inline(always)]
    pub(crate) fn along(v: Vec3, by: F<S>) -> Self {
        Self { x: by * v.x, y: by * v.y, z: by * v.z }
    }

    /// The positive parts.
    #[inline(always)]
    pub(crate) fn positive(self) -> Self {
        Self { x: self.x.max(0.0), y: self.y.max(0.0), z: self.z.max(0.0) }
    }

    /// The negative parts.
    #[inline(always)]
    pub(crate) fn negative(self) -> Self {
        Self { x: self.x.min(0.0), y: self.y.min(0.0), z: self.z.min(0.0) }
    }

    /// Normalised, or `other` if the length is zero.
    #[inline(always)]
    pub(crate) fn unit_or(self, other: Self) -> Self {
        let square = self.dot(self);
        let has = square.simd_gt(1e-12);
        let over = 1.0 / square.sqrt();
        Self {
            x: has.select(self.x * over, other.x),
            y: has.select(self.y * over, other.y),
            z: has.select(self.z * over, other.z),
        }
    }

    /// `a` where `mask`, else `b`.
    #[inline(always)]
    pub(crate) fn select(mask: M<S>, a: Self, b: Self) -> Self {
        Self { x: mask.select(a.x, b.x), y: mask.select(a.y, b.y), z: mask.select(a.z, b.z) }
    }
}

/// A value for each pixel. The library's function for filling an array is not always inlined, and code called from it
/// is then compiled without the wide instructions.
#[inline(always)]
pub(crate) fn each<T: Copy + Default>(mut value: impl FnMut(usize) -> T) -> [T; LANES] {
    let mut all = [T::default(); LANES];
    for (lane, one) in all.iter_mut().enumerate() {
        *one = value(lane);
    }
    all
}

/// `x` clamped to `low`..=`high`.
#[inline(always)]
pub(crate) fn clamp<S: Simd>(x: F<S>, low: f32, high: f32) -> F<S> {
    x.max(low).min(high)
}

/// 0 below 0, 1 above 1, smooth between.
#[inline(always)]
pub(crate) fn smooth<S: Simd>(x: F<S>) -> F<S> {
    let x = clamp(x, 0.0, 1.0);
    x * x * (3.0 - x * 2.0)
}

/// The integers of whole-valued `x`, |x| < 2³¹.
#[inline(always)]
pub(crate) fn whole<S: Simd>(x: F<S>) -> I<S> {
    x.to_int()
}

/// Bilinear interpolation between the four corners of a square, one byte each (the two with lower y, then the others):
/// 0..=255 at (x, y), 0..=1 each.
#[inline(always)]
pub(crate) fn four_bytes<S: Simd>(corners: U<S>, [x, y]: [F<S>; 2]) -> F<S> {
    // Written out: a closure that is not inlined has no wide instructions, and costs a call per operation.
    let (a, b): (I<S>, I<S>) = ((corners & 0xff).bitcast(), ((corners >> 8) & 0xff).bitcast());
    let (c, d): (I<S>, I<S>) = (((corners >> 16) & 0xff).bitcast(), (corners >> 24).bitcast());
    let (a, b, c, d): (F<S>, F<S>, F<S>, F<S>) = (a.to_float(), b.to_float(), c.to_float(), d.to_float());
    let (near, far) = (a + (b - a) * x, c + (d - c) * x);
    near + (far - near) * y
}

/// `exp(−x)` for x ≥ 0; relative error below 1e-5, and never below 2⁻¹²⁰.
#[inline(always)]
pub(crate) fn decay<S: Simd>(x: F<S>) -> F<S> {
    let halvings = clamp(x * core::f32::consts::LOG2_E, 0.0, 120.0);
    let full = halvings.floor();
    let f = halvings - full;
    // 2⁻ᶠ by the polynomial of degree 4 through five Chebyshev nodes of 0..=1, including both ends.
    let part = (((f * 0.006_842 - 0.053_286_06) * f + 0.239_528_47) * f - 0.693_084_4) * f + 1.0;
    let power: U<S> = (I::splat(part.token(), 127) - whole(full)).bitcast();
    let power: F<S> = (power << 23).bitcast();
    part * power
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decay_is_the_exponential() {
        with_instructions!(Instructions::best(), simd => {
            for i in 0..600 {
                let x = i as f32 * 0.05;
                let found = decay(F::splat(simd, x))[3];
                assert!((f64::from(found) / libm::exp(-f64::from(x)) - 1.0).abs() < 1e-5, "{x}: {found}");
            }
            assert!(decay(F::splat(simd, 1e9))[0] < 1e-30);
        });
    }
}

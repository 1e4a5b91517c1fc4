//! Tables for the shader: smooth noise, and the display's transfer curve.

use glam::Vec3;

use super::shade::film;

/// Side of the noise table; noise repeats after this many cells.
const SIDE: usize = 256;

/// Value noise from a table, −1..=1, with smooth steps between cells.
#[derive(Debug)]
pub(crate) struct Noise {
    values: Box<[f32; SIDE * SIDE]>,
}

/// A number 0..1 for a lattice cell.
#[inline]
pub(crate) fn cell_hash(x: i32, y: i32, salt: u32) -> f32 {
    // The finaliser of MurmurHash3 (Appleby): full avalanche of 32 bits.
    let mut h = (x as u32).wrapping_mul(0x9e37_79b1) ^ (y as u32).wrapping_mul(0x85eb_ca77) ^ salt.wrapping_mul(0xc2b2_ae3d);
    h = (h ^ (h >> 16)).wrapping_mul(0x85eb_ca6b);
    h = (h ^ (h >> 13)).wrapping_mul(0xc2b2_ae35);
    (h >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// The greatest whole number not above `x`, for |x| < 2³¹: a truncation and a compare, where the library calls a function.
#[inline]
pub(crate) fn floor(x: f32) -> i32 {
    let whole = x as i32;
    whole - i32::from(x < whole as f32)
}

impl Noise {
    pub(crate) fn new() -> Self {
        let cell = |i: usize| cell_hash((i % SIDE) as i32, (i / SIDE) as i32, 77) * 2.0 - 1.0;
        let mut values = Box::new([0.0; SIDE * SIDE]);
        values.iter_mut().enumerate().for_each(|(i, value)| *value = cell(i));
        Self { values }
    }

    /// Noise at (x, y), in cells.
    #[inline]
    pub(crate) fn at(&self, x: f32, y: f32) -> f32 {
        let (ix, iy) = (floor(x), floor(y));
        let (fx, fy) = (x - ix as f32, y - iy as f32);
        let (sx, sy) = (fx * fx * (3.0 - 2.0 * fx), fy * fy * (3.0 - 2.0 * fy));
        let (x0, y0) = (ix as usize & (SIDE - 1), (iy as usize & (SIDE - 1)) * SIDE);
        let (x1, y1) = ((x0 + 1) & (SIDE - 1), (y0 + SIDE) & (SIDE * SIDE - 1));
        let top = self.values[y0 + x0] + (self.values[y0 + x1] - self.values[y0 + x0]) * sx;
        let bottom = self.values[y1 + x0] + (self.values[y1 + x1] - self.values[y1 + x0]) * sx;
        top + (bottom - top) * sy
    }

    /// Noise of so many cells a metre, faded out as the footprint of a pixel nears the cell.
    #[inline]
    pub(crate) fn faded(&self, x: f32, y: f32, cells: f32, footprint: f32) -> f32 {
        let fade = 1.6 - 1.6 * footprint * cells;
        if fade <= 0.0 { 0.0 } else { self.at(x * cells, y * cells) * fade.min(1.0) }
    }
}

/// Linear light 0..=1 to an sRGB byte (IEC 61966-2-1), by table.
#[derive(Debug)]
pub(crate) struct Srgb {
    bytes: Vec<u8>,
}

impl Srgb {
    pub(crate) fn new() -> Self {
        let encode =
            |linear: f64| if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * libm::pow(linear, 1.0 / 2.4) - 0.055 };
        Self { bytes: (0..=4096).map(|i| (encode(f64::from(i) / 4096.0) * 255.0 + 0.5) as u8).collect() }
    }

    /// Values outside of 0..=1 are clamped.
    #[inline]
    pub(crate) fn byte(&self, linear: f32) -> u8 {
        self.bytes[((linear.clamp(0.0, 1.0) * 4096.0 + 0.5) as usize).min(4096)]
    }
}

/// Light on the film to an sRGB byte, by table: [`film`], then [`Srgb`].
#[derive(Debug)]
pub(crate) struct Developed {
    bytes: Box<[u8; DEVELOPED]>,
}

/// Entries of the film's table: 4096 for each unit of light; the film is white at 8 units.
const DEVELOPED: usize = 8 * 4096;

impl Developed {
    pub(crate) fn new() -> Self {
        let srgb = Srgb::new();
        let mut bytes = Box::new([0; DEVELOPED]);
        bytes.iter_mut().enumerate().for_each(|(i, byte)| *byte = srgb.byte(film(Vec3::splat(i as f32 / 4096.0)).x));
        Self { bytes }
    }

    /// Light below 0 is black, beyond the table white.
    #[inline]
    pub(crate) fn byte(&self, light: f32) -> u8 {
        // Added to 2²³, a number is rounded to a whole one, which its lowest bits then hold.
        let steps = (light * 4096.0).clamp(0.0, (DEVELOPED - 1) as f32) + 8_388_608.0;
        self.bytes[steps.to_bits() as usize & (DEVELOPED - 1)]
    }
}

/// `exp(−x)` for x ≥ 0 by table and line, error below 1e-4.
#[derive(Debug)]
pub(crate) struct Decay {
    values: Vec<f32>,
}

impl Decay {
    pub(crate) fn new() -> Self {
        Self { values: (0..=514).map(|i| libm::exp(-f64::from(i) / 64.0) as f32).collect() }
    }

    #[inline]
    pub(crate) fn at(&self, x: f32) -> f32 {
        let x = (x * 64.0).clamp(0.0, 512.0);
        let i = x as usize;
        let (a, b) = (self.values[i], self.values[i + 1]);
        a + (b - a) * (x - i as f32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn floor_is_floor() {
        for x in [-2.0, -1.5, -0.25, 0.0, 0.25, 1.0, 1.75, 1e6] {
            assert_eq!(floor(x), f32::floor(x) as i32);
        }
    }

    #[test]
    fn tables_follow_their_functions() {
        for i in 0..800 {
            let x = i as f32 * 0.01;
            assert!((Decay::new().at(x) - (-x).exp()).abs() < 1e-4);
        }
        let srgb = Srgb::new();
        assert_eq!([srgb.byte(-1.0), srgb.byte(0.0), srgb.byte(0.2122), srgb.byte(2.0)], [0, 0, 127, 255]);
    }

    #[test]
    fn developing_by_table_is_developing() {
        let (srgb, developed) = (Srgb::new(), Developed::new());
        assert_eq!([developed.byte(-1.0), developed.byte(9.0), developed.byte(f32::INFINITY)], [0, 255, 255]);
        for i in 0..9000 {
            let light = i as f32 * 0.000_9;
            let exact = srgb.byte(film(Vec3::splat(light)).x);
            assert!(developed.byte(light).abs_diff(exact) <= 1, "{light}");
        }
    }

    #[test]
    fn noise_is_smooth_and_repeats() {
        let noise = Noise::new();
        assert!((noise.at(3.0, 4.0) - noise.at(259.0, -252.0)).abs() < 1e-6);
        assert!((noise.at(3.999_9, 4.0) - noise.at(4.0, 4.0)).abs() < 1e-3);
        assert_eq!(noise.faded(3.2, 4.1, 1.0, 2.0), 0.0);
    }
}

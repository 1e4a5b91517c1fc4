//! Textures: an image with its mip levels, shared between scenes, renderers and threads.

use std::sync::Arc;

use glam::Vec3;

/// Maximum side of a texture, texels.
pub const MAX_SIDE: u32 = 8192;

/// An opaque, repeating image. Clones share it.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    /// The image, then copies of half the size down to a single texel; never empty.
    levels: Arc<Vec<Level>>,
}

/// One mip level.
#[derive(Debug, PartialEq)]
pub struct Level {
    /// Texels per row.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
    /// Rows from the top, texels from the left. Each channel is the square root of linear light: about as fine as sRGB,
    /// and decoded by one multiplication. The fourth byte is padding.
    pub texels: Vec<[u8; 4]>,
}

/// Linear light of a texel in the format of [`Level`].
#[inline]
#[must_use]
pub fn decoded(texel: [u8; 4]) -> Vec3 {
    let root = Vec3::new(f32::from(texel[0]), f32::from(texel[1]), f32::from(texel[2])) * (1.0 / 255.0);
    root * root
}

fn encoded(light: Vec3) -> [u8; 4] {
    let root = |light: f32| (light.clamp(0.0, 1.0).sqrt() * 255.0 + 0.5) as u8;
    [root(light.x), root(light.y), root(light.z), u8::MAX]
}

/// The sRGB transfer function (IEC 61966-2-1), decoding 0..=1.
pub(crate) fn srgb_to_linear(c: f64) -> f64 {
    if c <= 0.04045 { c / 12.92 } else { libm::pow((c + 0.055) / 1.055, 2.4) }
}

impl Texture {
    /// Creates a texture from sRGB bytes, three per texel, rows from the top; `None` unless both sides are
    /// 1..=[`MAX_SIDE`] and the number of bytes matches.
    #[must_use]
    pub fn from_srgb(width: u32, height: u32, rgb: &[u8]) -> Option<Self> {
        let sides = 1..=MAX_SIDE;
        let texels = width as usize * height as usize;
        if !sides.contains(&width) || !sides.contains(&height) || rgb.len() != texels * 3 {
            return None;
        }
        let root: [u8; 256] = core::array::from_fn(|byte| {
            let linear = srgb_to_linear(byte as f64 / 255.0);
            (linear.sqrt() * 255.0 + 0.5) as u8
        });
        let texel = |c: &[u8]| [root[usize::from(c[0])], root[usize::from(c[1])], root[usize::from(c[2])], u8::MAX];
        Some(Self::from_roots(width as usize, height as usize, rgb.chunks_exact(3).map(texel).collect()))
    }

    /// A texture from texels in the stored format, `width` × `height` of them and at least one.
    pub(crate) fn from_roots(width: usize, height: usize, texels: Vec<[u8; 4]>) -> Self {
        let mut levels = vec![Level { width, height, texels }];
        while let Some(half) = levels.last().and_then(Level::halved) {
            levels.push(half);
        }
        Self { levels: Arc::new(levels) }
    }

    /// Width and height, texels.
    #[must_use]
    pub fn size(&self) -> (usize, usize) {
        (self.levels[0].width, self.levels[0].height)
    }

    /// Mean colour, linear RGB.
    #[must_use]
    pub fn mean(&self) -> Vec3 {
        decoded(self.levels[self.levels.len() - 1].texels[0])
    }

    /// The same image without its `count` finest levels; at least one level is kept.
    #[must_use]
    pub fn coarser(self, count: usize) -> Self {
        let first = count.min(self.levels.len() - 1);
        match Arc::try_unwrap(self.levels) {
            Ok(mut levels) => Self { levels: Arc::new(levels.split_off(first)) },
            Err(shared) => {
                let copy = |l: &Level| Level { width: l.width, height: l.height, texels: l.texels.clone() };
                Self { levels: Arc::new(shared[first..].iter().map(copy).collect()) }
            }
        }
    }

    /// Memory used, bytes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.levels.iter().map(|level| level.texels.len() * 4).sum()
    }

    /// The image, then levels of half the size each, down to a single texel.
    #[inline]
    #[must_use]
    pub fn levels(&self) -> &[Level] {
        &self.levels
    }
}

impl Level {
    /// Half the size, each texel the mean light of those it covers; none for a single texel.
    fn halved(&self) -> Option<Self> {
        if self.width == 1 && self.height == 1 {
            return None;
        }
        let (width, height) = ((self.width / 2).max(1), (self.height / 2).max(1));
        let mut texels = Vec::with_capacity(width * height);
        for y in 0..height {
            let rows = y * self.height / height..(y + 1) * self.height / height;
            for x in 0..width {
                let columns = x * self.width / width..(x + 1) * self.width / width;
                let mut light = Vec3::ZERO;
                for row in rows.clone() {
                    for texel in &self.texels[row * self.width..][columns.clone()] {
                        light += decoded(*texel);
                    }
                }
                texels.push(encoded(light / (rows.len() * columns.len()) as f32));
            }
        }
        Some(Self { width, height, texels })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mid_grey_decodes_to_a_fifth() {
        // 0x80/255 = 0.50196; ((0.50196 + 0.055) / 1.055)^2.4 = 0.2159.
        assert!((srgb_to_linear(128.0 / 255.0) - 0.2159).abs() < 1e-4);
        let grey = Texture::from_srgb(1, 1, &[128; 3]).unwrap();
        assert!((grey.mean() - Vec3::splat(0.2159)).abs().max_element() < 0.004);
    }

    #[test]
    fn halving_keeps_the_light() {
        // Five by three texels, two of them white: a mean of 2/15, whatever the odd sides.
        let mut rgb = vec![0; 45];
        rgb[..3].fill(255);
        rgb[42..].fill(255);
        let texture = Texture::from_srgb(5, 3, &rgb).unwrap();
        let sizes: Vec<_> = texture.levels().iter().map(|l| (l.width, l.height)).collect();
        assert_eq!(sizes, [(5, 3), (2, 1), (1, 1)]);
        // Two texels of 2×3 and 3×3 are averaged alike, so the mean is (1/6 + 1/9) / 2.
        assert!((texture.mean().x - 5.0 / 36.0).abs() < 0.003, "{}", texture.mean());
        assert_eq!(texture.clone().coarser(1).size(), (2, 1));
        assert_eq!(texture.coarser(9).size(), (1, 1));
    }

    #[test]
    fn sizes_that_do_not_fit_are_refused() {
        assert!(Texture::from_srgb(0, 1, &[]).is_none());
        assert!(Texture::from_srgb(2, 2, &[0; 11]).is_none());
        assert!(Texture::from_srgb(MAX_SIDE + 1, 1, &vec![0; 3 * (MAX_SIDE as usize + 1)]).is_none());
    }
}

//! Chooses the size of an image so that the model sees exactly what was sent.
//!
//! Vendors resize silently, and coordinates then refer to the resized image. The size is therefore chosen so that each
//! vendor's own rule leaves it unchanged: within its limits, and with sides in its multiples.

use serde::Deserialize;

/// Limits on image sizes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ImageRule {
    /// Maximum side length sent, pixels: larger images cost time and improve little.
    pub long_side: u32,
    /// Sides are multiples of this.
    pub multiple: u32,
    /// Maximum side length that the vendor does not resize, pixels; 0 for no limit.
    pub max_side: u32,
    /// Side of the vendor's patches, pixels; 0 if it does not use patches.
    pub patch: u32,
    /// Maximum number of patches that the vendor does not resize.
    pub max_patches: u32,
    /// JPEG quality, 1..=100.
    pub quality: u8,
}

impl Default for ImageRule {
    fn default() -> Self {
        // A city at 768×576 and quality 70 stays under 80 kB.
        Self { long_side: 768, multiple: 1, max_side: 0, patch: 0, max_patches: 0, quality: 70 }
    }
}

/// Width and height of the image sent, pixels.
pub type SentSize = (u32, u32);

impl ImageRule {
    /// The size at which a camera's frame is sent. `long_side` replaces the rule's value if the user set one. Images
    /// are never enlarged.
    #[must_use]
    pub fn sent(&self, camera: (u32, u32), long_side: Option<u32>) -> SentSize {
        let (width, height) = (camera.0.max(1), camera.1.max(1));
        let mut side = long_side.unwrap_or(self.long_side).clamp(1, width.max(height));
        if self.max_side > 0 {
            side = side.min(self.max_side);
        }
        loop {
            let size = (self.rounded(width, side, width.max(height)), self.rounded(height, side, width.max(height)));
            // Rounding up may exceed a limit that the side itself satisfies.
            if side <= self.multiple.max(1) || self.fits(size) {
                return size;
            }
            side -= 1;
        }
    }

    /// Whether the vendor leaves an image of this size unchanged.
    #[must_use]
    pub fn fits(&self, (width, height): SentSize) -> bool {
        let squares = |side: u32| u64::from(side.div_ceil(self.patch.max(1)));
        (self.max_side == 0 || width.max(height) <= self.max_side)
            && (self.patch == 0 || squares(width) * squares(height) <= u64::from(self.max_patches))
    }

    /// `side · to / from`, rounded to the nearest multiple, ties to even as in the vendors' code.
    fn rounded(&self, side: u32, to: u32, from: u32) -> u32 {
        let multiple = u64::from(self.multiple.max(1));
        // In units of the multiple: quotient and remainder of side·to / (from·multiple).
        let (number, unit) = (u64::from(side) * u64::from(to), u64::from(from) * multiple);
        let (whole, rest) = (number / unit, number % unit);
        let up = 2 * rest > unit || (2 * rest == unit && whole % 2 == 1);
        let rounded = (whole + u64::from(up)).max(1) * multiple;
        u32::try_from(rounded).unwrap_or(u32::MAX)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const QWEN25: ImageRule = ImageRule { long_side: 1280, multiple: 28, max_side: 0, patch: 0, max_patches: 0, quality: 70 };
    const CLAUDE: ImageRule =
        ImageRule { long_side: 4000, multiple: 1, max_side: 1568, patch: 28, max_patches: 1568, quality: 70 };

    #[test]
    fn worked_sizes() {
        // The rounding of the vendors' own code: 720/28 = 25.7 → 26; 720/32 = 22.5 → 22, the even one.
        assert_eq!(QWEN25.sent((1280, 720), None), (1288, 728));
        assert_eq!(ImageRule { multiple: 32, ..QWEN25 }.sent((1280, 720), None), (1280, 704));
        assert_eq!(ImageRule { multiple: 28, ..ImageRule::default() }.sent((960, 720), None), (756, 588));
        assert_eq!(ImageRule::default().sent((960, 720), None), (768, 576));
        assert_eq!(ImageRule::default().sent((1920, 1080), None), (768, 432));
        assert_eq!(ImageRule::default().sent((1920, 1080), Some(640)), (640, 360));
        // Never enlarged.
        assert_eq!(ImageRule::default().sent((320, 240), Some(1280)), (320, 240));
        // 1280×720: 46·26 = 1196 patches of 28 pixels, within 1568; 1920×1080 would be 69·39 = 2691.
        assert_eq!(CLAUDE.sent((1280, 720), None), (1280, 720));
        let (width, height) = CLAUDE.sent((1920, 1080), None);
        assert!(width.div_ceil(28) * height.div_ceil(28) <= 1568 && width > 1400, "{width}×{height}");
    }

    proptest! {
        #[test]
        fn the_vendor_leaves_it_as_it_is(width in 1_u32..8000, height in 1_u32..8000, long in prop::option::of(16_u32..4000), multiple in 1_u32..40) {
            let rule = ImageRule { multiple, ..CLAUDE };
            let size = rule.sent((width, height), long);
            prop_assert!(size.0 >= 1 && size.1 >= 1);
            prop_assert_eq!((size.0 % multiple, size.1 % multiple), (0, 0));
            // Very narrow images keep at least one multiple per side.
            prop_assert!(rule.fits(size) || size.0.min(size.1) <= multiple);
        }
    }
}

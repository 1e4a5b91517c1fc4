//! At which size an image is sent, so that the model sees exactly what was sent.
//!
//! Vendors resize silently, and coordinates then refer to an image that was never ours. So a size is chosen here that each
//! vendor's own rule leaves as it is: within its limits, and with sides in its multiples.

use serde::Deserialize;

/// What bounds an image's size.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ImageRule {
    /// Longest side that is sent, pixels: larger ones cost time and bring little.
    pub long_side: u32,
    /// Sides are multiples of this.
    pub multiple: u32,
    /// Longest side that the vendor leaves alone, pixels; 0: none.
    pub max_side: u32,
    /// Side of the squares that the vendor counts, pixels; 0: it counts none.
    pub patch: u32,
    /// Most squares that the vendor leaves alone.
    pub max_patches: u32,
}

impl Default for ImageRule {
    fn default() -> Self {
        Self { long_side: 768, multiple: 1, max_side: 0, patch: 0, max_patches: 0 }
    }
}

/// Width and height of an image as sent, pixels.
pub type SentSize = (u32, u32);

impl ImageRule {
    /// The size at which a camera's frame is sent. `long_side` over the rule's, when a person chose one; an image is never
    /// made larger than it was.
    #[must_use]
    pub fn sent(&self, camera: (u32, u32), long_side: Option<u32>) -> SentSize {
        let (width, height) = (camera.0.max(1), camera.1.max(1));
        let mut side = long_side.unwrap_or(self.long_side).clamp(1, width.max(height));
        if self.max_side > 0 {
            side = side.min(self.max_side);
        }
        loop {
            let size = (self.rounded(width, side, width.max(height)), self.rounded(height, side, width.max(height)));
            // Rounding up may pass a limit that the side itself keeps.
            if side <= self.multiple.max(1) || self.fits(size) {
                return size;
            }
            side -= 1;
        }
    }

    /// Whether the vendor leaves an image of this size as it is.
    #[must_use]
    pub fn fits(&self, (width, height): SentSize) -> bool {
        let squares = |side: u32| u64::from(side.div_ceil(self.patch.max(1)));
        (self.max_side == 0 || width.max(height) <= self.max_side)
            && (self.patch == 0 || squares(width) * squares(height) <= u64::from(self.max_patches))
    }

    /// `side · to / from`, to the nearest multiple, halves to the even one as the vendors' own code does.
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

    const QWEN25: ImageRule = ImageRule { long_side: 1280, multiple: 28, max_side: 0, patch: 0, max_patches: 0 };
    const CLAUDE: ImageRule = ImageRule { long_side: 4000, multiple: 1, max_side: 1568, patch: 28, max_patches: 1568 };

    #[test]
    fn worked_sizes() {
        // The multiples of the vendors' own code: 720/28 = 25.7 → 26; 720/32 = 22.5 → 22, the even one.
        assert_eq!(QWEN25.sent((1280, 720), None), (1288, 728));
        assert_eq!(ImageRule { multiple: 32, ..QWEN25 }.sent((1280, 720), None), (1280, 704));
        assert_eq!(ImageRule { multiple: 28, ..ImageRule::default() }.sent((960, 720), None), (756, 588));
        assert_eq!(ImageRule::default().sent((960, 720), None), (768, 576));
        assert_eq!(ImageRule::default().sent((1920, 1080), None), (768, 432));
        assert_eq!(ImageRule::default().sent((1920, 1080), Some(640)), (640, 360));
        // Never larger than it was.
        assert_eq!(ImageRule::default().sent((320, 240), Some(1280)), (320, 240));
        // 1280×720: 46·26 = 1196 squares of 28 pixels, within 1568; 1920×1080 would be 69·39 = 2691.
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
            // Slender images keep at least one multiple a side.
            prop_assert!(rule.fits(size) || size.0.min(size.1) <= multiple);
        }
    }
}

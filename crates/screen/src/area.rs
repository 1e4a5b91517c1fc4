//! Rectangles: in pixels of the screen, and as fractions of a picture.

use serde::{Deserialize, Serialize};

/// A rectangle of the screen, pixels; x to the right and y downwards from the upper left corner of the screen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Area {
    /// Left edge.
    pub x: i32,
    /// Upper edge.
    pub y: i32,
    /// Width.
    pub width: u32,
    /// Height.
    pub height: u32,
}

impl Area {
    /// Number of pixels.
    #[must_use]
    pub fn pixels(&self) -> u64 {
        u64::from(self.width) * u64::from(self.height)
    }

    /// The common part of two rectangles; empty if there is none.
    #[must_use]
    pub fn common(&self, other: &Self) -> Self {
        let end = |start: i32, length: u32| i64::from(start) + i64::from(length);
        let (x, y) = (self.x.max(other.x), self.y.max(other.y));
        let right = end(self.x, self.width).min(end(other.x, other.width));
        let bottom = end(self.y, self.height).min(end(other.y, other.height));
        let length = |from: i32, to: i64| u32::try_from(to - i64::from(from)).unwrap_or(0);
        Self { x, y, width: length(x, right), height: length(y, bottom) }
    }

    /// The part of this rectangle that a region is, in whole pixels.
    #[must_use]
    pub fn part(&self, region: &Region) -> Self {
        let Region([left, top, width, height]) = *region;
        let at = |fraction: f64, length: u32| (fraction * f64::from(length)).round().clamp(0.0, f64::from(length)) as u32;
        let (left, right) = (at(left, self.width), at(left + width, self.width));
        let (top, bottom) = (at(top, self.height), at(top + height, self.height));
        Self {
            x: self.x.saturating_add_unsigned(left),
            y: self.y.saturating_add_unsigned(top),
            width: right - left,
            height: bottom - top,
        }
    }
}

/// Left, top, width and height as fractions of a picture's size.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Region(pub [f64; 4]);

impl Default for Region {
    fn default() -> Self {
        Self::WHOLE
    }
}

impl Region {
    /// All of it.
    pub const WHOLE: Self = Self([0.0, 0.0, 1.0, 1.0]);

    /// Whether it lies within the picture, and has a size.
    #[must_use]
    pub fn is_valid(&self) -> bool {
        let [left, top, width, height] = self.0;
        let within = |start: f64, length: f64| start >= 0.0 && length > 0.0 && start + length <= 1.0 + 1e-9;
        within(left, width) && within(top, height)
    }

    /// Whether a point, in fractions, lies in it or nearer than `margin` to it.
    #[must_use]
    pub fn is_near(&self, x: f64, y: f64, margin: f64) -> bool {
        let [left, top, width, height] = self.0;
        let within = |at: f64, start: f64, length: f64| at >= start - margin && at <= start + length + margin;
        within(x, left, width) && within(y, top, height)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn area(x: i32, y: i32, width: u32, height: u32) -> Area {
        Area { x, y, width, height }
    }

    #[test]
    fn hand_worked_parts() {
        let window = area(100, -20, 960, 720);
        assert_eq!(window.part(&Region::WHOLE), window);
        assert_eq!(window.part(&Region([0.25, 0.5, 0.5, 0.5])), area(340, 340, 480, 360));
        assert_eq!(window.common(&area(0, 0, 200, 100)), area(100, 0, 100, 100));
        assert_eq!(window.common(&area(2000, 0, 9, 9)).pixels(), 0);
    }

    proptest! {
        #[test]
        fn a_part_lies_within_and_the_common_part_in_both(
            x in any::<i32>(), y in any::<i32>(), width in 0_u32..20_000, height in 0_u32..20_000,
            left in 0.0..1.0, top in 0.0..1.0, w in 0.0..1.0, h in 0.0..1.0, x2 in any::<i32>(), y2 in any::<i32>()
        ) {
            let whole = area(x, y, width, height);
            let region = Region([left, top, w * (1.0 - left), h * (1.0 - top)]);
            let part = whole.part(&region);
            prop_assert!(part.width <= width && part.height <= height);
            let other = area(x2, y2, height, width);
            let common = whole.common(&other);
            prop_assert_eq!(common, other.common(&whole));
            prop_assert!(common.pixels() <= whole.pixels().min(other.pixels()));
        }
    }
}

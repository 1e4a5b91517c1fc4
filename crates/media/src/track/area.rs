//! Where something is in an image, in pixels.

/// An upright box in pixels. Its edges lie between pixels: the whole image of 480×360 is 0, 0, 480, 360.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PixelBox {
    /// Left edge.
    pub left: f64,
    /// Upper edge.
    pub top: f64,
    /// Right edge.
    pub right: f64,
    /// Lower edge.
    pub bottom: f64,
}

/// A shift in the image, pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Shift {
    /// To the right.
    pub x: f64,
    /// Downwards.
    pub y: f64,
}

impl PixelBox {
    /// The box with this centre and these sides.
    #[must_use]
    pub fn around((x, y): (f64, f64), width: f64, height: f64) -> Self {
        Self { left: x - width / 2.0, top: y - height / 2.0, right: x + width / 2.0, bottom: y + height / 2.0 }
    }

    /// Width, pixels.
    #[must_use]
    pub fn width(&self) -> f64 {
        self.right - self.left
    }

    /// Height, pixels.
    #[must_use]
    pub fn height(&self) -> f64 {
        self.bottom - self.top
    }

    /// The shorter side, pixels.
    #[must_use]
    pub fn side(&self) -> f64 {
        self.width().min(self.height())
    }

    /// The centre.
    #[must_use]
    pub fn centre(&self) -> (f64, f64) {
        ((self.left + self.right) / 2.0, (self.top + self.bottom) / 2.0)
    }

    /// The box with all coordinates multiplied, as in an image of another size.
    #[must_use]
    pub fn in_image_scaled(&self, x: f64, y: f64) -> Self {
        Self { left: self.left * x, top: self.top * y, right: self.right * x, bottom: self.bottom * y }
    }

    /// The share of the two boxes' union that both have (intersection over union); 0 if they are apart.
    #[must_use]
    pub fn overlap(&self, other: &Self) -> f64 {
        let width = self.right.min(other.right) - self.left.max(other.left);
        let height = self.bottom.min(other.bottom) - self.top.max(other.top);
        let both = width.max(0.0) * height.max(0.0);
        let either = self.width() * self.height() + other.width() * other.height() - both;
        if either > 0.0 { both / either } else { 0.0 }
    }

    /// Scaled about the centre; the same bits if it is not.
    pub fn scaled(&self, scale: f64) -> Self {
        if scale == 1.0 {
            return *self;
        }
        Self::around(self.centre(), self.width() * scale, self.height() * scale)
    }

    /// Moved, and scaled about the centre.
    pub fn moved(&self, shift: Shift, scale: f64) -> Self {
        let (x, y) = self.centre();
        Self::around((x + shift.x, y + shift.y), self.width() * scale, self.height() * scale)
    }

    /// Halfway between this box and another.
    pub fn between(&self, other: &Self) -> Self {
        Self {
            left: (self.left + other.left) / 2.0,
            top: (self.top + other.top) / 2.0,
            right: (self.right + other.right) / 2.0,
            bottom: (self.bottom + other.bottom) / 2.0,
        }
    }

    /// The share of the box inside an image of this size.
    pub fn inside(&self, (width, height): (u32, u32)) -> f64 {
        let across = self.right.min(f64::from(width)) - self.left.max(0.0);
        let down = self.bottom.min(f64::from(height)) - self.top.max(0.0);
        across.max(0.0) * down.max(0.0) / (self.width() * self.height()).max(1e-9)
    }

    /// Whether the coordinates are numbers, in order, and not absurd.
    pub fn is_sound(&self) -> bool {
        let edges = [self.left, self.top, self.right, self.bottom];
        edges.iter().all(|edge| edge.is_finite() && edge.abs() < 1e5) && self.width() > 0.0 && self.height() > 0.0
    }
}

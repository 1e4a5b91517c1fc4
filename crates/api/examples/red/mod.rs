//! Finds the red part of an image.

use spf_media::Rgb;

/// Something red.
pub(crate) struct Spot {
    /// Its centre, as fractions of the image's width and height.
    pub(crate) u: f64,
    pub(crate) v: f64,
    /// Distance at which a ball one metre across appears this large, metres.
    pub(crate) range: f64,
}

/// The red part; `None` if nothing is red.
pub(crate) fn find(image: &Rgb) -> Option<Spot> {
    let (width, height) = (f64::from(image.width()), f64::from(image.height()));
    let (mut red, mut u, mut v) = (0.0, 0.0, 0.0);
    for (at, pixel) in image.data().chunks_exact(3).enumerate() {
        if pixel[0] > 180 && pixel[1] < 80 {
            red += 1.0;
            u += (at as f64 % width) / width;
            v += (at as f64 / width).floor() / height;
        }
    }
    // Radius 0.5 m, and an image about as wide as the ball's distance: the focal length is some 0.9 widths.
    let range = 0.5 * 0.9 * width / (red / core::f64::consts::PI).sqrt();
    (red >= 4.0).then(|| Spot { u: u / red, v: v / red, range })
}

impl Spot {
    /// The depth label: labels are logarithmic in range, 1 at 1 m, 10 at 100 m.
    pub(crate) fn depth(&self) -> f64 {
        (1.0 + 4.5 * self.range.max(1.0).log10()).round()
    }

    /// Progress of the craft.
    pub(crate) fn status(&self) -> &'static str {
        if self.range < 2.0 { "done" } else { "navigating" }
    }
}

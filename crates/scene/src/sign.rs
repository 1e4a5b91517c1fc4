//! Words and arrows in a scene, as somebody who stands before them reads them.

use spf_core::geometry::EnuPosition;
pub use spf_core::sign::Arrow;

/// What is written on an object that stands still.
#[derive(Clone, Debug, PartialEq)]
pub struct Sign {
    /// The text, lines separated by `\n`; empty for an arrow alone.
    pub text: String,
    /// An arrow.
    pub arrow: Option<Arrow>,
    /// The middle of the writing.
    pub centre: EnuPosition,
    /// Where its front faces, radians clockwise from north.
    pub heading: f64,
    /// Height of a capital letter, or of the arrow where there is no text, metres.
    pub letter: f64,
    /// Area of the board, or of the strokes where there is none, square metres.
    pub area: f64,
    /// Whether the back shows the same.
    pub double: bool,
}

impl Sign {
    /// How much it faces an eye: the cosine of the angle between its front and the direction to the eye, 0 when seen along its
    /// board or from behind, 1 when seen from straight ahead.
    #[must_use]
    pub fn facing(&self, eye: EnuPosition) -> f64 {
        let away = eye.distance(self.centre);
        let (sin, cos) = libm::sincos(self.heading);
        let front = (eye.east - self.centre.east) * sin + (eye.north - self.centre.north) * cos;
        let cosine = if away > 0.0 { front / away } else { 0.0 };
        if self.double { cosine.abs() } else { cosine.max(0.0) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sign_faces_who_stands_before_it() {
        let at = |east, north| EnuPosition { east, north, up: 1.0 };
        let sign = Sign {
            text: "EXIT".to_owned(),
            arrow: None,
            centre: at(1.0, 2.0),
            heading: core::f64::consts::FRAC_PI_2,
            letter: 0.1,
            area: 1.0,
            double: false,
        };
        assert!((sign.facing(at(5.0, 2.0)) - 1.0).abs() < 1e-12);
        assert!((sign.facing(at(2.0, 3.0)) - 0.5_f64.sqrt()).abs() < 1e-12);
        assert_eq!((sign.facing(at(-3.0, 2.0)), sign.facing(sign.centre)), (0.0, 0.0));
        assert!((Sign { double: true, ..sign }.facing(at(-3.0, 2.0)) - 1.0).abs() < 1e-12);
    }
}

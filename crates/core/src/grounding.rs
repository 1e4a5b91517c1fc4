//! Grounding profiles: the coordinate conventions in which model families give image points.
//!
//! A model family points well only in the convention it was trained on (Gemini: `[y, x]` in thousandths; Qwen 3: `[x,
//! y]` in thousandths; Claude and Qwen 2.5: pixels of the image they receive). Each is queried in its own convention,
//! and the result is converted here once: the rest of the core uses [`ImagePoint`] and [`ImageBox`] only.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::query::{ImageBox, ImagePoint};

/// Fraction of the image size by which a coordinate may lie outside and still be moved to the edge.
pub const EDGE_TOLERANCE: f64 = 0.01;
/// How far a box may overrun the image, as a fraction of the image size: its corners are not what is flown to.
pub const BOX_TOLERANCE: f64 = 0.05;

/// Order of the coordinates in a model's output.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum AxisOrder {
    /// `[y, x]` and `[ymin, xmin, ymax, xmax]`.
    #[default]
    Yx,
    /// `[x, y]` and `[xmin, ymin, xmax, ymax]`.
    Xy,
}

/// Unit of the coordinates.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Scale {
    /// Thousandths of the image size, 0..=1000.
    #[default]
    Thousand,
    /// Percent of the image size, 0..=100.
    Hundred,
    /// Fractions of the image size, 0..=1.
    Unit,
    /// Pixels of the image *as sent to the model*, which may differ from the captured size.
    Pixels {
        /// Its width, > 0.
        width: u32,
        /// Its height, > 0.
        height: u32,
    },
}

/// The form in which a model family points, whatever form it is asked for. Such a point may come without its depth.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Habit {
    /// None: it answers as it is asked.
    #[default]
    Asked,
    /// A list of `{"point": …, "label": …}`.
    List,
    /// Tags: `<point x="…" y="…" alt="…">…</point>`.
    Tags,
}

impl Habit {
    fn is_asked(&self) -> bool {
        *self == Self::Asked
    }
}

/// The coordinate convention of a model family. The origin is always the upper left corner of the image.
///
/// The default, `[y, x]` in thousandths, is Gemini's and the one the oracle uses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct GroundingProfile {
    /// Order of the coordinates.
    pub order: AxisOrder,
    /// Unit of the coordinates.
    pub scale: Scale,
    /// Its own form of points.
    #[serde(default, skip_serializing_if = "Habit::is_asked")]
    pub habit: Habit,
}

/// Why coordinates are not a point in the image.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum GroundingError {
    /// More than [`EDGE_TOLERANCE`] outside, or not a finite number.
    #[error("`[{first}, {second}]` is outside the image, whose coordinates are {limits}")]
    Outside {
        /// The first number as the model wrote it.
        first: f64,
        /// The second number as the model wrote it.
        second: f64,
        /// The expected range.
        limits: Limits,
    },
    /// Fractions below one where whole thousandths, percent or pixels were expected: read as requested they would all
    /// mean the upper left corner, and the craft would turn there.
    #[error("`[{first}, {second}]` are normalized coordinates, but the prompt asks for {limits}")]
    WrongScale {
        /// The first number as the model wrote it.
        first: f64,
        /// The second number as the model wrote it.
        second: f64,
        /// The expected range.
        limits: Limits,
    },
}

/// The range of each coordinate, for messages and prompts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Maximum horizontal coordinate.
    pub x: f64,
    /// Maximum vertical coordinate.
    pub y: f64,
}

impl core::fmt::Display for Limits {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "x 0 to {}, y 0 to {}", self.x, self.y)
    }
}

impl GroundingProfile {
    /// The maximum of each coordinate, at the right and lower edges.
    #[must_use]
    pub fn limits(&self) -> Limits {
        match self.scale {
            Scale::Thousand => Limits { x: 1000.0, y: 1000.0 },
            Scale::Hundred => Limits { x: 100.0, y: 100.0 },
            Scale::Unit => Limits { x: 1.0, y: 1.0 },
            Scale::Pixels { width, height } => Limits { x: f64::from(width.max(1)), y: f64::from(height.max(1)) },
        }
    }

    /// Converts a pair of numbers, in the order the model wrote them, to an image point.
    ///
    /// ```
    /// use spf_core::grounding::{AxisOrder, GroundingProfile, Scale};
    ///
    /// let profile = GroundingProfile { order: AxisOrder::Xy, scale: Scale::Hundred, ..GroundingProfile::default() };
    /// let point = profile.point([75.0, 40.0])?;
    /// assert!((point.u - 0.75).abs() < 1e-9 && (point.v - 0.4).abs() < 1e-9);
    /// # Ok::<(), spf_core::grounding::GroundingError>(())
    /// ```
    ///
    /// # Errors
    /// [`GroundingError::Outside`] more than 1 % outside the image, or not finite (closer points are moved to the
    /// edge); [`GroundingError::WrongScale`] for fractions below one where a coarser unit was requested.
    pub fn point(&self, numbers: [f64; 2]) -> Result<ImagePoint, GroundingError> {
        self.point_within(numbers, EDGE_TOLERANCE)
    }

    fn point_within(&self, [first, second]: [f64; 2], tolerance: f64) -> Result<ImagePoint, GroundingError> {
        let limits = self.limits();
        let (x, y) = match self.order {
            AxisOrder::Xy => (first, second),
            AxisOrder::Yx => (second, first),
        };
        let (u, v) = (x / limits.x, y / limits.y);
        let inside = -tolerance..=1.0 + tolerance;
        if !inside.contains(&u) || !inside.contains(&v) {
            return Err(GroundingError::Outside { first, second, limits });
        }
        let fraction = |c: f64| (0.0..=1.0).contains(&c);
        if self.scale != Scale::Unit && fraction(x) && fraction(y) && (x.fract() != 0.0 || y.fract() != 0.0) {
            return Err(GroundingError::WrongScale { first, second, limits });
        }
        Ok(ImagePoint { u: u.clamp(0.0, 1.0), v: v.clamp(0.0, 1.0) })
    }

    /// Converts four numbers, in the order the model wrote them, to a rectangle. Edges in the wrong order are swapped,
    /// since they span the same rectangle. One that overruns the image by at most [`BOX_TOLERANCE`] is cut off at its edge.
    ///
    /// # Errors
    /// Those of [`point`](Self::point), for either corner, and [`GroundingError::Outside`] if nothing of it is inside.
    pub fn area(&self, [a, b, c, d]: [f64; 4]) -> Result<ImageBox, GroundingError> {
        // The scale is checked on the far corner: a box may well start in the upper left corner of the image.
        let far = self.point_within([a.max(c), b.max(d)], BOX_TOLERANCE)?;
        let near = [a.min(c), b.min(d)];
        let near = match self.point_within(near, BOX_TOLERANCE) {
            Err(GroundingError::WrongScale { .. }) => self.corner(near),
            other => other?,
        };
        let is_flat = a == c || b == d;
        if !is_flat && (far.u <= near.u || far.v <= near.v) {
            return Err(GroundingError::Outside { first: a, second: b, limits: self.limits() });
        }
        Ok(ImageBox { left: near.u, top: near.v, right: far.u, bottom: far.v })
    }

    /// A point already known to be inside, without the scale check.
    fn corner(&self, [first, second]: [f64; 2]) -> ImagePoint {
        let limits = self.limits();
        let (x, y) = match self.order {
            AxisOrder::Xy => (first, second),
            AxisOrder::Yx => (second, first),
        };
        ImagePoint { u: (x / limits.x).clamp(0.0, 1.0), v: (y / limits.y).clamp(0.0, 1.0) }
    }

    /// The numbers a model of this family writes for `point`, rounded as such models do: whole thousandths and pixels,
    /// tenths of a percent, ten-thousandths of a fraction.
    #[must_use]
    pub fn point_numbers(&self, point: ImagePoint) -> [f64; 2] {
        self.exact_point(point).map(|number| self.rounded(number))
    }

    /// The numbers for `point`, unrounded.
    #[must_use]
    pub fn exact_point(&self, point: ImagePoint) -> [f64; 2] {
        let limits = self.limits();
        let (x, y) = (point.u * limits.x, point.v * limits.y);
        match self.order {
            AxisOrder::Xy => [x, y],
            AxisOrder::Yx => [y, x],
        }
    }

    /// The numbers for `area`, unrounded.
    #[must_use]
    pub fn exact_area(&self, area: ImageBox) -> [f64; 4] {
        let [a, b] = self.exact_point(ImagePoint { u: area.left, v: area.top });
        let [c, d] = self.exact_point(ImagePoint { u: area.right, v: area.bottom });
        [a, b, c, d]
    }

    /// The numbers a model of this family writes for `area`, rounded like [`point_numbers`](Self::point_numbers).
    #[must_use]
    pub fn area_numbers(&self, area: ImageBox) -> [f64; 4] {
        self.exact_area(area).map(|number| self.rounded(number))
    }

    fn rounded(&self, value: f64) -> f64 {
        match self.scale {
            Scale::Thousand | Scale::Pixels { .. } => libm::round(value),
            Scale::Hundred => libm::round(value * 10.0) / 10.0,
            Scale::Unit => libm::round(value * 1e4) / 1e4,
        }
    }

    /// The convention in words, for a prompt.
    #[must_use]
    pub fn describe(&self) -> String {
        let unit = match self.scale {
            Scale::Thousand => "in thousandths of the image".to_owned(),
            Scale::Hundred => "in percent of the image".to_owned(),
            Scale::Unit => "as decimal fractions of the image".to_owned(),
            Scale::Pixels { width, height } => format!("in pixels of this image, {width} wide and {height} high,"),
        };
        let (point, area) = match self.order {
            AxisOrder::Yx => ("[y, x]", "[ymin, xmin, ymax, xmax]"),
            AxisOrder::Xy => ("[x, y]", "[xmin, ymin, xmax, ymax]"),
        };
        format!("Points are {point}, boxes {area}, {unit} from its top left corner.")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_convention_reads_the_same_place() {
        // A quarter from the left and three quarters down, in every convention.
        let pixels = Scale::Pixels { width: 960, height: 720 };
        for (order, scale, numbers) in [
            (AxisOrder::Yx, Scale::Thousand, [750.0, 250.0]),
            (AxisOrder::Xy, Scale::Thousand, [250.0, 750.0]),
            (AxisOrder::Xy, Scale::Hundred, [25.0, 75.0]),
            (AxisOrder::Xy, Scale::Unit, [0.25, 0.75]),
            (AxisOrder::Xy, pixels, [240.0, 540.0]),
            (AxisOrder::Yx, pixels, [540.0, 240.0]),
        ] {
            let profile = GroundingProfile { order, scale, ..GroundingProfile::default() };
            assert_eq!(profile.point(numbers).unwrap(), ImagePoint { u: 0.25, v: 0.75 }, "{profile:?}");
            assert_eq!(profile.point_numbers(ImagePoint { u: 0.25, v: 0.75 }), numbers, "{profile:?}");
        }
    }

    #[test]
    fn one_percent_outside_is_the_edge_and_more_is_refused() {
        let profile = GroundingProfile::default();
        assert_eq!(profile.point([1010.0, -10.0]).unwrap(), ImagePoint { u: 0.0, v: 1.0 });
        assert!(matches!(profile.point([1011.0, 500.0]), Err(GroundingError::Outside { .. })));
        assert!(matches!(profile.point([f64::NAN, 500.0]), Err(GroundingError::Outside { .. })));
        assert!(matches!(profile.point([500.0, f64::INFINITY]), Err(GroundingError::Outside { .. })));
    }

    #[test]
    fn shares_under_a_coarse_scale_are_not_the_corner() {
        let profile = GroundingProfile::default();
        assert!(matches!(profile.point([0.42, 0.55]), Err(GroundingError::WrongScale { .. })));
        assert!(matches!(profile.area([0.1, 0.1, 0.4, 0.5]), Err(GroundingError::WrongScale { .. })));
        // Whole numbers there are a corner, and a box may begin in one.
        assert_eq!(profile.point([1.0, 0.0]).unwrap(), ImagePoint { u: 0.0, v: 0.001 });
        assert!(profile.area([0.5, 0.0, 400.0, 300.0]).is_ok());
    }

    #[test]
    fn a_box_with_swapped_edges_is_the_same_box() {
        let profile = GroundingProfile::default();
        let area = profile.area([100.0, 200.0, 300.0, 400.0]).unwrap();
        assert_eq!(area, ImageBox { left: 0.2, top: 0.1, right: 0.4, bottom: 0.3 });
        assert_eq!(profile.area([300.0, 400.0, 100.0, 200.0]).unwrap(), area);
        assert_eq!(profile.area_numbers(area), [100.0, 200.0, 300.0, 400.0]);
    }
}

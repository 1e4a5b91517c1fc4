//! Models of lenses, as OpenCV has them.

use core::fmt;

use super::CalibrationError;

/// How a lens distorts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Lens {
    /// Brown and Conrady's polynomial with the rational extension (OpenCV's `calib3d`; ROS' `plumb_bob` and
    /// `rational_polynomial`).
    Brown {
        /// Radial coefficients of the numerator.
        k: [f64; 3],
        /// Radial coefficients of the denominator.
        denominator: [f64; 3],
        /// Tangential coefficients.
        p: [f64; 2],
    },
    /// Kannala and Brandt's polynomial of the angle from the axis (OpenCV's `fisheye`; ROS' `equidistant`).
    Fisheye {
        /// Coefficients.
        k: [f64; 4],
    },
}

/// What a name of a model means.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Family {
    None,
    Brown,
    Fisheye,
}

impl fmt::Display for Lens {
    /// The model by its names, and the coefficients; of those that most lenses lack, the ones that are not zero.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.is_none() {
            return f.write_str("no distortion");
        }
        match self {
            Self::Brown { k: [k1, k2, k3], denominator, p: [p1, p2] } => {
                write!(f, "Brown (plumb_bob, radtan): k1 {k1}, k2 {k2}, p1 {p1}, p2 {p2}, k3 {k3}")?;
                let more = [("k4", denominator[0]), ("k5", denominator[1]), ("k6", denominator[2])];
                more.iter().filter(|(_, value)| *value != 0.0).try_for_each(|(name, value)| write!(f, ", {name} {value}"))
            }
            Self::Fisheye { k: [k1, k2, k3, k4] } => {
                write!(f, "fisheye (equidistant): k1 {k1}, k2 {k2}, k3 {k3}, k4 {k4}")
            }
        }
    }
}

impl Lens {
    /// From OpenCV's order of coefficients: k1, k2, p1, p2, k3, k4, k5, k6.
    #[must_use]
    pub const fn brown([k1, k2, p1, p2, k3, k4, k5, k6]: [f64; 8]) -> Self {
        Self::Brown { k: [k1, k2, k3], denominator: [k4, k5, k6], p: [p1, p2] }
    }

    /// From OpenCV's order of coefficients.
    #[must_use]
    pub const fn fisheye(k: [f64; 4]) -> Self {
        Self::Fisheye { k }
    }

    /// From the names of models that a file gives by their keys, OpenCV's flag for a fisheye, and the coefficients with
    /// their key.
    pub(super) fn of(
        models: &[(&'static str, &str)],
        fisheye: Option<f64>,
        (key, coefficients): (&'static str, &[f64]),
    ) -> Result<Self, CalibrationError> {
        let mut family: Option<(&'static str, Family)> = fisheye.map(|flag| {
            let is_fisheye = flag != 0.0;
            ("fisheye_model", if is_fisheye { Family::Fisheye } else { Family::Brown })
        });
        for &(key, name) in models {
            let named = match name.trim().to_ascii_lowercase().as_str() {
                // The model of the projection, which leaves that of the distortion open.
                "pinhole" | "perspective" if key == "camera_model" => continue,
                "plumb_bob" | "rational_polynomial" | "radtan" | "radial-tangential" | "pinhole-radtan" => Family::Brown,
                "equidistant" | "fisheye" | "kannala_brandt" | "equi" | "pinhole-equi" => Family::Fisheye,
                "none" | "" => Family::None,
                _ => {
                    let shown = name.chars().filter(char::is_ascii_graphic).take(40).collect();
                    return Err(CalibrationError::Model(shown));
                }
            };
            match family {
                Some((other, known)) if known != named => return Err(CalibrationError::Contradiction(other, key)),
                _ => family = Some((key, named)),
            }
        }
        match family.map_or(Family::Brown, |(_, family)| family) {
            Family::None if coefficients.iter().any(|k| *k != 0.0) => {
                Err(CalibrationError::Invalid(key, "there are some, and the file says that there is no distortion"))
            }
            Family::None => Ok(Self::brown([0.0; 8])),
            Family::Fisheye => {
                let k = coefficients.try_into().map_err(|_| CalibrationError::Invalid(key, "a fisheye has four"))?;
                Ok(Self::fisheye(k))
            }
            // The last six of OpenCV's fourteen are for prisms and tilted sensors.
            Family::Brown if !matches!(coefficients.len(), 0 | 4 | 5 | 8 | 12 | 14) => {
                Err(CalibrationError::Invalid(key, "there are 4, 5 or 8"))
            }
            Family::Brown if coefficients.iter().skip(8).any(|k| *k != 0.0) => {
                Err(CalibrationError::Invalid(key, "those of thin prisms and tilted sensors cannot be used"))
            }
            Family::Brown => {
                let mut all = [0.0; 8];
                all.iter_mut().zip(coefficients).for_each(|(to, from)| *to = *from);
                Ok(Self::brown(all))
            }
        }
    }

    /// Whether it does not distort at all.
    #[must_use]
    pub fn is_none(&self) -> bool {
        *self == Self::brown([0.0; 8])
    }

    /// Where the lens shows a direction: both in units of the focal length, `x` to the right and `y` down. `None` where the
    /// polynomial folds back.
    #[must_use]
    pub fn distort(&self, x: f64, y: f64) -> Option<(f64, f64)> {
        let r2 = x * x + y * y;
        match self {
            Self::Brown { k: [k1, k2, k3], denominator: [k4, k5, k6], p: [p1, p2] } => {
                let numerator = |r2: f64| 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
                let denominator = |r2: f64| 1.0 + r2 * (k4 + r2 * (k5 + r2 * k6));
                let radial = numerator(r2) / denominator(r2);
                // The radius in the image grows with the angle, up to where the polynomial is of no use any more.
                let inner = 0.98 * 0.98 * r2;
                if !(radial > 0.0 && radial >= 0.98 * numerator(inner) / denominator(inner)) {
                    return None;
                }
                Some((
                    x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
                    y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
                ))
            }
            Self::Fisheye { k: [k1, k2, k3, k4] } => {
                let radius = r2.sqrt();
                if radius < 1e-9 {
                    return Some((x, y));
                }
                let distorted = |angle: f64| {
                    let a2 = angle * angle;
                    angle * (1.0 + a2 * (k1 + a2 * (k2 + a2 * (k3 + a2 * k4))))
                };
                let angle = radius.atan();
                let scale = distorted(angle) / radius;
                (scale > 0.0 && distorted(angle) >= distorted(0.98 * angle)).then_some((x * scale, y * scale))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lens_without_distortion_changes_nothing() {
        assert_eq!(Lens::brown([0.0; 8]).distort(0.3, -0.2), Some((0.3, -0.2)));
        // An equidistant lens shows an angle by a length: 45° at π/4.
        let (x, y) = Lens::fisheye([0.0; 4]).distort(1.0, 0.0).unwrap();
        assert!((x - std::f64::consts::FRAC_PI_4).abs() < 1e-12 && y == 0.0);
    }

    /// By hand from OpenCV's formulas: r² = 0.25, radial = 1 − 0.28·0.25 + 0.025·0.0625, tangential with p1 = 0.001.
    #[test]
    fn brown_by_hand() {
        let (x, y) = Lens::brown([-0.28, 0.025, 0.001, 0.0, 0.0, 0.0, 0.0, 0.0]).distort(0.3, 0.4).unwrap();
        let radial = 1.0 - 0.28 * 0.25 + 0.025 * 0.0625;
        assert!((x - (0.3 * radial + 2.0 * 0.001 * 0.12)).abs() < 1e-12, "{x}");
        assert!((y - (0.4 * radial + 0.001 * (0.25 + 2.0 * 0.16))).abs() < 1e-12, "{y}");
    }

    #[test]
    fn where_the_polynomial_folds_back_nothing_is_shown() {
        let lens = Lens::brown([-0.3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        // The slope 1 − 0.9 r² is zero at r = 1.05.
        assert!(lens.distort(0.9, 0.0).is_some() && lens.distort(1.2, 0.0).is_none());
        assert!(Lens::fisheye([-0.5, 0.0, 0.0, 0.0]).distort(5.0, 0.0).is_none());
    }
}

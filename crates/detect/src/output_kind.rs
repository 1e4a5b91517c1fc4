//! What the output of a depth network means, as its user states it: its shape does not tell.

use core::fmt;
use core::str::FromStr;

use crate::mono_depth::DepthKind;

/// The kinds, for error messages.
pub const KINDS: &str = "disparity, relative, metric, canonical or canonical=FOCAL";
/// The focal length that metric models of Depth Anything V3 assume, pixels.
const CANONICAL: f64 = 300.0;

/// What the output of a depth network means.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum OutputKind {
    /// Inverse depth, up to a scale and a shift: near = large.
    Disparity,
    /// Depth, up to a scale and perhaps a shift: far = large.
    Relative,
    /// Metres.
    Metric,
    /// Metres as of a camera with this focal length, in pixels of the network's input: the depth is as many times as large as the
    /// camera's focal length is.
    Canonical(f64),
}

impl OutputKind {
    /// What is left to be known of its scale.
    #[must_use]
    pub fn depth_kind(self) -> DepthKind {
        match self {
            Self::Disparity => DepthKind::Disparity,
            Self::Relative => DepthKind::Relative,
            Self::Metric | Self::Canonical(_) => DepthKind::Metric,
        }
    }
}

/// A text that names no kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("expected {KINDS}")]
pub struct WrongKind;

impl FromStr for OutputKind {
    type Err = WrongKind;

    fn from_str(text: &str) -> Result<Self, WrongKind> {
        Ok(match text {
            "disparity" => Self::Disparity,
            "relative" => Self::Relative,
            "metric" => Self::Metric,
            "canonical" => Self::Canonical(CANONICAL),
            _ => {
                let focal = text.strip_prefix("canonical=").and_then(|focal| focal.parse().ok());
                Self::Canonical(focal.filter(|focal| (1.0..=100_000.0).contains(focal)).ok_or(WrongKind)?)
            }
        })
    }
}

impl fmt::Display for OutputKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Disparity => f.write_str("disparity"),
            Self::Relative => f.write_str("relative"),
            Self::Metric => f.write_str("metric"),
            Self::Canonical(focal) => write!(f, "canonical={focal}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_kind_is_written_as_it_is_read() {
        for text in ["disparity", "relative", "metric", "canonical=1000", "canonical=300"] {
            assert_eq!(text.parse::<OutputKind>().unwrap().to_string(), text);
        }
        assert_eq!("canonical".parse(), Ok(OutputKind::Canonical(300.0)));
        for wrong in ["", "depth", "canonical=", "canonical=0", "canonical=NaN", "canonical=-3", "Metric"] {
            assert_eq!(wrong.parse::<OutputKind>(), Err(WrongKind), "{wrong}");
        }
    }
}

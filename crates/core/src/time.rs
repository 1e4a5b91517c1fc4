//! Flight time: an integer count of nanoseconds since the flight began.
//!
//! The project distinguishes three times: flight time (this type), a frame's capture time (also this type, in
//! [`FrameMeta::captured`](crate::frame::FrameMeta::captured)) and the wall clock of a log, which this crate never
//! uses.

use core::fmt;
use core::ops::{Add, AddAssign, Sub};
pub use core::time::Duration;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// An instant of flight time: nanoseconds since the flight began. Serialises as that integer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct Time(u64);

impl Time {
    /// The instant at which the flight began.
    pub const ZERO: Self = Self(0);
    /// Later than every instant a flight reaches: 584 years.
    pub const MAX: Self = Self(u64::MAX);

    /// The instant `nanos` nanoseconds after the flight began.
    #[must_use]
    pub const fn from_nanos(nanos: u64) -> Self {
        Self(nanos)
    }

    /// The instant `millis` milliseconds after the flight began.
    #[must_use]
    pub const fn from_millis(millis: u64) -> Self {
        Self(millis * 1_000_000)
    }

    /// The instant `secs` seconds after the flight began, rounded to the nanosecond; negative and NaN give [`Time::ZERO`].
    #[must_use]
    pub fn from_secs_f64(secs: f64) -> Self {
        // `as` saturates and maps NaN to zero, which is the documented behaviour.
        Self(libm::round(secs * 1e9) as u64)
    }

    /// Nanoseconds since the flight began.
    #[must_use]
    pub const fn as_nanos(self) -> u64 {
        self.0
    }

    /// Seconds since the flight began.
    #[must_use]
    pub fn as_secs_f64(self) -> f64 {
        self.0 as f64 * 1e-9
    }

    /// The time from `earlier` to `self`; zero when `earlier` is later.
    #[must_use]
    pub const fn since(self, earlier: Self) -> Duration {
        Duration::from_nanos(self.0.saturating_sub(earlier.0))
    }
}

impl Add<Duration> for Time {
    type Output = Self;
    fn add(self, rhs: Duration) -> Self {
        Self(self.0.saturating_add(u64::try_from(rhs.as_nanos()).unwrap_or(u64::MAX)))
    }
}

impl AddAssign<Duration> for Time {
    fn add_assign(&mut self, rhs: Duration) {
        *self = *self + rhs;
    }
}

impl Sub<Duration> for Time {
    type Output = Self;
    /// Saturates at [`Time::ZERO`].
    fn sub(self, rhs: Duration) -> Self {
        Self(self.0.saturating_sub(u64::try_from(rhs.as_nanos()).unwrap_or(u64::MAX)))
    }
}

impl fmt::Display for Time {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.2} s", self.as_secs_f64())
    }
}

/// A duration of `secs` seconds; negative and NaN give zero, out-of-range values the longest duration, instead of a
/// panic.
#[must_use]
pub fn duration_from_secs(secs: f64) -> Duration {
    Duration::from_nanos(libm::round(secs.max(0.0) * 1e9) as u64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arithmetic_saturates() {
        assert_eq!(Time::from_millis(5) - Duration::from_secs(1), Time::ZERO);
        assert_eq!(Time::MAX + Duration::from_secs(1), Time::MAX);
        assert_eq!(Time::from_millis(1500).since(Time::from_millis(500)), Duration::from_secs(1));
        assert_eq!(Time::from_secs_f64(f64::NAN), Time::ZERO);
        assert_eq!(duration_from_secs(-1.0), Duration::ZERO);
    }
}

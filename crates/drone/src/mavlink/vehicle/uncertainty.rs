//! How uncertain the vehicle's horizontal position is, by whatever it tells of that.

use spf_core::time::{Duration, Time};
use spf_mavlink::report::{Gps, Report};

/// A source is followed for this long after its last report, and then the next one: over a slow link reports come every 5 s.
const FOLLOWED: Duration = Duration::from_secs(15);
/// What stands for no position, metres: numbers in logs are finite.
const NONE: f64 = 1e6;
/// `GPS_FIX_TYPE`: below this there is no position.
const FIX: u8 = 2;

/// Standard deviations, metres, and when they were told: of the estimator's status, of a covariance, of satellite navigation.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Uncertainty([Option<(Time, f64)>; 3]);

impl Uncertainty {
    pub(super) fn observe(&mut self, now: Time, report: &Report) {
        let (source, sd) = match *report {
            Report::PositionError(sd) => (0, sd),
            Report::PositionCovariance(sd) => (1, sd),
            Report::Gps(Gps { fix, accuracy, .. }) => match accuracy {
                Some(accuracy) => (2, accuracy),
                None if fix < FIX => (2, NONE),
                None => return,
            },
            _ => return,
        };
        if !sd.is_nan() {
            self.0[source] = Some((now, sd.min(NONE)));
        }
    }

    /// Standard deviation of the horizontal position, metres; `None` if nothing has told it.
    pub(super) fn deviation(&self, now: Time) -> Option<f64> {
        let told = || self.0.iter().flatten();
        let followed = told().find(|(at, _)| now.since(*at) < FOLLOWED);
        followed.or_else(|| told().max_by_key(|(at, _)| *at)).map(|(_, sd)| *sd)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_best_source_counts_as_long_as_it_speaks_and_no_fix_is_no_position() {
        let at = Time::from_millis;
        let gps = |fix, accuracy| Report::Gps(Gps { fix, accuracy, ..Gps::default() });
        let mut known = Uncertainty::default();
        assert_eq!(known.deviation(at(0)), None);
        known.observe(at(0), &gps(0, None));
        assert_eq!(known.deviation(at(0)), Some(NONE));
        known.observe(at(100), &gps(3, Some(40.0)));
        known.observe(at(200), &Report::PositionCovariance(2.0));
        assert_eq!(known.deviation(at(200)), Some(2.0));
        known.observe(at(300), &Report::PositionError(0.4));
        assert_eq!(known.deviation(at(300)), Some(0.4));
        known.observe(at(400), &Report::PositionError(f64::INFINITY));
        known.observe(at(500), &Report::PositionError(f64::NAN));
        assert_eq!(known.deviation(at(500)), Some(NONE));
        // Silent for longer than a report over a slow link takes.
        known.observe(at(20_000), &Report::PositionCovariance(3.0));
        assert_eq!(known.deviation(at(20_000)), Some(3.0));
        assert_eq!(known.deviation(at(90_000)), Some(3.0), "the last that was told");
    }
}

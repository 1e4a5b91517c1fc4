//! Whether the reported height follows the commands. A height that stays the same while the craft is told to climb defeats
//! the ceiling, and while it is told to sink the floor.

use spf_core::craft::Craft;

/// Commanded climb or descent, summed over time, after which the height must have changed, m.
const COMPARED_AFTER: f64 = 1.5;
/// Change of the reported height that shows that it is alive, m: a quarter of the former, so that a craft that is much slower
/// than its figures is believed, and more than the 0.1 m steps of a Tello's height.
const CHANGE: f64 = 0.375;
/// Of a longer gap between two reports only this much counts, s.
const GAP: f64 = 0.5;

/// Compares the commanded vertical motion with the reported height.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct HeightCheck {
    /// Vertical speed that the craft should have by the commands to it, m/s.
    speed: f64,
    /// Reported height when it last changed, m.
    from: Option<f64>,
    /// Commanded climb since then, m; negative for a descent.
    commanded: f64,
    failed: bool,
}

impl HeightCheck {
    /// Takes a report of a craft that flies by setpoints: `elapsed` seconds after the one before, during which it was told to
    /// climb with `up` m/s.
    pub(super) fn observe(&mut self, craft: &Craft, elapsed: f64, up: f64, height: f64) {
        let elapsed = elapsed.clamp(0.0, GAP);
        let lag = (craft.dead_time + craft.lag).max(0.01);
        self.speed += (up - self.speed) * (1.0 - libm::exp(-elapsed / lag));
        self.commanded += self.speed * elapsed;
        if (height - *self.from.get_or_insert(height)).abs() >= CHANGE {
            (self.from, self.commanded) = (Some(height), 0.0);
        }
        self.failed |= self.commanded.abs() >= COMPARED_AFTER;
    }

    /// Takes a report in any other phase: the craft climbs or sinks by itself.
    pub(super) fn pause(&mut self) {
        *self = Self { failed: self.failed, ..Self::default() };
    }

    /// Starts over, for a new flight.
    pub(super) fn reset(&mut self) {
        *self = Self::default();
    }

    /// Whether the height has not followed the commands once: it cannot show that it is reliable again, since no climb is
    /// allowed from then on.
    pub(super) fn has_failed(&self) -> bool {
        self.failed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Feeds reports every 0.1 s for `seconds`, with the height as `shown` of the commanded climb. Returns when the check
    /// fails, s.
    fn fails_at(craft: &Craft, up: impl Fn(f64) -> f64, seconds: f64, shown: f64) -> Option<f64> {
        let (mut check, mut height) = (HeightCheck::default(), 0.8);
        (0..(seconds * 10.0) as u32).find_map(|n| {
            let t = 0.1 * f64::from(n);
            height += shown * up(t - craft.dead_time - craft.lag) * 0.1;
            check.observe(craft, 0.1, up(t), libm::round(10.0 * height) / 10.0);
            check.has_failed().then_some(t)
        })
    }

    #[test]
    fn a_height_that_does_not_change_is_noticed_within_a_metre_and_a_half_of_commanded_motion() {
        for (craft, up) in [(Craft::tello(), 0.6), (Craft::tello(), -0.4), (Craft::quad(), 1.0), (Craft::quad(), 0.1)] {
            let at = fails_at(&craft, |_| up, 40.0, 0.0).unwrap();
            let lag = craft.dead_time + craft.lag;
            assert!((at - (1.5 / up.abs() + lag)).abs() < 0.3, "{up} m/s: {at} s");
            // With pauses it takes the same motion.
            let paused = fails_at(&craft, |t| if t % 4.0 < 2.0 { up } else { 0.0 }, 80.0, 0.0).unwrap();
            assert!(paused >= at && paused < 2.0 * at + 4.0, "{up} m/s: {paused} s");
        }
    }

    #[test]
    fn a_craft_that_follows_also_slowly_or_turns_round_is_believed() {
        for craft in [Craft::tello(), Craft::quad()] {
            for shown in [0.4, 1.0, 1.5] {
                assert_eq!(fails_at(&craft, |_| 0.8, 60.0, shown), None, "{shown}");
                let wave = |period: f64| move |t: f64| 0.8 * libm::sin(2.0 * core::f64::consts::PI * t / period);
                for period in [1.0, 3.0, 10.0, 30.0] {
                    assert_eq!(fails_at(&craft, wave(period), 120.0, shown), None, "{shown}, period {period} s");
                }
            }
        }
    }
}

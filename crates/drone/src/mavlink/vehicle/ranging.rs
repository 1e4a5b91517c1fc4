//! Sensors around the craft: what they measure for the pilot, and what the pilot's map shows for the autopilot.

use spf_core::ranges::RangeScan;
use spf_core::time::{Duration, Time};
use spf_mavlink::ranges::Ranges;

use super::Vehicle;
use crate::DroneEvent;

/// A sensor that was heard this recently measures.
const HEARD: Duration = Duration::from_secs(5);
/// Maximum number of sensors.
const SENSORS: usize = 64;

impl Vehicle {
    /// A scan arrived.
    pub(super) fn scan(&mut self, now: Time, ranges: &Ranges) {
        // What it is told by us it tells again.
        if self.tells_surroundings == Some(true) && ranges.may_be_echo() {
            return;
        }
        if self.range_clocks.len() >= SENSORS && !self.range_clocks.contains_key(&ranges.sensor) {
            return;
        }
        let Some(captured) = self.range_clocks.entry(ranges.sensor).or_default().measured(now, ranges.boot_ms) else { return };
        let Some(heading) = self.sensed.heading(now).or((!ranges.from_north).then_some(0.0)) else { return };
        let turned = if ranges.from_north { heading } else { 0.0 };
        let rays = ranges.rays.iter().map(|ray| spf_core::ranges::RangeRay { azimuth: ray.azimuth - turned, ..*ray }).collect();
        if ranges.is_level() {
            self.facts.ranged = Some(now);
        }
        let scan = RangeScan { captured, sensor: ranges.sensor, rays };
        self.push_measured(now, DroneEvent::Ranges(Box::new(scan)));
    }

    /// Whether sensors around the craft measure ranges: one that looks up only does not see what it flies at.
    #[must_use]
    pub fn measures_ranges(&self, now: Time) -> bool {
        self.facts.ranged.is_some_and(|at| now.since(at) < HEARD)
    }

    /// Whether the autopilot wants to know what is around it: one that measures it itself must not be told its own ranges again.
    #[must_use]
    pub fn wants_surroundings(&self) -> bool {
        self.tells_surroundings.unwrap_or(self.facts.ranged.is_none()) && self.is_flying()
    }

    /// Tells it what is around it.
    pub fn tell_surroundings(&mut self, scan: &RangeScan) {
        if self.wants_surroundings() && !scan.rays.is_empty() {
            // Decided once: from now on its own words may be ours.
            self.tells_surroundings = Some(true);
            self.surroundings = Some(scan.clone());
        }
    }
}

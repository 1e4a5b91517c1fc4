//! The return by the craft's own navigation, whose path the envelope knows only in outline: up, straight home, down.

use super::{ClearedCommand, Envelope, Limits, Refusal, passed};
use crate::command::Command;
use crate::craft::Craft;
use crate::geometry::EnuPosition;
use crate::time::{Time, duration_from_secs};

/// Distance between the places of the path at which the geofence is looked at, metres.
const SPACING: f64 = 0.5;

impl Limits {
    /// Whether a craft may return by itself within these limits, as far as that can be told before a flight.
    ///
    /// # Errors
    /// [`Refusal::NoReturn`] if it cannot return, [`Refusal::ReturnTooHigh`] if it would climb above the ceiling.
    pub fn check_return(&self, craft: &Craft) -> Result<f64, Refusal> {
        let height = craft.return_height.filter(|height| height.is_finite()).ok_or(Refusal::NoReturn)?;
        let limit = self.max_altitude;
        if height > limit { Err(Refusal::ReturnTooHigh { height, limit }) } else { Ok(height) }
    }
}

impl Envelope {
    /// Clears a return. Nothing of it can be corrected on the way, so all of it must lie within the limits. The distance limit is
    /// kept by coming nearer.
    pub(super) fn clear_return(&mut self, now: Time) -> Result<ClearedCommand, Refusal> {
        let now = self.advance(now);
        let height = self.limits.check_return(&self.craft)?.max(self.estimate.height);
        if self.watch.is_link_lost() {
            return Err(Refusal::LinkLost);
        }
        let fresh = duration_from_secs(self.limits.max_telemetry_age);
        let Some(home) =
            self.estimate.home.filter(|_| self.estimate.measured.is_some_and(|measured| now.since(measured) <= fresh))
        else {
            return Err(Refusal::NoTelemetry);
        };
        if let Some(fence) = &self.limits.geofence {
            let from = self.estimate.position;
            let steps = (from.horizontal_distance(home) / SPACING).ceil().clamp(1.0, 1e5) as u32;
            let place = |step: u32| EnuPosition { up: height, ..from.towards(home, f64::from(step) / f64::from(steps)) };
            if !(0..=steps).map(place).all(|place| fence.contains_below_ceiling(place)) {
                return Err(Refusal::ReturnOutsideGeofence);
            }
        }
        self.commanded = None;
        Ok(passed(Command::Return))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geofence::Geofence;
    use crate::telemetry::{FlightPhase, Telemetry};

    fn at(east: f64, north: f64, up: f64, fence: Option<&str>, height: Option<f64>) -> Envelope {
        let craft = Craft { return_height: height, ..Craft::quad() };
        let geofence = fence.map(|fence| Geofence::from_geojson(fence).unwrap());
        let mut envelope = Envelope::new(Limits { max_altitude: 30.0, geofence, ..Limits::for_craft(&craft) }, craft);
        let report = |ms, position, phase| Telemetry {
            time: Time::from_millis(ms),
            position: Some(position),
            phase,
            ..Default::default()
        };
        envelope.observe_telemetry(Time::from_millis(0), &report(0, EnuPosition::default(), FlightPhase::OnGround));
        let place = EnuPosition { east, north, up };
        let flying = Telemetry { height: Some(up), ..report(100, place, FlightPhase::Flying) };
        envelope.observe_telemetry(Time::from_millis(100), &flying);
        envelope
    }

    fn refusal(mut envelope: Envelope) -> Option<Refusal> {
        envelope.clear(Time::from_millis(200), Command::Return).err()
    }

    #[test]
    fn a_return_is_cleared_only_if_all_of_it_lies_within_the_limits() {
        assert_eq!(refusal(at(10.0, 0.0, 5.0, None, Some(15.0))), None);
        assert_eq!(refusal(at(10.0, 0.0, 5.0, None, None)), Some(Refusal::NoReturn));
        assert_eq!(refusal(at(10.0, 0.0, 5.0, None, Some(f64::NAN))), Some(Refusal::NoReturn));
        let high = Some(Refusal::ReturnTooHigh { height: 60.0, limit: 30.0 });
        assert_eq!(refusal(at(10.0, 0.0, 5.0, None, Some(60.0))), high);
        // A fence in the form of an L, with home in the corner of one leg and the craft in the other.
        let bent =
            r#"{"type": "Polygon", "coordinates": [[[-5, -5], [50, -5], [50, 50], [40, 50], [40, 5], [-5, 5], [-5, -5]]]}"#;
        assert_eq!(refusal(at(45.0, 0.0, 5.0, Some(bent), Some(15.0))), None);
        assert_eq!(refusal(at(45.0, 45.0, 5.0, Some(bent), Some(15.0))), Some(Refusal::ReturnOutsideGeofence));
        let low = r#"{"type": "Feature", "properties": {"max_altitude_m": 12}, "geometry":
            {"type": "Polygon", "coordinates": [[[-50, -50], [50, -50], [50, 50], [-50, 50], [-50, -50]]]}}"#;
        assert_eq!(refusal(at(45.0, 0.0, 5.0, Some(low), Some(15.0))), Some(Refusal::ReturnOutsideGeofence));
        assert_eq!(refusal(at(45.0, 0.0, 5.0, Some(low), Some(10.0))), None);
    }

    #[test]
    fn without_telemetry_or_link_there_is_no_return() {
        let mut late = at(10.0, 0.0, 5.0, None, Some(15.0));
        assert_eq!(late.clear(Time::from_millis(5000), Command::Return).err(), Some(Refusal::NoTelemetry));
        let mut lost = at(10.0, 0.0, 5.0, None, Some(15.0));
        lost.link_lost(Time::from_millis(150));
        assert_eq!(refusal(lost), Some(Refusal::LinkLost));
    }
}

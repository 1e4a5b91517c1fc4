//! The return by the craft's own navigation, whose path the envelope knows only in outline: up, straight home, down.

use super::estimate::Estimate;
use super::watch::Watch;
use super::{Limits, Refusal};
use spf_core::craft::Craft;
use spf_core::geometry::EnuPosition;
use spf_core::time::{Time, duration_from_secs};

/// Distance between the places of the path at which the geofence is looked at, metres.
const SPACING: f64 = 0.5;
/// The craft's own home may lie this far from the place that the distance limit counts from, metres.
const SAME_PLACE: f64 = 3.0;

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

/// Whether a craft may return now. Nothing of a return can be corrected on the way, so all of it must lie within the limits. The
/// distance limit is kept by coming nearer.
pub(super) fn check(now: Time, limits: &Limits, craft: &Craft, watch: &Watch, estimate: &Estimate) -> Result<(), Refusal> {
    let height = limits.check_return(craft)?;
    // The craft may be higher than that, and climbs from there.
    let height = height.max(estimate.height + craft.return_climb.max(0.0));
    let limit = limits.max_altitude;
    if height > limit && craft.return_climb > 0.0 {
        return Err(Refusal::ReturnTooHigh { height, limit });
    }
    if watch.is_link_lost() {
        return Err(Refusal::LinkLost);
    }
    let fresh = duration_from_secs(limits.max_telemetry_age);
    let Some(start) = estimate.home.filter(|_| estimate.measured.is_some_and(|measured| now.since(measured) <= fresh)) else {
        return Err(Refusal::NoTelemetry);
    };
    // It flies to its own home, which is another place if somebody set it, or if it was taken over in the air.
    let home = estimate.returns_to.ok_or(Refusal::UnknownHome)?;
    let away = home.horizontal_distance(start);
    if away > SAME_PLACE {
        return Err(Refusal::ReturnElsewhere { away });
    }
    if let Some(fence) = &limits.geofence {
        let from = estimate.position;
        let steps = (from.horizontal_distance(home) / SPACING).ceil().clamp(1.0, 1e5) as u32;
        let place = |step: u32| EnuPosition { up: height, ..from.towards(home, f64::from(step) / f64::from(steps)) };
        if !(0..=steps).map(place).all(|place| fence.contains_below_ceiling(place)) {
            return Err(Refusal::ReturnOutsideGeofence);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Envelope;
    use crate::geofence::Geofence;
    use spf_core::command::Command;
    use spf_core::telemetry::{FlightPhase, Telemetry};

    fn at(east: f64, north: f64, up: f64, fence: Option<&str>, height: Option<f64>) -> Envelope {
        let craft = Craft { return_height: height, ..Craft::quad() };
        let geofence = fence.map(|fence| Geofence::from_geojson(fence).unwrap());
        let mut envelope = Envelope::new(Limits { max_altitude: 30.0, geofence, ..Limits::for_craft(&craft) }, craft);
        let report = |ms, position, phase| Telemetry {
            time: Time::from_millis(ms),
            position: Some(position),
            returns_to: Some(EnuPosition::default()),
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

    /// Taken over in the air 40 m from its home, with a fence across the way, or with none.
    #[test]
    fn a_craft_that_would_return_to_another_place_than_it_came_from_does_not_return() {
        let adopted = |fence: Option<&str>, returns_to: Option<EnuPosition>| {
            let craft = Craft { return_height: Some(10.0), ..Craft::quad() };
            let geofence = fence.map(|fence| Geofence::from_geojson(fence).unwrap());
            let mut envelope = Envelope::new(Limits { max_altitude: 30.0, geofence, ..Limits::for_craft(&craft) }, craft);
            let telemetry = Telemetry {
                time: Time::from_millis(100),
                position: Some(EnuPosition { east: 40.0, north: 0.0, up: 5.0 }),
                height: Some(5.0),
                returns_to,
                phase: FlightPhase::Flying,
                ..Default::default()
            };
            envelope.observe_telemetry(Time::from_millis(100), &telemetry);
            refusal(envelope)
        };
        let between = r#"{"type": "Polygon", "coordinates": [[[30, -20], [60, -20], [60, 20], [30, 20], [30, -20]]]}"#;
        for fence in [Some(between), None] {
            assert_eq!(adopted(fence, Some(EnuPosition::default())), Some(Refusal::ReturnElsewhere { away: 40.0 }));
            assert_eq!(adopted(fence, None), Some(Refusal::UnknownHome));
            assert_eq!(adopted(fence, Some(EnuPosition { east: 38.0, ..EnuPosition::default() })), None);
        }
    }

    /// It climbs from where it is, above the ceiling.
    #[test]
    fn a_return_that_climbs_from_where_it_is_is_refused_below_the_ceiling() {
        let mut envelope = at(10.0, 0.0, 25.0, None, Some(15.0));
        envelope.craft.return_climb = 10.0;
        assert_eq!(refusal(envelope), Some(Refusal::ReturnTooHigh { height: 35.0, limit: 30.0 }));
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

//! The envelope's limits: values, defaults and validation.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::brake_limits::BrakeLimits;
use crate::geofence::Geofence;
use spf_core::craft::Craft;

/// The envelope's parameters (`docs/explanation/safety.md`). Metres, seconds, radians; infinity switches a limit off.
/// Altitudes are above the take-off point.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Limits {
    /// Maximum horizontal speed of a setpoint, m/s.
    pub max_speed: f64,
    /// Maximum climb and descent rate of a setpoint, m/s.
    pub max_climb: f64,
    /// Maximum yaw rate of a setpoint, rad/s.
    pub max_yaw_rate: f64,
    /// Minimum altitude except while landing, m. It only limits downward motion and never makes a craft climb.
    pub min_altitude: f64,
    /// Maximum altitude, m.
    pub max_altitude: f64,
    /// Maximum horizontal distance from the take-off point, m.
    pub max_distance: f64,
    /// Distance inside the ceiling, the distance limit and the geofence at which setpoints stop the craft, m, to which twice
    /// the stated standard deviation of the position adds. It absorbs larger errors and gusts, so that a craft held at a limit
    /// does not count as outside.
    pub margin: f64,
    /// How long a setpoint stays valid without a successor, s; after that the craft holds.
    pub setpoint_validity: f64,
    /// Age of the newest frame, from its capture, above which the pilot stops moving, s.
    pub max_frame_age: f64,
    /// How long frames may arrive with an unchanged capture counter before the camera is considered frozen, s.
    pub frozen_after: f64,
    /// Time from a stale, frozen or unusable camera to landing, s.
    pub camera_land_after: f64,
    /// Age of the newest telemetry above which the craft does not move, s.
    pub max_telemetry_age: f64,
    /// Time from stale telemetry to landing, s.
    pub telemetry_land_after: f64,
    /// Time from link loss to hold, s.
    pub link_hold_after: f64,
    /// Time from link loss to landing, s.
    pub link_land_after: f64,
    /// Battery charge (0..=1) below which take-off is refused.
    pub take_off_battery: f64,
    /// Whether take-off requires a fresh usable frame and a reported battery charge. Set for real craft: a camera or a
    /// battery that reports nothing is detected on the ground.
    #[serde(skip_serializing_if = "core::ops::Not::not")]
    pub take_off_checks: bool,
    /// Temperature reported by the craft, °C, above which take-off is refused; `None` for no limit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_temperature: Option<f64>,
    /// Battery charge (0..=1) below which the craft holds, then lands.
    pub low_battery: f64,
    /// Time from low battery to landing, s.
    pub battery_land_after: f64,
    /// Number of consecutive failed replies that lands the craft; each earlier one makes it hold.
    pub max_failed_replies: u32,
    /// Time from a breach of the altitude, distance or geofence limit to landing, s.
    pub breach_land_after: f64,
    /// Where the craft may fly; `None` for no geofence.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub geofence: Option<Geofence>,
    /// The brake before obstacles; `None` for no brake.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub brake: Option<BrakeLimits>,
}

/// An invalid limit.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LimitsError {
    /// A value is negative or NaN.
    #[error("limit `{field}` is `{value}`, but must be a non-negative number")]
    Negative {
        /// Field name.
        field: &'static str,
        /// Its value.
        value: f64,
    },
    /// Less than 0.5 m between floor and ceiling.
    #[error("`min_altitude` `{min}` m and `max_altitude` `{max}` m must be at least 0.5 m apart")]
    NoRoom {
        /// Floor, m.
        min: f64,
        /// Ceiling, m.
        max: f64,
    },
}

impl Default for Limits {
    /// The limits for [`Craft::quad`].
    fn default() -> Self {
        Self::for_craft(&Craft::quad())
    }
}

impl Limits {
    /// The default figures for a craft: one and a half times its preset speeds, so that the envelope leaves room for a
    /// controller that catches up, and the timings of `docs/explanation/safety.md`.
    #[must_use]
    pub fn for_craft(craft: &Craft) -> Self {
        Self {
            max_speed: 1.5 * craft.cruise_speed,
            max_climb: 1.5 * craft.climb_speed,
            max_yaw_rate: 1.5 * craft.yaw_rate,
            min_altitude: 0.3,
            max_altitude: 120.0,
            max_distance: 300.0,
            margin: 0.5,
            setpoint_validity: 0.5,
            max_frame_age: 1.0,
            frozen_after: 1.0,
            camera_land_after: 10.0,
            max_telemetry_age: 1.0,
            telemetry_land_after: 5.0,
            link_hold_after: 0.5,
            link_land_after: 5.0,
            take_off_battery: 0.2,
            take_off_checks: false,
            max_temperature: None,
            low_battery: 0.15,
            battery_land_after: 5.0,
            max_failed_replies: 5,
            breach_land_after: 5.0,
            geofence: None,
            brake: None,
        }
    }

    /// The craft with its preset speeds reduced to these limits, so that planning with its speeds does not expect more motion
    /// than the envelope clears.
    #[must_use]
    pub fn capped(&self, craft: &Craft) -> Craft {
        Craft {
            cruise_speed: craft.cruise_speed.min(self.max_speed),
            climb_speed: craft.climb_speed.min(self.max_climb),
            yaw_rate: craft.yaw_rate.min(self.max_yaw_rate),
            ..*craft
        }
    }

    /// Half the size of the region that the limits leave, m: of the distance limit, and of the widest area of the geofence.
    /// Infinite without either.
    pub(super) fn room(&self) -> f64 {
        let fence = self.geofence.as_ref().map_or(f64::INFINITY, |fence| 0.5 * fence.width());
        fence.min(0.5 * self.max_distance)
    }

    /// Every limit that must not be negative, by name.
    fn figures(&mut self) -> [(&'static str, &mut f64); 18] {
        [
            ("max_speed", &mut self.max_speed),
            ("max_climb", &mut self.max_climb),
            ("max_yaw_rate", &mut self.max_yaw_rate),
            ("max_altitude", &mut self.max_altitude),
            ("max_distance", &mut self.max_distance),
            ("margin", &mut self.margin),
            ("setpoint_validity", &mut self.setpoint_validity),
            ("max_frame_age", &mut self.max_frame_age),
            ("frozen_after", &mut self.frozen_after),
            ("camera_land_after", &mut self.camera_land_after),
            ("max_telemetry_age", &mut self.max_telemetry_age),
            ("telemetry_land_after", &mut self.telemetry_land_after),
            ("link_hold_after", &mut self.link_hold_after),
            ("link_land_after", &mut self.link_land_after),
            ("take_off_battery", &mut self.take_off_battery),
            ("low_battery", &mut self.low_battery),
            ("battery_land_after", &mut self.battery_land_after),
            ("breach_land_after", &mut self.breach_land_after),
        ]
    }

    /// Validates the limits, for use when reading a configuration.
    ///
    /// # Errors
    /// [`LimitsError::Negative`] for the first value that is negative or NaN (only `min_altitude` may be negative),
    /// [`LimitsError::NoRoom`] if floor and ceiling are less than 0.5 m apart.
    pub fn check(&self) -> Result<(), LimitsError> {
        let mut copy = self.clone();
        for (field, value) in copy.figures() {
            if value.is_nan() || *value < 0.0 {
                return Err(LimitsError::Negative { field, value: *value });
            }
        }
        if self.min_altitude.is_nan() || self.max_altitude - self.min_altitude < 0.5 {
            return Err(LimitsError::NoRoom { min: self.min_altitude, max: self.max_altitude });
        }
        Ok(())
    }

    /// The strictest reading of unvalidated limits: negative values and NaN become zero.
    pub(super) fn made_strict(mut self) -> Self {
        for (_, value) in self.figures() {
            *value = value.max(0.0);
        }
        if self.min_altitude.is_nan() {
            self.min_altitude = 0.0;
        }
        self.brake = self.brake.map(BrakeLimits::made_strict);
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn defaults_make_sense_and_nonsense_is_named() {
        for craft in [Craft::quad(), Craft::tello()] {
            assert_eq!(Limits::for_craft(&craft).check(), Ok(()));
        }
        let nan = Limits { max_climb: f64::NAN, ..Limits::default() };
        assert!(matches!(nan.check(), Err(LimitsError::Negative { field: "max_climb", .. })));
        assert_eq!(nan.made_strict().max_climb, 0.0);
        let flat = Limits { max_altitude: 0.5, ..Limits::default() };
        assert!(matches!(flat.check(), Err(LimitsError::NoRoom { .. })));
    }

    #[test]
    fn configuration_may_name_one_figure_and_no_unknown_one() {
        let some: Limits = serde_json::from_str(r#"{"max_altitude": 30}"#).unwrap();
        assert_eq!(some, Limits { max_altitude: 30.0, ..Limits::default() });
        assert!(serde_json::from_str::<Limits>(r#"{"max_altitud": 30}"#).is_err());
    }
}

//! The craft that is assumed, with the limits that its autopilot sets.

use spf_core::craft::Craft;
use spf_mavlink::modes::Autopilot;

use super::vehicle::Facts;

/// Acceleration of a craft whose autopilot does not tell, m/s².
const ACCELERATION: f64 = 2.0;

/// The craft that is assumed: a general quadrotor.
pub(super) fn craft() -> Craft {
    Craft::quad()
}

/// The craft with the limits that its autopilot sets, metres and seconds. Its acceleration decides where it comes to rest: one that
/// is unknown counts as low.
pub(super) fn limited(usual: Craft, facts: &Facts, take_off_height: Option<f64>) -> Craft {
    // ArduPilot's are in cm.
    let (names, unit) = match facts.autopilot {
        Autopilot::Px4 => (["MPC_XY_VEL_MAX", "MPC_Z_VEL_MAX_UP", "MPC_Z_VEL_MAX_DN", "MPC_ACC_HOR"], 1.0),
        Autopilot::ArduPilot => (["WPNAV_SPEED", "WPNAV_SPEED_UP", "WPNAV_SPEED_DN", "WPNAV_ACCEL"], 0.01),
    };
    let [level, up, down, acceleration] =
        names.map(|name| facts.parameter(name).map(|value| value.abs() * unit).filter(|value| *value > 0.0));
    let vertical = up.unwrap_or(f64::INFINITY).min(down.unwrap_or(f64::INFINITY));
    Craft {
        cruise_speed: usual.cruise_speed.min(level.unwrap_or(f64::INFINITY)),
        climb_speed: usual.climb_speed.min(vertical),
        acceleration: usual.acceleration.min(acceleration.unwrap_or(ACCELERATION)),
        take_off_height: take_off_height.unwrap_or(usual.take_off_height),
        return_height: facts.return_height().ok(),
        return_climb: facts.return_climb(),
        ..usual
    }
}

#[cfg(test)]
mod tests {
    use spf_core::time::Time;
    use spf_mavlink::modes::Mode;
    use spf_mavlink::report::Report;

    use super::super::vehicle::Vehicle;
    use super::*;

    #[test]
    fn the_autopilot_s_own_limits_are_those_of_the_craft() {
        let facts = |mode: Mode, parameters: &[(&str, f32)]| {
            let mut vehicle = Vehicle::new(Time::ZERO, mode, [1, 191], 3.0, false);
            for (name, field) in parameters {
                vehicle.handle(Time::ZERO, &Report::Parameter { name: (*name).to_owned(), field: *field, kind: 9 });
            }
            vehicle.facts().clone()
        };
        let (px4, copter) = (Autopilot::Px4.hold(), Autopilot::ArduPilot.hold());
        let of = |facts: &Facts| {
            let it = limited(Craft::quad(), facts, None);
            [it.cruise_speed, it.climb_speed, it.acceleration, it.take_off_height]
        };
        assert_eq!(of(&facts(px4, &[])), [3.0, 1.0, 2.0, 3.0]);
        assert_eq!(
            of(&facts(px4, &[("MPC_XY_VEL_MAX", 1.5), ("MPC_Z_VEL_MAX_DN", 0.5), ("MPC_ACC_HOR", 3.0)])),
            [1.5, 0.5, 3.0, 3.0]
        );
        assert_eq!(
            of(&facts(copter, &[("WPNAV_SPEED", 200.0), ("WPNAV_SPEED_UP", 50.0), ("WPNAV_ACCEL", 100.0)])),
            [2.0, 0.5, 1.0, 3.0]
        );
        assert_eq!(limited(Craft::quad(), &facts(px4, &[]), Some(2.5)).take_off_height, 2.5);
    }
}

//! The return: at which height, over home, and its end.

use spf_core::command::Setpoint;
use spf_core::geometry::EnuPosition;
use spf_core::time::{Duration, Time};
use spf_mavlink::modes::Autopilot;

use super::fence::{HEIGHT, is_kind_in_force};
use super::loops::{Loops, Yaw};
use crate::mavlink::parameters::Parameters;

/// Of ArduPilot: the least height of a return, the climb that its cone does not shorten, and slopes below this are no cone, metres.
const LEAST_HEIGHT: f64 = 0.3;
const LEAST_CLIMB: f64 = 2.5;
const LEAST_SLOPE: f64 = 0.5;
/// Distance at which a place is reached, metres.
const NEAR: f64 = 0.6;

/// Height above home at which a vehicle returns that is this high and this far from home, metres: never below where it is. `ceiling` is the
/// greatest height of a fence that is in force.
fn return_height(autopilot: Autopilot, parameters: &Parameters, ceiling: Option<f64>, height: f64, away: f64) -> f64 {
    let number = |name, default| parameters.number(name, default);
    match autopilot {
        // As `RTL::calculate_return_alt_from_cone_half_angle` has it.
        Autopilot::Px4 => {
            let (full, radius, cone) =
                (number("RTL_RETURN_ALT", 60.0), number("NAV_ACC_RAD", 10.0), number("RTL_CONE_ANG", 45.0));
            let wanted = if cone <= 0.0 {
                full
            } else if away <= radius {
                2.0 * away
            } else if away <= number("RTL_MIN_DIST", 10.0) {
                (away / libm::tan(cone.clamp(1.0, 89.0).to_radians())).min(full).max(2.0 * radius)
            } else {
                full.max(2.0 * radius)
            };
            wanted.max(height)
        }
        // As `ModeRTL::compute_return_target` has it.
        Autopilot::ArduPilot => {
            let metres = |name, default| 0.01 * number(name, default);
            let climb = height + metres("RTL_CLIMB_MIN", 0.0).max(0.0);
            let mut wanted = metres("RTL_ALT", 1500.0).max(LEAST_HEIGHT).max(climb);
            let slope = number("RTL_CONE_SLOPE", 3.0);
            if slope >= LEAST_SLOPE {
                wanted = wanted.min((away * slope).max(height + LEAST_CLIMB));
            }
            wanted.min(ceiling.unwrap_or(f64::INFINITY)).max(height)
        }
    }
}

/// A return under way.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Return {
    /// Its height above the estimator's origin, metres, once it has begun.
    up: Option<f64>,
    /// Whether it has climbed.
    climbed: bool,
    /// Since when it has been over home.
    arrived: Option<Time>,
}

impl Return {
    /// On the way home, which is relative to the estimator's origin: up, over, then `None` for the landing.
    pub(super) fn setpoint(&mut self, loops: &Loops<'_>, home: EnuPosition) -> Option<Setpoint> {
        let here = loops.here;
        let away = here.horizontal_distance(home);
        // Decided where it begins: on the way it comes nearer.
        let up = *self.up.get_or_insert_with(|| {
            let number = |name, default| loops.parameters.number(name, default);
            let ceiling =
                is_kind_in_force(loops.parameters, HEIGHT).then(|| number("FENCE_ALT_MAX", 100.0) - number("FENCE_MARGIN", 2.0));
            home.up + return_height(loops.autopilot, loops.parameters, ceiling, here.up - home.up, away)
        });
        if self.arrived.is_some() || (away < NEAR && here.up > up - NEAR) {
            return None;
        }
        // Once it flies home it does not stop to climb.
        self.climbed |= up - here.up <= NEAR;
        let place = if self.climbed { EnuPosition { up, ..home } } else { EnuPosition { up, ..here } };
        Some(loops.to(place, Yaw::Keep))
    }

    /// Whether it has waited over home, and ends in a landing.
    pub(super) fn lands(&mut self, now: Time, autopilot: Autopilot, parameters: &Parameters) -> bool {
        let waited = now.since(*self.arrived.get_or_insert(now));
        let (waits, lands) = match autopilot {
            Autopilot::Px4 => (parameters.seconds("RTL_LAND_DELAY", 0.0), parameters.number("RTL_LAND_DELAY", 0.0) >= 0.0),
            Autopilot::ArduPilot => {
                let waits = Duration::from_millis(parameters.number("RTL_LOIT_TIME", 5000.0).clamp(0.0, 60_000.0) as u64);
                (waits, parameters.number("RTL_ALT_FINAL", 0.0) == 0.0)
            }
        };
        lands && waited >= waits
    }
}

/// Over home, where a return waits, or ends without a landing.
pub(super) fn over_home(loops: &Loops<'_>, home: EnuPosition) -> Setpoint {
    let here = loops.here;
    let last = match loops.autopilot {
        Autopilot::Px4 => loops.parameters.number("RTL_DESCEND_ALT", 30.0),
        Autopilot::ArduPilot => 0.01 * loops.parameters.number("RTL_ALT_FINAL", 0.0),
    };
    let up = if last > 0.0 { here.up.min(home.up + last) } else { here.up };
    loops.to(EnuPosition { up, ..home }, Yaw::Keep)
}
#[cfg(test)]
mod tests {
    use spf_mavlink::parameter::REAL32;

    use super::*;

    /// Worked by hand from the two formulas.
    #[test]
    fn the_height_of_a_return_follows_from_the_parameters() {
        let height = |autopilot, set: &[(&str, f32)], ceiling, height, away| {
            let mut parameters = Parameters::of(autopilot);
            set.iter().for_each(|(name, value)| assert!(parameters.set(name, *value, REAL32).is_some(), "{name}"));
            return_height(autopilot, &parameters, ceiling, height, away)
        };
        let px4 = |set: &[(&str, f32)], up, away| height(Autopilot::Px4, set, None, up, away);
        // Far away, near, and near but higher already.
        assert_eq!((px4(&[], 3.0, 40.0), px4(&[], 3.0, 4.0), px4(&[], 30.0, 4.0)), (60.0, 8.0, 30.0));
        // Without a cone the full height everywhere; with one of 45° as high as far, and at least twice the radius.
        assert_eq!(px4(&[("RTL_CONE_ANG", 0.0)], 3.0, 4.0), 60.0);
        let wide: &[(&str, f32)] = &[("NAV_ACC_RAD", 2.0), ("RTL_MIN_DIST", 50.0)];
        assert!((px4(wide, 3.0, 20.0) - 20.0).abs() < 1e-9);
        assert_eq!((px4(wide, 1.0, 3.0), px4(wide, 3.0, 51.0)), (4.0, 60.0));
        let copter = |set: &[(&str, f32)], ceiling, up, away| height(Autopilot::ArduPilot, set, ceiling, up, away);
        assert_eq!((copter(&[], None, 3.0, 40.0), copter(&[], None, 30.0, 40.0)), (15.0, 30.0));
        // The cone of slope 3, and its least climb.
        assert_eq!((copter(&[], None, 3.0, 3.0), copter(&[], None, 3.0, 0.5)), (9.0, 5.5));
        let steep: &[(&str, f32)] = &[("RTL_CONE_SLOPE", 0.0), ("RTL_CLIMB_MIN", 900.0)];
        assert_eq!((copter(steep, None, 3.0, 0.5), copter(steep, None, 10.0, 0.5)), (15.0, 19.0));
        assert_eq!((copter(&[], Some(12.0), 3.0, 40.0), copter(&[], Some(12.0), 13.0, 40.0)), (12.0, 13.0));
    }
}

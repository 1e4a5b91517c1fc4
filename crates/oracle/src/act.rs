//! Text actions instead of points.

use libm::{atan2, exp, hypot, round};
use serde_json::{Value, json};
use spf_core::query::{ActForm, Query};
use spf_core::reply::Look;

use super::Oracle;
use super::percept::Percept;
use super::sight::slopes;
use super::stages::{Aim, Place};

/// A motion suggested by the percept.
#[derive(Clone, Copy, Debug, Default)]
struct Motion {
    /// Degrees clockwise.
    turn: f64,
    /// Metres along the new heading.
    forward: f64,
    /// Metres up.
    climb: f64,
}

/// Slope (metres up per metre forward) above which a fixed move is a climb or descent.
const STEEP: f64 = 0.3;

/// The answer in the given form: bearing rounded, distance estimated.
pub(super) fn act(oracle: &Oracle, query: &Query, percept: &Percept, aim: &Aim, form: ActForm) -> String {
    // The plain-text forms cannot express "not visible" or "blocked": the craft turns, climbs or backs off.
    let motion = if aim.done {
        Motion::default()
    } else if let Some(place) = aim.place {
        towards(oracle, query, percept, place)
    } else if aim.too_near {
        Motion { forward: -1.0, ..Motion::default() }
    } else {
        match aim.look.unwrap_or(Look::Right) {
            Look::Left => Motion { turn: -60.0, ..Motion::default() },
            Look::Right => Motion { turn: 60.0, ..Motion::default() },
            Look::Behind => Motion { turn: 180.0, ..Motion::default() },
            Look::Up => Motion { climb: 1.0, ..Motion::default() },
            Look::Down => Motion { forward: -1.0, ..Motion::default() },
            Look::Ahead => Motion { forward: 1.0, ..Motion::default() },
        }
    };
    let reply = match form {
        ActForm::Commands => json!({ "actions": commands(motion, aim.done), "done": aim.done }),
        ActForm::Numeric => {
            json!({ "dx": motion.forward, "dy": 0, "dz": motion.climb, "dyaw": motion.turn, "done": aim.done })
        }
        ActForm::Discrete => json!({ "action": if aim.done { "stop" } else { fixed(motion) } }),
    };
    reply.to_string()
}

fn towards(oracle: &Oracle, query: &Query, percept: &Percept, place: Place) -> Motion {
    let (right, up) = slopes(&percept.camera, place.point);
    let errors = &oracle.errors.act;
    let bearing = atan2(right, 1.0).to_degrees();
    let turn = errors.bearing_step_deg * round(bearing / errors.bearing_step_deg);
    let distance = place.range * exp(errors.log_sd * oracle.by_query("act", query).normal());
    let slope = hypot(1.0, right);
    let forward = metres(distance * slope / hypot(slope, up));
    let climb = up / slope * forward;
    Motion { turn, forward, climb: if climb.abs() < 0.2 { 0.0 } else { metres(climb.abs()).copysign(climb) } }
}

/// Clamps metres to the range of the form, rounded to a tenth.
fn metres(value: f64) -> f64 {
    round(10.0 * value.clamp(0.2, 5.0)) / 10.0
}

fn commands(motion: Motion, done: bool) -> Vec<Value> {
    if done {
        return vec![json!({ "cmd": "stop", "value": 0 })];
    }
    let signed = |value: f64, positive: &str, negative: &str| {
        (value != 0.0).then(|| json!({ "cmd": if value > 0.0 { positive } else { negative }, "value": value.abs() }))
    };
    let all = [
        signed(motion.turn, "yaw_right", "yaw_left"),
        signed(motion.forward, "forward", "back"),
        signed(motion.climb, "up", "down"),
    ];
    all.into_iter().flatten().collect()
}

/// The fixed move that covers most of the motion.
fn fixed(motion: Motion) -> &'static str {
    if motion.turn != 0.0 {
        if motion.turn > 0.0 { "turn_right" } else { "turn_left" }
    } else if motion.forward < 0.0 || motion.climb < -STEEP * motion.forward {
        "down"
    } else if motion.climb > STEEP * motion.forward {
        "up"
    } else {
        "forward"
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fixed_move_turns_first_and_climbs_when_it_is_steep() {
        let of = |turn, forward, climb| fixed(Motion { turn, forward, climb });
        assert_eq!((of(15.0, 5.0, 5.0), of(-30.0, 5.0, 0.0)), ("turn_right", "turn_left"));
        assert_eq!((of(0.0, 5.0, 1.0), of(0.0, 5.0, 2.0), of(0.0, 5.0, -2.0)), ("forward", "up", "down"));
        assert_eq!((of(0.0, 0.0, 1.0), of(0.0, -1.0, 0.0)), ("up", "down"));
    }

    #[test]
    fn commands_leave_out_what_is_nothing() {
        let reply = commands(Motion { turn: -15.0, forward: 5.0, climb: 0.0 }, false);
        assert_eq!(reply, [json!({ "cmd": "yaw_left", "value": 15.0 }), json!({ "cmd": "forward", "value": 5.0 })]);
        assert_eq!(commands(Motion::default(), true), [json!({ "cmd": "stop", "value": 0 })]);
    }
}

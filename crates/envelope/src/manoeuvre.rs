//! Manoeuvres: limiting a move that the craft ends by itself.

use super::Cause;
use super::ahead::Ahead;
use super::brake::Brake;
use super::marked::Marked;
use super::reach;
use spf_core::command::{Manoeuvre, Setpoint};
use spf_core::craft::Craft;
use spf_core::geometry::BodyDisplacement;
use spf_core::time::{Duration, duration_from_secs};

/// Factor on the duration at full speed, and extra seconds, after which a manoeuvre that has not ended is stopped.
const PATIENCE: (f64, f64) = (2.0, 8.0);

/// How long a manoeuvre may take.
pub(super) fn patience(manoeuvre: Manoeuvre, craft: &Craft) -> Duration {
    let turn_rate = craft.yaw_rate.max(0.1);
    duration_from_secs(PATIENCE.0 * manoeuvre.duration(turn_rate) + PATIENCE.1)
}

/// The part of a finite manoeuvre that stays within the limits.
pub(super) fn confined(
    ahead: &Ahead<'_>,
    brake: &Brake,
    marked: &Marked,
    requested: Manoeuvre,
) -> (Option<Manoeuvre>, Option<Cause>) {
    let limits = ahead.limits;
    let Manoeuvre::Go { displacement: way, speed } = requested else { return (Some(requested), None) };
    let Some(situation) = ahead.situation() else { return (None, Some(Cause::NoTelemetry)) };
    let (allowed, confined) = reach::confine_path(limits, ahead.craft, &situation, way);
    let (allowed, braked, most) = braked_path(ahead, brake, marked, allowed);
    let confined = confined.or(braked);
    if allowed.max_component() < Manoeuvre::MIN_DISPLACEMENT {
        return (None, confined);
    }
    let fastest = allowed.speed_within(limits.max_speed, limits.max_climb);
    let why = if most < fastest { Cause::Obstacle } else { Cause::SpeedLimit };
    let fastest = fastest.min(most);
    if !(speed > 0.0 && fastest > 0.0) {
        return (None, Some(why));
    }
    let slowed = (speed > fastest).then_some(why);
    (Some(Manoeuvre::Go { displacement: allowed, speed: speed.min(fastest) }), confined.or(slowed))
}

/// The part of a straight path that the brake allows, and the maximum speed along it.
fn braked_path(
    ahead: &Ahead<'_>,
    brake: &Brake,
    marked: &Marked,
    way: BodyDisplacement,
) -> (BodyDisplacement, Option<Cause>, f64) {
    let limits = ahead.limits.brake.as_ref();
    if limits.is_none() && marked.is_empty() {
        return (way, None, f64::INFINITY);
    }
    let asked = Setpoint { right: way.right, forward: way.forward, up: way.up, yaw_rate: 0.0 };
    let motion = ahead.motion(brake, asked, [0.0; 3]);
    let (room, blind) = match (&motion, limits) {
        (None, _) => (0.0, true),
        (Some(motion), Some(limits)) => brake.way(ahead.now, limits, motion),
        (Some(_), None) => (f64::INFINITY, false),
    };
    let room = motion.map_or(room, |motion| room.min(marked.path(&motion, ahead.spread)));
    let most = limits.and_then(|limits| limits.blind_speed).filter(|_| blind).unwrap_or(f64::INFINITY);
    let (length, within) = (way.length(), room / (1.0 + reach::DISTANCE_ERROR));
    if length <= within {
        return (way, None, most);
    }
    let fraction = within / length;
    let part = BodyDisplacement { right: way.right * fraction, forward: way.forward * fraction, up: way.up * fraction };
    (part, Some(Cause::Obstacle), most)
}

//! Manoeuvres: limiting a move that the craft ends by itself.

use super::reach::{self, Situation};
use super::watch::Control;
use super::{Cause, Cleared, ClearedCommand, Envelope, Reaction};
use spf_core::command::{Command, Manoeuvre, Setpoint};
use spf_core::geometry::BodyDisplacement;
use spf_core::time::{Time, duration_from_secs};

/// Factor on the duration at full speed, and extra seconds, after which a manoeuvre that has not ended is stopped.
const PATIENCE: (f64, f64) = (2.0, 8.0);

impl Envelope {
    /// Clears a manoeuvre of the pilot, shortened so that its path and end stay within all limits; a hold if nothing of
    /// it is left, or if a setpoint would not be allowed to move the craft now. No manoeuvre starts from outside a limit. The
    /// clearance is valid until the manoeuvre must have ended.
    pub fn clear_manoeuvre(&mut self, now: Time, requested: Manoeuvre) -> ClearedCommand {
        let now = self.advance(now);
        let velocity = requested.velocity(self.craft.yaw_rate);
        // A manoeuvre must not be used to fly back inside a limit, as a setpoint may: it would not be supervised.
        let reaction = match self.reaction(now) {
            Reaction::Continue => None,
            Reaction::Hold(cause) | Reaction::Land(cause) => Some(cause),
        };
        let stopped = self.stopped_by(now, velocity, Control::Pilot).max(reaction);
        let (allowed, changed) = match stopped {
            _ if !requested.is_finite() => (None, Some(Cause::NotFinite)),
            Some(cause) => (None, Some(cause)),
            None => self.confined(now, requested),
        };
        let Some(manoeuvre) = allowed else { return ClearedCommand { changed, ..self.hold(now) } };
        let turn_rate = self.craft.yaw_rate.max(0.1);
        let valid_until = now + duration_from_secs(PATIENCE.0 * manoeuvre.duration(turn_rate) + PATIENCE.1);
        let heading = self.estimate.heading.unwrap_or(0.0);
        self.commanded = Some((reach::world_velocity(manoeuvre.velocity(0.0), heading), valid_until));
        ClearedCommand { cleared: Cleared { what: Command::Manoeuvre(manoeuvre), valid_until }, changed }
    }

    /// The part of a finite manoeuvre that stays within the limits.
    fn confined(&self, now: Time, requested: Manoeuvre) -> (Option<Manoeuvre>, Option<Cause>) {
        let limits = &self.limits;
        let Manoeuvre::Go { displacement: way, speed } = requested else { return (Some(requested), None) };
        let (Some(home), Some(heading)) = (self.estimate.home, self.estimate.heading) else {
            return (None, Some(Cause::NoTelemetry));
        };
        let situation = Situation { at: self.ahead(now), home, heading, spread: self.spread };
        let (allowed, confined) = reach::confine_path(limits, &self.craft, &situation, way);
        let (allowed, braked, most) = self.braked_path(now, allowed);
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
    fn braked_path(&self, now: Time, way: BodyDisplacement) -> (BodyDisplacement, Option<Cause>, f64) {
        if self.limits.brake.is_none() && self.marked.is_empty() {
            return (way, None, f64::INFINITY);
        }
        let asked = Setpoint { right: way.right, forward: way.forward, up: way.up, yaw_rate: 0.0 };
        let motion = self.motion_of(now, asked, [0.0; 3]);
        let (room, blind) = match (&motion, &self.limits.brake) {
            (None, _) => (0.0, true),
            (Some(motion), Some(limits)) => self.brake.way(now, limits, motion),
            (Some(_), None) => (f64::INFINITY, false),
        };
        let room = motion.map_or(room, |motion| room.min(self.marked.path(&motion, self.spread)));
        let most = self.limits.brake.and_then(|limits| limits.blind_speed).filter(|_| blind).unwrap_or(f64::INFINITY);
        let (length, within) = (way.length(), room / (1.0 + reach::DISTANCE_ERROR));
        if length <= within {
            return (way, None, most);
        }
        let fraction = within / length;
        let part = BodyDisplacement { right: way.right * fraction, forward: way.forward * fraction, up: way.up * fraction };
        (part, Some(Cause::Obstacle), most)
    }
}

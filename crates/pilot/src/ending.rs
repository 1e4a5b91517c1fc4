//! Take-off, limits and landing: the phases around deciding.

use super::take_over::HOVER_TIME;
use super::{Action, Ending, Outcome, Phase, Pilot};
use spf_core::command::Command;
use spf_core::telemetry::FlightPhase;
use spf_core::time::{Duration, Time};

/// A craft that does not report flying this long after take-off is abandoned.
const TAKE_OFF_TIME: Duration = Duration::from_secs(30);
/// How long a craft on the ground is given to send its first usable frame, where take-off requires one.
const VIDEO_TIME: Duration = Duration::from_secs(15);
/// A boundary that reduced a setpoint less than this before a timeout is named as its likely cause.
const HELD_BACK: Duration = Duration::from_secs(10);
/// Interval at which `Land` is repeated until the craft reports being on the ground: a lost command must not leave it
/// in the air.
pub(super) const LAND_REPEAT: Duration = Duration::from_secs(1);
/// The flight ends if the craft does not report being on the ground this long after `Land`.
const LANDING_TIME: Duration = Duration::from_secs(90);

impl Pilot {
    /// Follows the phase the craft reports; `before` is the phase of its previous report.
    pub(super) fn follow_craft(&mut self, now: Time, before: FlightPhase, crashed: bool) {
        if crashed && self.phase != Phase::Ended {
            self.cancel_queries();
            self.stop_motion(now);
            self.settle_outcome(Outcome::Collision, "the craft collided with something".to_owned());
            self.command(now, Command::EmergencyStop);
            return self.enter(now, Phase::Ended);
        }
        match (self.phase, self.craft_phase) {
            // This includes a craft that is already in the air when first heard of: it is flown from where it is.
            (Phase::Ground | Phase::TakeOff, FlightPhase::Flying) => {
                self.rest_from(now);
                self.needs_rest = true;
                self.next_tick = now;
                let phase = if self.hold_after_take_off { Phase::Held } else { Phase::Flying };
                self.enter(now, phase);
            }
            // Take-off began, and the craft is on the ground again: it has given up, and reports why itself.
            (Phase::TakeOff, FlightPhase::OnGround) if matches!(before, FlightPhase::TakingOff | FlightPhase::Landing) => {
                self.finish(now, Outcome::Failed, "the craft refused to take off".to_owned());
            }
            (Phase::Landing | Phase::Returning, FlightPhase::OnGround | FlightPhase::Stopped) => self.enter(now, Phase::Ended),
            // The craft lands or has stopped by itself (its own battery or link protection): follow it, never fight it.
            (
                Phase::Flying | Phase::Held | Phase::Manual | Phase::Hovering,
                FlightPhase::Landing | FlightPhase::OnGround | FlightPhase::Stopped,
            )
            | (Phase::TakeOff, FlightPhase::Stopped)
                if !self.is_still_landing(now) =>
            {
                self.finish(now, Outcome::Failed, "the craft landed or stopped its motors".to_owned());
            }
            _ => {}
        }
    }

    /// Time-driven transitions: take-off, its timeout, the flight's time limit, the end of landing.
    pub(super) fn limits(&mut self, now: Time) {
        let waited = now.since(self.entered);
        match self.phase {
            Phase::Ground => self.take_off(now),
            Phase::TakeOff if waited >= TAKE_OFF_TIME => {
                self.finish(now, Outcome::Failed, format!("no take-off within {} s", TAKE_OFF_TIME.as_secs()));
            }
            Phase::Flying | Phase::Held | Phase::Manual | Phase::TakeOff if self.is_out_of_time(now) => {
                let limit = self.settings.max_time.as_secs_f64();
                let held_back = self.held_back(now);
                self.finish(now, Outcome::Timeout, format!("the flight time limit of {limit} s was reached{held_back}"));
            }
            Phase::Hovering if waited >= HOVER_TIME => self.land(now),
            Phase::Returning => self.follow_return(now, waited),
            Phase::Landing if waited >= LANDING_TIME => self.enter(now, Phase::Ended),
            Phase::Landing if now >= self.next_tick => self.command(now, Command::Land),
            _ => {}
        }
    }

    /// The end of the message of a timeout: the boundary that held the craft back, if any.
    pub(super) fn held_back(&self, now: Time) -> String {
        let recent = self.held_back.filter(|(at, _)| now.since(*at) <= HELD_BACK);
        recent.map_or(String::new(), |(_, cause)| format!("; in the last {} s, the craft was {cause}", HELD_BACK.as_secs()))
    }

    fn take_off(&mut self, now: Time) {
        let limit = self.settings.max_time;
        if self.is_out_of_time(now) {
            return self.end_before_take_off(
                now,
                Outcome::Timeout,
                format!("the flight time limit of {} s was reached on the ground", limit.as_secs_f64()),
            );
        }
        if self.hold_after_take_off || self.craft_phase != FlightPhase::OnGround || self.estimator.newest().is_none() {
            return;
        }
        // Video takes seconds to start; without it the take-off is refused below.
        let ready = *self.ready_since.get_or_insert(now);
        let video = !self.envelope.limits().take_off_checks || self.envelope.has_fresh_frame(now);
        if !video && now.since(ready) < VIDEO_TIME {
            return;
        }
        match self.envelope.clear(now, Command::TakeOff) {
            Ok(clearance) => {
                self.outbox.push_back(Action::Command(clearance.cleared));
                self.enter(now, Phase::TakeOff);
            }
            Err(refusal) => {
                self.settle_outcome(Outcome::Aborted, refusal.to_string());
                self.enter(now, Phase::Ended);
            }
        }
    }

    /// Ends a flight before take-off. A craft that is already taking off by itself is landed.
    pub(super) fn end_before_take_off(&mut self, now: Time, outcome: Outcome, cause: String) {
        if self.craft_phase == FlightPhase::OnGround {
            self.settle_outcome(outcome, cause);
            self.enter(now, Phase::Ended);
        } else {
            self.finish(now, outcome, cause);
        }
    }

    /// Ends the flight because a budget is exhausted.
    pub(super) fn spent(&mut self, now: Time, reason: String) {
        match self.phase {
            Phase::Ground => self.end_before_take_off(now, Outcome::Aborted, reason),
            Phase::Landing | Phase::Returning | Phase::Ended => {}
            _ => self.finish(now, Outcome::Aborted, reason),
        }
    }

    /// Sets the outcome and lands.
    pub(super) fn finish(&mut self, now: Time, outcome: Outcome, cause: String) {
        self.cancel_queries();
        self.stop_motion(now);
        self.settle_outcome(outcome, cause);
        self.land(now);
    }

    /// Begins the landing of a flight whose outcome is settled.
    pub(super) fn land(&mut self, now: Time) {
        if !matches!(self.phase, Phase::Landing | Phase::Ended) {
            self.enter(now, Phase::Landing);
            self.command(now, Command::Land);
            self.next_tick = now + LAND_REPEAT;
        }
    }

    /// Sets the outcome; the first cause wins.
    pub(super) fn settle_outcome(&mut self, outcome: Outcome, cause: String) {
        if self.ending.is_none() {
            let ending = Ending { outcome, cause };
            self.ending = Some(ending.clone());
            self.outbox.push_back(Action::Finished(ending));
        }
    }

    /// Sends a command that the envelope always passes: land or emergency stop.
    pub(super) fn command(&mut self, now: Time, command: Command) {
        if let Ok(clearance) = self.envelope.clear(now, command) {
            self.outbox.push_back(Action::Command(clearance.cleared));
        }
    }
}

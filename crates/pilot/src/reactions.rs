//! The pilot's reactions to the envelope: hold, or land with an outcome.
//!
//! The conditions and their delays belong to the envelope (`docs/explanation/safety.md`, "Reactions";
//! `envelope/watch.rs`).

use super::{Note, Outcome, Phase, Pilot};
use spf_core::time::Time;
use spf_envelope::{Cause, Reaction};

impl Pilot {
    /// Obeys the envelope's current reaction.
    pub(super) fn react(&mut self, now: Time) {
        if self.phase == Phase::Returning {
            // Told, and nothing else: the craft's own navigation goes on, and has failsafes of its own.
            let cause = self.envelope.manual_reaction(now).cause();
            let last = core::mem::replace(&mut self.last_reaction, cause);
            return self.note_change(cause, last);
        }
        if !matches!(self.phase, Phase::Flying | Phase::Held | Phase::Manual | Phase::Hovering | Phase::TakeOff) {
            return;
        }
        // An operator in manual flight sees the craft: a frozen camera does not end it.
        let by_hand = matches!(self.phase, Phase::Manual | Phase::Held | Phase::Hovering);
        let reaction = if by_hand { self.envelope.manual_reaction(now) } else { self.envelope.reaction(now) };
        let last = core::mem::replace(&mut self.last_reaction, reaction.cause());
        self.note_change(reaction.cause(), last);
        match reaction {
            Reaction::Continue => {}
            Reaction::Hold(cause) => {
                if self.executing {
                    self.stop_motion(now);
                }
                if cause.is_blind() {
                    self.set_aside_unseen(now);
                }
            }
            Reaction::Land(cause) => {
                // Every other condition can be resolved, or judged, by an operator who sees the craft.
                if cause == Cause::LowBattery {
                    self.must_land = Some("landing on a low battery; only cutting the motors is accepted now");
                }
                let outcome = outcome_of(cause);
                self.finish(now, outcome, cause.to_string());
            }
        }
    }

    /// Reports a cause once, until another replaces it.
    pub(super) fn note_change(&mut self, cause: Option<Cause>, last: Option<Cause>) {
        if let Some(cause) = cause.filter(|cause| last != Some(*cause)) {
            self.note(Note::Envelope(cause));
        }
    }
}

/// The outcome of a flight that ends by a cause (`docs/explanation/safety.md`).
fn outcome_of(cause: Cause) -> Outcome {
    match cause {
        Cause::Crashed => Outcome::Collision,
        Cause::AltitudeBreach | Cause::DistanceBreach | Cause::GeofenceBreach | Cause::UncertainPosition | Cause::LowBattery => {
            Outcome::Aborted
        }
        _ => Outcome::Failed,
    }
}

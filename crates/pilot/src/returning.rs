//! The return by the craft's own navigation at the end of an instruction. It is watched and not interfered with; the operator may
//! hold, land, fly by hand or give a new instruction at any time.

use super::{Action, Note, Outcome, Phase, Pilot};
use spf_core::command::Command;
use spf_core::telemetry::FlightPhase;
use spf_core::time::{Duration, Time};

/// The craft must report that it returns within this time, or it is landed where it is.
const RETURN_BEGINS: Duration = Duration::from_secs(10);
/// A return that has not ended by then becomes a landing.
const RETURN_TIME: Duration = Duration::from_secs(600);

impl Pilot {
    /// Sets the outcome and returns home, if the envelope clears it; else lands.
    pub(super) fn return_home(&mut self, now: Time, outcome: Outcome, cause: String) {
        let Ok(clearance) = self.envelope.clear(now, Command::Return) else {
            self.note(Note::Limited("the safety envelope does not clear a return from here: landing"));
            return self.finish(now, outcome, cause);
        };
        self.cancel_queries();
        self.stop_motion(now);
        self.settle_outcome(outcome, cause);
        self.outbox.push_back(Action::Command(clearance.cleared));
        self.enter(now, Phase::Returning);
    }

    /// Watches a return that began `waited` ago.
    pub(super) fn follow_return(&mut self, now: Time, waited: Duration) {
        if waited >= RETURN_BEGINS && self.craft_phase != FlightPhase::Landing {
            self.note(Note::Limited("the craft does not return: landing"));
            self.land(now);
        } else if waited >= RETURN_TIME {
            self.note(Note::Limited("the return takes too long: landing"));
            self.land(now);
        }
    }
}

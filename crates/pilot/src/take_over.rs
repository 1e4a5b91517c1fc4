//! Taking over after the end of an instruction: interrupting a landing, hovering, and the flight time that counts.

use super::{AtEnd, LetGo, Note, Outcome, Phase, Pilot};
use crate::policy::PolicyEvent;
use spf_core::telemetry::FlightPhase;
use spf_core::time::{Duration, Time};

/// How long the craft hovers after the end of an instruction.
pub(super) const HOVER_TIME: Duration = Duration::from_secs(60);
/// How long a craft may still report that it lands after its landing was interrupted.
const OBEYS_WITHIN: Duration = Duration::from_secs(2);
/// Manual flight pauses the flight time limit for this long after each setpoint.
const AT_THE_KEYS: Duration = Duration::from_secs(60);

impl Pilot {
    /// Ends the current instruction: the outcome is settled, and the craft lands, hovers or returns.
    pub(super) fn end_instruction(&mut self, now: Time, outcome: Outcome, cause: String) {
        match self.settings.at_end {
            AtEnd::Hover if self.phase == Phase::Flying => {}
            AtEnd::Return if self.phase == Phase::Flying => return self.return_home(now, outcome, cause),
            _ => return self.finish(now, outcome, cause),
        }
        self.cancel_queries();
        self.stop_motion(now);
        self.settle_outcome(outcome, cause);
        self.enter(now, Phase::Hovering);
        self.next_tick = now;
    }

    /// Why a landing cannot be taken over; `None` if it can.
    pub(super) fn landing_is_final(&self) -> Option<&'static str> {
        match self.craft_phase {
            FlightPhase::OnGround | FlightPhase::Stopped => Some("already on the ground"),
            _ => self.must_land,
        }
    }

    /// Interrupts a landing or return in progress: from now on the craft holds in `phase`, unless it reports otherwise.
    pub(super) fn interrupt_landing(&mut self, now: Time, phase: Phase) {
        if matches!(self.phase, Phase::Landing | Phase::Returning) {
            self.taken_over = Some(now);
            self.rest_from(now);
        }
        self.enter(now, phase);
    }

    /// Whether a report of the craft that it lands is the landing that was just interrupted.
    pub(super) fn is_still_landing(&self, now: Time) -> bool {
        self.craft_phase == FlightPhase::Landing && self.taken_over.is_some_and(|at| now.since(at) < OBEYS_WITHIN)
    }

    /// Continues a flight whose outcome was settled, with the current instruction. Time and decisions count afresh.
    pub(super) fn reopen(&mut self, now: Time) {
        if self.ending.take().is_none() {
            return;
        }
        self.forget_instruction();
        let text = self.instruction.clone();
        self.policy.handle(PolicyEvent::Instruction(&text));
        (self.counted_from, self.counted_to) = (now, now);
        self.earlier_decisions = self.decisions;
    }

    /// The craft does not fly by our commands any more.
    pub(super) fn let_go(&mut self, now: Time, news: LetGo) {
        if self.phase == Phase::Ended {
            return;
        }
        self.note(Note::LetGo(news));
        let news = match news {
            LetGo::Somebody => {
                self.flown_elsewhere.get_or_insert_default();
                news
            }
            // Whoever has left the controls meanwhile decides nothing about it.
            LetGo::Failsafe if self.flown_elsewhere.take().is_some_and(|elsewhere| elsewhere.abandoned) => LetGo::Nobody,
            LetGo::Failsafe | LetGo::Nobody => {
                self.flown_elsewhere = None;
                news
            }
            LetGo::NotLanded => news,
        };
        match news {
            // A landing that was ordered, as by a signal, is not forgotten: it is commanded again, and the craft is landed as soon as
            // it is known to be nobody's, or the flight ends because it is somebody's.
            LetGo::Somebody | LetGo::Failsafe if self.phase == Phase::Landing || self.landing_is_final().is_some() => {}
            LetGo::Somebody | LetGo::Failsafe => self.hold(now, Phase::Held),
            LetGo::Nobody => self.finish(
                now,
                Outcome::Aborted,
                "the link was lost, the craft's own failsafe held it, and nobody was there to decide".to_owned(),
            ),
            LetGo::NotLanded if self.phase == Phase::Landing => self.enter(now, Phase::Ended),
            LetGo::NotLanded => {}
        }
    }

    /// Number of decisions about the current instruction.
    pub(super) fn counted_decisions(&self) -> u32 {
        self.decisions - self.earlier_decisions
    }

    /// Advances the flight time that counts against the limit; manual flight does not count.
    pub(super) fn count_time(&mut self, now: Time) {
        let by_hand = self.phase == Phase::Manual && self.last_manual.is_some_and(|at| now.since(at) < AT_THE_KEYS);
        if by_hand {
            self.counted_from += now.since(self.counted_to);
        }
        self.counted_to = now;
    }

    /// Whether the flight time limit is reached.
    pub(super) fn is_out_of_time(&self, now: Time) -> bool {
        now.since(self.counted_from) >= self.settings.max_time
    }
}

//! Operator inputs: taking over at any time, and the effect of each input in each phase.

use super::{Note, OperatorEvent, Outcome, Phase, Pilot};
use crate::policy::PolicyEvent;
use spf_core::command::Command;
use spf_core::keep_out::{KeepOut, MARKED_MOST};
use spf_core::time::{Duration, Time};
use spf_space::obstacle_map::{CELL, Cell};

/// How long a manual setpoint is held without a new one, so that a released key stops the craft.
const MANUAL_VALIDITY: Duration = Duration::from_millis(400);

/// Setpoints that follow each other within this time are those of one held key: longer than the delay after which a terminal
/// begins to repeat it.
const HELD_KEY: Duration = Duration::from_millis(700);

impl Pilot {
    pub(super) fn operator(&mut self, now: Time, event: OperatorEvent) {
        let is_setpoint = matches!(event, OperatorEvent::Setpoint(_));
        // A key that was held when the landing began would undo the landing that a signal, or the other hand, asked for.
        let ends = matches!(self.phase, Phase::Landing | Phase::Returning);
        let still_held = is_setpoint && ends && self.last_setpoint.is_some_and(|last| now.since(last) < HELD_KEY);
        if is_setpoint {
            self.last_setpoint = Some(now);
        }
        let held = still_held.then_some("landing or returning: let go of the key, and press it again to take over");
        if let Some(why) = self.ignored(&event).or(held) {
            if let (OperatorEvent::Abandoned, Some(elsewhere)) = (&event, &mut self.flown_elsewhere) {
                elsewhere.abandoned = true;
            }
            return self.note(Note::OperatorIgnored(event, why));
        }
        self.note(Note::Operator(event.clone()));
        match event {
            OperatorEvent::Hold | OperatorEvent::Left => self.hold(now, Phase::Held),
            OperatorEvent::Resume => {
                self.flown_elsewhere = None;
                self.resume(now);
            }
            OperatorEvent::Setpoint(setpoint) => {
                self.hold(now, Phase::Manual);
                self.last_manual = Some(now);
                self.manual = Some((setpoint, now + MANUAL_VALIDITY));
                self.next_tick = now;
            }
            OperatorEvent::Instruction(text) => self.instruct(now, text),
            OperatorEvent::KeepOut(places) => self.keep_out(now, places),
            OperatorEvent::Land if self.phase == Phase::Ground => {
                self.end_before_take_off(now, Outcome::Aborted, "the operator ended the flight before take-off".to_owned());
            }
            OperatorEvent::Land => self.finish(now, Outcome::Aborted, "the operator ended the flight".to_owned()),
            OperatorEvent::Abandoned if self.phase == Phase::Ground => {
                self.end_before_take_off(now, Outcome::Aborted, "nobody had the controls before take-off".to_owned());
            }
            OperatorEvent::Abandoned => self.finish(now, Outcome::Aborted, "nobody had the controls any more".to_owned()),
            OperatorEvent::CutMotors => {
                self.cancel_queries();
                self.stop_motion(now);
                self.settle_outcome(Outcome::Aborted, "the operator cut the motors".to_owned());
                self.command(now, Command::EmergencyStop);
                self.enter(now, Phase::Ended);
            }
        }
    }

    /// Why an input has no effect in this phase.
    fn ignored(&self, event: &OperatorEvent) -> Option<&'static str> {
        use OperatorEvent::{Abandoned, CutMotors, Hold, Instruction, Land, Left, Resume, Setpoint};
        match (self.phase, event) {
            (Phase::Ended, CutMotors) if self.craft_phase != spf_core::telemetry::FlightPhase::OnGround => None,
            (Phase::Ended, _) => Some("the flight is over"),
            (_, Left | Abandoned) => self.goes_on_alone(event),
            (_, OperatorEvent::KeepOut(places)) => refused_places(places),
            (Phase::Landing, Land) => Some("already landing"),
            (Phase::Landing | Phase::Returning, Hold | Resume | Setpoint(_) | Instruction(_)) => self.landing_is_final(),
            (Phase::Ground | Phase::TakeOff, Setpoint(_)) => Some("not flying yet"),
            (Phase::Ground | Phase::TakeOff | Phase::Flying, Resume) if !self.hold_after_take_off => Some("no hold is in effect"),
            _ => None,
        }
    }

    /// Why what the craft does goes on though nobody has the controls.
    fn goes_on_alone(&self, event: &OperatorEvent) -> Option<&'static str> {
        match self.phase {
            Phase::Landing => Some("the landing goes on"),
            Phase::Returning => Some("the return goes on"),
            Phase::Hovering if *event == OperatorEvent::Left => Some("it hovers already"),
            _ if *event == OperatorEvent::Abandoned && self.flown_elsewhere.is_some() => Some("somebody else flies"),
            _ => None,
        }
    }

    /// Stops deciding and flying; open queries are cancelled.
    pub(super) fn hold(&mut self, now: Time, phase: Phase) {
        self.cancel_queries();
        self.stop_motion(now);
        self.manual = None;
        match self.phase {
            Phase::Ground | Phase::TakeOff => self.hold_after_take_off = true,
            _ => self.interrupt_landing(now, phase),
        }
        self.next_tick = now;
    }

    fn resume(&mut self, now: Time) {
        self.hold_after_take_off = false;
        if matches!(self.phase, Phase::Held | Phase::Manual | Phase::Hovering | Phase::Returning | Phase::Landing) {
            self.manual = None;
            self.rest_from(now);
            self.needs_rest = true;
            self.reopen(now);
            self.interrupt_landing(now, Phase::Flying);
            self.next_tick = now;
        }
    }

    /// Keeps out of these places from now on. The motion ends, for its way was not checked against them; the next decision leads
    /// around them. Flight by hand goes on.
    fn keep_out(&mut self, now: Time, mut places: Vec<KeepOut>) {
        // An order that crossed with the loss of the position may name places of before.
        places.retain(|place| self.voided.is_none_or(|last| place.id > last));
        self.stop_motion(now);
        self.policy.handle(PolicyEvent::KeepOut(&places));
        self.envelope.keep_out(&places);
        self.guiding.keep_out(places.iter().flat_map(|place| place.points(CELL)).map(Cell::of));
        self.kept_out = places;
    }

    /// Forgets the places to keep out of when the position was lost: nobody knows where they are now. What flew on its
    /// own holds, until the operator has marked them again and resumes.
    pub(super) fn void_kept_out(&mut self, now: Time) {
        let Some(last) = self.kept_out.iter().map(|place| place.id).max() else { return };
        self.voided = Some(last);
        self.keep_out(now, Vec::new());
        self.note(Note::Limited(
            "the position was lost, and is another now: the marked places are void; mark them again, then resume",
        ));
        if matches!(self.phase, Phase::Ground | Phase::TakeOff | Phase::Flying) {
            self.hold(now, Phase::Held);
        }
    }

    /// Forgets what belongs to the instruction until now: the target's place, height and track, and whom the craft follows.
    pub(super) fn forget_instruction(&mut self) {
        self.guiding.forget_target();
        self.guiding.forget_height();
        self.untrack();
        self.end_following();
    }

    fn instruct(&mut self, now: Time, text: String) {
        self.cancel_queries();
        self.stop_motion(now);
        self.needs_rest = true;
        self.forget_instruction();
        // A fresh start: the policy forgets the previous instruction.
        self.policy.handle(PolicyEvent::Instruction(&text));
        self.instruction = text;
        // Held by the operator it waits for `Resume`, also if the previous instruction had ended.
        if matches!(self.phase, Phase::Hovering | Phase::Returning | Phase::Landing) {
            self.resume(now);
        }
    }
}

/// Why places cannot be kept out of.
fn refused_places(places: &[KeepOut]) -> Option<&'static str> {
    let is_valid = places.len() <= MARKED_MOST && places.iter().all(KeepOut::is_valid);
    (!is_valid).then_some("at most 16 places with finite coordinates can be marked")
}

//! Watches a flight: whether every motion has a fresh reason.

use spf_core::command::Command;
use spf_core::envelope::Limits;
use spf_core::pilot::{Action, Event, Note, OperatorEvent, Outcome, Phase, Pilot};
use spf_core::time::{Duration, Time, duration_from_secs};
use spf_flight::run::Observer;

use super::faults::FlightPart;

/// Zero is commanded within this time of the end of a reason to move.
const STOP_RULE: Duration = Duration::from_millis(200);
/// Time for which an operator's setpoint moves the craft.
const BY_HAND: Duration = Duration::from_millis(400);

/// The record of a flight.
pub(crate) struct Watch {
    limits: Limits,
    /// Capture of the newest usable frame with a new capture counter.
    captured: Option<Time>,
    counter: Option<u64>,
    /// Measurement time of the newest telemetry.
    measured: Option<Time>,
    /// Since when no decision moves the craft; `None` while one does.
    without_reason: Option<Time>,
    by_hand: Option<Time>,
    asked: Option<Time>,
    first_motion: Option<Time>,
    first_manual: Option<Time>,
    phases: Vec<(Time, Phase)>,
    pub(crate) last_motion: Option<Time>,
    pub(crate) last_command: String,
    pub(crate) outcome: Option<(Outcome, String)>,
    pub(crate) violations: Vec<String>,
}

impl Watch {
    pub(crate) fn new(limits: Limits) -> Self {
        Self {
            limits,
            captured: None,
            counter: None,
            measured: None,
            without_reason: Some(Time::ZERO),
            by_hand: None,
            asked: None,
            first_motion: None,
            first_manual: None,
            phases: Vec::new(),
            last_motion: None,
            last_command: "none".to_owned(),
            outcome: None,
            violations: Vec::new(),
        }
    }

    /// When the pilot first entered a phase.
    pub(crate) fn entered(&self, phase: Phase) -> Option<Time> {
        self.phases.iter().find(|(_, entered)| *entered == phase).map(|(at, _)| *at)
    }

    /// Time at which a phase of the flight was well in progress.
    pub(crate) fn begin_of(&self, part: FlightPart) -> Option<Time> {
        let entered = |phase| self.entered(phase);
        let (at, after) = match part {
            FlightPart::TakeOff => (entered(Phase::TakeOff), 1000),
            FlightPart::Deciding => (self.asked, 300),
            FlightPart::Executing | FlightPart::Searching => (self.first_motion, 500),
            FlightPart::Manual => (self.first_manual, 1500),
            FlightPart::Landing => (entered(Phase::Landing), 300),
        };
        at.map(|at| at + Duration::from_millis(after))
    }

    fn moved(&mut self, now: Time, phase: Phase) {
        self.last_motion = Some(now);
        self.first_motion.get_or_insert(now);
        let mut wrong = |why: &str, since: Duration| {
            if self.violations.len() < 3 {
                self.violations.push(format!("at {now} it moves {why}, {:.2} s", since.as_secs_f64()));
            }
        };
        let old = duration_from_secs(self.limits.max_telemetry_age) + STOP_RULE;
        let age = now.since(self.measured.unwrap_or(Time::ZERO));
        if age > old {
            wrong("without telemetry", age);
        }
        match phase {
            Phase::Manual => {
                let released = now.since(self.by_hand.unwrap_or(Time::ZERO));
                if released > BY_HAND + STOP_RULE {
                    wrong("by a released key", released);
                }
            }
            Phase::Flying => {
                let age = now.since(self.captured.unwrap_or(Time::ZERO));
                if age > duration_from_secs(self.limits.max_frame_age) + STOP_RULE {
                    wrong("on an old frame", age);
                }
                let without = self.without_reason.map_or(Duration::ZERO, |since| now.since(since));
                if without > STOP_RULE {
                    wrong("without a decision", without);
                }
            }
            phase => wrong(&format!("in {phase:?}"), Duration::ZERO),
        }
    }
}

impl Observer for Watch {
    fn event(&mut self, now: Time, event: &Event) {
        match event {
            Event::Frame(frame) if frame.unusable.is_none() && self.counter != Some(frame.capture_counter) => {
                self.counter = Some(frame.capture_counter);
                self.captured = self.captured.max(Some(frame.captured));
            }
            Event::Telemetry(telemetry) => self.measured = self.measured.max(Some(telemetry.time)),
            Event::Operator(OperatorEvent::Setpoint(_)) => self.by_hand = Some(now),
            Event::Operator(_) | Event::LinkLost => self.without_reason = self.without_reason.or(Some(now)),
            _ => {}
        }
    }

    fn action(&mut self, now: Time, action: &Action, pilot: &Pilot) {
        match action {
            Action::Ask(_) => _ = self.asked.get_or_insert(now),
            Action::Command(cleared) => match *cleared.get() {
                Command::Setpoint(setpoint) => {
                    self.last_command = if setpoint.is_hold() { "hold" } else { "motion" }.to_owned();
                    if !setpoint.is_hold() {
                        if pilot.phase() == Phase::Manual {
                            self.first_manual.get_or_insert(now);
                        }
                        self.moved(now, pilot.phase());
                    }
                }
                Command::Manoeuvre(_) => self.moved(now, pilot.phase()),
                Command::TakeOff => "take-off".clone_into(&mut self.last_command),
                Command::Land => "land".clone_into(&mut self.last_command),
                Command::EmergencyStop => "cut motors".clone_into(&mut self.last_command),
            },
            Action::Note(Note::Phase(phase)) => self.phases.push((now, *phase)),
            Action::Note(Note::Decision(decision)) => match decision.step.as_str() {
                "move" => self.without_reason = None,
                _ => self.without_reason = self.without_reason.or(Some(now)),
            },
            Action::Note(Note::QueryFailed { .. }) => self.without_reason = self.without_reason.or(Some(now)),
            Action::Finished(ending) => self.outcome = Some((ending.outcome, ending.cause.clone())),
            _ => {}
        }
    }
}

//! What the keys do and when: take-off and landing, setpoints with their validity, and every reason to release. Sans-IO.

use std::collections::VecDeque;

use spf_core::command::{Command, Setpoint};
use spf_core::telemetry::FlightPhase;
use spf_core::time::{Duration, Time, duration_from_secs};
use spf_envelope::Cleared;
use spf_screen::profile::{Profile, Step};

use super::motion::{Motion, Wanted};
use crate::DroneEvent;

/// After this silence of the flight loop nothing is pressed, not even by a take-off that has begun.
const SILENCE: Duration = Duration::from_secs(2);
/// Shortest take-off and landing: the flight loop is told of them.
const SHORTEST: Duration = Duration::from_millis(300);

/// What the operator is told when keys of a take-off or a landing could not be pressed.
const NOT_TAKEN_OFF: &str = "not taken off: the keys could not be pressed";
const NOT_LANDED: &str = "not landed: the keys could not be pressed; the craft stays in the game where it is";

/// A part without which there is no flight.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Part {
    /// The keyboard.
    Keys,
    /// The capture of the window.
    Picture,
    /// The window itself: its program has ended.
    Window,
}

/// Why no key is pressed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Bar {
    /// The window cannot be seen.
    Hidden,
    /// The picture does not answer.
    Frozen,
}

#[derive(Debug)]
enum Phase {
    OnGround,
    TakingOff(Running),
    Flying,
    Landing(Running),
    Stopped,
}

/// Steps that are pressed, one after the other.
#[derive(Debug)]
struct Running {
    steps: Vec<Step>,
    begun: Time,
    /// A key of them could not be pressed.
    missed: bool,
}

impl Running {
    fn new(steps: Vec<Step>, begun: Time) -> Self {
        Self { steps, begun, missed: false }
    }

    fn ends(&self) -> Time {
        self.begun + duration_from_secs(self.steps.iter().map(|step| step.for_s).sum()).max(SHORTEST)
    }

    /// The step at this time.
    fn step(&self, now: Time) -> Option<&Step> {
        let mut end = self.begun;
        self.steps.iter().find(|step| {
            end += duration_from_secs(step.for_s);
            now < end
        })
    }

    /// Whether a key or a stick is still to be pressed, or is pressed now.
    fn awaits_key(&self, now: Time) -> bool {
        let mut end = self.begun;
        self.steps.iter().any(|step| {
            end += duration_from_secs(step.for_s);
            now < end && (step.hold.is_some() || step.push.is_some())
        })
    }
}

/// Decides what is pressed.
#[derive(Debug)]
pub(super) struct Control {
    take_off: Vec<Step>,
    landing: Vec<Step>,
    motion: Motion,
    phase: Phase,
    setpoint: Setpoint,
    valid_until: Time,
    heard: Time,
    /// Somebody has taken the focus.
    taken: bool,
    /// What cannot be used.
    broken: Vec<Part>,
    /// What the operator is to be told.
    complaint: Option<&'static str>,
    bars: Vec<Bar>,
    /// The motion of the keys that are down, of the mouse and of the sticks.
    done: Setpoint,
    events: VecDeque<(Time, DroneEvent)>,
}

impl Control {
    pub(super) fn new(now: Time, profile: &Profile) -> Self {
        let take_off = profile.reset.steps.iter().chain(&profile.take_off.steps).cloned().collect();
        Self {
            take_off,
            landing: profile.landing.steps.clone(),
            motion: Motion::new(&profile.controls),
            phase: Phase::OnGround,
            setpoint: Setpoint::HOLD,
            valid_until: now,
            heard: now,
            taken: false,
            broken: Vec::new(),
            complaint: None,
            bars: Vec::new(),
            done: Setpoint::HOLD,
            events: VecDeque::new(),
        }
    }

    /// The flight loop lives.
    pub(super) fn heartbeat(&mut self, now: Time) {
        self.heard = now;
    }

    pub(super) fn phase(&self) -> FlightPhase {
        match self.phase {
            Phase::OnGround => FlightPhase::OnGround,
            Phase::TakingOff(_) => FlightPhase::TakingOff,
            Phase::Flying => FlightPhase::Flying,
            Phase::Landing(_) => FlightPhase::Landing,
            Phase::Stopped => FlightPhase::Stopped,
        }
    }

    pub(super) fn apply(&mut self, now: Time, command: &Cleared<Command>) {
        self.handle(now, *command.get(), command.valid_until());
    }

    fn handle(&mut self, now: Time, command: Command, valid_until: Time) {
        match command {
            Command::TakeOff if matches!(self.phase, Phase::OnGround) => {
                self.phase = Phase::TakingOff(Running::new(self.take_off.clone(), now));
            }
            Command::Setpoint(setpoint) => {
                // A landing is taken over by a motion; the holds that come with it do not end it.
                if matches!(self.phase, Phase::Landing(_)) && !setpoint.is_hold() {
                    self.phase = Phase::Flying;
                }
                (self.setpoint, self.valid_until) = (setpoint, valid_until);
            }
            // It is repeated until the ground is reached.
            Command::Land if matches!(self.phase, Phase::Flying | Phase::TakingOff(_)) => self.land(now),
            Command::EmergencyStop => self.phase = Phase::Stopped,
            _ => {}
        }
    }

    fn land(&mut self, now: Time) {
        self.setpoint = Setpoint::HOLD;
        self.phase = Phase::Landing(Running::new(self.landing.clone(), now));
        self.miss(now);
    }

    /// Draws the consequence of keys that cannot be pressed: without them nothing takes off, and nothing lands.
    fn miss(&mut self, now: Time) {
        if self.can_press_steps(now) {
            return;
        }
        let may_press = self.may_press();
        match &mut self.phase {
            Phase::TakingOff(running) if running.awaits_key(now) => self.break_off(),
            Phase::Landing(running) if running.awaits_key(now) => {
                running.missed = true;
                if !may_press {
                    // It is not waited for: the craft stays in the game where it is.
                    (running.steps, running.begun) = (Vec::new(), now);
                }
            }
            _ => {}
        }
    }

    fn break_off(&mut self) {
        self.phase = Phase::OnGround;
        self.complaint = Some(NOT_TAKEN_OFF);
    }

    /// Whether the keys of a take-off or of a landing can be pressed.
    fn can_press_steps(&self, now: Time) -> bool {
        // The landing goes on when the flight loop is gone.
        let is_heard = now.since(self.heard) < SILENCE || matches!(self.phase, Phase::Landing(_));
        self.may_press() && is_heard && !self.bars.contains(&Bar::Hidden)
    }

    /// Whether a motion may be pressed.
    fn can_press_motion(&self, now: Time) -> bool {
        self.may_press() && self.bars.is_empty() && now < self.valid_until && matches!(self.phase, Phase::Flying)
    }

    /// Whether what [`poll`](Self::poll) wanted may still be pressed.
    pub(super) fn still(&self, now: Time) -> bool {
        match self.phase {
            Phase::TakingOff(_) | Phase::Landing(_) => self.can_press_steps(now),
            _ => self.can_press_motion(now),
        }
    }

    /// Ends the flight without the flight loop. The landing's keys are still pressed.
    pub(super) fn leave(&mut self, now: Time) {
        if matches!(self.phase, Phase::Flying | Phase::TakingOff(_)) {
            self.land(now);
        }
        self.setpoint = Setpoint::HOLD;
    }

    /// Whether it stands, or stays where it is for good.
    pub(super) fn is_over(&self) -> bool {
        matches!(self.phase, Phase::OnGround | Phase::Stopped)
    }

    fn may_press(&self) -> bool {
        !self.taken && self.broken.is_empty()
    }

    /// The window has lost the focus: somebody has taken over. Whether that is news.
    pub(super) fn lose_focus(&mut self, now: Time) -> bool {
        if self.taken || self.is_over() {
            return false;
        }
        self.taken = true;
        self.setpoint = Setpoint::HOLD;
        match self.phase {
            // Whether the craft has left the ground is not known.
            Phase::TakingOff(_) => self.break_off(),
            _ => self.miss(now),
        }
        self.events.push_back((now, DroneEvent::TakenOver));
        true
    }

    /// The operator has resumed, but the window did not get the focus: it is still taken.
    pub(super) fn refuse_resume(&mut self, now: Time) {
        if self.taken {
            self.events.push_back((now, DroneEvent::TakenOver));
        }
    }

    /// The window has the focus again, and the operator resumes.
    pub(super) fn take_back(&mut self, now: Time) {
        self.taken = false;
        self.set_broken(now, Part::Window, false);
    }

    /// Notes how many pictures per second the game draws, if fewer than are looked at.
    pub(super) fn draws(&mut self, pictures_per_s: Option<f64>) {
        self.motion.draws(pictures_per_s);
    }

    /// Whether only the operator's resume brings it back.
    pub(super) fn awaits_resume(&self) -> bool {
        self.taken || self.broken.contains(&Part::Window)
    }

    pub(super) fn is_taken(&self) -> bool {
        self.taken
    }

    /// Notes that a part cannot be used, or can again. Whether that is news.
    pub(super) fn set_broken(&mut self, now: Time, part: Part, broken: bool) -> bool {
        if broken == self.broken.contains(&part) {
            return false;
        }
        let was_whole = self.broken.is_empty();
        self.broken.retain(|other| *other != part);
        if broken {
            self.broken.push(part);
        }
        if was_whole != self.broken.is_empty() {
            self.events.push_back((now, if broken { DroneEvent::LinkLost } else { DroneEvent::LinkRestored }));
        }
        self.miss(now);
        true
    }

    /// What the operator is to be told, once.
    pub(super) fn take_complaint(&mut self) -> Option<&'static str> {
        self.complaint.take()
    }

    /// Notes a reason not to press keys, or that it has passed.
    pub(super) fn bar(&mut self, bar: Bar, is_barred: bool) {
        self.bars.retain(|other| *other != bar);
        if is_barred {
            self.bars.push(bar);
        }
    }

    pub(super) fn take_event(&mut self) -> Option<(Time, DroneEvent)> {
        self.events.pop_front()
    }

    /// What is to be pressed now.
    pub(super) fn poll(&mut self, now: Time) -> Wanted {
        self.miss(now);
        match &self.phase {
            Phase::TakingOff(running) if now >= running.ends() => self.phase = Phase::Flying,
            Phase::Landing(running) if now >= running.ends() => {
                self.complaint = running.missed.then_some(NOT_LANDED);
                self.phase = Phase::OnGround;
            }
            _ => {}
        }
        let setpoint = if self.can_press_motion(now) { self.setpoint } else { Setpoint::HOLD };
        self.motion.set(now, setpoint);
        let (Phase::TakingOff(running) | Phase::Landing(running)) = &self.phase else {
            let wanted = self.motion.poll(now);
            self.done = wanted.motion;
            return wanted;
        };
        self.done = Setpoint::HOLD;
        let step = running.step(now).filter(|_| self.can_press_steps(now));
        let mut wanted = Wanted { keys: step.and_then(|step| step.hold).into_iter().collect(), ..Wanted::default() };
        if let Some(stick) = step.and_then(|step| step.push) {
            wanted.sticks.push(stick, 1.0);
        }
        wanted
    }

    /// The motion for which the keys are pressed.
    pub(super) fn done(&self) -> Setpoint {
        self.done
    }
}

#[cfg(test)]
mod tests;

//! What the keys do and when: take-off and landing, setpoints with their validity, and every reason to release. Sans-IO.

use std::collections::VecDeque;

use spf_core::command::{Command, Setpoint};
use spf_core::envelope::Cleared;
use spf_core::telemetry::FlightPhase;
use spf_core::time::{Duration, Time, duration_from_secs};
use spf_screen::profile::{Profile, Step};

use super::motion::{Motion, Wanted};
use crate::DroneEvent;

/// After this silence of the flight loop nothing is pressed, not even by a take-off that has begun.
const SILENCE: Duration = Duration::from_secs(2);
/// Shortest take-off and landing: the flight loop is told of them.
const SHORTEST: Duration = Duration::from_millis(300);

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
}

impl Running {
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
    /// The keyboard or the display cannot be used.
    broken: bool,
    bars: Vec<Bar>,
    /// What the keys are pressed for.
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
            broken: false,
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
                self.phase = Phase::TakingOff(Running { steps: self.take_off.clone(), begun: now });
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
        // With keys that cannot be pressed nothing lands: the craft stays in the game where it is.
        let steps = if self.may_press() { self.landing.clone() } else { Vec::new() };
        self.phase = Phase::Landing(Running { steps, begun: now });
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
        !self.taken && !self.broken
    }

    /// The window has lost the focus: somebody has taken over.
    pub(super) fn lose_focus(&mut self, now: Time) {
        if self.taken || self.is_over() {
            return;
        }
        self.taken = true;
        self.setpoint = Setpoint::HOLD;
        match self.phase {
            Phase::TakingOff(_) => self.phase = Phase::Flying,
            Phase::Landing(_) => self.phase = Phase::Landing(Running { steps: Vec::new(), begun: now }),
            _ => {}
        }
        self.events.push_back((now, DroneEvent::TakenOver));
    }

    /// The window has the focus again, and the operator resumes.
    pub(super) fn take_back(&mut self) {
        self.taken = false;
    }

    pub(super) fn is_taken(&self) -> bool {
        self.taken
    }

    /// Whether keyboard and display can be used.
    pub(super) fn set_broken(&mut self, now: Time, broken: bool) {
        if broken != self.broken {
            self.broken = broken;
            self.events.push_back((now, if broken { DroneEvent::LinkLost } else { DroneEvent::LinkRestored }));
        }
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
        match &self.phase {
            Phase::TakingOff(running) if now >= running.ends() => self.phase = Phase::Flying,
            Phase::Landing(running) if now >= running.ends() => self.phase = Phase::OnGround,
            _ => {}
        }
        let is_fresh = now < self.valid_until;
        let may_move = self.may_press() && self.bars.is_empty() && is_fresh && matches!(self.phase, Phase::Flying);
        let setpoint = if may_move { self.setpoint } else { Setpoint::HOLD };
        self.done = self.motion.set(now, setpoint);
        let (Phase::TakingOff(running) | Phase::Landing(running)) = &self.phase else { return self.motion.poll(now) };
        // The landing goes on when the flight loop is gone.
        let is_heard = now.since(self.heard) < SILENCE || matches!(self.phase, Phase::Landing(_));
        let hidden = self.bars.contains(&Bar::Hidden);
        let step = running.step(now).filter(|_| self.may_press() && is_heard && !hidden);
        Wanted { keys: step.and_then(|step| step.hold).into_iter().collect(), mouse: 0 }
    }

    /// The motion for which the keys are pressed.
    pub(super) fn done(&self) -> Setpoint {
        self.done
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use spf_screen::profile::Key;

    use super::*;

    fn ms(ms: u64) -> Time {
        Time::from_millis(ms)
    }

    fn key(name: &str) -> Key {
        Key::named(name).unwrap()
    }

    fn flying() -> Control {
        let mut control = Control::new(ms(0), &Profile::shipped("spf-window").unwrap());
        control.handle(ms(0), Command::TakeOff, Time::MAX);
        // `t` for 0.3 s, then 5 s of waiting.
        assert_eq!((control.poll(ms(100)).keys, control.phase()), (vec![key("t")], FlightPhase::TakingOff));
        control.heartbeat(ms(400));
        assert_eq!(control.poll(ms(400)).keys, []);
        control.poll(ms(5300));
        assert_eq!(control.phase(), FlightPhase::Flying);
        control
    }

    fn ahead(control: &mut Control, now: u64) {
        let setpoint = Setpoint { forward: 4.0, ..Setpoint::HOLD };
        control.heartbeat(ms(now));
        control.handle(ms(now), Command::Setpoint(setpoint), ms(now + 500));
    }

    #[test]
    fn a_setpoint_is_pressed_as_long_as_it_is_valid() {
        let mut control = flying();
        ahead(&mut control, 6000);
        assert_eq!(control.poll(ms(6001)).keys, [key("w")]);
        assert_eq!(control.poll(ms(6499)).keys, [key("w")]);
        assert_eq!((control.poll(ms(6500)).keys, control.done()), (vec![], Setpoint::HOLD));
    }

    #[test]
    fn without_focus_nothing_is_pressed_until_the_operator_resumes() {
        let mut control = flying();
        ahead(&mut control, 6000);
        control.lose_focus(ms(6050));
        assert_eq!(control.take_event(), Some((ms(6050), DroneEvent::TakenOver)));
        ahead(&mut control, 6100);
        assert_eq!(control.poll(ms(6101)).keys, []);
        control.lose_focus(ms(6150));
        assert_eq!(control.take_event(), None);
        control.take_back();
        ahead(&mut control, 6200);
        assert_eq!(control.poll(ms(6201)).keys, [key("w")]);
    }

    #[test]
    fn a_hidden_window_and_a_frozen_picture_bar_every_motion() {
        let mut control = flying();
        for bar in [Bar::Hidden, Bar::Frozen] {
            ahead(&mut control, 6000);
            control.bar(bar, true);
            control.bar(bar, true);
            assert_eq!((control.poll(ms(6001)).keys, control.done()), (vec![], Setpoint::HOLD));
            control.bar(bar, false);
            assert_eq!(control.poll(ms(6002)).keys, [key("w")]);
        }
    }

    #[test]
    fn a_landing_goes_on_without_the_flight_loop_and_a_motion_takes_it_over() {
        let mut control = flying();
        control.handle(ms(6000), Command::Land, Time::MAX);
        control.handle(ms(6100), Command::Land, Time::MAX);
        control.handle(ms(6100), Command::Setpoint(Setpoint::HOLD), ms(6600));
        assert_eq!((control.poll(ms(6250)).keys, control.phase()), (vec![key("l")], FlightPhase::Landing));
        ahead(&mut control, 6300);
        control.poll(ms(6310));
        assert_eq!(control.phase(), FlightPhase::Flying);
        control.leave(ms(7000));
        assert_eq!(control.poll(ms(7100)).keys, [key("l")]);
        control.poll(ms(12_400));
        assert!(control.is_over());
        // A take-off that nobody attends presses nothing.
        control.handle(ms(13_000), Command::TakeOff, Time::MAX);
        assert_eq!(control.poll(ms(13_010)).keys, []);
    }

    #[test]
    fn with_a_broken_keyboard_it_ends_where_it_is() {
        let mut control = flying();
        control.set_broken(ms(6000), true);
        control.set_broken(ms(6001), true);
        assert_eq!((control.take_event(), control.take_event()), (Some((ms(6000), DroneEvent::LinkLost)), None));
        control.handle(ms(6100), Command::Land, Time::MAX);
        assert_eq!(control.poll(ms(6110)).keys, []);
        control.poll(ms(6400));
        assert!(control.is_over());
    }

    proptest! {
        /// Whatever happens in whatever order, nothing is pressed on the ground, without focus, or after the last setpoint ended.
        #[test]
        fn keys_need_a_reason(steps in proptest::collection::vec((0_u64..700, 0..9_u8), 1..120)) {
            let mut control = Control::new(ms(0), &Profile::shipped("spf-window").unwrap());
            let (mut now, mut valid) = (0, 0);
            for (passed, what) in steps {
                now += passed;
                control.heartbeat(ms(now));
                match what {
                    0 => control.handle(ms(now), Command::TakeOff, Time::MAX),
                    1 => control.handle(ms(now), Command::Land, Time::MAX),
                    2 => control.lose_focus(ms(now)),
                    3 => control.take_back(),
                    4 => control.set_broken(ms(now), passed % 2 == 0),
                    5 => control.bar(Bar::Hidden, passed % 2 == 0),
                    6 => control.bar(Bar::Frozen, passed % 2 == 0),
                    7 if passed > 600 => control.handle(ms(now), Command::EmergencyStop, Time::MAX),
                    _ => {
                        ahead(&mut control, now);
                        valid = now + 500;
                    }
                }
                let keys = control.poll(ms(now)).keys;
                let in_sequence = matches!(control.phase, Phase::TakingOff(_) | Phase::Landing(_));
                let may = control.may_press() && !control.bars.contains(&Bar::Hidden);
                if control.is_over() || !may || (!in_sequence && (now >= valid || !control.bars.is_empty())) {
                    prop_assert_eq!(keys, []);
                }
            }
        }
    }
}

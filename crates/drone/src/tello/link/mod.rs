//! The driver's protocol logic: commands and state of one Tello, without sockets and clocks.

use std::collections::VecDeque;

use spf_core::command::{Command, Setpoint};
use spf_core::telemetry::FlightPhase;
use spf_core::time::{Duration, Time};
use spf_envelope::Cleared;

mod leaving;
mod reach;
mod report;

use self::leaving::TakeOff;
use self::reach::Reach;
use self::report::Told;
use super::answer::{Answer, explain};
use super::conversation::{Conversation, Order, OrderOutcome};
use super::ground::{Ground, Repeats};
use super::imu::Imu;
pub use super::imu::MotionFault;
use super::manoeuvre::{self, Move, Stage};
use super::state::State;
use super::sticks::{Calibration, Sticks};
use crate::DroneEvent;
use crate::heartbeat::{Heartbeat, Silence};

/// Age of the state above which the link is lost.
const LOST: Duration = Duration::from_secs(2);
/// `land` is repeated after this long without reaching the ground.
const LAND_AGAIN: Duration = Duration::from_secs(1);
/// While no state arrives, `command` is repeated at this interval: the drone may have restarted.
const CALL_AGAIN: Duration = Duration::from_secs(1);
/// `emergency` is sent three times at once, at this interval …
const EMERGENCIES: u32 = 3;
const EMERGENCY_SPACING: Duration = Duration::from_millis(20);
/// … and then, until the state shows the motors off, at this one and at most this often.
const EMERGENCY_AGAIN: Duration = Duration::from_millis(200);
const EMERGENCIES_AGAIN: u32 = 25;
/// Height at which a take-off has left the ground, centimetres.
const LIFTED: i32 = 30;
/// A take-off without a response is complete once the drone has been at that height for this long.
const TAKEN_OFF: Duration = Duration::from_secs(3);
/// Interval between the zero setpoints before `land`, and `land`.
const ZEROS_FIRST: Duration = Duration::from_millis(80);

/// A message of the driver for the user.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Notice {
    /// A command was refused.
    Refused {
        /// The command.
        command: String,
        /// The drone's response.
        answer: String,
        /// Explanation of the response.
        meaning: &'static str,
    },
    /// No response arrived.
    Unanswered {
        /// The command.
        command: String,
    },
    /// A manoeuvre was not sent: an earlier command might still be answered, and the responses could be confused.
    Unsaid {
        /// The command.
        command: String,
    },
    /// The drone seems to have landed or stopped its motors by itself; a landing is commanded.
    MotorsOff,
    /// A `takeoff` had no response and no effect; a landing is commanded.
    NoTakeOff,
    /// The pilot does not call the driver any more: the drone holds, or lands.
    Unattended {
        /// Whether it lands.
        landing: bool,
    },
    /// One of the driver's threads failed; a landing is commanded.
    Failed,
    /// Its reported speed contradicts the commands to it; this counts as an error of its inertial measurement.
    Motion(MotionFault),
    /// The state arrives, but the drone responds to no command any more: the link counts as lost.
    Unheard,
}

/// The link to one Tello. Sans-IO.
#[derive(Debug)]
pub struct Link {
    calibration: Calibration,
    conversation: Conversation,
    sticks: Sticks,
    phase: FlightPhase,
    events: VecDeque<(Time, DroneEvent)>,
    notices: VecDeque<Notice>,
    state: State,
    /// Time of the last state.
    heard: Option<Time>,
    lost: bool,
    /// Whether commands arrive, as far as responses tell.
    reach: Reach,
    called: Time,
    land_again: Option<Time>,
    /// Whether `land` was sent since the landing began.
    land_sent: bool,
    /// The pilot began the landing, so a hold of the pilot ends it.
    interruptible: bool,
    emergencies: VecDeque<Time>,
    /// Evidence of standing on the ground.
    ground: Ground,
    repeats: Repeats,
    imu: Imu,
    take_off: Option<TakeOff>,
    heartbeat: Heartbeat,
    /// Since when the drone is at take-off height.
    high_since: Option<Time>,
    /// Velocities commanded, oldest first, for the direction of speeds.
    told: VecDeque<Told>,
    modelled: [f64; 3],
    rc_sent: u64,
    /// The manoeuvre being flown.
    manoeuvre: Option<Move>,
    /// Whether to request a key frame.
    key_wanted: bool,
}

/// Maximum number of events that wait for the pilot; the oldest telemetry makes room.
const EVENTS: usize = 64;

impl Link {
    /// A link to a drone in SDK mode, on the ground or in the air.
    #[must_use]
    pub fn new(calibration: Calibration) -> Self {
        Self {
            calibration,
            conversation: Conversation::default(),
            sticks: Sticks::default(),
            phase: FlightPhase::OnGround,
            events: VecDeque::new(),
            notices: VecDeque::new(),
            state: State::default(),
            heard: None,
            lost: false,
            reach: Reach::default(),
            called: Time::ZERO,
            land_again: None,
            land_sent: false,
            interruptible: false,
            emergencies: VecDeque::new(),
            ground: Ground::default(),
            repeats: Repeats::default(),
            imu: Imu::default(),
            take_off: None,
            heartbeat: Heartbeat::default(),
            high_since: None,
            told: VecDeque::new(),
            modelled: [0.0; 3],
            rc_sent: 0,
            manoeuvre: None,
            key_wanted: false,
        }
    }

    /// Takes over a drone that is in the air: it is flown from where it is, without a take-off command.
    pub fn adopt(&mut self, now: Time) {
        self.begin_flying(now);
    }

    /// Lands the drone because a part of the driver failed.
    pub fn fail(&mut self, now: Time) {
        if self.is_airborne() && self.land_again.is_none() {
            self.notices.push_back(Notice::Failed);
            self.begin_landing(now);
        }
    }

    /// Queues a command, such as `streamon`.
    pub fn order(&mut self, order: Order) {
        self.conversation.submit(order);
    }

    /// Requests the video again, because nothing decodable arrives, unless another command is pending. This has no effect on a
    /// drone that already sends it.
    pub fn ask_for_video(&mut self) {
        let busy = self.lost || !self.conversation.is_idle() || self.land_again.is_some() || self.phase == FlightPhase::Stopped;
        if !busy {
            self.conversation.submit(Order::quick("streamon"));
        }
    }

    /// Requests a key frame by `streamon`, because a loss has made all images until the next one undecodable. Only while
    /// the drone flies by setpoints: the answer is not waited for, and delays the next order with an `ok` by
    /// [`GRACE`](super::conversation::GRACE).
    pub fn ask_for_key_frame(&mut self) {
        self.key_wanted = self.phase == FlightPhase::Flying && !self.lost && self.land_again.is_none();
    }

    /// The newest state.
    #[must_use]
    pub fn state(&self) -> &State {
        &self.state
    }

    /// Whether something urgent is still to be sent: repetitions of `emergency`, until the telemetry
    /// shows the motors off.
    #[must_use]
    pub fn is_urgent(&self) -> bool {
        !self.emergencies.is_empty()
    }

    /// Number of `rc` commands sent.
    #[must_use]
    pub fn rc_sent(&self) -> u64 {
        self.rc_sent
    }

    /// The next event for the pilot.
    pub fn take_event(&mut self) -> Option<(Time, DroneEvent)> {
        self.events.pop_front()
    }

    /// The next message for the user.
    pub fn take_notice(&mut self) -> Option<Notice> {
        self.notices.pop_front()
    }

    /// Carries out a cleared command.
    pub fn apply(&mut self, now: Time, command: &Cleared<Command>) {
        match *command.get() {
            Command::TakeOff => {
                self.phase = FlightPhase::TakingOff;
                self.high_since = None;
                self.ground.forget();
                self.take_off = Some(TakeOff::new(now));
                // Never repeated: a response can take longer than 7 s, and the state shows the result.
                self.conversation.submit(Order::motion(TakeOff::COMMAND, Duration::from_millis(1500), Duration::from_secs(20)));
            }
            Command::Setpoint(setpoint) => {
                if self.phase == FlightPhase::Manoeuvring && setpoint.is_hold() {
                    self.end_manoeuvre(now);
                } else if self.phase == FlightPhase::Landing && self.interruptible && setpoint.is_hold() {
                    self.interrupt_landing(now, command.valid_until());
                } else if self.phase == FlightPhase::Flying {
                    self.sticks.set(self.calibration.sticks(setpoint), command.valid_until());
                    self.tell(now, setpoint, command.valid_until());
                }
            }
            Command::Manoeuvre(manoeuvre) if self.phase == FlightPhase::Flying => {
                let Some(begun) = Move::new(manoeuvre, now, command.valid_until(), self.calibration.yaw_rate) else { return };
                self.sticks.release();
                self.phase = FlightPhase::Manoeuvring;
                self.manoeuvre = Some(begun);
            }
            Command::Manoeuvre(_) => {}
            // Not announced in the capabilities.
            Command::Return | Command::Tilt(_) => {}
            // A repeated `Land` of the pilot is the same landing.
            Command::Land if self.land_again.is_some() => {}
            Command::Land => {
                self.begin_landing(now);
                self.interruptible = true;
            }
            Command::EmergencyStop => {
                self.sticks.release();
                self.manoeuvre = None;
                self.conversation.clear();
                self.phase = FlightPhase::Stopped;
                self.land_again = None;
                self.ground.forget();
                let first = (0..EMERGENCIES).map(|n| now + EMERGENCY_SPACING * n);
                let again = (1..=EMERGENCIES_AGAIN).map(|n| now + EMERGENCY_AGAIN * n);
                self.emergencies = first.chain(again).collect();
            }
        }
    }

    /// Handles a datagram from the drone's command port.
    pub fn handle_answer(&mut self, now: Time, datagram: &[u8]) {
        if let Answer::Refused(text) = Answer::read(datagram)
            && text.to_ascii_lowercase().starts_with("error motor stop")
            && self.phase == FlightPhase::Landing
            && self.land_sent
            && !self.may_still_rise(now)
            // An answer alone ends no flight: it may be late, or belong to an earlier command.
            && self.ground.looks_low()
        {
            self.on_ground();
        }
        self.reach.answered();
        self.restore(now);
        self.conversation.handle(now, datagram);
        self.settle(now);
    }

    /// Ends the loss of the link, if there is none any more.
    fn restore(&mut self, now: Time) {
        let silent = self.heard.is_some_and(|heard| now.since(heard) >= LOST);
        if self.lost && !silent && !self.reach.is_lost(now) {
            self.lost = false;
            self.events.push_back((now, DroneEvent::LinkRestored));
        }
    }

    /// Handles completed orders.
    fn settle(&mut self, now: Time) {
        while let Some((order, fate)) = self.conversation.take_ended() {
            let command = order.text.clone();
            match fate {
                OrderOutcome::Answered(Answer::Refused(answer)) => {
                    if command == TakeOff::COMMAND && self.phase == FlightPhase::TakingOff {
                        // The datagram may have arrived twice, with only the second one refused: the state decides
                        // whether the motors turn.
                        self.begin_landing(now);
                    }
                    let meaning = explain(&answer);
                    if self.is_airborne() && self.imu.refused(&answer) {
                        // The reaction must not wait for the next state line.
                        self.report_phase(now);
                    }
                    self.manoeuvre_over(now, &command);
                    self.notices.push_back(Notice::Refused { command, answer, meaning });
                }
                OrderOutcome::Answered(_) => {
                    if command == "takeoff" && self.phase == FlightPhase::TakingOff {
                        self.begin_flying(now);
                    }
                    self.manoeuvre_over(now, &command);
                }
                OrderOutcome::TimedOut => {
                    self.manoeuvre_over(now, &command);
                    self.notices.push_back(Notice::Unanswered { command });
                }
            }
        }
    }

    /// Ends the current manoeuvre, if any: removed if not sent yet, stopped otherwise.
    fn end_manoeuvre(&mut self, now: Time) {
        let Some(flown) = &mut self.manoeuvre else { return };
        match flown.stage {
            Stage::Resting => self.hover(now),
            Stage::Submitted if self.conversation.withdraw(&flown.text) => self.hover(now),
            Stage::Submitted => {
                flown.stage = Stage::Stopping;
                self.conversation.interrupt(now, manoeuvre::stop());
                // Sent in addition, for a drone on which stick input also ends a manoeuvre.
                self.sticks.set([0; 4], now);
                self.tell(now, Setpoint::HOLD, now);
            }
            Stage::Stopping => {}
        }
    }

    /// An order has completed: if it is the current manoeuvre, or its `stop`, setpoints apply again.
    fn manoeuvre_over(&mut self, now: Time, command: &str) {
        let is = |flown: &Move| if flown.stage == Stage::Stopping { command == manoeuvre::STOP } else { command == flown.text };
        if self.manoeuvre.as_ref().is_some_and(is) {
            self.hover(now);
        }
    }

    /// After a manoeuvre: sticks at rest, until a setpoint arrives.
    fn hover(&mut self, now: Time) {
        self.manoeuvre = None;
        self.sticks.set([0; 4], now);
        self.tell(now, Setpoint::HOLD, now);
        if self.phase == FlightPhase::Manoeuvring {
            self.phase = FlightPhase::Flying;
            self.reach.begin(now);
        }
    }

    /// Continues the cleared manoeuvre.
    fn fly_manoeuvre(&mut self, now: Time) {
        let Some(flown) = &mut self.manoeuvre else { return };
        if flown.stage == Stage::Resting && now >= flown.due() {
            flown.stage = Stage::Submitted;
            self.conversation.submit(flown.order());
        }
        // Whatever delayed it, it must not start at some later time.
        if flown.is_stale(now) && self.conversation.withdraw(&flown.text) {
            let command = flown.text.clone();
            self.notices.push_back(Notice::Unsaid { command });
            self.hover(now);
        } else if now >= flown.valid_until {
            self.end_manoeuvre(now);
        }
    }

    fn on_ground(&mut self) {
        self.phase = FlightPhase::OnGround;
        self.take_off = None;
        self.imu = Imu::default();
        self.reach = Reach::default();
        self.ground.forget();
        self.manoeuvre = None;
        self.land_again = None;
        self.sticks.release();
        self.told.clear();
        self.modelled = [0.0; 3];
    }

    fn begin_flying(&mut self, now: Time) {
        self.phase = FlightPhase::Flying;
        self.take_off = None;
        self.ground.forget();
        self.reach.begin(now);
        // From here on something is sent continuously.
        self.sticks.set([0; 4], now);
    }

    /// Handles a datagram from the state port.
    pub fn handle_state(&mut self, now: Time, datagram: &[u8]) {
        let Some(state) = State::read(datagram) else { return };
        let stale = self.repeats.is_stale(now, datagram);
        let before = self.heard.replace(now);
        self.restore(now);
        // The link works, but the values are old: the envelope treats them as missing.
        if stale {
            return;
        }
        self.state = state;
        self.judge_phase(now);
        self.model(now, before.unwrap_or(now));
        let [east, north, _] = self.modelled;
        let told = self.flies_by_sticks().then(|| libm::hypot(east, north));
        self.imu.observe(&self.state, before.map_or(Duration::ZERO, |before| now.since(before)), told);
        self.notices.extend(self.imu.take_found().map(Notice::Motion));
        self.report_phase(now);
    }

    fn report_phase(&mut self, now: Time) {
        // Somebody who floods the state port must not fill the memory, nor put old telemetry before the pilot.
        if self.events.len() >= EVENTS {
            let oldest = self.events.iter().position(|(_, event)| matches!(event, DroneEvent::Telemetry(_)));
            oldest.and_then(|index| self.events.remove(index));
        }
        self.events.push_back((now, DroneEvent::Telemetry(self.telemetry(now))));
    }

    /// In flight by setpoints, with no landing begun.
    fn flies_by_sticks(&self) -> bool {
        self.phase == FlightPhase::Flying && self.land_again.is_none()
    }

    /// Whether the evidence of the ground is unreliable yet: a `takeoff` in transit may still start the motors.
    fn may_still_rise(&self, now: Time) -> bool {
        self.take_off.is_some_and(|take_off| take_off.may_start(now))
    }

    /// Reacts to a pilot that does not call any more.
    fn check_heartbeat(&mut self, now: Time) {
        if !matches!(self.phase, FlightPhase::TakingOff | FlightPhase::Flying | FlightPhase::Manoeuvring) {
            return;
        }
        let Some(silence) = self.heartbeat.silence(now) else { return };
        self.notices.push_back(Notice::Unattended { landing: silence == Silence::Land });
        match (silence, self.phase) {
            (Silence::Land, _) => self.begin_landing(now),
            (Silence::Hold, FlightPhase::Manoeuvring) => self.end_manoeuvre(now),
            (Silence::Hold, FlightPhase::Flying) => {
                self.sticks.zero(now);
                self.tell(now, Setpoint::HOLD, now);
            }
            _ => {}
        }
    }

    /// Abandons a take-off that was not sent, or that did not happen.
    fn check_take_off(&mut self, now: Time) {
        let Some(take_off) = self.take_off.filter(|_| self.phase == FlightPhase::TakingOff) else { return };
        if take_off.is_late(now) && self.conversation.withdraw(TakeOff::COMMAND) {
            self.notices.push_back(Notice::Unsaid { command: TakeOff::COMMAND.to_owned() });
            self.on_ground();
            self.report_phase(now);
        } else if take_off.should_show(now) && !self.ground.motors_turned() && self.high_since.is_none() {
            self.notices.push_back(Notice::NoTakeOff);
            // It may have been carried out after all, without any evidence of it.
            self.begin_landing(now);
        }
    }

    /// Determines the flight phase from the state and the commands sent.
    fn judge_phase(&mut self, now: Time) {
        let height = self.state.height.unwrap_or(0).max(self.state.tof.unwrap_or(0));
        self.ground.observe(now, &self.state);
        let motors_off = self.ground.is_reached() && !self.may_still_rise(now);
        if height >= LIFTED {
            self.high_since.get_or_insert(now);
        } else {
            self.high_since = None;
        }
        match self.phase {
            FlightPhase::TakingOff if self.high_since.is_some_and(|since| now.since(since) >= TAKEN_OFF) => {
                self.begin_flying(now)
            }
            FlightPhase::Stopped if motors_off => self.emergencies.clear(),
            // Counted from the first `land` on.
            FlightPhase::Landing if motors_off && self.land_sent => self.on_ground(),
            // Even if this is certain, it costs nothing to send `land` to a drone on the ground.
            FlightPhase::Flying | FlightPhase::Manoeuvring if motors_off => {
                self.notices.push_back(Notice::MotorsOff);
                self.begin_landing(now);
            }
            _ => {}
        }
    }

    /// The next datagram to send to the drone's command port.
    pub fn poll(&mut self, now: Time) -> Option<String> {
        self.check_heartbeat(now);
        self.check_take_off(now);
        if self.emergencies.front().is_some_and(|at| *at <= now) {
            self.emergencies.pop_front();
            return Some("emergency".to_owned());
        }
        if self.land_again.is_some_and(|at| at <= now) {
            self.land_again = Some(now + LAND_AGAIN);
            self.land_sent = true;
            self.sticks.release();
            self.conversation.sent_outside(now);
            return Some("land".to_owned());
        }
        let silent = self.heard.is_some_and(|heard| now.since(heard) >= LOST);
        let unheard = self.flies_by_sticks() && self.reach.is_lost(now);
        if (silent || unheard) && !self.lost {
            self.lost = true;
            self.events.push_back((now, DroneEvent::LinkLost));
            if unheard {
                self.notices.push_back(Notice::Unheard);
            }
        }
        if silent && now.since(self.called) >= CALL_AGAIN {
            self.called = now;
            self.conversation.sent_outside(now);
            return Some("command".to_owned());
        }
        // `rc` commands leave gaps of some 80 ms; a setpoint that is due is sent with the next call.
        if std::mem::take(&mut self.key_wanted) && self.phase == FlightPhase::Flying {
            self.conversation.sent_outside(now);
            return Some("streamon".to_owned());
        }
        if self.flies_by_sticks() && self.reach.ask(now) {
            return Some(reach::QUESTION.to_owned());
        }
        if let Some(text) = self.sticks.poll(now) {
            self.rc_sent += 1;
            return Some(text);
        }
        self.fly_manoeuvre(now);
        let sent = self.conversation.poll(now);
        if sent.as_deref() == Some(TakeOff::COMMAND)
            && let Some(take_off) = &mut self.take_off
        {
            take_off.sent = Some(now);
        }
        let begun = self.manoeuvre.as_ref().filter(|flown| Some(&flown.text) == sent.as_ref());
        if let Some((velocity, until)) = begun.map(|flown| (flown.velocity, flown.valid_until)) {
            self.tell(now, velocity, until);
        }
        self.settle(now);
        sent
    }
}

#[cfg(test)]
mod tests;

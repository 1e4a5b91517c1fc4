//! The driver's logic: commands, answers and reports of one vehicle, without sockets and clocks.

mod drive;
mod notice;
mod request;
mod stage;
#[cfg(test)]
mod tests;

use std::collections::VecDeque;

use spf_core::command::{Command, Setpoint};
use spf_core::telemetry::{FlightPhase, Telemetry};
use spf_core::time::{Duration, Time};
use spf_envelope::Cleared;

use self::drive::Drive;
pub(super) use self::drive::VALID;
pub(super) use self::notice::Notice;
pub(super) use self::request::Request;
pub(super) use self::stage::Seen;
use self::stage::{Descent, Stage};
use crate::DroneEvent;
use crate::heartbeat::{Heartbeat, Silence};

/// No report for this long, or no answer to a call that is answered at once: the link is lost.
const LOST: Duration = Duration::from_secs(2);
const UNANSWERED: Duration = Duration::from_secs(3);
/// A take-off that the simulator refuses (it wants a craft at rest) is asked for again after this long, this often.
const TAKE_OFF_AGAIN: Duration = Duration::from_secs(1);
const TAKE_OFFS: u32 = 3;
/// A take-off without an answer is judged by the height after this long.
const TAKE_OFF_TIME: Duration = Duration::from_secs(25);
/// In the air, metres above where it stood.
const IN_THE_AIR: f64 = 0.5;
/// A landing that has ended in the air is commanded again after this long.
const LAND_AGAIN: Duration = Duration::from_secs(1);
/// A craft whose height changes by less than this, metres, for this long, stands.
const STILL: f64 = 0.05;
const STANDS_FOR: Duration = Duration::from_secs(1);
/// A landing that has ended is commanded again if the craft does not stand after this long.
const STANDS_WITHIN: Duration = Duration::from_secs(3);
/// From the hover to the landing.
const HOVERS_FOR: Duration = Duration::from_millis(100);
/// Control counts as given after this long, and as taken by somebody else if it is not there then.
const CONTROL_WITHIN: Duration = Duration::from_secs(2);
/// Longest list of calls without an answer, and of events that wait.
const MOST_OPEN: usize = 256;
const EVENTS: usize = 64;
/// Numbers of calls wrap here, as those of the simulator's own client.
pub(super) const NUMBERS: u32 = 1 << 30;

/// One vehicle. Sans-IO.
#[derive(Debug)]
pub(super) struct Control {
    stage: Stage,
    drive: Drive,
    setpoint: Option<(Setpoint, Time)>,
    /// The number of the next call; calls that wait, and those that wait for an answer.
    number: u32,
    due: VecDeque<Request>,
    open: VecDeque<(u32, Request, Time)>,
    /// Since when control was asked for; `None` if it was given back.
    control_since: Option<Time>,
    seen: Option<Seen>,
    /// Last report whose time had advanced.
    heard: Time,
    lost: bool,
    heartbeat: Heartbeat,
    collided: bool,
    resumed: bool,
    said_not_ours: bool,
    /// The last refusal that the user has read.
    said: Option<Notice>,
    events: VecDeque<(Time, DroneEvent)>,
    notices: VecDeque<Notice>,
}

impl Control {
    /// A vehicle that is only watched.
    pub(super) fn new(now: Time) -> Self {
        Self {
            stage: Stage::Watching,
            drive: Drive::default(),
            setpoint: None,
            number: 0,
            due: VecDeque::new(),
            open: VecDeque::new(),
            control_since: None,
            seen: None,
            heard: now,
            lost: false,
            heartbeat: Heartbeat::default(),
            collided: false,
            resumed: false,
            said_not_ours: false,
            said: None,
            events: VecDeque::new(),
            notices: VecDeque::new(),
        }
    }

    /// Whether its last report shows it in the air.
    pub(super) fn is_seen_in_the_air(&self) -> bool {
        self.seen.is_some_and(|seen| !seen.landed && seen.height > IN_THE_AIR)
    }

    /// Begins to fly it. Returns whether it is in the air, and is then flown from where it is.
    pub(super) fn engage(&mut self, now: Time) -> bool {
        let flies = self.is_seen_in_the_air();
        self.take_control(now);
        self.stage = if flies { Stage::Flying } else { Stage::Idle };
        self.drive.stop(now);
        flies
    }

    fn take_control(&mut self, now: Time) {
        self.control_since = Some(now);
        self.due.push_back(Request::Control(true));
    }

    /// Carries out a cleared command.
    pub(super) fn apply(&mut self, now: Time, command: &Cleared<Command>) {
        match *command.get() {
            Command::TakeOff if self.stage == Stage::Idle => {
                // The take-off follows once it is armed: the two may be carried out in any order.
                self.due.push_back(Request::Arm(true));
                self.stage = Stage::TakingOff { since: now, again: None, tries: 1 };
            }
            Command::Setpoint(setpoint) => self.fly(now, setpoint, command.valid_until()),
            Command::Land => match self.stage {
                Stage::TakingOff { .. } | Stage::Flying => self.begin_landing(now, true),
                Stage::Released => {
                    if !std::mem::replace(&mut self.said_not_ours, true) {
                        self.notices.push_back(Notice::NotOurs { what: "landing" });
                    }
                    self.events.push_back((now, DroneEvent::NotLanded));
                }
                _ => {}
            },
            Command::EmergencyStop => {
                (self.stage, self.setpoint) = (Stage::Stopped, None);
                self.due.clear();
                // In case one is lost; on the ground it changes nothing.
                self.due.extend([Request::Arm(false); 3]);
            }
            // None of these is announced in the capabilities.
            Command::TakeOff | Command::Manoeuvre(_) | Command::Return | Command::Tilt(_) => {}
        }
    }

    fn fly(&mut self, now: Time, setpoint: Setpoint, until: Time) {
        match self.stage {
            Stage::Flying => self.setpoint = Some((setpoint, until)),
            // A hold, and nothing else, ends a landing that the pilot began.
            Stage::Landing { by_pilot: true, .. } if setpoint.is_hold() => {
                self.stage = Stage::Flying;
                self.drive.stop(now);
            }
            Stage::Released if self.resumed && !setpoint.is_hold() => {
                (self.resumed, self.said_not_ours) = (false, false);
                self.take_control(now);
                (self.stage, self.setpoint) = (Stage::Flying, Some((setpoint, until)));
            }
            _ => {}
        }
    }

    /// The operator resumes.
    pub(super) fn resume(&mut self) {
        self.resumed |= self.stage == Stage::Released;
    }

    /// Zero, hover, then the simulator's own landing.
    fn begin_landing(&mut self, now: Time, by_pilot: bool) {
        self.setpoint = None;
        // A take-off that was not sent must not be.
        self.due.retain(|request| !matches!(request, Request::TakeOff));
        self.drive.stop(now);
        self.stage = Stage::Landing { step: Descent::Brakes, by_pilot };
    }

    /// Lands the craft, if it is in the air and ours; called again until it is not [in the air](Self::is_airborne). Nothing but the
    /// cutting of the motors ends such a landing.
    pub(super) fn leave(&mut self, now: Time) {
        match &mut self.stage {
            Stage::TakingOff { .. } | Stage::Flying => self.begin_landing(now, false),
            Stage::Landing { by_pilot, .. } => *by_pilot = false,
            _ => {}
        }
    }

    /// Stops the motors and gives control back, once it is on the ground.
    pub(super) fn part(&mut self) {
        match self.stage {
            Stage::Released => self.notices.push_back(Notice::LeftInTheAir),
            // In the air after all: it stays where it is.
            Stage::TakingOff { .. } | Stage::Flying | Stage::Landing { .. } => self.due.push_back(Request::Hover),
            Stage::Idle | Stage::Stopped if self.control_since.take().is_some() => {
                self.due.extend([Request::Arm(false), Request::Control(false)]);
            }
            _ => {}
        }
        self.stage = Stage::Watching;
    }

    /// Lands the craft because a part of the driver failed.
    pub(super) fn fail(&mut self, now: Time) {
        if self.is_airborne() {
            self.notices.push_back(Notice::Failed);
            self.leave(now);
        }
    }

    /// How long its landing may take from where it is: the simulator's own descends at 0.2 m/s.
    pub(super) fn landing_time(&self) -> Duration {
        // The ground may be lower than where it started.
        const LEAST: f64 = 120.0;
        const SLOWEST: f64 = 0.15;
        // No simulator's sky is higher.
        let height = self.seen.map_or(0.0, |seen| seen.height).clamp(0.0, 10_000.0);
        Duration::from_secs_f64(LEAST + height / SLOWEST)
    }

    /// Whether it is, or may be, in the air under our control.
    pub(super) fn is_airborne(&self) -> bool {
        matches!(self.stage, Stage::TakingOff { .. } | Stage::Flying | Stage::Landing { .. })
    }

    /// Whether it stands on the ground; before anything is commanded, as the simulator says.
    pub(super) fn stands(&self, landed: bool) -> bool {
        self.stage == Stage::Idle || self.stage == Stage::Watching && landed
    }

    /// Whether everything that is answered at once was sent and answered.
    pub(super) fn is_settled(&self) -> bool {
        self.due.is_empty() && !self.open.iter().any(|(_, request, _)| request.is_short())
    }

    /// Records that the pilot is alive.
    pub(super) fn heartbeat(&mut self, now: Time) {
        self.heartbeat.beat(now);
    }

    /// Its phase.
    pub(super) fn phase(&self) -> FlightPhase {
        match self.stage {
            Stage::Watching | Stage::Idle => FlightPhase::OnGround,
            Stage::TakingOff { .. } => FlightPhase::TakingOff,
            Stage::Flying | Stage::Released => FlightPhase::Flying,
            Stage::Landing { .. } => FlightPhase::Landing,
            Stage::Stopped => FlightPhase::Stopped,
        }
    }

    /// Takes a report that is newer than the last one, and what of it the pilot is told.
    pub(super) fn handle_report(&mut self, now: Time, seen: Seen, told: Telemetry) {
        (self.heard, self.seen) = (now, Some(seen));
        self.restore(now);
        self.watch_landing(seen);
        // Whoever floods us with reports must not fill the memory.
        if self.events.len() >= EVENTS {
            let oldest = self.events.iter().position(|(_, event)| matches!(event, DroneEvent::Telemetry(_)));
            drop(oldest.and_then(|index| self.events.remove(index)));
        }
        let telemetry = Telemetry { phase: self.phase(), crashed: self.collided, ..told };
        self.events.push_back((now, DroneEvent::Telemetry(telemetry)));
    }

    /// A report that cannot be used; said once until one can.
    pub(super) fn warn(&mut self, why: &'static str) {
        self.notices.push_back(Notice::NoPose { why });
    }

    /// The craft has touched something since this was asked last. On the ground it always has, and where it lands.
    pub(super) fn handle_collision(&mut self, object: &str) {
        let height = self.seen.map_or(0.0, |seen| seen.height);
        let counts = match self.stage {
            Stage::Flying | Stage::Released => true,
            Stage::TakingOff { .. } | Stage::Landing { step: Descent::Brakes | Descent::Hovers { .. }, .. } => {
                height > IN_THE_AIR
            }
            _ => false,
        };
        if counts && !std::mem::replace(&mut self.collided, true) {
            self.notices.push_back(Notice::Collided { object: object.chars().take(80).collect() });
        }
    }

    /// Whether the simulator says that it is controlled by a program.
    pub(super) fn handle_control(&mut self, now: Time, given: bool) {
        let expected = self.control_since.is_some_and(|since| now.since(since) >= CONTROL_WITHIN);
        if !given && expected && self.is_airborne() {
            self.due.clear();
            (self.stage, self.setpoint, self.control_since) = (Stage::Released, None, None);
            self.notices.push_back(Notice::TakenOver);
            self.events.push_back((now, DroneEvent::TakenOver));
        }
    }

    /// The answer to a call: `true` if it ended as it should; an error's text.
    pub(super) fn handle_answer(&mut self, now: Time, number: u32, answer: Result<bool, String>) {
        let Some(index) = self.open.iter().position(|(open, ..)| *open == number) else { return };
        let Some((_, request, _)) = self.open.remove(index) else { return };
        self.restore(now);
        match (request, &answer) {
            (Request::TakeOff, Ok(true)) => self.taken_off(now),
            (Request::TakeOff, _) => self.no_take_off(now, answer),
            (Request::Arm(true), Ok(true)) if matches!(self.stage, Stage::TakingOff { .. }) => {
                self.due.push_back(Request::TakeOff)
            }
            (Request::Arm(true), Ok(false) | Err(_)) if matches!(self.stage, Stage::TakingOff { .. }) => {
                self.due.clear();
                self.refuse(request, answer);
                self.stage = Stage::Idle;
            }
            (Request::Land, Ok(true)) => self.landing_ended(now),
            // Cut off by our own next call, or out of its time.
            (Request::Land, Ok(_)) => self.land_again(now),
            (Request::Land, Err(_)) => {
                self.refuse(request, answer);
                self.land_again(now);
            }
            // A velocity is cut off by the next one.
            (Request::Fly(_) | Request::Hover, Ok(_)) | (_, Ok(true)) => {}
            _ => self.refuse(request, answer),
        }
    }

    fn refuse(&mut self, request: Request, answer: Result<bool, String>) {
        let why = answer.err().unwrap_or_else(|| "it answers false".to_owned()).chars().take(300).collect();
        let notice = Notice::Refused { what: request.words(), why };
        // A velocity is refused twenty times a second.
        if self.said != Some(notice.clone()) {
            self.said = Some(notice.clone());
            self.notices.push_back(notice);
        }
    }

    fn is_high(&self) -> bool {
        self.seen.is_some_and(|seen| seen.height > IN_THE_AIR)
    }

    fn taken_off(&mut self, now: Time) {
        if matches!(self.stage, Stage::TakingOff { .. }) {
            self.stage = Stage::Flying;
            self.drive.stop(now);
        }
    }

    fn no_take_off(&mut self, now: Time, answer: Result<bool, String>) {
        let Stage::TakingOff { since, tries, .. } = self.stage else { return };
        if self.is_high() {
            return self.taken_off(now);
        }
        self.refuse(Request::TakeOff, answer);
        self.stage = if tries < TAKE_OFFS {
            Stage::TakingOff { since, again: Some(now + TAKE_OFF_AGAIN), tries: tries + 1 }
        } else {
            Stage::Idle
        };
    }

    fn land_again(&mut self, now: Time) {
        if let Stage::Landing { step: Descent::Descends { again, .. }, .. } = &mut self.stage {
            *again = Some(now + LAND_AGAIN);
        }
    }

    /// The simulator says that its landing has ended well. Whether it stands is for its reports to show; if they do not, it is commanded
    /// again.
    fn landing_ended(&mut self, now: Time) {
        if let Stage::Landing { step: Descent::Descends { again, ended, .. }, .. } = &mut self.stage {
            (*ended, *again) = (Some(now), Some(now + STANDS_WITHIN));
        }
    }

    /// It stands once the simulator says so, in its state or by the end of its landing, and its height has been the same for a while: on
    /// one word alone, motors would be cut in the air.
    fn watch_landing(&mut self, seen: Seen) {
        let Stage::Landing { step: Descent::Descends { since, ended, rests, .. }, .. } = &mut self.stage else { return };
        if seen.at <= *since {
            return;
        }
        let still = rests.filter(|(_, height)| (height - seen.height).abs() < STILL);
        let (from, _) = *rests.insert(still.unwrap_or((seen.at, seen.height)));
        if (seen.landed || ended.is_some()) && seen.at.since(from) >= STANDS_FOR {
            self.on_ground();
        }
    }

    fn on_ground(&mut self) {
        (self.stage, self.setpoint, self.drive) = (Stage::Idle, None, Drive::Hovers);
        self.due.push_back(Request::Arm(false));
    }

    /// The connection was made anew: nobody answers what was asked on the old one.
    pub(super) fn reconnected(&mut self, now: Time) {
        let open: Vec<Request> = self.open.drain(..).map(|(_, request, _)| request).collect();
        if self.control_since.is_some() {
            self.due.push_front(Request::Control(true));
            self.control_since = Some(now);
        }
        // The motors stay cut, whether or not that has arrived.
        if open.contains(&Request::Arm(false)) || self.stage == Stage::Stopped {
            self.due.push_back(Request::Arm(false));
        }
        if open.contains(&Request::TakeOff) || open.contains(&Request::Arm(true)) {
            self.no_take_off(now, Err("the connection was lost".to_owned()));
        }
        if open.contains(&Request::Land) {
            self.land_again(now);
        }
        if self.stage == Stage::Flying {
            self.drive.stop(now);
        }
    }

    /// Ends the loss of the link, if there is none any more.
    fn restore(&mut self, now: Time) {
        if self.lost && now.since(self.heard) < LOST && !self.is_unanswered(now) {
            self.lost = false;
            self.events.push_back((now, DroneEvent::LinkRestored));
        }
    }

    /// Whether a call that is answered at once was not: its connection may be dead, and another is to be made.
    pub(super) fn is_unanswered(&self, now: Time) -> bool {
        self.open.iter().any(|(_, request, at)| request.is_short() && now.since(*at) >= UNANSWERED)
    }

    fn watch_link(&mut self, now: Time) {
        let unanswered = self.is_unanswered(now);
        if !self.lost && (unanswered || now.since(self.heard) >= LOST) {
            self.lost = true;
            self.events.push_back((now, DroneEvent::LinkLost));
            if unanswered {
                self.notices.push_back(Notice::Unanswered);
            }
        }
    }

    fn watch_pilot(&mut self, now: Time) {
        let flies = matches!(self.stage, Stage::TakingOff { .. } | Stage::Flying | Stage::Landing { by_pilot: true, .. });
        let Some(silence) = flies.then(|| self.heartbeat.silence(now)).flatten() else { return };
        match silence {
            Silence::Hold if self.stage == Stage::Flying => {
                self.setpoint = None;
                self.notices.push_back(Notice::Unattended { landing: false });
            }
            Silence::Hold => {}
            Silence::Land => {
                self.notices.push_back(Notice::Unattended { landing: true });
                self.leave(now);
            }
        }
    }

    /// What depends on time alone.
    pub(super) fn tick(&mut self, now: Time) {
        self.watch_pilot(now);
        self.watch_link(now);
    }

    /// The next call to send, with its number.
    pub(super) fn poll(&mut self, now: Time) -> Option<(u32, Request)> {
        let request = self.due.pop_front().or_else(|| self.next_of_stage(now))?;
        let number = self.number;
        self.number = (number + 1) % NUMBERS;
        if self.open.len() >= MOST_OPEN {
            self.open.pop_front();
        }
        self.open.push_back((number, request, now));
        Some((number, request))
    }

    fn next_of_stage(&mut self, now: Time) -> Option<Request> {
        let seen = self.seen;
        match &mut self.stage {
            Stage::Flying => {
                let wanted = self.setpoint.filter(|(_, until)| now < *until).map_or(Setpoint::HOLD, |(setpoint, _)| setpoint);
                self.drive.poll(now, wanted, seen.as_ref())
            }
            Stage::TakingOff { again, .. } if again.is_some_and(|at| now >= at) => {
                *again = None;
                Some(Request::Arm(true))
            }
            Stage::TakingOff { since, .. } if now.since(*since) >= TAKE_OFF_TIME => {
                if self.is_high() {
                    self.taken_off(now);
                } else {
                    self.refuse(Request::TakeOff, Err(format!("no answer within {} s", TAKE_OFF_TIME.as_secs())));
                    self.begin_landing(now, false);
                }
                None
            }
            Stage::Landing { step, .. } => match *step {
                Descent::Brakes => {
                    let request = self.drive.poll(now, Setpoint::HOLD, seen.as_ref());
                    if self.drive == Drive::Hovers {
                        *step = Descent::Hovers { until: now + HOVERS_FOR };
                    }
                    request
                }
                Descent::Hovers { until } if now >= until => {
                    *step = Descent::Descends { since: now, again: None, ended: None, rests: None };
                    Some(Request::Land)
                }
                Descent::Descends { again: Some(again), .. } if now >= again => {
                    *step = Descent::Descends { since: now, again: None, ended: None, rests: None };
                    Some(Request::Land)
                }
                Descent::Hovers { .. } | Descent::Descends { .. } => None,
            },
            _ => None,
        }
    }

    /// The next event for the pilot.
    pub(super) fn take_event(&mut self) -> Option<(Time, DroneEvent)> {
        self.events.pop_front()
    }

    /// Whether an event waits for the pilot.
    pub(super) fn has_event(&self) -> bool {
        !self.events.is_empty()
    }

    /// The next message for the user.
    pub(super) fn take_notice(&mut self) -> Option<Notice> {
        self.notices.pop_front()
    }
}

//! The phases of a flight: what the craft, the operator and the time make of them.

use crate::event::{Ending, LetGo, OperatorEvent, Outcome, Phase};
use crate::policy::FailReason;
use spf_core::command::Setpoint;
use spf_core::keep_out::{KeepOut, MARKED_MOST};
use spf_core::telemetry::FlightPhase;
use spf_core::time::{Duration, Time};
use spf_envelope::Cause;

/// How long the craft hovers after the end of an instruction.
const HOVER_TIME: Duration = Duration::from_secs(60);
/// How long a craft may still report that it lands after its landing was interrupted.
const OBEYS_WITHIN: Duration = Duration::from_secs(2);
/// Manual flight pauses the flight time limit for this long after each setpoint.
const AT_THE_KEYS: Duration = Duration::from_secs(60);
/// A craft that does not report flying this long after take-off is abandoned.
pub(crate) const TAKE_OFF_TIME: Duration = Duration::from_secs(30);
/// The flight ends if the craft does not report being on the ground this long after `Land`.
const LANDING_TIME: Duration = Duration::from_secs(90);
/// The craft must report that it returns within this time, or it is landed where it is.
const RETURN_BEGINS: Duration = Duration::from_secs(10);
/// A return that has not ended by then becomes a landing.
const RETURN_TIME: Duration = Duration::from_secs(600);
/// How long a manual setpoint is held without a new one, so that a released key stops the craft.
const MANUAL_VALIDITY: Duration = Duration::from_millis(400);
/// Setpoints that follow each other within this time are those of one held key: longer than the delay after which a terminal
/// begins to repeat it.
const HELD_KEY: Duration = Duration::from_millis(700);

/// The phase, and what bears upon it.
#[derive(Debug)]
pub(crate) struct Flight {
    /// Latest time passed in; earlier times are treated as equal to it.
    now: Time,
    pub(crate) phase: Phase,
    entered: Time,
    /// The phase that the craft reports.
    pub(crate) craft: FlightPhase,
    pub(crate) link_lost: bool,
    pub(crate) ending: Option<Ending>,
    pub(crate) instruction: String,
    counted: Counted,
    hands: Hands,
    landing: Landing,
    /// Somebody else flies the craft.
    elsewhere: Option<Elsewhere>,
    pub(crate) start: Start,
}

/// Before the craft is in the air.
#[derive(Debug, Default)]
pub(crate) struct Start {
    /// Time since which the camera alone has been delaying take-off.
    pub(crate) ready_since: Option<Time>,
    /// The operator wants a hold once it flies.
    pub(crate) then_hold: bool,
}

/// Flight time that counts against its limit.
#[derive(Debug, Default)]
struct Counted {
    /// Time from which it is counted, advanced by the time flown by hand; and up to which it is.
    from: Time,
    to: Time,
}

/// The operator's hands at the controls.
#[derive(Debug, Default)]
struct Hands {
    /// The setpoint flown by hand, and until when.
    setpoint: Option<(Setpoint, Time)>,
    /// When the last one was flown, and when the last one came, also an ignored one.
    flown: Option<Time>,
    heard: Option<Time>,
}

/// A landing under way.
#[derive(Debug, Default)]
struct Landing {
    /// Why it must not be interrupted.
    must: Option<&'static str>,
    /// When the operator took over one that the craft may still be flying.
    taken_over: Option<Time>,
}

/// Somebody else flies, and not by our commands.
#[derive(Clone, Copy, Debug, Default)]
struct Elsewhere {
    /// Whether whoever had our controls has left them since.
    abandoned: bool,
}

/// What follows from a report of the craft's phase.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum CraftNews {
    /// Nothing.
    None,
    /// It hit something.
    Crashed,
    /// It is in the air; this includes a craft that is already flying when first heard of, which is flown from where it is.
    Airborne,
    /// Take-off began, and it is on the ground again: it has given up, and reports why itself.
    Refused,
    /// Its landing, or return, has ended.
    Landed,
    /// It lands or has stopped by itself (its own battery or link protection): follow it, never fight it.
    LandedByItself,
}

/// What is due at a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Due {
    Nothing,
    TakeOff,
    NoTakeOff,
    OutOfTime,
    HoverOver,
    /// The craft does not return, for this reason.
    NoReturn(&'static str),
    LandingOver,
    LandAgain,
}

impl Flight {
    pub(crate) fn new(instruction: String) -> Self {
        Self {
            now: Time::ZERO,
            phase: Phase::Ground,
            entered: Time::ZERO,
            craft: FlightPhase::OnGround,
            link_lost: false,
            ending: None,
            instruction,
            counted: Counted::default(),
            hands: Hands::default(),
            landing: Landing::default(),
            elsewhere: None,
            start: Start::default(),
        }
    }

    /// The time, which never goes back.
    pub(crate) fn clock(&mut self, now: Time) -> Time {
        self.now = self.now.max(now);
        self.now
    }

    pub(crate) fn now(&self) -> Time {
        self.now
    }

    /// Enters a phase; returns whether it is a new one.
    pub(crate) fn enter(&mut self, now: Time, phase: Phase) -> bool {
        let is_new = self.phase != phase;
        if is_new {
            (self.phase, self.entered) = (phase, now);
        }
        is_new
    }

    /// Sets the outcome; the first cause wins.
    pub(crate) fn settle(&mut self, ending: Ending) -> Option<Ending> {
        if self.ending.is_some() {
            return None;
        }
        self.ending = Some(ending.clone());
        Some(ending)
    }

    /// Takes the phase that the craft reports.
    pub(crate) fn observe(&mut self, now: Time, reported: FlightPhase, crashed: bool) -> CraftNews {
        let before = core::mem::replace(&mut self.craft, reported);
        if crashed && self.phase != Phase::Ended {
            return CraftNews::Crashed;
        }
        match (self.phase, reported) {
            (Phase::Ground | Phase::TakeOff, FlightPhase::Flying) => CraftNews::Airborne,
            (Phase::TakeOff, FlightPhase::OnGround) if matches!(before, FlightPhase::TakingOff | FlightPhase::Landing) => {
                CraftNews::Refused
            }
            (Phase::Landing | Phase::Returning, FlightPhase::OnGround | FlightPhase::Stopped) => CraftNews::Landed,
            (
                Phase::Flying | Phase::Held | Phase::Manual | Phase::Hovering,
                FlightPhase::Landing | FlightPhase::OnGround | FlightPhase::Stopped,
            )
            | (Phase::TakeOff, FlightPhase::Stopped)
                if !self.is_still_landing(now) =>
            {
                CraftNews::LandedByItself
            }
            _ => CraftNews::None,
        }
    }

    /// Whether a report of the craft that it lands is the landing that was just interrupted.
    fn is_still_landing(&self, now: Time) -> bool {
        self.craft == FlightPhase::Landing && self.landing.taken_over.is_some_and(|at| now.since(at) < OBEYS_WITHIN)
    }

    /// The time-driven transition that is due: take-off, its timeout, the flight's time limit, the end of landing; `land_again` is
    /// when `Land` is to be repeated.
    pub(crate) fn due(&self, now: Time, max_time: Duration, land_again: Time) -> Due {
        let waited = now.since(self.entered);
        match self.phase {
            Phase::Ground => Due::TakeOff,
            Phase::TakeOff if waited >= TAKE_OFF_TIME => Due::NoTakeOff,
            Phase::Flying | Phase::Held | Phase::Manual | Phase::TakeOff if self.is_out_of_time(now, max_time) => Due::OutOfTime,
            Phase::Hovering if waited >= HOVER_TIME => Due::HoverOver,
            Phase::Returning if waited >= RETURN_BEGINS && self.craft != FlightPhase::Landing => {
                Due::NoReturn("the craft does not return: landing")
            }
            Phase::Returning if waited >= RETURN_TIME => Due::NoReturn("the return takes too long: landing"),
            Phase::Landing if waited >= LANDING_TIME => Due::LandingOver,
            Phase::Landing if now >= land_again => Due::LandAgain,
            _ => Due::Nothing,
        }
    }

    /// Whether the flight time limit is reached.
    pub(crate) fn is_out_of_time(&self, now: Time, max_time: Duration) -> bool {
        now.since(self.counted.from) >= max_time
    }

    /// Advances the flight time that counts against the limit; manual flight does not count.
    pub(crate) fn count_time(&mut self, now: Time) {
        let by_hand = self.phase == Phase::Manual && self.hands.flown.is_some_and(|at| now.since(at) < AT_THE_KEYS);
        if by_hand {
            self.counted.from += now.since(self.counted.to);
        }
        self.counted.to = now;
    }

    /// Takes back a settled outcome: time counts afresh. Returns whether there was one.
    pub(crate) fn reopen(&mut self, now: Time) -> bool {
        let was_settled = self.ending.take().is_some();
        if was_settled {
            (self.counted.from, self.counted.to) = (now, now);
        }
        was_settled
    }

    /// Notes that a setpoint of the operator came. Returns whether it is one of a key that was held when the landing or return
    /// began, which would undo what a signal, or the other hand, asked for.
    pub(crate) fn hears_held_key(&mut self, now: Time) -> bool {
        let ends = matches!(self.phase, Phase::Landing | Phase::Returning);
        let last = self.hands.heard.replace(now);
        ends && last.is_some_and(|last| now.since(last) < HELD_KEY)
    }

    /// Takes a setpoint to be flown by hand.
    pub(crate) fn take_setpoint(&mut self, now: Time, setpoint: Setpoint) {
        self.hands.flown = Some(now);
        self.hands.setpoint = Some((setpoint, now + MANUAL_VALIDITY));
    }

    /// The setpoint flown by hand at `now`.
    pub(crate) fn by_hand(&self, now: Time) -> Option<Setpoint> {
        let is_manual = self.phase == Phase::Manual && !self.link_lost;
        self.hands.setpoint.filter(|(_, until)| is_manual && now < *until).map(|(setpoint, _)| setpoint)
    }

    /// When the setpoint flown by hand ends.
    pub(crate) fn hand_deadline(&self) -> Option<Time> {
        self.hands.setpoint.map(|(_, until)| until)
    }

    /// Ends the setpoint flown by hand, if its time is over. Returns whether it was.
    pub(crate) fn expire_hand(&mut self, now: Time) -> bool {
        self.hands.setpoint.take_if(|(_, until)| *until <= now).is_some()
    }

    /// Nothing is flown by hand any more.
    pub(crate) fn hands_off(&mut self) {
        self.hands.setpoint = None;
    }

    /// The landing that begins must not be interrupted.
    pub(crate) fn must_land(&mut self, why: &'static str) {
        self.landing.must = Some(why);
    }

    /// Why a landing cannot be taken over; `None` if it can.
    pub(crate) fn landing_is_final(&self) -> Option<&'static str> {
        match self.craft {
            FlightPhase::OnGround | FlightPhase::Stopped => Some("already on the ground"),
            _ => self.landing.must,
        }
    }

    /// Notes that a landing or return in progress is interrupted. Returns whether there was one.
    pub(crate) fn interrupt_landing(&mut self, now: Time) -> bool {
        let lands = matches!(self.phase, Phase::Landing | Phase::Returning);
        if lands {
            self.landing.taken_over = Some(now);
        }
        lands
    }

    /// Takes news of who has the craft; returns what they come to.
    pub(crate) fn let_go(&mut self, news: LetGo) -> LetGo {
        match news {
            LetGo::Somebody => {
                self.elsewhere.get_or_insert_default();
                news
            }
            // Whoever has left the controls meanwhile decides nothing about it.
            LetGo::Failsafe if self.elsewhere.take().is_some_and(|elsewhere| elsewhere.abandoned) => LetGo::Nobody,
            LetGo::Failsafe | LetGo::Nobody => {
                self.elsewhere = None;
                news
            }
            LetGo::NotLanded => news,
        }
    }

    /// The craft flies by our commands again.
    pub(crate) fn take_back(&mut self) {
        self.elsewhere = None;
    }

    /// Notes that an input was ignored: who leaves the controls while somebody else flies decides nothing later.
    pub(crate) fn ignore(&mut self, event: &OperatorEvent) {
        if let (OperatorEvent::Abandoned, Some(elsewhere)) = (event, &mut self.elsewhere) {
            elsewhere.abandoned = true;
        }
    }

    /// Why an input has no effect in this phase.
    pub(crate) fn refusal(&self, event: &OperatorEvent) -> Option<&'static str> {
        use OperatorEvent::{Abandoned, CutMotors, Hold, Instruction, Land, Left, Resume, Setpoint};
        match (self.phase, event) {
            (Phase::Ended, CutMotors) if self.craft != FlightPhase::OnGround => None,
            (Phase::Ended, _) => Some("the flight is over"),
            (_, Left | Abandoned) => self.goes_on_alone(event),
            (_, OperatorEvent::KeepOut(places)) => refused_places(places),
            (Phase::Landing, Land) => Some("already landing"),
            (Phase::Landing | Phase::Returning, Hold | Resume | Setpoint(_) | Instruction(_)) => self.landing_is_final(),
            (Phase::Ground | Phase::TakeOff, Setpoint(_)) => Some("not flying yet"),
            (Phase::Ground | Phase::TakeOff | Phase::Flying, Resume) if !self.start.then_hold => Some("no hold is in effect"),
            _ => None,
        }
    }

    /// Why what the craft does goes on though nobody has the controls.
    fn goes_on_alone(&self, event: &OperatorEvent) -> Option<&'static str> {
        match self.phase {
            Phase::Landing => Some("the landing goes on"),
            Phase::Returning => Some("the return goes on"),
            Phase::Hovering if *event == OperatorEvent::Left => Some("it hovers already"),
            _ if *event == OperatorEvent::Abandoned && self.elsewhere.is_some() => Some("somebody else flies"),
            _ => None,
        }
    }
}

impl Ending {
    pub(crate) fn new(outcome: Outcome, cause: impl Into<String>) -> Self {
        Self { outcome, cause: cause.into() }
    }

    /// The end of a flight that the envelope ends (`docs/explanation/safety.md`).
    pub(crate) fn by(cause: Cause) -> Self {
        let outcome = match cause {
            Cause::Crashed => Outcome::Collision,
            Cause::AltitudeBreach
            | Cause::DistanceBreach
            | Cause::GeofenceBreach
            | Cause::UncertainPosition
            | Cause::LowBattery => Outcome::Aborted,
            _ => Outcome::Failed,
        };
        Self::new(outcome, cause.to_string())
    }

    /// The end of a flight that its policy gives up.
    pub(crate) fn given_up(reason: FailReason) -> Self {
        match reason {
            FailReason::NotFound => Self::new(Outcome::NotFound, "two full search turns without seeing the target"),
            FailReason::NoProgram => Self::new(Outcome::Failed, "several programs in a row failed"),
        }
    }
}

/// Why places cannot be kept out of.
fn refused_places(places: &[KeepOut]) -> Option<&'static str> {
    let is_valid = places.len() <= MARKED_MOST && places.iter().all(KeepOut::is_valid);
    (!is_valid).then_some("at most 16 places with finite coordinates can be marked")
}

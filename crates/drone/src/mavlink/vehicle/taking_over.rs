//! Who has control, by the mode that the vehicle shows: taking it, and letting go of it. While somebody else flies, a radio,
//! another station, a failsafe, nothing is sent, until the operator takes control back.

use spf_core::time::{Duration, Time};
use spf_mavlink::command::{VehicleCommand, ids};
use spf_mavlink::modes::{Autopilot, Mode};

use super::control::Control;
use super::holder::Holder;
use super::{Notice, Vehicle};
use crate::DroneEvent;

/// PX4 wants setpoints for about a second before it accepts the mode in which it follows them.
const STREAM_FIRST: Duration = Duration::from_millis(1200);
/// How long a mode that we commanded may take to appear in a heartbeat, of which there is one a second.
const UNDER_WAY: Duration = Duration::from_millis(2500);
/// The radio's channels, or that there is no receiver, must have arrived this long after the change of mode.
const CLEAR_WITHIN: Duration = Duration::from_secs(5);
/// A craft that moves slower than this hovers, m/s.
const HOVERS: f64 = 0.3;
/// An older heartbeat does not show the mode any more: there is one a second.
const MODE_AGE: Duration = Duration::from_millis(2500);
/// A heartbeat is asked for again after this long, and waited for at most this long before a landing.
const BEAT_AGAIN: Duration = Duration::from_secs(1);
const MODE_WAIT: Duration = Duration::from_secs(3);
/// `HEARTBEAT`.
const HEARTBEAT: f32 = 0.0;

impl Vehicle {
    /// Begins to fly a vehicle that was only watched. One that is in the air is taken only if it hovers in the mode for
    /// setpoints and nobody sends any, as a program that died leaves it, and no other station was heard. Otherwise somebody may have paused it, or flies it: the pilot holds until the operator resumes. Returns whether it is
    /// flown.
    pub fn engage(&mut self, now: Time) -> bool {
        // PX4 climbs to a height of its own. One that arrives later is not that which the envelope has checked.
        self.climbs_to = match self.autopilot {
            Autopilot::Px4 => self.facts.parameter("MIS_TAKEOFF_ALT"),
            Autopilot::ArduPilot => Some(self.take_off_height),
        };
        if !self.is_flying() {
            self.control = Control::Idle;
            return true;
        }
        if self.mode == self.autopilot.external() && !self.evidence.has_station() && self.is_left_alone(now) {
            self.control = self.entering(now, false);
            return true;
        }
        self.release(now, Holder::Somebody);
        false
    }

    /// Whether a vehicle in the mode for setpoints seems to get none.
    fn is_left_alone(&self, now: Time) -> bool {
        let hovers = self.sensed.speed(now).is_some_and(|speed| speed < HOVERS);
        // PX4 leaves the mode without setpoints: one that has been in it for longer gets them from somebody.
        let ours = match (self.autopilot, self.facts.parameter("COM_OF_LOSS_T")) {
            (Autopilot::Px4, Some(loss)) => now.since(self.mode_since).as_secs_f64() < loss,
            (Autopilot::Px4, None) => false,
            (Autopilot::ArduPilot, _) => true,
        };
        hovers && ours
    }

    /// Begins to take control: setpoints first, then the mode in which they count.
    pub(super) fn entering(&mut self, now: Time, takes_off: bool) -> Control {
        (self.setpoint, self.next_setpoint) = (None, now);
        let wait = if self.mode == self.autopilot.external() || self.autopilot == Autopilot::ArduPilot {
            Duration::ZERO
        } else {
            STREAM_FIRST
        };
        Control::Entering { from: self.mode, ask_at: now + wait, tries: 0, takes_off }
    }

    /// Remembers a mode that the vehicle may show because of us.
    pub(super) fn expect(&mut self, now: Time, mode: Mode) {
        self.commanded = [Some((now, mode)), self.commanded[0].filter(|(_, before)| *before != mode).or(self.commanded[1])];
    }

    /// Whether a mode was commanded here so recently that the vehicle may show it now.
    fn is_under_way(&self, now: Time, mode: Mode) -> bool {
        self.commanded.iter().flatten().any(|(at, commanded)| *commanded == mode && now.since(*at) <= UNDER_WAY)
    }

    /// Whether a mode does not mean that somebody else flies.
    pub(super) fn is_allowed(&self, now: Time, mode: Mode) -> bool {
        let it = self.autopilot;
        let (external, hold, land, take_off) = (it.external(), it.hold(), it.land(), Mode::px4(4, 2));
        let allowed = match self.control {
            Control::Watching | Control::Idle | Control::Released(_) | Control::Stopping { .. } | Control::Refused { .. } => {
                return true;
            }
            Control::Preparing { from, .. } | Control::Arming { from, .. } => [from, external, hold],
            // That the hold is the end of the take-off, the height must show.
            Control::Climbing { shown: true, .. } => [take_off, hold, hold],
            Control::Climbing { from, .. } if it == Autopilot::Px4 => [from, take_off, hold],
            Control::Climbing { .. } | Control::Flying => [external; 3],
            Control::Entering { from, .. } => [from, external, external],
            Control::Landing { shown: true, .. } => [land; 3],
            // A landing, or another kind of return, that was not commanded here is a failsafe's or a person's.
            Control::Returning { shown: true, .. } => [it.return_home(); 3],
            Control::Returning { from, .. } => [from, it.return_home(), external],
            // In its hold it may have gone by itself; where a stick has moved meanwhile, somebody has put it there.
            Control::Landing { .. } if mode == hold && self.evidence.is_anybodys(self.mode_since) => [land; 3],
            Control::Landing { from, .. } => return [from, land, external, hold].contains(&mode) || self.is_under_way(now, mode),
        };
        allowed.contains(&mode) || self.is_under_way(now, mode)
    }

    /// The mode was not commanded here: it is not flown any more.
    pub(super) fn let_go(&mut self, now: Time) {
        let holder = self.holder_of(now, self.mode);
        self.evidence.await_news();
        if holder == Holder::Somebody {
            self.notices.push_back(Notice::LetGo { mode: self.mode });
        }
        self.release(now, holder);
    }

    fn release(&mut self, now: Time, holder: Holder) {
        self.commands.clear();
        (self.control, self.setpoint, self.told, self.resumed) = (Control::Released(holder), None, false, false);
        self.commanded = [None; 2];
        self.said_not_ours = false;
        self.events.push_back((now, DroneEvent::TakenOver));
    }

    /// The operator resumes: the next setpoint that moves may take control back. A resume from before the pilot was told means
    /// something else.
    pub fn resume(&mut self) {
        self.resumed = matches!(self.control, Control::Released(_)) && self.told;
    }

    /// A setpoint that moves, while somebody else flies. It takes control back if the operator has resumed; keys that were held,
    /// and decisions under way, do not.
    pub(super) fn take_back(&mut self, now: Time) {
        if !self.resumed {
            return self.say_not_ours("setpoint");
        }
        if self.is_flying() && !self.mode.is_landing() {
            self.resumed = false;
            self.notices.push_back(Notice::TakingBack { mode: self.mode });
            self.control = self.entering(now, false);
        }
    }

    /// Whether the mode is known as it is now: who has taken over is seen by it alone, so that no mode is commanded without. A
    /// heartbeat is asked for meanwhile.
    pub(super) fn is_mode_fresh(&mut self, now: Time) -> bool {
        let is_fresh = self.evidence.beat_age(now) < MODE_AGE;
        if !is_fresh && now >= self.beat_asked {
            self.beat_asked = now + BEAT_AGAIN;
            self.commands.interrupt(VehicleCommand::new(ids::REQUEST, &[HEARTBEAT]));
        }
        is_fresh
    }

    /// The same, or it was waited for since then in vain: a craft that was ours is landed also if it tells nothing.
    pub(super) fn knows_mode(&mut self, now: Time, since: Time) -> bool {
        self.is_mode_fresh(now) || now.since(since) >= MODE_WAIT
    }

    /// The hold into which a silent link leads, and after how many seconds, by the parameters that were read before take-off.
    fn failsafe_hold(&self) -> Option<(Mode, f64)> {
        match self.autopilot {
            // 5 is Hold.
            Autopilot::Px4 => (self.facts.parameter("COM_OBL_RC_ACT") == Some(5.0))
                .then(|| self.facts.parameter("COM_OF_LOSS_T"))?
                .map(|after| (self.autopilot.hold(), after)),
            // It stops and stays in the mode for setpoints, so that nobody has to let go.
            Autopilot::ArduPilot => None,
        }
    }

    /// Who has a craft whose newest heartbeat has shown this mode, which was not commanded here. That failsafe is one of the mode for
    /// setpoints: a landing or a return that ends in a hold was stopped.
    fn holder_of(&self, now: Time, mode: Mode) -> Holder {
        let by_setpoints = matches!(
            self.control,
            Control::Flying
                | Control::Entering { .. }
                | Control::Landing { shown: false, .. }
                | Control::Returning { shown: false, .. }
        );
        let predicted = self.failsafe_hold().filter(|(hold, _)| by_setpoints && *hold == mode);
        match predicted {
            Some((_, after)) if !self.evidence.has_station() && self.evidence.radio_is_as_before() != Some(false) => {
                Holder::Unclear { until: now + CLEAR_WITHIN, silent: self.evidence.is_of_a_silence(after) }
            }
            _ => Holder::Somebody,
        }
    }

    /// Follows what shows who has it. What was nobody's becomes somebody's for good.
    pub(super) fn follow_holder(&mut self, now: Time) {
        let Control::Released(holder) = self.control else { return };
        let failsafe = self.failsafe_hold().filter(|(hold, _)| *hold == self.mode && !self.evidence.has_station());
        let explained = failsafe.is_some_and(|(_, after)| self.evidence.is_explained(self.mode_since, after));
        let radio = self.evidence.radio_is_as_before();
        let found = match holder {
            Holder::Somebody => return,
            _ if failsafe.is_none() || radio == Some(false) => Holder::Somebody,
            Holder::Unclear { silent, .. } if radio == Some(true) && (silent || explained) => Holder::Failsafe,
            Holder::Unclear { until, .. } if now >= until => Holder::Somebody,
            _ => return,
        };
        if found == holder {
            return;
        }
        self.control = Control::Released(found);
        match found {
            Holder::Failsafe => {
                self.notices.push_back(Notice::HeldByFailsafe { mode: self.mode });
                self.events.push_back((now, DroneEvent::HeldByFailsafe));
            }
            _ => self.notices.push_back(Notice::LetGo { mode: self.mode }),
        }
    }

    /// Tells once that a command of the pilot is not carried out.
    pub(super) fn say_not_ours(&mut self, what: &'static str) {
        if !core::mem::replace(&mut self.said_not_ours, true) {
            self.notices.push_back(Notice::NotOurs { what });
        }
    }
}

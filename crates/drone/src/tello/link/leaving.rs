//! Landing by the driver itself: when the program ends, when nobody calls it any more, when a take-off fails, and when the
//! drone seems to have stopped. Everything here slows or lands the craft; nothing here moves it.

use spf_core::command::Setpoint;
use spf_core::telemetry::FlightPhase;
use spf_core::time::{Duration, Time};

use super::super::conversation::Order;
use super::super::manoeuvre::{self, Stage};
use super::{Link, ZEROS_FIRST};

/// A `takeoff` that could not be sent within this time is withdrawn: the motors must not start unexpectedly later.
const TAKE_OFF_UNSENT: Duration = Duration::from_secs(2);
/// A `takeoff` without a response, without motors and without height for this long was lost.
const TAKE_OFF_UNSEEN: Duration = Duration::from_secs(6);
/// After `takeoff` was sent, the motors may still start for this long.
const SPIN_UP: Duration = Duration::from_secs(3);

/// A take-off in progress.
#[derive(Clone, Copy, Debug)]
pub(super) struct TakeOff {
    /// When it was commanded.
    asked: Time,
    /// When `takeoff` was sent.
    pub(super) sent: Option<Time>,
}

impl TakeOff {
    pub(super) const COMMAND: &'static str = "takeoff";

    pub(super) fn new(now: Time) -> Self {
        Self { asked: now, sent: None }
    }

    /// Whether it could not be sent in time.
    pub(super) fn is_late(&self, now: Time) -> bool {
        self.sent.is_none() && now.since(self.asked) >= TAKE_OFF_UNSENT
    }

    /// Whether it should show by now.
    pub(super) fn should_show(&self, now: Time) -> bool {
        self.sent.is_some_and(|sent| now.since(sent) >= TAKE_OFF_UNSEEN)
    }

    /// Whether it may still start the motors, being in transit.
    pub(super) fn may_start(&self, now: Time) -> bool {
        self.sent.is_some_and(|sent| now.since(sent) < SPIN_UP)
    }
}

impl Link {
    /// Records that the pilot is alive. Without this the craft holds after 2 s and lands after 5 s; a link that was never
    /// called by a pilot waits for the first call.
    pub fn heartbeat(&mut self, now: Time) {
        self.heartbeat.beat(now);
    }

    /// Ends any motion of the craft: zero, then `land`, repeated until it stands on the ground. Used when the program
    /// exits.
    pub fn leave(&mut self, now: Time) {
        if self.is_airborne() && self.land_again.is_none() {
            self.begin_landing(now);
        }
    }

    /// Whether the craft is, or may be, in the air.
    #[must_use]
    pub fn is_airborne(&self) -> bool {
        !matches!(self.phase, FlightPhase::OnGround | FlightPhase::Stopped)
    }

    /// Ends a landing that the pilot began: the craft hovers. The SDK documents `stop` as effective at any time; if the
    /// drone continues to descend, its motors stop, which the state shows, and `land` is sent.
    pub(super) fn interrupt_landing(&mut self, now: Time, valid_until: Time) {
        self.land_again = None;
        self.interruptible = false;
        self.phase = FlightPhase::Flying;
        self.reach.begin(now);
        self.ground.forget();
        self.conversation.interrupt(now, manoeuvre::stop());
        self.sticks.set([0; 4], valid_until);
    }

    /// Zero, then `land`, repeated until the ground is reached.
    pub(super) fn begin_landing(&mut self, now: Time) {
        self.interruptible = false;
        // A manoeuvre in progress would refuse it. Sent once, since a later `stop` would end the landing; `land` is repeated.
        if self.manoeuvre.take().is_some_and(|flown| flown.stage != Stage::Resting) {
            self.conversation.interrupt(now, Order { repeats: 0, ..manoeuvre::stop() });
        }
        // Stick positions hold until replaced, even if `land` gets lost.
        self.sticks.zero(now);
        self.tell(now, Setpoint::HOLD, now);
        self.conversation.clear();
        if self.phase != FlightPhase::OnGround {
            self.phase = FlightPhase::Landing;
        }
        // Earlier evidence does not apply to this landing.
        self.ground.forget();
        (self.land_again, self.land_sent) = (Some(now + ZEROS_FIRST), false);
    }
}

//! Landing: by the pilot, and by the driver itself when the program ends, when nobody calls it any more, or when a part of it
//! failed. Everything here slows or lands the craft, and nothing of it happens while somebody else flies.

use spf_core::time::{Duration, Time};
use spf_mavlink::command::{VehicleCommand, ids};

use super::control::Control;
use super::holder::Holder;
use super::{Notice, Vehicle};
use crate::DroneEvent;

/// Without a call of the pilot for this long the craft holds, and later lands.
const SILENT_HOLD: Duration = Duration::from_secs(2);
const SILENT_LAND: Duration = Duration::from_secs(5);
/// A landing that the vehicle does not show is commanded again after this long.
const LAND_AGAIN: Duration = Duration::from_secs(1);
/// A landing is over when the vehicle says for this long that it has landed, or its height stays that of the ground for this long.
const LANDED_FOR: Duration = Duration::from_secs(1);
const LOW_FOR: Duration = Duration::from_secs(3);
/// The height of the ground: above home or below it up to this, metres, at less than this speed, m/s.
const LOW: f64 = 0.4;
const RESTS: f64 = 0.3;
/// A craft that has been on the ground for this long, and did not disarm by itself, is disarmed.
const DISARMED_AFTER: Duration = Duration::from_secs(5);
/// The same, and nothing shows whether it was disarmed: it is left where it stands.
const GROUNDED_FOR: Duration = Duration::from_secs(10);

impl Vehicle {
    /// The pilot lands the craft; a hold of the pilot ends such a landing.
    pub(super) fn land(&mut self, now: Time) {
        self.begin_landing(now, true);
    }

    /// A landing of the driver itself, which nothing but the cutting of the motors ends.
    pub(super) fn land_for_good(&mut self, now: Time) {
        self.begin_landing(now, false);
    }

    fn begin_landing(&mut self, now: Time, by_pilot: bool) {
        let flying = self.is_flying();
        match &mut self.control {
            Control::Released(Holder::Somebody) => {
                self.say_not_ours("landing");
                // One that lands by itself is followed to the ground.
                if !self.mode.is_landing() {
                    self.events.push_back((now, DroneEvent::NotLanded));
                }
            }
            // Whoever asks asks again.
            Control::Released(Holder::Unclear { .. }) => {}
            Control::Watching | Control::Stopping { .. } => {}
            Control::Idle | Control::Refused { .. } if !flying => {}
            Control::Preparing { .. } if !self.armed => {
                self.commands.clear();
                self.control = Control::Idle;
            }
            // Commanded again until the vehicle shows it.
            Control::Landing { interruptible, .. } => *interruptible &= by_pilot,
            _ => {
                let from = self.mode;
                self.setpoint = None;
                self.commands.clear();
                self.control = Control::Landing { from, since: now, shown: false, again: now, tries: 0, interruptible: by_pilot };
                self.advance_landing(now);
            }
        }
    }

    /// Commands a landing until the vehicle shows it, and disarms it on the ground.
    pub(super) fn advance_landing(&mut self, now: Time) {
        let Control::Landing { from, since, shown, again, tries, interruptible } = self.control else { return };
        if now < again || (tries == 0 && !self.knows_mode(now, since)) {
            return;
        }
        let again = now + LAND_AGAIN;
        let grounded = self.grounded.filter(|_| self.landed == 1).map(|at| now.since(at.max(since)));
        // It was disarmed again and again; that it is, only heartbeats would tell, and none come.
        if grounded.is_some_and(|long| long >= GROUNDED_FOR) && !self.is_mode_fresh(now) {
            self.commands.clear();
            self.control = Control::Idle;
            return;
        }
        if !self.armed {
            // The arming may be under way.
            self.commands.interrupt(VehicleCommand::new(ids::ARM, &[0.0]));
        } else if grounded.is_some_and(|long| long >= DISARMED_AFTER) {
            // Never with the number that skips the checks: in the air it is refused.
            self.commands.interrupt(VehicleCommand::new(ids::ARM, &[0.0]));
        } else if self.mode != self.autopilot.land() || tries == 0 {
            self.expect(now, self.autopilot.land());
            let nan = f32::NAN;
            self.commands.interrupt(VehicleCommand { id: ids::LAND, parameters: [0.0, 0.0, 0.0, nan, nan, nan, 0.0] });
            let tries = tries.saturating_add(1);
            self.control = Control::Landing { from, since, shown, again, tries, interruptible };
            return;
        }
        self.control = Control::Landing { from, since, shown, again, tries, interruptible };
    }

    /// Follows a landing to its end, which whichever of landed state, arming and height shows first: any of them may be stuck, or
    /// not told. It is disarmed as before.
    pub(super) fn follow_descent(&mut self, now: Time) {
        let low = self.sensed.height(now).is_some_and(|height| height.abs() <= LOW);
        // A craft that goes on down passes the height of home.
        let rests = self.sensed.speed(now).is_none_or(|speed| speed < RESTS);
        self.low = (low && rests).then(|| self.low.unwrap_or(now));
        let Control::Landing { since, .. } = self.control else {
            self.down = None;
            return;
        };
        // Told since the landing began: one that is stuck says nothing.
        let landed = self.grounded.is_some_and(|at| self.landed == 1 && at >= since && now.since(at) >= LANDED_FOR);
        let low = self.low.is_some_and(|at| now.since(at.max(since)) >= LOW_FOR);
        if (landed || low) && self.down.is_none() {
            self.down = Some(now);
            self.report_rest(now);
        }
    }

    /// Ends any motion and lands, unless it is on the ground or somebody else flies it. Used when the program exits; called again
    /// as long as it [is ours](Self::is_ours).
    pub fn leave(&mut self, now: Time) {
        if self.is_ours() {
            self.land_for_good(now);
        }
    }

    /// The program has done what it can: of a craft in the air the user reads who has it.
    pub fn part(&mut self) {
        if self.control == Control::Released(Holder::Somebody) && self.is_flying() {
            self.notices.push_back(Notice::LeftTo { mode: self.mode });
        }
    }

    /// Whether it is, or may be, in the air under our control.
    #[must_use]
    pub fn is_ours(&self) -> bool {
        match self.control {
            Control::Watching | Control::Released(Holder::Somebody) => false,
            Control::Idle | Control::Refused { .. } => self.is_flying(),
            Control::Stopping { .. } => self.armed,
            _ => true,
        }
    }

    /// Lands the craft because a part of the driver failed.
    pub fn fail(&mut self, now: Time) {
        if self.is_ours() && !matches!(self.control, Control::Stopping { .. }) {
            self.notices.push_back(Notice::Failed);
            self.land_for_good(now);
        }
    }

    /// Reacts to a pilot that does not call any more.
    pub(super) fn check_pilot(&mut self, now: Time) {
        // A return goes on without us: nothing better is known for it.
        let by_itself = matches!(
            self.control,
            Control::Landing { interruptible: false, .. } | Control::Returning { shown: true, .. } | Control::Stopping { .. }
        );
        let flies = self.is_ours() && !by_itself && !matches!(self.control, Control::Released(Holder::Unclear { .. }));
        let Some(silent) = self.beat.map(|beat| now.since(beat)).filter(|_| flies) else { return };
        if silent >= SILENT_LAND {
            self.notices.push_back(Notice::Unattended { landing: true });
            self.land_for_good(now);
        } else if silent >= SILENT_HOLD
            && !matches!(self.control, Control::Landing { .. })
            && !core::mem::replace(&mut self.held_silent, true)
        {
            self.notices.push_back(Notice::Unattended { landing: false });
            self.setpoint = None;
        }
    }
}

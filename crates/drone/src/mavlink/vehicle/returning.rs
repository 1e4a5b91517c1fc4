//! The return by the vehicle's own navigation: commanded until its mode shows it, then only watched, until it has landed and
//! disarmed.

use spf_core::time::{Duration, Time};
use spf_mavlink::command::{VehicleCommand, ids};

use super::control::Control;
use super::{Notice, Vehicle};

/// A return that the vehicle does not show is commanded again after this long, at most this often.
const AGAIN: Duration = Duration::from_secs(1);
const TRIES: u8 = 4;
/// A craft that has been on the ground for this long, and did not disarm by itself, is disarmed.
const DISARMED_AFTER: Duration = Duration::from_secs(5);

impl Vehicle {
    /// The pilot lets it return home. Only from flight by our setpoints: nobody else is sent home.
    pub(super) fn return_home(&mut self, now: Time) {
        match self.control {
            Control::Flying | Control::Entering { .. } => {
                self.setpoint = None;
                self.commands.clear();
                let from = self.mode;
                self.control = Control::Returning { from, since: now, shown: false, again: now, tries: 0 };
                self.advance_return(now);
            }
            Control::Released(_) => self.say_not_ours("return"),
            _ => {}
        }
    }

    /// Commands the return until the vehicle shows it, and disarms it on the ground.
    pub(super) fn advance_return(&mut self, now: Time) {
        let Control::Returning { from, since, shown, again, tries } = self.control else { return };
        if now < again || (!shown && !self.is_mode_fresh(now)) {
            return;
        }
        let again = now + AGAIN;
        if shown {
            let grounded = self.grounded.filter(|_| self.landed == 1).map(|at| now.since(at.max(since)));
            if grounded.is_some_and(|long| long >= DISARMED_AFTER) {
                // Never with the number that skips the checks: in the air it is refused.
                self.commands.interrupt(VehicleCommand::new(ids::ARM, &[0.0]));
            }
        } else if tries < TRIES {
            self.expect(now, self.autopilot.return_home());
            self.commands.interrupt(VehicleCommand::new(ids::RETURN, &[]));
        } else {
            // In vain: it hovers by our setpoints again, and the pilot sees that it does not return.
            self.commands.clear();
            self.control = self.entering(now, false);
            return;
        }
        self.control = Control::Returning { from, since, shown, again, tries: tries.saturating_add(1) };
    }

    /// It has landed and disarmed after a return.
    pub(super) fn returned(&mut self, now: Time) {
        let off = self.facts.home.zip(self.sensed.position(now)).map(|(home, at)| home.horizontal_distance(at));
        self.notices.push_back(Notice::Returned { off });
        self.commands.clear();
        (self.control, self.setpoint) = (Control::Idle, None);
        self.report_rest(now);
    }
}

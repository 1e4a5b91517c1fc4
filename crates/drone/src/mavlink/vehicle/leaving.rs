//! Landing by the driver itself: when the program ends, and when nobody calls it any more. Everything here slows or lands the
//! craft, and nothing of it happens while somebody else flies.

use spf_core::time::{Duration, Time};

use super::control::Control;
use super::{Notice, Vehicle};

/// Without a call of the pilot for this long the craft holds, and later lands.
const SILENT_HOLD: Duration = Duration::from_secs(2);
const SILENT_LAND: Duration = Duration::from_secs(5);

impl Vehicle {
    /// Ends any motion and lands, unless it is on the ground or somebody else flies it. Used when the program exits.
    pub fn leave(&mut self) {
        if self.is_ours() {
            self.land();
        }
    }

    /// Whether it is, or may be, in the air under our control.
    #[must_use]
    pub fn is_ours(&self) -> bool {
        match self.control {
            Control::Idle | Control::Released | Control::Refused { .. } => false,
            Control::Stopping { .. } => self.armed,
            _ => true,
        }
    }

    /// Lands the craft because a part of the driver failed.
    pub fn fail(&mut self) {
        if self.is_ours() && !matches!(self.control, Control::Landing { .. } | Control::Stopping { .. }) {
            self.notices.push_back(Notice::Failed);
            self.land();
        }
    }

    /// Reacts to a pilot that does not call any more.
    pub(super) fn check_pilot(&mut self, now: Time) {
        let flies = self.is_ours() && !matches!(self.control, Control::Landing { .. } | Control::Stopping { .. });
        let Some(silent) = self.beat.map(|beat| now.since(beat)).filter(|_| flies) else { return };
        if silent >= SILENT_LAND {
            self.notices.push_back(Notice::Unattended { landing: true });
            self.land();
        } else if silent >= SILENT_HOLD && !core::mem::replace(&mut self.held_silent, true) {
            self.notices.push_back(Notice::Unattended { landing: false });
            self.setpoint = None;
        }
    }
}

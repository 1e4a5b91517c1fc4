//! Whether the pilot still calls a driver.

use spf_core::time::{Duration, Time};

/// Without a call of the pilot for this long the craft holds, and later lands.
const SILENT_HOLD: Duration = Duration::from_secs(2);
const SILENT_LAND: Duration = Duration::from_secs(5);

/// What the silence of the pilot calls for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Silence {
    Hold,
    Land,
}

/// The calls of the pilot.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Heartbeat {
    /// The last call.
    beat: Option<Time>,
    /// Whether the craft holds because of the silence since.
    held: bool,
}

impl Heartbeat {
    /// The pilot calls.
    pub(crate) fn beat(&mut self, now: Time) {
        *self = Self { beat: Some(now), held: false };
    }

    /// What its silence calls for now: once a hold, then a landing.
    pub(crate) fn silence(&mut self, now: Time) -> Option<Silence> {
        let silent = now.since(self.beat?);
        if silent >= SILENT_LAND {
            Some(Silence::Land)
        } else if silent >= SILENT_HOLD && !std::mem::replace(&mut self.held, true) {
            Some(Silence::Hold)
        } else {
            None
        }
    }
}

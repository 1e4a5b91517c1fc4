//! What the driver knows of a flight.

use spf_core::time::Time;

/// What the simulator's report shows of the flight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::airsim) struct Seen {
    /// When it was measured.
    pub(in crate::airsim) at: Time,
    /// Metres above where the craft stood.
    pub(in crate::airsim) height: f64,
    /// m/s.
    pub(in crate::airsim) speed: f64,
    /// Whether the simulator says that it has landed. It may say the opposite of a craft that stands with its motors on.
    pub(in crate::airsim) landed: bool,
}

/// What the craft does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Stage {
    /// Nothing is commanded yet.
    Watching,
    /// On the ground.
    Idle,
    TakingOff {
        since: Time,
        again: Option<Time>,
        tries: u32,
    },
    Flying,
    Landing {
        step: Descent,
        by_pilot: bool,
    },
    /// In the air under somebody else's control.
    Released,
    /// Its motors were cut.
    Stopped,
}

/// The steps of a landing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Descent {
    Brakes,
    Hovers {
        until: Time,
    },
    /// `ended` is when the simulator said that its landing has ended well, which alone proves nothing; `rests` is since when the height
    /// has been this, metres.
    Descends {
        since: Time,
        again: Option<Time>,
        ended: Option<Time>,
        rests: Option<(Time, f64)>,
    },
}

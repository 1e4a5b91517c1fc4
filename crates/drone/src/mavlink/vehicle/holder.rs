//! Who has a craft that we have let go: somebody, or nobody but its own failsafe.
//!
//! Letting go ends the control of motion, and not the duty to land a craft that nobody has. It is nobody's only if all of this
//! is so, and what is not known counts as changed: it shows the hold that its parameters predict for a silent link, it changed
//! while our link was silent, no other station was heard, and the radio's sticks and switches are as before.

use spf_core::time::{Duration, Time, duration_from_secs};
use spf_mavlink::modes::{Autopilot, Mode};
use spf_mavlink::report::Channels;

use super::control::Control;
use super::{Notice, Vehicle};
use crate::DroneEvent;

/// Nothing heard for this long is a silence; messages come 20 times a second, and twice over a slow link.
const SILENCE: Duration = Duration::from_millis(700);
/// The autopilot counts from our last setpoint, which arrived somewhat after its last message left.
const EARLIER: f64 = 0.15;
/// The radio's channels, or that there is no receiver, must have arrived this long after the change of mode.
const CLEAR_WITHIN: Duration = Duration::from_secs(5);

/// Who has it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Holder {
    /// Somebody: a person, another station, another failsafe.
    Somebody,
    /// It shows its failsafe's hold, and news of its radio is awaited.
    Unclear {
        /// Until when.
        until: Time,
    },
    /// Nobody: its own failsafe for a silent link holds it.
    Failsafe,
}

/// A time in which nothing was heard.
#[derive(Clone, Copy, Debug)]
struct Silence {
    from: Time,
    until: Time,
}

/// What shows who has it.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Evidence {
    /// The last silence.
    silence: Option<Silence>,
    /// The newest heartbeat, and the one before it.
    beats: [Option<Time>; 2],
    /// The radio's channels from before the last silence, and since.
    before: Option<Channels>,
    since: Option<Channels>,
    /// Whether there was a receiver before the last silence, and is one since, as far as the vehicle has told.
    received: Option<bool>,
    receives: Option<bool>,
    /// When another station was heard first.
    station: Option<Time>,
}

impl Evidence {
    /// Something arrived; `before` is when something last did.
    pub(super) fn heard(&mut self, now: Time, before: Time) {
        if now.since(before) >= SILENCE {
            self.silence = Some(Silence { from: before, until: now });
            (self.before, self.received) = (self.since.take().or(self.before), self.receives.take().or(self.received));
        }
    }

    /// A heartbeat arrived.
    pub(super) fn beats(&mut self, now: Time) {
        self.beats = [Some(now), self.beats[0]];
    }

    /// How old the newest heartbeat is.
    pub(super) fn beat_age(&self, now: Time) -> Duration {
        self.beats[0].map_or(Duration::MAX, |beat| now.since(beat))
    }

    /// The radio's channels.
    pub(super) fn radio(&mut self, channels: Channels) {
        self.since = Some(channels);
    }

    /// Whether there is a receiver.
    pub(super) fn receiver(&mut self, is_there: bool) {
        self.receives = Some(is_there);
    }

    /// Another station.
    pub(super) fn station(&mut self, now: Time) {
        self.station.get_or_insert(now);
    }

    /// Whether somebody has shown up who may have commanded a mode during the last silence.
    pub(super) fn is_anybodys(&self) -> bool {
        self.silence.is_some() && (self.station.is_some() || self.radio_is_as_before() == Some(false))
    }

    /// Whether the sticks and switches are as before the last silence; `None` while that is unknown.
    fn radio_is_as_before(&self) -> Option<bool> {
        let none = |channels: Option<Channels>, receiver: Option<bool>| {
            channels.is_some_and(|it| it.count == 0) || (channels.is_none() && receiver == Some(false))
        };
        if none(self.before, self.received) {
            return (self.since.is_some() || self.receives.is_some()).then(|| none(self.since, self.receives));
        }
        Some(self.before?.is_like(&self.since?))
    }
}

impl Vehicle {
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

    /// Who has a craft whose newest heartbeat has shown this mode, which was not commanded here.
    pub(super) fn holder_of(&self, now: Time, mode: Mode) -> Holder {
        let begun_in = |silence: Silence, after: f64| {
            let long = silence.until.since(silence.from) >= duration_from_secs((after - EARLIER).max(0.0));
            long && self.evidence.beats[1].is_none_or(|beat| beat <= silence.from)
        };
        match (self.failsafe_hold(), self.evidence.silence) {
            (Some((hold, after)), Some(silence))
                if hold == mode && begun_in(silence, after) && self.evidence.station.is_none() =>
            {
                Holder::Unclear { until: now + CLEAR_WITHIN }
            }
            _ => Holder::Somebody,
        }
    }

    /// Follows what shows who has it. What was nobody's becomes somebody's for good.
    pub(super) fn follow_holder(&mut self, now: Time) {
        let Control::Released(holder) = self.control else { return };
        let alone = self.evidence.station.is_none() && self.failsafe_hold().is_some_and(|(hold, _)| hold == self.mode);
        let radio = self.evidence.radio_is_as_before();
        let found = match (holder, radio) {
            (Holder::Somebody, _) => return,
            _ if !alone || radio == Some(false) => Holder::Somebody,
            (_, Some(true)) => Holder::Failsafe,
            (Holder::Unclear { until }, None) if now >= until => Holder::Somebody,
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
}

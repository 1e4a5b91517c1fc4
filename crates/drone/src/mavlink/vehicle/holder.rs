//! Who has a craft that we have let go: somebody, or nobody but its own failsafe.
//!
//! Letting go ends the control of motion, and not the duty to land a craft that nobody has. It is nobody's only if all of this
//! is so, and what is not known counts as changed: it shows the hold that its parameters predict for a silent link; it changed
//! while our link was silent, or this program was stopped, or says itself that a failsafe did it; no other station was heard; and
//! the radio's sticks and switches are as before.

use spf_core::time::{Duration, Time, duration_from_secs};
use spf_mavlink::report::Channels;

/// Nothing heard for this long is a silence; messages come 20 times a second, and twice over a slow link.
const SILENCE: Duration = Duration::from_millis(700);
/// A heartbeat, of which there is one a second, shows the mode this long after a silence at most.
const BEAT: Duration = Duration::from_millis(1200);
/// What a vehicle says of its failsafe comes this long before the heartbeat that shows it at most, or after it.
const WORDS: Duration = Duration::from_millis(2500);
/// The autopilot counts from our last setpoint, which arrived somewhat after its last message left.
const EARLIER: f64 = 0.15;

/// Who has it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Holder {
    /// Somebody: a person, another station, another failsafe.
    Somebody,
    /// It shows its failsafe's hold, and news of its radio, or its own words about it, are awaited.
    Unclear {
        /// Until when.
        until: Time,
        /// Whether the link was silent when it changed.
        silent: bool,
    },
    /// Nobody: its own failsafe for a silent link holds it.
    Failsafe,
}

/// A time without a heartbeat in which nothing was heard, but for a few messages between two gaps.
#[derive(Clone, Copy, Debug)]
struct Silence {
    from: Time,
    until: Time,
    /// Its longest gap.
    gap: Duration,
}

/// What shows who has it.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Evidence {
    /// The last silence.
    silence: Option<Silence>,
    /// The newest heartbeat, and the one before it.
    beats: [Option<Time>; 2],
    /// The radio's channels when the vehicle last showed the mode for setpoints, and since.
    before: Option<Channels>,
    since: Option<Channels>,
    /// Whether there was a receiver then, and is one since, as far as the vehicle has told.
    received: Option<bool>,
    receives: Option<bool>,
    /// When this program last ran, and the end and the length of its last pause.
    ran: Option<Time>,
    pause: Option<(Time, Duration)>,
    /// When the vehicle said that a failsafe acts.
    said: Option<Time>,
    /// Whether another station was heard.
    station: bool,
}

impl Evidence {
    /// Something arrived; `before` is when something last did.
    pub(super) fn heard(&mut self, now: Time, before: Time) {
        let gap = now.since(before);
        if gap < SILENCE {
            return;
        }
        // Until a heartbeat shows the mode it is one silence.
        let open = self.silence.filter(|it| self.beats[0].is_none_or(|beat| beat < it.until));
        self.silence = Some(match open {
            Some(it) => Silence { until: now, gap: it.gap.max(gap), ..it },
            None => Silence { from: before, until: now, gap },
        });
    }

    /// A heartbeat arrived.
    pub(super) fn beats(&mut self, now: Time) {
        self.beats = [Some(now), self.beats[0]];
    }

    /// This program runs, as it does many times a second.
    pub(super) fn runs(&mut self, now: Time) {
        let passed = self.ran.replace(now).map_or(Duration::ZERO, |ran| now.since(ran));
        if passed >= SILENCE {
            self.pause = Some((now, passed));
        }
    }

    /// The vehicle says something.
    pub(super) fn says(&mut self, now: Time, text: &str) {
        let text = text.to_lowercase();
        if text.contains("failsafe") && !["clear", "deactivated", "disabled", "recovered"].iter().any(|end| text.contains(end)) {
            self.said = Some(now);
        }
    }

    /// The newest heartbeat shows the mode for setpoints: what the radio shows now means nothing else.
    pub(super) fn remember_radio(&mut self) {
        (self.before, self.received) = (self.since.take().or(self.before), self.receives.take().or(self.received));
    }

    /// From now on news of the radio is news: what came with the last heartbeats may be from before its mode changed.
    pub(super) fn await_news(&mut self) {
        (self.since, self.receives) = (None, None);
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
    pub(super) fn station(&mut self) {
        self.station = true;
    }

    /// Whether what the newest heartbeat shows may have begun in a silence, nobody else being heard: one that was long enough for a
    /// failsafe that waits for this many seconds.
    pub(super) fn is_of_a_silence(&self, after: f64) -> bool {
        let enough = duration_from_secs((after - EARLIER).max(0.0));
        let in_it = |silence: Silence| silence.gap >= enough && self.beats[1].is_none_or(|beat| beat <= silence.from);
        self.silence.is_some_and(in_it) && !self.station
    }

    /// Whether a mode that is shown since then is explained otherwise: this program was stopped for so long that a failsafe came
    /// that waits for this many seconds, or the vehicle says that one did.
    pub(super) fn is_explained(&self, shown: Time, after: f64) -> bool {
        let enough = duration_from_secs((after - EARLIER).max(0.0));
        let paused = self.pause.is_some_and(|(until, passed)| passed >= enough && until + BEAT >= shown);
        paused || self.said.is_some_and(|at| at + WORDS >= shown)
    }

    /// Whether another station was heard.
    pub(super) fn has_station(&self) -> bool {
        self.station
    }

    /// Whether somebody has shown up who may have commanded the mode that is shown since then: sticks have moved, or another station
    /// is on a link that was silent as it changed.
    pub(super) fn is_anybodys(&self, shown: Time) -> bool {
        let in_it = |silence: Silence| silence.from <= shown && shown.since(silence.until) <= BEAT;
        self.radio_is_as_before() == Some(false) || self.station && self.silence.is_some_and(in_it)
    }

    /// Whether the sticks and switches are as when the vehicle last showed the mode for setpoints; `None` while that is unknown.
    pub(super) fn radio_is_as_before(&self) -> Option<bool> {
        let none = |channels: Option<Channels>, receiver: Option<bool>| {
            channels.is_some_and(|it| it.count == 0) || (channels.is_none() && receiver == Some(false))
        };
        if none(self.before, self.received) {
            return (self.since.is_some() || self.receives.is_some()).then(|| none(self.since, self.receives));
        }
        Some(self.before?.is_like(&self.since?))
    }
}

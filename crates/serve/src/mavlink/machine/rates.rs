//! Rates: which message each client gets, and how often.

use std::collections::BTreeMap;

use spf_core::time::{Duration, Time, duration_from_secs};
use spf_mavlink::modes::Autopilot;
use spf_mavlink::wire::{EKF_STATUS_REPORT, MOUNT_STATUS};

/// Every message that can be requested, with its usual rate in Hz; zero for those that are only sent on request.
pub(super) const DEFAULTS: [(u32, f32); 25] = [
    (0, 1.0),
    (1, 1.0),
    (2, 1.0),
    (24, 1.0),
    (30, 20.0),
    (31, 20.0),
    (32, 20.0),
    (33, 5.0),
    (49, 0.0),
    (65, 2.0),
    (74, 5.0),
    (85, 5.0),
    (132, 5.0),
    (147, 1.0),
    (148, 0.0),
    (MOUNT_STATUS, 2.0),
    (162, 0.0),
    (EKF_STATUS_REPORT, 1.0),
    (230, 1.0),
    (242, 0.5),
    (245, 2.0),
    (280, 0.0),
    (281, 0.0),
    (285, 5.0),
    (330, 5.0),
];
/// Shortest interval between two messages.
const SHORTEST: Duration = Duration::from_millis(20);

/// When a client gets which message next.
#[derive(Clone, Debug)]
pub(super) struct Streams(BTreeMap<u32, (Duration, Time)>);

impl Streams {
    pub(super) fn new(autopilot: Autopilot, now: Time) -> Self {
        let mut streams = Self(BTreeMap::new());
        for (id, rate) in DEFAULTS {
            if let Some(interval) = interval(rate).filter(|_| has(autopilot, id)) {
                streams.0.insert(id, (interval, now));
            }
        }
        streams
    }

    /// Sets an interval in microseconds: 0 for the usual one, negative for none.
    pub(super) fn set(&mut self, id: u32, micros: f32, autopilot: Autopilot, now: Time) {
        let usual = DEFAULTS.iter().find(|(known, _)| *known == id).map_or(0.0, |(_, rate)| *rate);
        let wanted = if micros == 0.0 { interval(usual) } else { interval(1e6 / micros) };
        match wanted.filter(|_| has(autopilot, id)) {
            Some(wanted) => self.0.insert(id, (wanted, now)),
            None => self.0.remove(&id),
        };
    }

    /// Nothing but the heartbeat, as an ArduPilot sends that nobody has asked for anything.
    pub(super) fn quiet(&mut self) {
        self.0.retain(|id, _| *id == 0);
    }

    /// One rate, Hz, for a group of messages (`MAV_DATA_STREAM`; 0 is every group); zero stops them.
    pub(super) fn set_group(&mut self, group: u8, rate: u16, autopilot: Autopilot, now: Time) {
        for (id, _) in DEFAULTS.iter().filter(|(id, _)| has(autopilot, *id)) {
            if *id == 0 || (group != 0 && group_of(*id) != Some(group)) || group_of(*id).is_none() {
                continue;
            }
            match interval(rate.into()) {
                Some(period) => drop(self.0.insert(*id, (period, now))),
                None => drop(self.0.remove(id)),
            }
        }
    }

    /// The messages that are due.
    pub(super) fn due(&mut self, now: Time) -> Vec<u32> {
        let mut due = Vec::new();
        for (id, (period, next)) in &mut self.0 {
            if *next <= now {
                *next = (*next + *period).max(now);
                due.push(*id);
            }
        }
        due
    }
}

fn interval(rate: f32) -> Option<Duration> {
    (rate > 0.0).then(|| duration_from_secs(1.0 / f64::from(rate.max(0.001))).max(SHORTEST))
}

/// The group of ArduCopter in which a message is sent.
fn group_of(id: u32) -> Option<u8> {
    Some(match id {
        1 | 24 | 162 => 2,
        65 => 3,
        32 | 33 => 6,
        30 | 31 => 10,
        74 => 11,
        2 | 132 | 147 | MOUNT_STATUS | 330 | EKF_STATUS_REPORT => 12,
        _ => return None,
    })
}

/// Whether an autopilot has this message.
pub(super) fn has(autopilot: Autopilot, id: u32) -> bool {
    match id {
        162 | EKF_STATUS_REPORT => autopilot == Autopilot::ArduPilot,
        230 => autopilot == Autopilot::Px4,
        _ => true,
    }
}

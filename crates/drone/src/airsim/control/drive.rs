//! How a velocity is flown, and how the craft is brought to rest.

use spf_core::command::Setpoint;
use spf_core::time::{Duration, Time};

use super::{Request, Seen};
use crate::airsim::axes::body_velocity;

/// Interval at which a velocity is sent again. The simulator turns a body velocity into the world once, when it arrives.
pub(super) const PERIOD: Duration = Duration::from_millis(50);
/// How long the simulator flies a velocity that is not replaced, s: five periods. Without the next within 60 ms of its end it holds its
/// position.
pub(in crate::airsim) const VALID: f64 = 0.25;
/// Below this speed it hovers, m/s: a hover keeps the position of the call, and a faster craft would fly back to it.
const AT_REST: f64 = 0.2;
/// It hovers after this long, whatever it reports.
const BRAKES_FOR: Duration = Duration::from_secs(3);
/// The zero is flown at least this long.
const BRAKES_AT_LEAST: Duration = Duration::from_millis(100);

/// What is being flown.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) enum Drive {
    /// A velocity; the time is that of the next call.
    Moves { next: Time },
    /// Zero, since some time.
    Brakes { since: Time, next: Time },
    /// It hovers, or has not begun.
    #[default]
    Hovers,
}

impl Drive {
    /// The next call, if one is due: `wanted` is the velocity, zero to come to rest.
    pub(super) fn poll(&mut self, now: Time, wanted: Setpoint, seen: Option<&Seen>) -> Option<Request> {
        if !wanted.is_hold() {
            let due = !matches!(self, Self::Moves { next } if now < *next);
            return due.then(|| {
                *self = Self::Moves { next: now + PERIOD };
                Request::Fly(body_velocity(wanted))
            });
        }
        match *self {
            Self::Hovers => None,
            Self::Moves { .. } => {
                *self = Self::Brakes { since: now, next: now + PERIOD };
                Some(Request::Fly([0.0; 4]))
            }
            Self::Brakes { next, .. } if now < next => None,
            Self::Brakes { since, .. } => {
                let long = now.since(since);
                let rests = seen.is_some_and(|seen| seen.at > since && seen.speed < AT_REST) && long >= BRAKES_AT_LEAST;
                if rests || long >= BRAKES_FOR {
                    *self = Self::Hovers;
                    return Some(Request::Hover);
                }
                *self = Self::Brakes { since, next: now + PERIOD };
                Some(Request::Fly([0.0; 4]))
            }
        }
    }

    /// Comes to rest from whatever was flown before: zero first.
    pub(super) fn stop(&mut self, now: Time) {
        *self = Self::Moves { next: now };
    }
}

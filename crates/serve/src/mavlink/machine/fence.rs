//! The fence of points: received over the mission protocol, told, and kept.

use spf_core::geometry::EnuPosition;
use spf_core::time::{Duration, Time};
use spf_mavlink::fence::{FenceItem, FenceMessage, FenceShape, MOST, shapes};
use spf_mavlink::frames::GlobalPosition;
use spf_mavlink::modes::Autopilot;
use spf_mavlink::wire::Body;

use super::{ORIGIN, Peer};
use crate::mavlink::parameters::Parameters;

/// A client that begins to send a fence and then is silent for this long has given up.
const ABANDONED: Duration = Duration::from_secs(8);
/// An item that does not come is asked for again after this long.
const ASKED_AGAIN: Duration = Duration::from_secs(1);
/// `MAV_MISSION_RESULT`.
const ERROR: u8 = 1;
const ACCEPTED: u8 = 0;
const NO_SPACE: u8 = 4;
const INVALID: u8 = 5;
const INVALID_SEQUENCE: u8 = 13;

/// Kinds of fences of ArduPilot (`FENCE_TYPE`): height, a circle around home, what was uploaded.
pub(super) const HEIGHT: i64 = 1;
pub(super) const CIRCLE: i64 = 2;
const POINTS: i64 = 4;

/// Whether a kind of fence is in force in an ArduPilot.
pub(super) fn is_kind_in_force(parameters: &Parameters, kind: i64) -> bool {
    let on = parameters.number("FENCE_ENABLE", 0.0) != 0.0;
    on && parameters.number("FENCE_TYPE", 7.0) as i64 & kind != 0
}

/// The fence, and one that is being received.
#[derive(Debug, Default)]
pub(super) struct Fence {
    items: Vec<FenceItem>,
    incoming: Option<Incoming>,
}

#[derive(Debug)]
struct Incoming {
    from: Peer,
    /// System and component that send it.
    sender: [u8; 2],
    asked: Time,
    count: u16,
    items: Vec<FenceItem>,
    heard: Time,
}

impl Fence {
    /// Whether there is one, and it is in force.
    pub(super) fn is_in_force(&self, autopilot: Autopilot, parameters: &Parameters) -> bool {
        !self.items.is_empty() && (autopilot == Autopilot::Px4 || is_kind_in_force(parameters, POINTS))
    }

    pub(super) fn clear(&mut self) {
        *self = Self::default();
    }

    /// Whether a position relative to the estimator's origin is forbidden. PX4 wants it inside any of the shapes that it must be
    /// inside of, ArduPilot inside all of them.
    pub(super) fn forbids(&self, autopilot: Autopilot, at: EnuPosition) -> bool {
        let shapes = shapes(&self.items).unwrap_or_default();
        let place = |[latitude, longitude]: [i32; 2]| {
            let place =
                GlobalPosition { latitude: f64::from(latitude) * 1e-7, longitude: f64::from(longitude) * 1e-7, altitude: 0.0 };
            ORIGIN.offset_to(place)
        };
        let contains = |shape: &FenceShape| match shape {
            FenceShape::Polygon { inside, corners } => {
                let ring: Vec<(f64, f64)> = corners.iter().map(|corner| place(*corner)).map(|at| (at.east, at.north)).collect();
                (*inside, in_ring(&ring, (at.east, at.north)))
            }
            FenceShape::Circle { inside, centre, radius } => {
                (*inside, place(*centre).horizontal_distance(at) <= f64::from(*radius))
            }
        };
        let found: Vec<(bool, bool)> = shapes.iter().map(contains).collect();
        let mut inclusions = found.iter().filter(|(inside, _)| *inside).map(|(_, contains)| *contains).peekable();
        let included = match autopilot {
            _ if inclusions.peek().is_none() => true,
            Autopilot::Px4 => inclusions.any(|contains| contains),
            Autopilot::ArduPilot => inclusions.all(|contains| contains),
        };
        !included || found.contains(&(false, true))
    }

    /// Asks again for an item that has not come: the message, and who gets it.
    pub(super) fn ask(&mut self, now: Time) -> Option<(Peer, Body)> {
        let incoming = self.incoming.as_mut()?;
        if now.since(incoming.heard) >= ABANDONED || now.since(incoming.asked) < ASKED_AGAIN {
            return None;
        }
        incoming.asked = now;
        Some((incoming.from, FenceMessage::Request(incoming.items.len() as u16).body(incoming.sender)))
    }

    /// Handles a message about the fence; `sender` is the system and component that sent it. Returns the answer.
    pub(super) fn receive(
        &mut self,
        now: Time,
        from: Peer,
        sender: [u8; 2],
        message: FenceMessage,
        autopilot: Autopilot,
    ) -> Option<FenceMessage> {
        let ardupilot = autopilot == Autopilot::ArduPilot;
        if self.incoming.as_ref().is_some_and(|incoming| now.since(incoming.heard) >= ABANDONED) {
            self.incoming = None;
        }
        Some(match message {
            FenceMessage::List => FenceMessage::Count(self.items.len() as u16),
            FenceMessage::Request(seq) => match self.items.get(usize::from(seq)) {
                Some(item) => FenceMessage::Item(seq, *item),
                None => FenceMessage::End(INVALID_SEQUENCE),
            },
            FenceMessage::Count(count) if count > MOST => FenceMessage::End(NO_SPACE),
            FenceMessage::Count(0) => {
                self.clear();
                FenceMessage::End(ACCEPTED)
            }
            FenceMessage::Count(count) => {
                self.incoming = Some(Incoming { from, sender, asked: now, count, items: Vec::new(), heard: now });
                FenceMessage::Request(0)
            }
            FenceMessage::Item(seq, item) => {
                let Some(incoming) = self.incoming.as_mut().filter(|incoming| incoming.from == from) else {
                    // Nothing was asked for. PX4 takes the last item once more, since its acknowledgement may have been lost.
                    if ardupilot {
                        return Some(FenceMessage::End(ERROR));
                    }
                    let again = usize::from(seq) + 1 == self.items.len() && self.items.last() == Some(&item);
                    return Some(FenceMessage::End(if again { ACCEPTED } else { INVALID_SEQUENCE }));
                };
                if usize::from(seq) == incoming.items.len() {
                    incoming.items.push(item);
                    (incoming.heard, incoming.asked) = (now, now);
                } else if ardupilot {
                    // It goes on.
                    return Some(FenceMessage::End(INVALID_SEQUENCE));
                }
                if incoming.items.len() < usize::from(incoming.count) {
                    return Some(FenceMessage::Request(incoming.items.len() as u16));
                }
                let items = core::mem::take(&mut incoming.items);
                self.incoming = None;
                // What is no fence leaves the one that there was.
                if shapes(&items).is_none() {
                    return Some(FenceMessage::End(INVALID));
                }
                self.items = items;
                FenceMessage::End(ACCEPTED)
            }
            FenceMessage::End(_) => return None,
        })
    }
}

/// Whether a point lies in a ring: a ray from it crosses the ring's edges an odd number of times.
fn in_ring(ring: &[(f64, f64)], (x, y): (f64, f64)) -> bool {
    let edges = ring.iter().zip(ring.iter().cycle().skip(1));
    let crossed =
        |&(&(x0, y0), &(x1, y1)): &(&(f64, f64), &(f64, f64))| (y0 > y) != (y1 > y) && x < x0 + (y - y0) / (y1 - y0) * (x1 - x0);
    edges.filter(crossed).count() % 2 == 1
}

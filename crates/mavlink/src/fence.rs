//! Fences of an autopilot, over the mission protocol (`MAV_MISSION_TYPE_FENCE`): uploaded, and read back.

use mavlink::dialects::common::{
    MISSION_ACK_DATA, MISSION_COUNT_DATA, MISSION_ITEM_INT_DATA, MISSION_REQUEST_INT_DATA, MISSION_REQUEST_LIST_DATA, MavCmd,
    MavFrame, MavMessage, MavMissionResult, MavMissionType,
};
use spf_core::time::{Duration, Time};

use crate::wire::Body;

/// Maximum number of items of a fence.
pub const MOST: u16 = 512;
/// A step without an answer is repeated after this long, at most this often.
const AGAIN: Duration = Duration::from_millis(700);
const TRIES: u8 = 5;
/// A transfer to the autopilot, which asks for each item, again after a second if it must, ends after this long without a request.
const ASKED_WITHIN: Duration = Duration::from_secs(8);
/// `MAV_MISSION_INVALID_SEQUENCE`: of an item that came twice; the autopilot goes on.
const INVALID_SEQUENCE: u8 = 13;
/// `MAV_MISSION_ERROR`.
const ERROR: u8 = 1;
/// Places that differ by no more than this are the same, 1e-7 degrees: autopilots store them as numbers of their own.
const SAME: i32 = 2;

/// An item of a fence: a corner or a circle, by its latitude and longitude in units of 1e-7 degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FenceItem {
    /// What it is.
    pub kind: FenceKind,
    /// Latitude and longitude, 1e-7 degrees.
    pub place: [i32; 2],
}

/// Kind of an item.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FenceKind {
    /// A corner of a polygon, inside or outside of which the vehicle must stay, with the number of its corners.
    Corner {
        /// Inside.
        inside: bool,
        /// Corners of the polygon.
        count: u16,
    },
    /// The centre of a circle, inside or outside of which the vehicle must stay.
    Circle {
        /// Inside.
        inside: bool,
        /// Metres.
        radius: f32,
    },
    /// Where it returns to after a breach.
    Return,
}

/// A shape of a fence.
#[derive(Clone, Debug, PartialEq)]
pub enum FenceShape {
    /// A polygon.
    Polygon {
        /// Whether the vehicle must stay inside.
        inside: bool,
        /// Latitudes and longitudes, 1e-7 degrees.
        corners: Vec<[i32; 2]>,
    },
    /// A circle.
    Circle {
        /// Whether the vehicle must stay inside.
        inside: bool,
        /// Latitude and longitude, 1e-7 degrees.
        centre: [i32; 2],
        /// Metres.
        radius: f32,
    },
}

/// The items of shapes, in the order in which they travel.
#[must_use]
pub fn items(shapes: &[FenceShape]) -> Vec<FenceItem> {
    let of = |shape: &FenceShape| match shape {
        FenceShape::Polygon { inside, corners } => {
            let kind = FenceKind::Corner { inside: *inside, count: corners.len().min(usize::from(MOST)) as u16 };
            corners.iter().map(|place| FenceItem { kind, place: *place }).collect()
        }
        FenceShape::Circle { inside, centre, radius } => {
            vec![FenceItem { kind: FenceKind::Circle { inside: *inside, radius: *radius }, place: *centre }]
        }
    };
    shapes.iter().flat_map(of).collect()
}

/// The shapes of items; `None` if a polygon is incomplete or has fewer than three corners, or a circle has no radius.
#[must_use]
pub fn shapes(items: &[FenceItem]) -> Option<Vec<FenceShape>> {
    let (mut shapes, mut rest) = (Vec::new(), items);
    while let Some((first, after)) = rest.split_first() {
        match first.kind {
            FenceKind::Corner { inside, count } => {
                let polygon = rest.get(..usize::from(count)).filter(|polygon| polygon.len() >= 3)?;
                if polygon.iter().any(|item| item.kind != first.kind) {
                    return None;
                }
                shapes.push(FenceShape::Polygon { inside, corners: polygon.iter().map(|item| item.place).collect() });
                rest = &rest[usize::from(count)..];
                continue;
            }
            FenceKind::Circle { inside, radius } if radius.is_finite() && radius > 0.0 => {
                shapes.push(FenceShape::Circle { inside, centre: first.place, radius });
            }
            FenceKind::Circle { .. } => return None,
            FenceKind::Return => {}
        }
        rest = after;
    }
    Some(shapes)
}

/// Whether two fences are the same but for rounding.
#[must_use]
pub fn are_same(a: &[FenceItem], b: &[FenceItem]) -> bool {
    let near = |(a, b): (&i32, &i32)| a.abs_diff(*b) <= SAME as u32;
    let same = |(a, b): (&FenceItem, &FenceItem)| {
        let kinds = match (a.kind, b.kind) {
            (FenceKind::Circle { inside: a, radius: r }, FenceKind::Circle { inside: b, radius: s }) => {
                a == b && (r - s).abs() < 0.01
            }
            (a, b) => a == b,
        };
        kinds && a.place.iter().zip(&b.place).all(near)
    };
    a.len() == b.len() && a.iter().zip(b).all(same)
}

/// A message of the transfer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FenceMessage {
    /// So many items are about to be sent.
    Count(u16),
    /// An item.
    Item(u16, FenceItem),
    /// The number of items is asked for.
    List,
    /// An item is asked for.
    Request(u16),
    /// The transfer has ended (`MAV_MISSION_RESULT`).
    End(u8),
}

impl FenceMessage {
    /// The message to a system and component.
    #[must_use]
    pub fn body(self, [target_system, target_component]: [u8; 2]) -> Body {
        let mission_type = MavMissionType::MAV_MISSION_TYPE_FENCE;
        Body::from(&match self {
            Self::Count(count) => MavMessage::MISSION_COUNT(MISSION_COUNT_DATA {
                count,
                target_system,
                target_component,
                mission_type,
                ..MISSION_COUNT_DATA::default()
            }),
            Self::Item(seq, item) => {
                let (command, param1) = match item.kind {
                    FenceKind::Corner { inside: true, count } => {
                        (MavCmd::MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION, f32::from(count))
                    }
                    FenceKind::Corner { inside: false, count } => {
                        (MavCmd::MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION, f32::from(count))
                    }
                    FenceKind::Circle { inside: true, radius } => (MavCmd::MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION, radius),
                    FenceKind::Circle { inside: false, radius } => (MavCmd::MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION, radius),
                    FenceKind::Return => (MavCmd::MAV_CMD_NAV_FENCE_RETURN_POINT, 0.0),
                };
                let [x, y] = item.place;
                MavMessage::MISSION_ITEM_INT(MISSION_ITEM_INT_DATA {
                    param1,
                    x,
                    y,
                    seq,
                    command,
                    target_system,
                    target_component,
                    frame: MavFrame::MAV_FRAME_GLOBAL,
                    autocontinue: 1,
                    mission_type,
                    ..MISSION_ITEM_INT_DATA::default()
                })
            }
            Self::List => {
                MavMessage::MISSION_REQUEST_LIST(MISSION_REQUEST_LIST_DATA { target_system, target_component, mission_type })
            }
            Self::Request(seq) => {
                MavMessage::MISSION_REQUEST_INT(MISSION_REQUEST_INT_DATA { seq, target_system, target_component, mission_type })
            }
            Self::End(result) => MavMessage::MISSION_ACK(MISSION_ACK_DATA {
                target_system,
                target_component,
                mavtype: result_of(result),
                mission_type,
                ..MISSION_ACK_DATA::default()
            }),
        })
    }

    /// The message of a fence in another one, with whom it is for; `None` for every other message.
    #[must_use]
    #[allow(deprecated, reason = "older autopilots ask by the message that MISSION_REQUEST_INT replaces")]
    pub fn read(message: &MavMessage) -> Option<(Self, [u8; 2])> {
        let (read, target, kind) = match message {
            MavMessage::MISSION_COUNT(it) => (Self::Count(it.count), [it.target_system, it.target_component], it.mission_type),
            MavMessage::MISSION_REQUEST_LIST(it) => (Self::List, [it.target_system, it.target_component], it.mission_type),
            MavMessage::MISSION_REQUEST_INT(it) => {
                (Self::Request(it.seq), [it.target_system, it.target_component], it.mission_type)
            }
            MavMessage::MISSION_REQUEST(it) => (Self::Request(it.seq), [it.target_system, it.target_component], it.mission_type),
            MavMessage::MISSION_ACK(it) => {
                (Self::End(it.mavtype as u8), [it.target_system, it.target_component], it.mission_type)
            }
            MavMessage::MISSION_ITEM_INT(it) => {
                let count = if (0.0..=f32::from(MOST)).contains(&it.param1) { it.param1 as u16 } else { 0 };
                let kind = match it.command {
                    MavCmd::MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION => FenceKind::Corner { inside: true, count },
                    MavCmd::MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION => FenceKind::Corner { inside: false, count },
                    MavCmd::MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION => FenceKind::Circle { inside: true, radius: it.param1 },
                    MavCmd::MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION => FenceKind::Circle { inside: false, radius: it.param1 },
                    MavCmd::MAV_CMD_NAV_FENCE_RETURN_POINT => FenceKind::Return,
                    _ => return None,
                };
                let item = FenceItem { kind, place: [it.x, it.y] };
                (Self::Item(it.seq, item), [it.target_system, it.target_component], it.mission_type)
            }
            _ => return None,
        };
        (kind == MavMissionType::MAV_MISSION_TYPE_FENCE).then_some((read, target))
    }
}

fn result_of(result: u8) -> MavMissionResult {
    match result {
        0 => MavMissionResult::MAV_MISSION_ACCEPTED,
        4 => MavMissionResult::MAV_MISSION_NO_SPACE,
        5 => MavMissionResult::MAV_MISSION_INVALID,
        13 => MavMissionResult::MAV_MISSION_INVALID_SEQUENCE,
        _ => MavMissionResult::MAV_MISSION_ERROR,
    }
}

/// Why a transfer failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum FenceError {
    /// The autopilot did not answer.
    #[error("the autopilot does not answer")]
    Silent,
    /// It refused.
    #[error("the autopilot refuses it (MAV_MISSION_RESULT {0})")]
    Refused(u8),
    /// It has, or says that it has, more items than are read.
    #[error("the autopilot's fence has more than {MOST} points")]
    TooLarge,
}

#[derive(Clone, Debug, Default, PartialEq)]
enum Step {
    #[default]
    Idle,
    /// Items are sent as they are asked for; before the first is, their number is.
    Sending {
        items: Vec<FenceItem>,
        asked: Option<u16>,
    },
    Listing,
    Fetching {
        count: u16,
        items: Vec<FenceItem>,
    },
}

/// A transfer of a fence, in either direction. Sans-IO.
///
/// What is sent is sent when the autopilot asks for it, and never again by itself: to an item that it did not ask for an ArduPilot
/// answers with an error. If its last word is lost, the transfer ends as if it had come; only reading the fence back tells.
#[derive(Clone, Debug, Default)]
pub struct Transfer {
    step: Step,
    due: Option<Time>,
    tries: u8,
    out: Option<FenceMessage>,
    ended: Option<Result<Option<Vec<FenceItem>>, FenceError>>,
}

impl Transfer {
    /// Begins to send a fence, instead of any other transfer.
    pub fn upload(&mut self, now: Time, items: Vec<FenceItem>) {
        *self = Self { step: Step::Sending { items, asked: None }, due: Some(now), ..Self::default() };
    }

    /// Begins to read the fence, instead of any other transfer.
    pub fn download(&mut self, now: Time) {
        *self = Self { step: Step::Listing, due: Some(now), ..Self::default() };
    }

    /// Whether it is under way.
    #[must_use]
    pub fn is_busy(&self) -> bool {
        self.step != Step::Idle
    }

    /// The result of the last transfer, once: the items that were read, or `None` for those sent, which must then be read back.
    pub fn take_result(&mut self) -> Option<Result<Option<Vec<FenceItem>>, FenceError>> {
        self.ended.take()
    }

    fn end(&mut self, result: Result<Option<Vec<FenceItem>>, FenceError>) {
        (self.step, self.due, self.ended) = (Step::Idle, None, Some(result));
    }

    fn next(&mut self, now: Time, message: FenceMessage) {
        (self.out, self.due, self.tries) = (Some(message), Some(now + AGAIN), 1);
    }

    /// Handles a message of the autopilot.
    pub fn handle(&mut self, now: Time, message: FenceMessage) {
        match (&mut self.step, message) {
            (Step::Sending { items, asked }, FenceMessage::Request(seq)) => {
                if let Some(item) = items.get(usize::from(seq)).copied() {
                    *asked = Some(seq);
                    (self.out, self.due) = (Some(FenceMessage::Item(seq, item)), Some(now + ASKED_WITHIN));
                }
            }
            (Step::Sending { .. }, FenceMessage::End(0)) => self.end(Ok(None)),
            (Step::Sending { .. }, FenceMessage::End(INVALID_SEQUENCE)) => {}
            // The last item came twice, to an autopilot that had it: reading back tells.
            (Step::Sending { items, asked: Some(seq) }, FenceMessage::End(ERROR)) if usize::from(*seq) + 1 == items.len() => {
                self.end(Ok(None));
            }
            (Step::Sending { .. } | Step::Listing | Step::Fetching { .. }, FenceMessage::End(result)) if result != 0 => {
                self.end(Err(FenceError::Refused(result)));
            }
            (Step::Listing, FenceMessage::Count(0)) => {
                self.end(Ok(Some(Vec::new())));
                self.out = Some(FenceMessage::End(0));
            }
            (Step::Listing, FenceMessage::Count(count)) if count > MOST => self.end(Err(FenceError::TooLarge)),
            (Step::Listing, FenceMessage::Count(count)) => {
                self.step = Step::Fetching { count, items: Vec::new() };
                self.next(now, FenceMessage::Request(0));
            }
            (Step::Fetching { count, items }, FenceMessage::Item(seq, item)) if usize::from(seq) == items.len() => {
                items.push(item);
                let (next, count) = (items.len() as u16, *count);
                if next == count {
                    let items = core::mem::take(items);
                    self.end(Ok(Some(items)));
                    self.out = Some(FenceMessage::End(0));
                } else {
                    self.next(now, FenceMessage::Request(next));
                }
            }
            _ => {}
        }
    }

    /// What is to be sent at `now`.
    pub fn poll(&mut self, now: Time) -> Option<FenceMessage> {
        if let Some(out) = self.out.take() {
            return Some(out);
        }
        if self.due.is_none_or(|due| now < due) {
            return None;
        }
        if let Step::Sending { items, asked: Some(seq) } = &self.step {
            let all = usize::from(*seq) + 1 == items.len();
            self.end(if all { Ok(None) } else { Err(FenceError::Silent) });
            return None;
        }
        if self.tries >= TRIES {
            self.end(Err(FenceError::Silent));
            return None;
        }
        (self.due, self.tries) = (Some(now + AGAIN), self.tries + 1);
        Some(match &self.step {
            Step::Idle | Step::Sending { asked: Some(_), .. } => return None,
            Step::Listing => FenceMessage::List,
            Step::Fetching { items, .. } => FenceMessage::Request(items.len() as u16),
            Step::Sending { items, asked: None } => FenceMessage::Count(items.len() as u16),
        })
    }
}

#[cfg(test)]
mod tests;

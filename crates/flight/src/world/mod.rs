//! The two worlds that a pilot can fly in, and the only places that read a clock.

mod live;
mod lockstep;
mod pause;

pub use live::Live;
pub use lockstep::Lockstep;

use std::collections::VecDeque;

use spf_core::query::QueryId;
use spf_core::time::{Duration, Time};
use spf_drone::{Drone, DroneEvent};
use spf_pilot::{Event, LetGo, OperatorEvent, Pilot};
use spf_vlm::VlmError;

/// Operator inputs at given flight times, for virtual time and tests.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Script(VecDeque<(Time, OperatorEvent)>);

impl Script {
    /// A script; events are sorted by time, keeping the given order for equal times.
    #[must_use]
    pub fn new(mut events: Vec<(Time, OperatorEvent)>) -> Self {
        events.sort_by_key(|(at, _)| *at);
        Self(events.into())
    }

    /// The instructions given in flight, with their times.
    pub fn instructions(&self) -> impl Iterator<Item = (Time, &str)> {
        self.0.iter().filter_map(|(at, event)| match event {
            OperatorEvent::Instruction(text) => Some((*at, text.as_str())),
            _ => None,
        })
    }

    fn next_at(&self) -> Option<Time> {
        self.0.front().map(|(at, _)| *at)
    }

    fn take(&mut self, now: Time) -> Option<OperatorEvent> {
        self.0.pop_front_if(|(at, _)| *at <= now).map(|(_, event)| event)
    }
}

/// The event for a VLM reply.
fn answer_event(id: QueryId, text: Result<String, VlmError>) -> Event {
    match text {
        Ok(text) => Event::Reply { id, text },
        Err(error @ VlmError::Spent { .. }) => Event::Spent { reason: error.to_string() },
        Err(error) => Event::ReplyFailed { id, reason: error.to_string() },
    }
}

/// Interval at which a craft is told what is around it, flight time.
const SURROUNDINGS: Duration = Duration::from_millis(200);

/// Tells a craft that wants it what the pilot's map shows around it; `told` is when it was last told.
fn tell_surroundings(now: Time, pilot: &Pilot, told: &mut Option<Time>, drone: &mut dyn Drone) {
    if told.is_some_and(|told| now.since(told) < SURROUNDINGS) || !drone.wants_surroundings() {
        return;
    }
    let Some(map) = pilot.obstacle_map() else { return };
    *told = Some(now);
    let beside = drone.capabilities().craft.radius + 0.2;
    drone.surroundings(now, &map.around(now, pilot.known_pose(now), beside));
}

/// What a craft reports, as an input of the pilot; whether an operator can intervene decides what becomes of a craft that nobody has.
fn pilot_event(event: DroneEvent, attended: bool) -> Event {
    match event {
        DroneEvent::Telemetry(telemetry) => Event::Telemetry(telemetry),
        DroneEvent::Frame(frame) => {
            if let Some(why) = frame.unusable {
                tracing::debug!(frame = frame.id.0, ?why, "unusable frame");
            }
            Event::Frame(frame)
        }
        DroneEvent::Depth(grid) => Event::Depth(grid),
        DroneEvent::Gimbal(report) => Event::Gimbal(report),
        DroneEvent::Ranges(scan) => Event::Ranges(scan),
        DroneEvent::TakenOver => Event::LetGo(LetGo::Somebody),
        DroneEvent::HeldByFailsafe => Event::LetGo(if attended { LetGo::Failsafe } else { LetGo::Nobody }),
        DroneEvent::NotLanded => Event::LetGo(LetGo::NotLanded),
        DroneEvent::LinkLost => Event::LinkLost,
        DroneEvent::LinkRestored => Event::LinkRestored,
    }
}

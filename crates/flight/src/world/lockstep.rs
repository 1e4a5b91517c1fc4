//! A world in virtual time: nothing waits, and the result depends only on the seed.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::mpsc::Receiver;

use spf_core::query::{Query, QueryId};
use spf_core::time::Time;
use spf_drone::Drone;
use spf_pilot::{Action, Event, Note, OperatorEvent, Pilot};
use spf_vlm::{QueryRequest, Vlm};

use super::{Script, answer_event, pilot_event};
use crate::image::QueryImages;
use crate::run::World;
use crate::tracking::VirtualTracker;

/// A world in virtual time: the craft is advanced to the next event, and a VLM reply arrives its latency after the
/// query.
///
/// A real VLM is awaited in wall time while virtual time stands still; then virtual time advances by the measured
/// latency.
pub struct Lockstep {
    now: Time,
    drone: Box<dyn Drone>,
    /// When the craft was last told what is around it.
    told: Option<Time>,
    vlm: Box<dyn Vlm>,
    images: QueryImages,
    script: Script,
    answers: Vec<(Time, QueryId, Event)>,
    interrupts: Arc<AtomicU32>,
    interrupted: bool,
    operator: Option<Receiver<OperatorEvent>>,
    tracker: Option<VirtualTracker>,
}

impl Lockstep {
    /// A world at flight time zero. `interrupts` counts Ctrl-C presses: the first one lands.
    #[must_use]
    pub fn new(drone: Box<dyn Drone>, vlm: Box<dyn Vlm>, script: Script, interrupts: Arc<AtomicU32>) -> Self {
        let images = QueryImages::of(drone.as_ref());
        Self {
            now: Time::ZERO,
            drone,
            told: None,
            vlm,
            images,
            script,
            answers: Vec::new(),
            interrupts,
            interrupted: false,
            operator: None,
            tracker: None,
        }
    }

    /// Adds a tracker for what the pilot asks to be tracked.
    pub(crate) fn with_tracker(mut self, tracker: Option<VirtualTracker>) -> Self {
        self.tracker = tracker;
        self
    }

    /// Adds manual operator inputs, which are delivered before any other event.
    #[must_use]
    pub fn with_operator(mut self, operator: Option<Receiver<OperatorEvent>>) -> Self {
        self.operator = operator;
        self
    }

    fn ask(&mut self, query: &Query) {
        let request = QueryRequest::new(query, query.deadline.since(self.now));
        let answer = self.vlm.answer(&request, &mut self.images.about(query));
        self.answers.push((self.now + answer.latency, query.id, answer_event(query.id, answer.text)));
    }

    /// The earliest reply due by `at`; equal times in order of query.
    fn take_answer(&mut self, at: Time) -> Option<Event> {
        let index = (0..self.answers.len())
            .filter(|&i| self.answers[i].0 <= at)
            .min_by_key(|&i| (self.answers[i].0, self.answers[i].1))?;
        Some(self.answers.remove(index).2)
    }

    /// The earliest report of the tracker, if it is due by `at`.
    fn take_report(&mut self, at: Time) -> Option<Event> {
        self.tracker.as_mut()?.take(at)
    }
}

impl World for Lockstep {
    fn now(&self) -> Time {
        self.now
    }

    fn wait(&mut self, deadline: Time) -> Option<Event> {
        if !self.interrupted && self.interrupts.load(Ordering::Relaxed) > 0 {
            self.interrupted = true;
            return Some(Event::Operator(OperatorEvent::Land));
        }
        if let Some(event) = self.operator.as_ref().and_then(|operator| operator.try_recv().ok()) {
            return Some(Event::Operator(event));
        }
        let answer = self.answers.iter().map(|(at, ..)| *at).min();
        let report = self.tracker.as_ref().and_then(VirtualTracker::next_at);
        let next = [self.drone.next_event_at(), answer, self.script.next_at(), report];
        self.now = self.now.max(next.into_iter().flatten().fold(deadline, Time::min));
        // At equal times: the operator first, then the craft, then replies, then the tracker.
        if let Some(event) = self.script.take(self.now) {
            return Some(Event::Operator(event));
        }
        if let Some((_, event)) = self.drone.next_event(self.now) {
            let event = pilot_event(event, self.operator.is_some() || self.script.next_at().is_some());
            if let Some(tracker) = &mut self.tracker {
                tracker.event(self.now, &event);
            }
            return Some(event);
        }
        self.take_answer(self.now).or_else(|| self.take_report(self.now))
    }

    fn surroundings(&mut self, pilot: &Pilot) {
        super::tell_surroundings(self.now, pilot, &mut self.told, self.drone.as_mut());
    }

    fn apply(&mut self, action: &Action) {
        if let Some(tracker) = &mut self.tracker {
            tracker.apply(self.now, action);
        }
        match action {
            Action::Ask(query) => self.ask(query),
            // The operator, and nothing that the pilot sends, lets a driver take control back.
            Action::Note(Note::Operator(OperatorEvent::Resume)) => self.drone.resume(self.now),
            // The reply to a cancelled query still arrives, as from a real model; the pilot counts it.
            Action::Cancel(_) | Action::Track(_) | Action::Untrack | Action::Note(_) | Action::Finished(_) => {}
            Action::Command(command) => {
                if let Err(error) = self.drone.apply(self.now, command) {
                    tracing::debug!(%error, "a command did not reach the craft");
                }
            }
        }
    }
}

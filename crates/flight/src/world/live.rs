//! A world on the wall clock.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::Instant;

use spf_core::query::{Query, QueryId};
use spf_core::time::{Duration, Time};
use spf_drone::{Drone, DroneEvent};
use spf_pilot::{Action, Event, Note, OperatorEvent, Pilot};
use spf_vlm::{Cancel, QueryRequest, Vlm, VlmError};

use super::pause::Pauses;
use super::{Script, answer_event, pilot_event};
use crate::image::QueryImages;
use crate::run::World;
use crate::tracking::TrackingThread;

/// Maximum reaction time to Ctrl-C and the operator when nothing else happens.
const MAX_WAIT: Duration = Duration::from_millis(20);

/// Time for which the link counts as lost after the loop did not run: data waiting in the sockets is read by then.
const PAUSE_OVER: Duration = Duration::from_secs(1);

/// A world on the wall clock. The VLM runs in its own thread, so that setpoints are sent while a query is open; all events
/// arrive through one channel.
pub struct Live {
    start: Instant,
    now: Time,
    drone: Box<dyn Drone>,
    /// When the craft was last told what is around it.
    told: Option<Time>,
    /// What it reported before the loop began; `None` before that.
    earlier: Option<VecDeque<DroneEvent>>,
    /// Leads to the thread in which the VLM answers one query after the other.
    vlm: Sender<(Query, Cancel)>,
    /// Open queries, with their cancel handles.
    out: Vec<(QueryId, Cancel)>,
    events: Receiver<(Time, Event)>,
    tracker: Option<TrackingThread>,
    later: Vec<(Time, Event)>,
    script: Script,
    interrupts: Arc<AtomicU32>,
    interrupted: bool,
    operator: Option<Receiver<OperatorEvent>>,
    pauses: Pauses,
    /// Whether the driver has reported the link as lost.
    link_lost: bool,
    /// Until when the link counts as lost because of a pause.
    paused_until: Option<Time>,
}

/// Starts the thread in which the VLM answers one query after the other.
fn ask_in_thread(
    start: Instant,
    mut vlm: Box<dyn Vlm>,
    mut images: QueryImages,
    answered: Sender<(Time, Event)>,
) -> std::io::Result<Sender<(Query, Cancel)>> {
    let (queries, request) = channel::<(Query, Cancel)>();
    std::thread::Builder::new().name("vlm".to_owned()).spawn(move || {
        for (query, cancel) in request {
            let begun = start.elapsed();
            let (latency, text) = if cancel.is_cancelled() {
                (Duration::ZERO, Err(VlmError::Cancelled))
            } else {
                let request = QueryRequest { query: &query, time_left: query.deadline.since(Time::ZERO + begun), cancel };
                let answer = vlm.answer(&request, &mut images.about(&query));
                (answer.latency, answer.text)
            };
            let event = answer_event(query.id, text);
            // The oracle reports a latency without spending it; a real model has already spent it.
            if answered.send((Time::ZERO + begun + latency, event)).is_err() {
                return;
            }
        }
    })?;
    Ok(queries)
}

impl Live {
    /// A world whose flight time zero is `start`, as for its drone. If `tracks`, a thread of its own tracks what the pilot asks
    /// to be tracked.
    ///
    /// # Errors
    /// The operating system's error if a thread cannot be started.
    pub fn new(
        start: Instant,
        drone: Box<dyn Drone>,
        vlm: Box<dyn Vlm>,
        script: Script,
        interrupts: Arc<AtomicU32>,
        tracks: bool,
    ) -> std::io::Result<Self> {
        let (answered, events) = channel();
        let tracker = tracks
            .then(|| TrackingThread::start(start, &drone.capabilities().camera, drone.frames(), answered.clone()))
            .transpose()?;
        let vlm = ask_in_thread(start, vlm, QueryImages::of(drone.as_ref()), answered)?;
        let now = Time::ZERO + start.elapsed();
        let (out, later) = (Vec::new(), Vec::new());
        Ok(Self {
            start,
            now,
            drone,
            told: None,
            earlier: None,
            vlm,
            out,
            events,
            tracker,
            later,
            script,
            interrupts,
            interrupted: false,
            operator: None,
            pauses: Pauses::new(),
            link_lost: false,
            paused_until: None,
        })
    }

    /// Adds manual operator inputs.
    #[must_use]
    pub fn with_operator(mut self, operator: Option<Receiver<OperatorEvent>>) -> Self {
        self.operator = operator;
        self
    }

    /// A loop that did not run has missed whatever happened to the craft: as with a lost link.
    fn pause(&mut self) -> Option<Event> {
        if let Some(pause) = self.pauses.check() {
            tracing::warn!("the flight loop did not run for {:.1} s: the link counts as lost", pause.as_secs_f64());
            self.paused_until = Some(self.now + PAUSE_OVER);
            return Some(Event::LinkLost);
        }
        self.paused_until.take_if(|until| *until <= self.now)?;
        (!self.link_lost).then_some(Event::LinkRestored)
    }

    /// Follows the driver's reports of the link; during a pause it stays lost.
    fn of_link(&mut self, event: Event) -> Option<Event> {
        match event {
            Event::LinkLost => self.link_lost = true,
            Event::LinkRestored => {
                self.link_lost = false;
                if self.paused_until.is_some() {
                    return None;
                }
            }
            _ => {}
        }
        Some(event)
    }

    /// What the craft reports next. Of the states that it reported before the loop began, such as while a page was waited for, the newest
    /// counts: by an older one no craft takes off.
    fn reported(&mut self) -> Option<DroneEvent> {
        let earlier = self.earlier.get_or_insert_with(|| {
            let mut earlier = VecDeque::new();
            while let Some((_, event)) = self.drone.next_event(self.now) {
                if matches!(event, DroneEvent::Telemetry(_)) {
                    earlier.retain(|event| !matches!(event, DroneEvent::Telemetry(_)));
                }
                earlier.push_back(event);
            }
            earlier
        });
        earlier.pop_front().or_else(|| self.drone.next_event(self.now).map(|(_, event)| event))
    }

    fn due(&mut self) -> Option<Event> {
        if !self.interrupted && self.interrupts.load(Ordering::Relaxed) > 0 {
            self.interrupted = true;
            return Some(Event::Operator(OperatorEvent::Land));
        }
        if let Some(event) = self.operator.as_ref().and_then(|operator| operator.try_recv().ok()) {
            return Some(Event::Operator(event));
        }
        if let Some(event) = self.script.take(self.now) {
            return Some(Event::Operator(event));
        }
        if let Some(event) = self.pause() {
            return Some(event);
        }
        while let Some(event) = self.reported() {
            if let Some(event) = self.of_link(pilot_event(event, self.operator.is_some() || self.script.next_at().is_some())) {
                if let Some(tracker) = &self.tracker {
                    tracker.event(&event);
                }
                return Some(event);
            }
        }
        let index = self.later.iter().position(|(at, _)| *at <= self.now)?;
        Some(self.later.remove(index).1)
    }
}

impl Drop for Live {
    /// Cancels all open queries.
    fn drop(&mut self) {
        for (_, cancel) in &self.out {
            cancel.cancel();
        }
    }
}

impl World for Live {
    fn now(&self) -> Time {
        self.now
    }

    fn wait(&mut self, deadline: Time) -> Option<Event> {
        loop {
            self.now = self.now.max(Time::ZERO + self.start.elapsed());
            if let Some(event) = self.due() {
                return Some(event);
            }
            if self.now >= deadline {
                return None;
            }
            let later = self.later.iter().map(|(at, _)| *at).min();
            let next = [self.drone.next_event_at(), self.script.next_at(), later].into_iter().flatten().fold(deadline, Time::min);
            match self.events.recv_timeout(next.since(self.now).min(MAX_WAIT)) {
                Ok((at, event)) => {
                    if let Event::Reply { id, .. } | Event::ReplyFailed { id, .. } = &event {
                        self.out.retain(|(of, _)| of != id);
                    }
                    self.later.push((at, event));
                }
                Err(RecvTimeoutError::Timeout) => {}
                // The reply thread is gone; its queries time out and the pilot holds.
                Err(RecvTimeoutError::Disconnected) => std::thread::sleep(next.since(self.now).min(MAX_WAIT)),
            }
        }
    }

    fn surroundings(&mut self, pilot: &Pilot) {
        super::tell_surroundings(self.now, pilot, &mut self.told, self.drone.as_mut());
    }

    fn apply(&mut self, action: &Action) {
        if let Some(tracker) = &self.tracker {
            tracker.apply(action);
        }
        match action {
            Action::Ask(query) => {
                let cancel = Cancel::default();
                self.out.push((query.id, cancel.clone()));
                if self.vlm.send(((**query).clone(), cancel)).is_err() {
                    tracing::warn!("the VLM thread has ended: queries are no longer sent");
                }
            }
            Action::Cancel(id) => {
                for (_, cancel) in self.out.extract_if(.., |(of, _)| of == id) {
                    cancel.cancel();
                }
            }
            // The operator, and nothing that the pilot sends, lets a driver take control back.
            Action::Note(Note::Operator(OperatorEvent::Resume)) => self.drone.resume(self.now),
            Action::Track(_) | Action::Untrack | Action::Note(_) | Action::Finished(_) => {}
            Action::Command(command) => {
                if let Err(error) = self.drone.apply(self.now, command) {
                    tracing::warn!(%error, "a command did not reach the craft");
                }
            }
        }
    }
}

//! The wall clock: events come when they come.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::Instant;

use spf_core::pilot::{Action, Event, OperatorEvent};
use spf_core::query::Query;
use spf_core::time::{Duration, Time};
use spf_drone::Drone;
use spf_vlm::Vlm;

use super::{Script, pilot_event};
use crate::picture::PictureSource;
use crate::run::World;

/// Ctrl-C is noticed within this time even when nothing else happens.
const LONGEST_NAP: Duration = Duration::from_millis(50);

/// A world on the wall clock. The VLM answers in a thread of its own, so that setpoints go out while it thinks; everything that
/// happens comes through one channel.
pub struct Live {
    start: Instant,
    now: Time,
    drone: Box<dyn Drone>,
    queries: Sender<Query>,
    events: Receiver<(Time, Event)>,
    later: Vec<(Time, Event)>,
    script: Script,
    interrupts: Arc<AtomicU32>,
    interrupted: bool,
}

impl Live {
    /// A world whose flight time zero is now.
    ///
    /// # Errors
    /// The operating system's, when no thread can be started.
    pub fn new(
        drone: Box<dyn Drone>,
        mut vlm: Box<dyn Vlm>,
        mut pictures: Box<dyn PictureSource>,
        script: Script,
        interrupts: Arc<AtomicU32>,
    ) -> std::io::Result<Self> {
        let (queries, asked) = channel::<Query>();
        let (answered, events) = channel();
        let start = Instant::now();
        std::thread::Builder::new().name("vlm".to_owned()).spawn(move || {
            for query in asked {
                let begun = start.elapsed();
                let id = query.id;
                let (latency, event) = match vlm.answer(&query, &mut *pictures.of(&query)) {
                    Ok(answer) => (answer.latency, Event::Reply { id, text: answer.text }),
                    Err(error) => (Duration::ZERO, Event::ReplyFailed { id, reason: error.to_string() }),
                };
                // The oracle tells a latency that it did not spend; a real model has spent it already.
                if answered.send((Time::ZERO + begun + latency, event)).is_err() {
                    return;
                }
            }
        })?;
        let script_start = Time::ZERO;
        Ok(Self { start, now: script_start, drone, queries, events, later: Vec::new(), script, interrupts, interrupted: false })
    }

    fn due(&mut self) -> Option<Event> {
        if !self.interrupted && self.interrupts.load(Ordering::Relaxed) > 0 {
            self.interrupted = true;
            return Some(Event::Operator(OperatorEvent::Land));
        }
        if let Some(event) = self.script.take(self.now) {
            return Some(Event::Operator(event));
        }
        if let Some((_, event)) = self.drone.next_event(self.now) {
            return Some(pilot_event(event));
        }
        let index = self.later.iter().position(|(at, _)| *at <= self.now)?;
        Some(self.later.remove(index).1)
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
            match self.events.recv_timeout(next.since(self.now).min(LONGEST_NAP)) {
                Ok(event) => self.later.push(event),
                Err(RecvTimeoutError::Timeout) => {}
                // The answering thread is gone; its queries run into their deadlines and the pilot holds.
                Err(RecvTimeoutError::Disconnected) => std::thread::sleep(next.since(self.now).min(LONGEST_NAP)),
            }
        }
    }

    fn apply(&mut self, action: &Action) {
        match action {
            Action::Ask(query) => {
                if self.queries.send((**query).clone()).is_err() {
                    tracing::warn!("the thread that asks the VLM is gone");
                }
            }
            Action::Cancel(_) | Action::Note(_) | Action::Finished(_) => {}
            Action::Command(command) => {
                if let Err(error) = self.drone.apply(self.now, command) {
                    tracing::warn!(%error, "a command did not reach the craft");
                }
            }
        }
    }
}

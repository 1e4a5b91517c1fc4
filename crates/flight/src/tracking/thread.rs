//! The tracker in a thread of its own, for flights on the wall clock.

use std::collections::VecDeque;
use std::sync::mpsc::Sender;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{Builder, JoinHandle};
use std::time::Instant;

use spf_core::camera::Camera;
use spf_core::frame::{FrameId, FrameMeta};
use spf_core::telemetry::Telemetry;
use spf_core::time::Time;
use spf_core::track::TrackStart;
use spf_drone::frames::{Frames, Photo};
use spf_pilot::{Action, Event};

use super::{Progress, Tracking};

/// Number of items that may wait for the thread, which takes them all before every image: about half a second's. Of more, the
/// oldest are dropped.
const WAITING: usize = 64;

/// Something that has arrived for the thread.
enum Item {
    Telemetry(Telemetry),
    Frame(FrameMeta, Option<Photo>),
    Asked(FrameId, Option<Photo>),
}

/// What waits for the thread.
#[derive(Default)]
struct Waiting {
    items: VecDeque<Item>,
    /// The newest request, if it was not taken yet; `Some(None)` to track nothing.
    request: Option<Option<TrackStart>>,
    closed: bool,
}

#[derive(Default)]
struct Inbox {
    waiting: Mutex<Waiting>,
    news: Condvar,
}

impl Inbox {
    fn waiting(&self) -> MutexGuard<'_, Waiting> {
        // The value is consistent between calls.
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn put(&self, item: Item) {
        let mut waiting = self.waiting();
        if waiting.items.len() >= WAITING {
            waiting.items.pop_front();
        }
        waiting.items.push_back(item);
        drop(waiting);
        self.news.notify_one();
    }

    fn change(&self, change: impl FnOnce(&mut Waiting)) {
        change(&mut self.waiting());
        self.news.notify_one();
    }

    /// Takes everything that waits, or waits for something if `idle`; `None` when closed.
    fn take(&self, idle: bool) -> Option<(VecDeque<Item>, Option<Option<TrackStart>>)> {
        let mut waiting = self.waiting();
        while idle && !waiting.closed && waiting.items.is_empty() && waiting.request.is_none() {
            waiting = self.news.wait(waiting).unwrap_or_else(PoisonError::into_inner);
        }
        (!waiting.closed).then(|| (std::mem::take(&mut waiting.items), waiting.request.take()))
    }
}

/// A tracker beside the flight loop, which it never delays: the loop only leaves frames and requests. The thread ends when this
/// is dropped.
pub(crate) struct TrackingThread {
    inbox: Arc<Inbox>,
    frames: Arc<dyn Frames>,
    thread: Option<JoinHandle<()>>,
}

impl TrackingThread {
    /// Starts the thread. Reports go to `events`, with their flight times since `start`.
    ///
    /// # Errors
    /// The operating system's error if the thread cannot be started.
    pub(crate) fn start(
        start: Instant,
        camera: &Camera,
        frames: Arc<dyn Frames>,
        events: Sender<(Time, Event)>,
    ) -> std::io::Result<Self> {
        let inbox = Arc::new(Inbox::default());
        let (of_thread, mut tracking) = (inbox.clone(), Tracking::new(camera));
        let report = move |event: Event| events.send((Time::ZERO + start.elapsed(), event)).is_ok();
        let thread = Builder::new().name("tracker".to_owned()).spawn(move || track(&of_thread, &mut tracking, report))?;
        Ok(Self { inbox, frames, thread: Some(thread) })
    }

    /// Notes an event that the pilot gets.
    pub(crate) fn event(&self, event: &Event) {
        match event {
            Event::Telemetry(telemetry) => self.inbox.put(Item::Telemetry(*telemetry)),
            // The frame is held from now on: its camera may drop it within a second.
            Event::Frame(meta) => self.inbox.put(Item::Frame(*meta, self.frames.photo(meta.id))),
            _ => {}
        }
    }

    /// Carries out an action of the pilot, if it concerns a tracker.
    pub(crate) fn apply(&self, action: &Action) {
        match action {
            Action::Ask(query) => self.inbox.put(Item::Asked(query.frame, self.frames.photo(query.frame))),
            Action::Track(start) => self.inbox.change(|waiting| waiting.request = Some(Some(*start))),
            Action::Untrack => self.inbox.change(|waiting| waiting.request = Some(None)),
            _ => {}
        }
    }
}

impl Drop for TrackingThread {
    /// Waits for the thread, which finishes at most one image.
    fn drop(&mut self) {
        self.inbox.change(|waiting| waiting.closed = true);
        if let Some(thread) = self.thread.take()
            && thread.join().is_err()
        {
            tracing::warn!("internal error: the tracker has failed");
        }
    }
}

/// The thread. Between two images it takes what has arrived, so that the newest request and the newest frame count.
fn track(inbox: &Inbox, tracking: &mut Tracking, report: impl Fn(Event) -> bool) {
    let mut idle = true;
    while let Some((items, request)) = inbox.take(idle) {
        for item in items {
            match item {
                Item::Telemetry(telemetry) => tracking.telemetry(&telemetry),
                Item::Frame(meta, photo) => tracking.frame(meta, || photo),
                Item::Asked(frame, photo) => tracking.asked(frame, photo),
            }
        }
        tracking.convert();
        match request {
            Some(Some(start)) => tracking.start(start),
            Some(None) => tracking.stop(),
            None => {}
        }
        idle = match tracking.step() {
            Progress::Idle => true,
            Progress::Behind => false,
            Progress::Report(found) => {
                if !report(Event::Track(found)) {
                    return;
                }
                false
            }
        };
    }
}

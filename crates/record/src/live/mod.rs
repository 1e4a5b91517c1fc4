//! The live view: the log's messages over Foxglove's WebSocket protocol while the flight goes on (docs/reference/flight-log.md).
//!
//! Whoever sends never waits: each viewer has a bounded queue, and what a slow one cannot take is left out and told to it. A viewer that
//! takes nothing for some seconds is let go.

mod protocol;
mod viewer;

use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use crate::log::{Message, Topic};

/// Messages that may wait for a viewer.
const WAITING: usize = 256;
/// Viewers at a time; further ones are turned away.
const VIEWERS: usize = 8;

/// How long viewers' threads are waited for at the end: so many glances.
const LAST_WORDS: u32 = 100;
const GLANCE: Duration = Duration::from_millis(10);

/// A server of live views.
#[derive(Debug)]
pub struct Live {
    address: SocketAddr,
    shared: Arc<Shared>,
    door: Option<JoinHandle<()>>,
}

/// Where messages go in. Any number of threads may hold one; it never waits.
#[derive(Clone, Debug)]
pub struct LiveSender(Arc<Shared>);

#[derive(Debug)]
struct Shared {
    name: String,
    topics: Vec<Topic>,
    closed: AtomicBool,
    /// Viewers' threads.
    serving: AtomicUsize,
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    next: u64,
    viewers: BTreeMap<u64, Subscriber>,
    /// The latest message of each topic, with which a viewer begins.
    latest: BTreeMap<usize, Message>,
}

/// What the flight knows of a viewer.
#[derive(Debug)]
struct Subscriber {
    queue: SyncSender<Message>,
    topics: BTreeSet<usize>,
    left_out: Arc<AtomicU64>,
}

/// What a viewer's thread has of its subscriber; the subscriber is given up when it is dropped.
struct Subscription<'a> {
    shared: &'a Shared,
    id: u64,
    queue: Receiver<Message>,
    left_out: Arc<AtomicU64>,
}

impl Live {
    /// Answers at `address` (port 0: one that is free); `name` is what viewers are told.
    ///
    /// # Errors
    /// The system's, when the address cannot be had or no thread be started.
    pub fn bind(address: SocketAddr, name: &str, topics: Vec<Topic>) -> io::Result<Self> {
        let listener = TcpListener::bind(address)?;
        let address = listener.local_addr()?;
        let shared = Arc::new(Shared {
            name: name.to_owned(),
            topics,
            closed: AtomicBool::new(false),
            serving: AtomicUsize::new(0),
            state: Mutex::default(),
        });
        let inside = shared.clone();
        let door = std::thread::Builder::new().name("live door".to_owned()).spawn(move || answer(&listener, &inside))?;
        Ok(Self { address, shared, door: Some(door) })
    }

    /// Where it answers.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Where messages go in.
    #[must_use]
    pub fn sender(&self) -> LiveSender {
        LiveSender(self.shared.clone())
    }
}

impl Drop for Live {
    fn drop(&mut self) {
        self.shared.closed.store(true, Ordering::Relaxed);
        // Viewers' queues end; the door wakes up from waiting for one more.
        self.shared.state().viewers.clear();
        drop(TcpStream::connect_timeout(&self.address, Duration::from_secs(1)));
        if let Some(door) = self.door.take() {
            door.join().ok();
        }
        // The last messages of the flight go out; a viewer that takes none is not waited for.
        for _ in 0..LAST_WORDS {
            if self.shared.serving.load(Ordering::Relaxed) == 0 {
                break;
            }
            std::thread::sleep(GLANCE);
        }
    }
}

impl LiveSender {
    /// Shows a message to whoever wants its topic.
    pub fn send(&self, message: &Message) {
        let mut state = self.0.state();
        for subscriber in state.viewers.values().filter(|subscriber| subscriber.topics.contains(&message.topic)) {
            if let Err(TrySendError::Full(_)) = subscriber.queue.try_send(message.clone()) {
                subscriber.left_out.fetch_add(1, Ordering::Relaxed);
            }
        }
        state.latest.insert(message.topic, message.clone());
    }
}

impl Shared {
    fn state(&self) -> MutexGuard<'_, State> {
        // A panic elsewhere leaves the lists whole.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A subscriber for one more viewer; none when all are taken.
    fn subscriber(&self) -> Option<Subscription<'_>> {
        let (queue, messages) = sync_channel(WAITING);
        let left_out = Arc::new(AtomicU64::new(0));
        let mut state = self.state();
        if state.viewers.len() >= VIEWERS || self.closed.load(Ordering::Relaxed) {
            return None;
        }
        let id = state.next;
        state.next += 1;
        self.serving.fetch_add(1, Ordering::Relaxed);
        state.viewers.insert(id, Subscriber { queue, topics: BTreeSet::new(), left_out: left_out.clone() });
        Some(Subscription { shared: self, id, queue: messages, left_out })
    }
}

impl Subscription<'_> {
    /// The viewer wants a topic, of which it is shown the latest message at once.
    fn subscribe(&self, topic: usize) {
        let mut state = self.shared.state();
        let latest = state.latest.get(&topic).cloned();
        if let Some(subscriber) = state.viewers.get_mut(&self.id)
            && subscriber.topics.insert(topic)
            && let Some(latest) = latest
        {
            subscriber.queue.try_send(latest).ok();
        }
    }

    /// The viewer wants a topic no longer.
    fn unsubscribe(&self, topic: usize) {
        if let Some(subscriber) = self.shared.state().viewers.get_mut(&self.id) {
            subscriber.topics.remove(&topic);
        }
    }
}

impl Drop for Subscription<'_> {
    fn drop(&mut self) {
        self.shared.state().viewers.remove(&self.id);
        self.shared.serving.fetch_sub(1, Ordering::Relaxed);
    }
}

/// Lets viewers in until the server is closed.
fn answer(listener: &TcpListener, shared: &Arc<Shared>) {
    for stream in listener.incoming() {
        if shared.closed.load(Ordering::Relaxed) {
            return;
        }
        let Ok(stream) = stream else {
            // Too many files open, most often: better later than in a circle.
            std::thread::sleep(Duration::from_millis(100));
            continue;
        };
        let inside = shared.clone();
        let viewer = std::thread::Builder::new().name("live viewer".to_owned());
        if let Err(error) = viewer.spawn(move || viewer::serve(stream, &inside)) {
            tracing::warn!(%error, "a viewer cannot be let in");
        }
    }
}

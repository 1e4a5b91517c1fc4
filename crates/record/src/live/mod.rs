//! The live view: the log's messages over Foxglove's WebSocket protocol during the flight
//! (docs/reference/flight-log.md).
//!
//! Sending never blocks: each viewer has a bounded queue, and a slow one loses messages and receives a status message
//! about it. A viewer that accepts nothing for some seconds is disconnected.

mod protocol;
mod viewer;

use std::collections::{BTreeMap, BTreeSet};
use std::io::{self, Write as _};
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use spf_guard::{Access, ConnectionSlots};

use crate::log::{Message, Topic};

/// Maximum number of messages queued for a viewer.
const WAITING: usize = 256;

/// Maximum wait for the viewers' threads at the end, in polling intervals.
const SHUTDOWN_POLLS: u32 = 100;
const GLANCE: Duration = Duration::from_millis(10);

/// Reads a viewer's request, for fuzzing; whether it is one.
#[doc(hidden)]
#[must_use]
pub fn read_request(text: &str) -> bool {
    serde_json::from_str::<protocol::Request>(text).is_ok()
}

/// The origin of Foxglove's web application, whose pages may connect.
pub const FOXGLOVE: &str = "https://app.foxglove.dev";

/// The live view server.
#[derive(Debug)]
pub struct Live {
    address: SocketAddr,
    shared: Arc<Shared>,
    door: Option<JoinHandle<()>>,
}

/// Sends messages to the viewers; can be shared by several threads. It never blocks.
#[derive(Clone, Debug)]
pub struct LiveSender(Arc<Shared>);

#[derive(Debug)]
struct Shared {
    name: String,
    topics: Vec<Topic>,
    closed: AtomicBool,
    access: Access,
    /// Whether a page of another origin was refused before: a page that tries again and again must not fill the log.
    refused: AtomicBool,
    places: ConnectionSlots,
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    next: u64,
    viewers: BTreeMap<u64, Subscriber>,
    /// The latest message of each topic, sent first to a new subscriber.
    latest: BTreeMap<usize, Message>,
}

/// The sending side of a viewer.
#[derive(Debug)]
struct Subscriber {
    queue: SyncSender<Message>,
    topics: BTreeSet<usize>,
    left_out: Arc<AtomicU64>,
}

/// The receiving side of a viewer; dropping it removes the subscriber.
struct Subscription<'a> {
    shared: &'a Shared,
    id: u64,
    queue: Receiver<Message>,
    left_out: Arc<AtomicU64>,
}

impl Live {
    /// Serves at `address` (port 0: any free port); `name` is the server name sent to viewers. Programs may connect, and
    /// pages of [`FOXGLOVE`] and of `origins`; no other page.
    ///
    /// # Errors
    /// The operating system's error if the address cannot be bound or no thread can be started; an invalid origin.
    pub fn bind(address: SocketAddr, name: &str, topics: Vec<Topic>, origins: &[String]) -> io::Result<Self> {
        let listener = TcpListener::bind(address)?;
        let address = listener.local_addr()?;
        let mut access = Access::at(address);
        for origin in core::iter::once(FOXGLOVE).chain(origins.iter().map(String::as_str)) {
            access = access.allowing(origin).map_err(io::Error::other)?;
        }
        let shared = Arc::new(Shared {
            name: name.to_owned(),
            topics,
            closed: AtomicBool::new(false),
            access,
            refused: AtomicBool::new(false),
            places: ConnectionSlots::new(spf_guard::CONNECTIONS),
            state: Mutex::default(),
        });
        let inside = shared.clone();
        let door = std::thread::Builder::new().name("live listener".to_owned()).spawn(move || answer(&listener, &inside))?;
        Ok(Self { address, shared, door: Some(door) })
    }

    /// The address served.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// A sender for messages.
    #[must_use]
    pub fn sender(&self) -> LiveSender {
        LiveSender(self.shared.clone())
    }
}

impl Drop for Live {
    fn drop(&mut self) {
        self.shared.closed.store(true, Ordering::Relaxed);
        // Close the viewers' queues, and wake the accepting thread with one more connection.
        self.shared.state().viewers.clear();
        drop(TcpStream::connect_timeout(&self.address, Duration::from_secs(1)));
        if let Some(door) = self.door.take() {
            door.join().ok();
        }
        // The last messages of the flight are sent; a viewer that accepts none is not awaited.
        for _ in 0..SHUTDOWN_POLLS {
            if self.shared.places.count() == 0 {
                break;
            }
            std::thread::sleep(GLANCE);
        }
    }
}

impl LiveSender {
    /// Sends a message to the subscribers of its topic.
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
        // After a panic elsewhere the lists are still consistent.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds a subscriber; `None` if the server is closed.
    fn subscriber(&self) -> Option<Subscription<'_>> {
        let (queue, messages) = sync_channel(WAITING);
        let left_out = Arc::new(AtomicU64::new(0));
        let mut state = self.state();
        if self.closed.load(Ordering::Relaxed) {
            return None;
        }
        let id = state.next;
        state.next += 1;
        state.viewers.insert(id, Subscriber { queue, topics: BTreeSet::new(), left_out: left_out.clone() });
        Some(Subscription { shared: self, id, queue: messages, left_out })
    }
}

impl Subscription<'_> {
    /// Subscribes to a topic and sends its latest message.
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

    /// Unsubscribes from a topic.
    fn unsubscribe(&self, topic: usize) {
        if let Some(subscriber) = self.shared.state().viewers.get_mut(&self.id) {
            subscriber.topics.remove(&topic);
        }
    }
}

impl Drop for Subscription<'_> {
    fn drop(&mut self) {
        self.shared.state().viewers.remove(&self.id);
    }
}

/// Accepts viewers until the server is closed.
fn answer(listener: &TcpListener, shared: &Arc<Shared>) {
    for stream in listener.incoming() {
        if shared.closed.load(Ordering::Relaxed) {
            return;
        }
        let Ok(stream) = stream else {
            // Usually too many open files: wait instead of spinning.
            std::thread::sleep(Duration::from_millis(100));
            continue;
        };
        // A viewer that has not said what it wants gives its place up to a new one; its thread ends with its connection.
        let Ok(other) = stream.try_clone() else { continue };
        let Some(place) = shared.places.enter(move || drop(other.shutdown(Shutdown::Both))) else {
            turn_away(&stream);
            continue;
        };
        let inside = shared.clone();
        let viewer = std::thread::Builder::new().name("live viewer".to_owned());
        if let Err(error) = viewer.spawn(move || viewer::serve(stream, &inside, &place)) {
            tracing::warn!(%error, "cannot accept a viewer");
        }
    }
}

/// Tells a viewer that there is no place; what cannot be sent at once is not.
fn turn_away(mut stream: &TcpStream) {
    let head = "HTTP/1.1 503 Service Unavailable\r\ncontent-length: 0\r\nretry-after: 1\r\nconnection: close\r\n\r\n";
    if stream.set_nonblocking(true).is_ok() {
        drop(stream.write_all(head.as_bytes()));
    }
}

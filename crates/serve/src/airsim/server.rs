//! Sockets and clock.

use std::collections::VecDeque;
use std::io::{Read, Write};
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError, Weak};
use std::thread::{Builder, JoinHandle};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use spf_core::time::Time;
use spf_drone::airsim::wire::{Decoder, Encoding, Limits, Message};
use spf_flight::sim::LoadedScene;

use super::calls;
use super::city::City;
use super::settings::Settings;

/// Most connections.
const CONNECTIONS: usize = 64;
/// Bytes of responses that wait before the next request of a connection is taken.
const WAITING: usize = 1 << 20;
/// How long a client may take nothing of what it has asked for.
const PATIENCE: Duration = Duration::from_secs(30);
/// Sleep of the clock.
const NAP: Duration = Duration::from_millis(2);
/// Lag of simulated time behind the wall clock that is caught up with; what is beyond is dropped.
const LAG: Duration = Duration::from_millis(500);

/// What is served.
pub struct AirSimPlan {
    /// The scene.
    pub loaded: Arc<LoadedScene>,
    /// Vehicles, cameras, clock.
    pub settings: Settings,
    /// Where.
    pub listen: SocketAddr,
    /// Seed of all random choices.
    pub seed: u64,
    /// Whether time stands still at the start, as after `simPause(True)`.
    pub paused: bool,
}

/// Why nothing can be served.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum AirSimError {
    /// The address cannot be used.
    #[error("cannot listen on {address}")]
    Listen {
        /// The address.
        address: SocketAddr,
        /// The cause.
        source: std::io::Error,
    },
    /// A thread cannot be started.
    #[error("cannot start a thread")]
    Thread(#[source] std::io::Error),
}

struct Shared {
    city: Mutex<City>,
    wake: Condvar,
    stopped: AtomicBool,
    connections: AtomicUsize,
    open: Mutex<Vec<Weak<Connection>>>,
}

impl Shared {
    fn city(&self) -> MutexGuard<'_, City> {
        self.city.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn is_stopped(&self) -> bool {
        self.stopped.load(Ordering::Relaxed)
    }
}

/// A running server; it stops when dropped.
pub struct AirSimServer {
    shared: Arc<Shared>,
    address: SocketAddr,
    threads: Vec<JoinHandle<()>>,
}

impl AirSimServer {
    /// Starts serving.
    ///
    /// # Errors
    /// [`AirSimError`] if it cannot listen, or a thread cannot be started.
    pub fn start(plan: AirSimPlan) -> Result<Self, AirSimError> {
        let AirSimPlan { loaded, settings, listen, seed, paused } = plan;
        let refused = |source| AirSimError::Listen { address: listen, source };
        let listener = TcpListener::bind(listen).map_err(refused)?;
        let address = listener.local_addr().map_err(refused)?;
        // What the first picture would prepare takes seconds on a slow machine.
        loaded.prepare();
        let epoch = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_nanos() as u64;
        let speed = settings.clock_speed;
        let mut city = City::new(loaded, settings, seed, epoch);
        city.pause(paused);
        let shared = Arc::new(Shared {
            city: Mutex::new(city),
            wake: Condvar::new(),
            stopped: AtomicBool::new(false),
            connections: AtomicUsize::new(0),
            open: Mutex::default(),
        });
        let mut server = Self { shared: shared.clone(), address, threads: Vec::new() };
        let of = shared.clone();
        server.spawn("airsim clock", move || run_clock(&of, speed))?;
        server.spawn("airsim accept", move || accept(&listener, &shared))?;
        Ok(server)
    }

    fn spawn(&mut self, name: &str, run: impl FnOnce() + Send + 'static) -> Result<(), AirSimError> {
        let thread = Builder::new().name(name.to_owned()).spawn(run).map_err(AirSimError::Thread)?;
        self.threads.push(thread);
        Ok(())
    }

    /// Where it listens.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.address
    }
}

impl Drop for AirSimServer {
    fn drop(&mut self) {
        self.shared.stopped.store(true, Ordering::Relaxed);
        self.shared.wake.notify_all();
        // Wakes whoever accepts.
        let mut own = self.address;
        if own.ip().is_unspecified() {
            own.set_ip(match own {
                SocketAddr::V4(_) => std::net::Ipv4Addr::LOCALHOST.into(),
                SocketAddr::V6(_) => std::net::Ipv6Addr::LOCALHOST.into(),
            });
        }
        drop(TcpStream::connect_timeout(&own, Duration::from_secs(1)));
        let open = core::mem::take(&mut *self.shared.open.lock().unwrap_or_else(PoisonError::into_inner));
        open.iter().filter_map(Weak::upgrade).for_each(|connection| connection.close());
        for thread in self.threads.drain(..) {
            drop(thread.join());
        }
    }
}

/// Moves simulated time: with the wall clock, or, paused, as fast as it can through an interval that was asked for.
fn run_clock(shared: &Shared, speed: f64) {
    let mut anchor = (Instant::now(), shared.city().now());
    while !shared.is_stopped() {
        let mut city = shared.city();
        if city.is_running() {
            city.advance_run();
            anchor = (Instant::now(), city.now());
            // Calls are answered meanwhile.
            drop(city);
            std::thread::yield_now();
            continue;
        }
        if city.is_paused() {
            drop(shared.wake.wait_timeout(city, LAG).unwrap_or_else(PoisonError::into_inner));
            anchor = (Instant::now(), shared.city().now());
            continue;
        }
        let wanted = anchor.1 + anchor.0.elapsed().mul_f64(speed);
        let reachable = wanted.min(city.now() + LAG.mul_f64(speed.max(1.0)));
        if reachable < wanted {
            anchor = (Instant::now(), reachable);
        }
        advance_gently(shared, city, reachable);
        let city = shared.city();
        drop(shared.wake.wait_timeout(city, NAP).unwrap_or_else(PoisonError::into_inner));
    }
}

/// Advances in pieces, between which calls are answered.
fn advance_gently<'a>(shared: &'a Shared, mut city: MutexGuard<'a, City>, to: Time) {
    const PIECE: Duration = Duration::from_millis(100);
    loop {
        let next = to.min(city.now() + PIECE);
        city.advance_to(next);
        if city.is_paused() || next >= to || shared.is_stopped() {
            return;
        }
        drop(city);
        city = shared.city();
    }
}

fn accept(listener: &TcpListener, shared: &Arc<Shared>) {
    while !shared.is_stopped() {
        let Ok((stream, peer)) = listener.accept() else {
            // Out of file descriptors, say: others may end meanwhile.
            std::thread::sleep(NAP);
            continue;
        };
        if shared.is_stopped() {
            return;
        }
        if shared.connections.load(Ordering::Relaxed) >= CONNECTIONS {
            tracing::warn!("{peer} is refused: {CONNECTIONS} clients are connected");
            continue;
        }
        if let Err(error) = welcome(stream, shared) {
            tracing::warn!(%error, "{peer} cannot be served");
        }
    }
}

fn welcome(stream: TcpStream, shared: &Arc<Shared>) -> std::io::Result<()> {
    stream.set_nodelay(true)?;
    stream.set_write_timeout(Some(PATIENCE))?;
    let (reads, writes) = (stream.try_clone()?, stream.try_clone()?);
    let connection = Arc::new(Connection { stream, outbox: Mutex::default(), changed: Condvar::new() });
    {
        let mut open = shared.open.lock().unwrap_or_else(PoisonError::into_inner);
        open.retain(|one| one.strong_count() > 0);
        open.push(Arc::downgrade(&connection));
    }
    if shared.is_stopped() {
        connection.close();
    }
    shared.connections.fetch_add(1, Ordering::Relaxed);
    let counted = Counted(shared.clone());
    let own = connection.clone();
    Builder::new().name("airsim write".to_owned()).spawn(move || own.write(writes))?;
    let of = connection.clone();
    let started = Builder::new().name("airsim read".to_owned()).spawn(move || {
        serve(reads, &counted.0, &of);
        of.close();
    });
    if started.is_err() {
        connection.close();
    }
    started.map(drop)
}

/// Counts a connection until it is dropped.
struct Counted(Arc<Shared>);

impl Drop for Counted {
    fn drop(&mut self) {
        self.0.connections.fetch_sub(1, Ordering::Relaxed);
    }
}

/// Reads requests until the client is gone.
fn serve(mut stream: TcpStream, shared: &Shared, connection: &Arc<Connection>) {
    let (mut decoder, mut encoding) = (Decoder::new(Limits::REQUESTS), Encoding::Map);
    let mut bytes = vec![0; 1 << 16];
    loop {
        loop {
            match decoder.next_message() {
                Ok(Some(Message::Request { id, method, params })) => {
                    encoding = calls::dialect(&method, &params).unwrap_or(encoding);
                    let to = connection.clone();
                    let respond = move |outcome: Result<_, String>| {
                        to.push(match outcome {
                            Ok(result) => Message::Response { id, outcome: Ok(result) }.encode(),
                            Err(text) => Message::failure(id, &text).encode(),
                        });
                    };
                    handle(shared, &method, &params, encoding, Box::new(respond));
                }
                Ok(Some(Message::Notification { method, params })) => {
                    handle(shared, &method, &params, encoding, Box::new(drop));
                }
                // Nobody has asked.
                Ok(Some(Message::Response { .. })) => {}
                Ok(None) => break,
                Err(error) => {
                    tracing::warn!(%error, "a client of AirSim is disconnected");
                    return;
                }
            }
            if !connection.wait_for_room() {
                return;
            }
        }
        match stream.read(&mut bytes) {
            Ok(0) | Err(_) => return,
            Ok(count) => decoder.push(&bytes[..count]),
        }
    }
}

fn handle(shared: &Shared, method: &str, params: &[spf_drone::airsim::wire::Raw], encoding: Encoding, respond: calls::Respond) {
    let mut city = shared.city();
    let pending = calls::call(&mut city, method, params, encoding, respond);
    let woken = city.is_running();
    drop(city);
    if woken || method == "simPause" {
        shared.wake.notify_all();
    }
    if let Some(pending) = pending {
        pending.finish();
    }
}

/// What is sent to a client. Responses wait here, so that a client that takes none holds up nobody.
struct Connection {
    stream: TcpStream,
    outbox: Mutex<Outbox>,
    changed: Condvar,
}

#[derive(Default)]
struct Outbox {
    waiting: VecDeque<Vec<u8>>,
    bytes: usize,
    closed: bool,
}

impl Connection {
    fn outbox(&self) -> MutexGuard<'_, Outbox> {
        self.outbox.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn push(&self, response: Vec<u8>) {
        let mut outbox = self.outbox();
        if !outbox.closed {
            outbox.bytes += response.len();
            outbox.waiting.push_back(response);
            self.changed.notify_all();
        }
    }

    /// Waits until little is left to send; false once the connection is closed.
    fn wait_for_room(&self) -> bool {
        let full = |outbox: &mut Outbox| !outbox.closed && outbox.bytes > WAITING;
        !self.changed.wait_while(self.outbox(), full).unwrap_or_else(PoisonError::into_inner).closed
    }

    fn write(&self, mut stream: TcpStream) {
        loop {
            let empty = |outbox: &mut Outbox| !outbox.closed && outbox.waiting.is_empty();
            let mut outbox = self.changed.wait_while(self.outbox(), empty).unwrap_or_else(PoisonError::into_inner);
            let Some(response) = outbox.waiting.pop_front().filter(|_| !outbox.closed) else { return };
            drop(outbox);
            if stream.write_all(&response).is_err() {
                self.close();
                return;
            }
            self.outbox().bytes -= response.len();
            self.changed.notify_all();
        }
    }

    fn close(&self) {
        let mut outbox = self.outbox();
        outbox.closed = true;
        outbox.waiting.clear();
        drop(outbox);
        self.changed.notify_all();
        drop(self.stream.shutdown(Shutdown::Both));
    }
}

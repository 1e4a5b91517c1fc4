//! Sockets of the server.

use std::hash::{BuildHasher as _, RandomState};
use std::net::{SocketAddr, TcpListener as StdListener};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use spf_media::h264::{AccessUnit, NalKind, nal_units};
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::{TcpListener, TcpStream, UdpSocket};
use tokio::sync::broadcast::error::RecvError;
use tokio::sync::{broadcast, watch};
use tokio::time::{Instant, sleep_until, timeout};

use super::Quirks;
use super::packet::{CLOCK, Packetizer};
use super::request::{Incoming, Request, read};
use super::session::{ParameterSets, Session, Step, TIMEOUT, Transport};

/// Maximum number of connections; more are closed at once.
const MOST_CLIENTS: usize = 16;
/// Images that wait for a client that is slower than the video. If more come, the client gets nothing until the next key frame.
const WAITING: usize = 8;
/// A client that takes nothing for this long is disconnected.
const STALLED: Duration = Duration::from_secs(5);
/// Longest time without a request of a client that is not seen to receive.
const SILENT: Duration = Duration::from_secs(TIMEOUT + 5);
/// Interval of sender reports; the first one follows the first image.
const REPORTS: Duration = Duration::from_secs(2);
/// Attempts to find two UDP ports in a row.
const ATTEMPTS: usize = 50;

/// Why a server could not start.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RtspError {
    /// The address could not be bound.
    #[error("cannot listen on TCP {address}")]
    Listen {
        /// The address.
        address: SocketAddr,
        /// The cause.
        #[source]
        source: std::io::Error,
    },
    /// The thread could not be started.
    #[error("cannot start the thread of the RTSP server")]
    Thread(#[source] std::io::Error),
}

/// An encoded image.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Unit {
    /// When it was captured.
    pub captured: SystemTime,
    /// Its data.
    pub unit: AccessUnit,
}

/// A running server with one stream; it stops when dropped.
pub struct Server {
    address: SocketAddr,
    path: String,
    shared: Arc<Shared>,
    stop: watch::Sender<bool>,
    thread: Option<JoinHandle<()>>,
}

struct Shared {
    path: String,
    quirks: Quirks,
    units: broadcast::Sender<Arc<Unit>>,
    parameters: Mutex<Option<ParameterSets>>,
    clients: AtomicUsize,
    viewers: AtomicUsize,
    needs_key: AtomicBool,
}

impl Server {
    /// Serves a stream at `path` (`/camera`) on a TCP address; port 0 selects a free one.
    ///
    /// # Errors
    /// [`RtspError`] if the address cannot be bound, or no thread can be started.
    pub fn start(listen: SocketAddr, path: &str) -> Result<Self, RtspError> {
        Self::start_with(listen, path, Quirks::default())
    }

    /// The same, of a camera with quirks.
    ///
    /// # Errors
    /// [`RtspError`] if the address cannot be bound, or no thread can be started.
    pub fn start_with(listen: SocketAddr, path: &str, quirks: Quirks) -> Result<Self, RtspError> {
        let failed = |source| RtspError::Listen { address: listen, source };
        let listener = StdListener::bind(listen).map_err(failed)?;
        let address = listener.local_addr().map_err(failed)?;
        listener.set_nonblocking(true).map_err(failed)?;
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(RtspError::Thread)?;
        let shared = Arc::new(Shared {
            path: path.to_owned(),
            quirks,
            units: broadcast::channel(WAITING).0,
            parameters: Mutex::default(),
            clients: AtomicUsize::new(0),
            viewers: AtomicUsize::new(0),
            needs_key: AtomicBool::new(false),
        });
        let (stop, mut stopped) = watch::channel(false);
        let serving = shared.clone();
        let work = move || {
            runtime.block_on(async {
                tokio::select! {
                    _ = stopped.changed() => {}
                    () = accept(listener, &serving) => {}
                }
            });
            runtime.shutdown_background();
        };
        let thread = std::thread::Builder::new().name("rtsp".to_owned()).spawn(work).map_err(RtspError::Thread)?;
        Ok(Self { address, path: path.to_owned(), shared, stop, thread: Some(thread) })
    }

    /// The address served.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// The address of the stream, for cameras.
    #[must_use]
    pub fn url(&self) -> String {
        format!("rtsp://{}{}", self.address, self.path)
    }

    /// Whether somebody plays the stream.
    #[must_use]
    pub fn is_watched(&self) -> bool {
        self.shared.viewers.load(Ordering::Relaxed) > 0
    }

    /// Whether a viewer waits for a key frame; asking resets it.
    #[must_use]
    pub fn takes_key(&self) -> bool {
        self.shared.needs_key.swap(false, Ordering::Relaxed)
    }

    /// Sends an image to all viewers. Never waits: a slow viewer misses images.
    pub fn send(&self, unit: Unit) {
        if unit.unit.key {
            let found = |kind| nal_units(&unit.unit.annex_b).find(|nal| NalKind::of(nal) == Some(kind)).map(<[u8]>::to_vec);
            if let (Some(sps), Some(pps)) = (found(NalKind::Sps), found(NalKind::Pps)) {
                *self.shared.parameters() = Some(ParameterSets { sps, pps });
            }
        }
        // Without viewers there is nobody to receive it.
        drop(self.shared.units.send(Arc::new(unit)));
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.stop.send_replace(true);
        if let Some(thread) = self.thread.take() {
            drop(thread.join());
        }
    }
}

impl Shared {
    fn parameters(&self) -> MutexGuard<'_, Option<ParameterSets>> {
        // The value is consistent between calls.
        self.parameters.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Counts as one as long as it lives.
struct Counted(Arc<Shared>, fn(&Shared) -> &AtomicUsize);

impl Counted {
    fn new(shared: &Arc<Shared>, count: fn(&Shared) -> &AtomicUsize) -> Self {
        count(shared).fetch_add(1, Ordering::Relaxed);
        Self(shared.clone(), count)
    }
}

impl Drop for Counted {
    fn drop(&mut self) {
        (self.1)(&self.0).fetch_sub(1, Ordering::Relaxed);
    }
}

async fn accept(listener: StdListener, shared: &Arc<Shared>) {
    let listener = match TcpListener::from_std(listener) {
        Ok(listener) => listener,
        Err(error) => return tracing::error!(%error, "the RTSP server failed"),
    };
    loop {
        match listener.accept().await {
            Ok((stream, peer)) if shared.clients.load(Ordering::Relaxed) < MOST_CLIENTS => {
                let client = Counted::new(shared, |shared| &shared.clients);
                let shared = shared.clone();
                tokio::spawn(async move {
                    if let Err(error) = Client::new(stream, peer, shared).serve().await {
                        tracing::debug!(%error, "an RTSP client");
                    }
                    drop(client);
                });
            }
            Ok(_) => tracing::debug!("too many RTSP clients"),
            // Such as too many open files.
            Err(error) => {
                tracing::debug!(%error, "an RTSP client could not connect");
                tokio::time::sleep(Duration::from_millis(100)).await;
            }
        }
    }
}

/// Random bits, from the keys of the standard library's hash tables.
fn random() -> u64 {
    RandomState::new().hash_one(0_u8)
}

fn since_1970(time: SystemTime) -> Duration {
    time.duration_since(UNIX_EPOCH).unwrap_or_default()
}

/// How the packets of a client travel.
enum Outlet {
    /// On these channels of the connection.
    Interleaved(u8, u8),
    /// From these sockets, which are connected to the client's.
    Udp(UdpSocket, UdpSocket),
}

/// A connection.
struct Client {
    stream: TcpStream,
    peer: SocketAddr,
    shared: Arc<Shared>,
    session: Session,
    packetizer: Packetizer,
    outlet: Option<Outlet>,
    /// Images, while it plays.
    playing: Option<(broadcast::Receiver<Arc<Unit>>, Counted)>,
    awaits_key: bool,
    /// Images sent so far.
    images: u32,
    next_report: Instant,
    /// Its last request.
    heard: Instant,
}

/// Whether a connection goes on.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Goes {
    On,
    Away,
}

impl Client {
    fn new(stream: TcpStream, peer: SocketAddr, shared: Arc<Shared>) -> Self {
        let now = Instant::now();
        Self {
            session: Session::new(&shared.path, random()),
            packetizer: Packetizer::new(random()),
            stream,
            peer,
            shared,
            outlet: None,
            playing: None,
            awaits_key: true,
            images: 0,
            next_report: now,
            heard: now,
        }
    }

    async fn serve(&mut self) -> std::io::Result<()> {
        // An image is to leave at once.
        self.stream.set_nodelay(true)?;
        let (mut unread, mut buffer) = (Vec::new(), [0; 4096]);
        loop {
            // By TCP a stalled client is noticed when it takes nothing.
            let is_seen = self.playing.is_some() && matches!(self.outlet, Some(Outlet::Interleaved(..)));
            let until = self.heard + if is_seen { Duration::from_secs(86_400) } else { SILENT };
            tokio::select! {
                length = self.stream.read(&mut buffer) => {
                    let length = length?;
                    if length == 0 {
                        return Ok(());
                    }
                    unread.extend_from_slice(&buffer[..length]);
                    if self.take(&mut unread).await? == Goes::Away {
                        return Ok(());
                    }
                }
                unit = next(&mut self.playing) => match unit {
                    Ok(unit) => self.show(&unit).await?,
                    Err(RecvError::Lagged(_)) => {
                        self.awaits_key = true;
                        self.shared.needs_key.store(true, Ordering::Relaxed);
                    }
                    Err(RecvError::Closed) => return Ok(()),
                },
                () = sleep_until(until) => return Ok(()),
            }
        }
    }

    /// Answers the requests that are complete.
    async fn take(&mut self, unread: &mut Vec<u8>) -> std::io::Result<Goes> {
        loop {
            match read(unread) {
                Ok(None) => return Ok(Goes::On),
                Ok(Some((incoming, length))) => {
                    unread.drain(..length);
                    if let Incoming::Request(request) = incoming {
                        self.heard = Instant::now();
                        if self.obey(&request).await? == Goes::Away {
                            return Ok(Goes::Away);
                        }
                    }
                }
                Err(_) => {
                    self.write(b"RTSP/1.0 400 Bad Request\r\n\r\n").await?;
                    return Ok(Goes::Away);
                }
            }
        }
    }

    async fn obey(&mut self, request: &Request) -> std::io::Result<Goes> {
        let parameters = self.shared.parameters().clone();
        let (mut text, step) = self.session.answer(request, parameters.as_ref());
        if let Step::SetUp(transport) = step {
            let (outlet, ports) = self.open(transport).await?;
            text = self.session.set_up(request, transport, ports, self.packetizer.source(), self.shared.quirks);
            self.outlet = Some(outlet);
        }
        self.write(text.as_bytes()).await?;
        match step {
            Step::Play if self.playing.is_none() => {
                self.playing = Some((self.shared.units.subscribe(), Counted::new(&self.shared, |shared| &shared.viewers)));
                self.awaits_key = true;
                self.next_report = Instant::now();
                self.shared.needs_key.store(true, Ordering::Relaxed);
            }
            Step::Pause => self.playing = None,
            Step::End => return Ok(Goes::Away),
            Step::None | Step::SetUp(_) | Step::Play => {}
        }
        Ok(Goes::On)
    }

    /// Opens the way of the packets; also the server's ports.
    async fn open(&self, transport: Transport) -> std::io::Result<(Outlet, (u16, u16))> {
        let (rtp, rtcp) = match transport {
            Transport::Interleaved { rtp, rtcp } => return Ok((Outlet::Interleaved(rtp, rtcp), (0, 0))),
            Transport::Udp { rtp, rtcp } => (rtp, rtcp),
        };
        let here = self.stream.local_addr()?.ip();
        for _ in 0..ATTEMPTS {
            let first = UdpSocket::bind((here, 0)).await?;
            let port = first.local_addr()?.port();
            let Some(next) = port.checked_add(1).filter(|_| port % 2 == 0) else { continue };
            let Ok(second) = UdpSocket::bind((here, next)).await else { continue };
            first.connect((self.peer.ip(), rtp)).await?;
            second.connect((self.peer.ip(), rtcp)).await?;
            return Ok((Outlet::Udp(first, second), (port, next)));
        }
        Err(std::io::Error::other("no two UDP ports in a row are free"))
    }

    /// Sends an image, and a report when it is due.
    async fn show(&mut self, unit: &Unit) -> std::io::Result<()> {
        self.awaits_key &= !unit.unit.key;
        if self.awaits_key {
            return Ok(());
        }
        let quirks = self.shared.quirks;
        let jump = if self.images / 5 % 2 == 1 { i32::from(quirks.jump) * CLOCK as i32 } else { 0 };
        self.packetizer.set_clock(jump - if self.images % 2 == 1 { i32::from(quirks.back) } else { 0 });
        let packets = self.packetizer.packets(since_1970(unit.captured), &unit.unit.annex_b);
        let mut report = None;
        if Instant::now() >= self.next_report {
            self.next_report = Instant::now() + REPORTS;
            // For the time of the image, not for now: by UDP it may arrive before the image, and receivers take none that is older than
            // the last report.
            report = Some(self.packetizer.sender_report(since_1970(unit.captured)));
        }
        match &self.outlet {
            Some(Outlet::Interleaved(rtp, rtcp)) => {
                let mut bytes = Vec::new();
                if quirks.noise {
                    // Text, a head of a packet that is none, and zeros, as a driver's messages or a lost part of the stream.
                    bytes.extend(b"debug: frame\r\n$\x00\x05\x78R\x00\x00\x00RTP");
                }
                let mut stray = Packetizer::new(u64::MAX);
                let strays = stray.packets(Duration::ZERO, &[0, 0, 1, 0x65, 1, 0, 0, 1, 0x65, 2]);
                let mut strays = strays.iter().filter(|_| quirks.stray_packets && self.images == 0);
                let (last, others) = packets.split_last().map_or((None, &packets[..]), |(last, others)| (Some(last), others));
                let sent = strays.next().into_iter().chain(others).chain(strays.next()).chain(last).map(|packet| (rtp, packet));
                for (channel, packet) in sent.chain(report.iter().map(|packet| (rtcp, packet))) {
                    bytes.extend([b'$', *channel]);
                    bytes.extend((packet.len() as u16).to_be_bytes());
                    bytes.extend(packet);
                }
                self.write(&bytes).await?;
            }
            Some(Outlet::Udp(rtp, rtcp)) => {
                // What the client does not take is lost, as a packet in the network is.
                for packet in &packets {
                    drop(rtp.send(packet).await);
                }
                if let Some(report) = &report {
                    drop(rtcp.send(report).await);
                }
            }
            None => {}
        }
        self.images = self.images.wrapping_add(1);
        Ok(())
    }

    async fn write(&mut self, bytes: &[u8]) -> std::io::Result<()> {
        match timeout(STALLED, self.stream.write_all(bytes)).await {
            Ok(written) => written,
            Err(_) => Err(std::io::ErrorKind::TimedOut.into()),
        }
    }
}

/// The next image; never, while nothing is played.
async fn next(playing: &mut Option<(broadcast::Receiver<Arc<Unit>>, Counted)>) -> Result<Arc<Unit>, RecvError> {
    match playing {
        Some((units, _)) => units.recv().await,
        None => std::future::pending().await,
    }
}

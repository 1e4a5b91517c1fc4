//! Links of the virtual vehicle: UDP and TCP with several clients, and serial ports.

use std::collections::BTreeMap;
use std::io::{ErrorKind, Read as _, Write as _};
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream, ToSocketAddrs as _, UdpSocket};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::SyncSender;
use std::sync::{Arc, Mutex};
use std::thread::{Builder, JoinHandle};

use spf_core::time::Duration;
use spf_mavlink::link::{LONGEST, Link};
use spf_mavlink::url::{HostPort, MavlinkUrl};

use super::error::VehicleServerError;
use super::machine::Peer;
use crate::tello::shared::lock;

/// Maximum blocking time of a receiver, so that it notices the shutdown.
const POLL_INTERVAL: Duration = Duration::from_millis(20);
/// Maximum number of TCP connections.
const CONNECTIONS: usize = 8;
/// Address of the one client of a serial port.
const NOBODY: SocketAddr = SocketAddr::new(std::net::IpAddr::V4(Ipv4Addr::UNSPECIFIED), 0);

/// Something that happened on a link.
pub(super) enum Happened {
    /// Bytes arrived. The flag is set if they do not continue those before.
    Received(Peer, Vec<u8>, bool),
    /// A client connected.
    Joined(Peer),
    /// A client's connection ended.
    Left(Peer),
}

/// The sending side of a link.
#[derive(Clone)]
enum Sender {
    Udp(Arc<UdpSocket>),
    Tcp(Arc<Mutex<BTreeMap<SocketAddr, TcpStream>>>),
    Serial(Arc<Link>),
}

/// The links of a server, with their threads.
pub(super) struct Transports {
    senders: Vec<Sender>,
    /// Clients to which it sends without being asked.
    pub(super) first: Vec<Peer>,
    /// The addresses that are bound, in the order of the links.
    pub(super) bound: Vec<Option<SocketAddr>>,
    threads: Vec<JoinHandle<()>>,
}

impl Transports {
    /// Opens the links. What happens on them goes to `events`, until `stopped`.
    pub(super) fn open(
        urls: &[MavlinkUrl],
        events: &SyncSender<Happened>,
        stopped: &Arc<AtomicBool>,
    ) -> Result<Self, VehicleServerError> {
        let mut opened = Self { senders: Vec::new(), first: Vec::new(), bound: Vec::new(), threads: Vec::new() };
        for (link, url) in urls.iter().enumerate() {
            let bind = |source| VehicleServerError::Bind { url: url.clone(), source };
            let (events, stopped) = (events.clone(), stopped.clone());
            let (sender, bound, work): (Sender, _, Box<dyn FnOnce() + Send>) = match url {
                MavlinkUrl::UdpIn(at) | MavlinkUrl::UdpOut(at) => {
                    let at = address(at).map_err(bind)?;
                    let local = match url {
                        MavlinkUrl::UdpIn(_) => at,
                        _ if at.ip().is_loopback() => SocketAddr::new(at.ip(), 0),
                        _ => NOBODY,
                    };
                    let socket = Arc::new(UdpSocket::bind(local).map_err(bind)?);
                    socket.set_read_timeout(Some(POLL_INTERVAL)).map_err(bind)?;
                    if matches!(url, MavlinkUrl::UdpOut(_)) {
                        opened.first.push(Peer { link, address: at });
                    }
                    let bound = socket.local_addr().ok();
                    let receiver = socket.clone();
                    (Sender::Udp(socket), bound, Box::new(move || datagrams(link, &receiver, &events, &stopped)))
                }
                MavlinkUrl::TcpIn(at) => {
                    let listener = TcpListener::bind(address(at).map_err(bind)?).map_err(bind)?;
                    listener.set_nonblocking(true).map_err(bind)?;
                    let (streams, bound) = (Arc::new(Mutex::default()), listener.local_addr().ok());
                    let sender = Sender::Tcp(Arc::clone(&streams));
                    (sender, bound, Box::new(move || connections(link, &listener, &streams, &events, &stopped)))
                }
                MavlinkUrl::Serial { .. } => {
                    let port = Arc::new(Link::open(url, None)?);
                    opened.first.push(Peer { link, address: NOBODY });
                    let receiver = port.clone();
                    (Sender::Serial(port), None, Box::new(move || serial(link, &receiver, &events, &stopped)))
                }
                MavlinkUrl::TcpOut(_) => return Err(VehicleServerError::Unserved { url: url.clone() }),
            };
            opened.senders.push(sender);
            opened.bound.push(bound);
            let thread = Builder::new().name(format!("mavlink link {link}")).spawn(work);
            opened.threads.push(thread.map_err(VehicleServerError::Thread)?);
        }
        Ok(opened)
    }

    /// Whether packets of this link can be lost.
    pub(super) fn is_datagram(&self, link: usize) -> bool {
        matches!(self.senders.get(link), Some(Sender::Udp(_)))
    }

    /// Sends a frame; what cannot be sent is lost.
    pub(super) fn send(&self, peer: Peer, frame: &[u8]) {
        match self.senders.get(peer.link) {
            Some(Sender::Udp(socket)) => drop(socket.send_to(frame, peer.address)),
            Some(Sender::Tcp(streams)) => {
                // A client that does not read loses its connection, instead of stopping the flight.
                let mut streams = lock(streams);
                if streams.get_mut(&peer.address).is_some_and(|stream| stream.write_all(frame).is_err()) {
                    streams.remove(&peer.address);
                }
            }
            Some(Sender::Serial(port)) => port.send(frame),
            None => {}
        }
    }

    /// Waits for the threads, which end once `stopped` is set.
    pub(super) fn join(&mut self) {
        for thread in self.threads.drain(..) {
            drop(thread.join());
        }
    }
}

fn address(at: &HostPort) -> std::io::Result<SocketAddr> {
    let HostPort { host, port } = at;
    (host.as_str(), *port).to_socket_addrs()?.next().ok_or_else(|| std::io::Error::new(ErrorKind::NotFound, "no address"))
}

fn datagrams(link: usize, socket: &UdpSocket, events: &SyncSender<Happened>, stopped: &AtomicBool) {
    let mut buffer = [0; LONGEST];
    while !stopped.load(Ordering::Relaxed) {
        if let Ok((length, address)) = socket.recv_from(&mut buffer) {
            // A full queue loses it, as a full socket would.
            drop(events.try_send(Happened::Received(Peer { link, address }, buffer[..length].to_vec(), true)));
        }
    }
}

fn serial(link: usize, port: &Link, events: &SyncSender<Happened>, stopped: &AtomicBool) {
    let mut buffer = [0; LONGEST];
    while !stopped.load(Ordering::Relaxed) {
        let (length, _) = port.receive(&mut buffer);
        if length > 0 {
            drop(events.try_send(Happened::Received(Peer { link, address: NOBODY }, buffer[..length].to_vec(), false)));
        }
    }
}

fn connections(
    link: usize,
    listener: &TcpListener,
    streams: &Mutex<BTreeMap<SocketAddr, TcpStream>>,
    events: &SyncSender<Happened>,
    stopped: &AtomicBool,
) {
    let mut readers: Vec<(SocketAddr, TcpStream)> = Vec::new();
    let mut buffer = [0; LONGEST];
    while !stopped.load(Ordering::Relaxed) {
        if let Ok((stream, address)) = listener.accept()
            && readers.len() < CONNECTIONS
            && let Some(writer) = prepared(&stream)
        {
            lock(streams).insert(address, writer);
            readers.push((address, stream));
            drop(events.send(Happened::Joined(Peer { link, address })));
        }
        let mut idle = true;
        readers.retain_mut(|(address, stream)| {
            let peer = Peer { link, address: *address };
            match stream.read(&mut buffer) {
                Ok(length) if length > 0 => {
                    idle = false;
                    drop(events.try_send(Happened::Received(peer, buffer[..length].to_vec(), false)));
                    true
                }
                Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => true,
                _ => {
                    lock(streams).remove(address);
                    drop(events.send(Happened::Left(peer)));
                    false
                }
            }
        });
        if idle {
            std::thread::sleep(Duration::from_millis(2));
        }
    }
}

/// Makes a connection ready to be polled; returns its sending side. Both never wait.
fn prepared(stream: &TcpStream) -> Option<TcpStream> {
    stream.set_nonblocking(true).ok()?;
    stream.set_nodelay(true).ok()?;
    stream.try_clone().ok()
}

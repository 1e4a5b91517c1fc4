//! A link to one vehicle: UDP, TCP or a serial port, as bytes.

use std::collections::BTreeMap;
use std::io::{ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream, ToSocketAddrs, UdpSocket};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use crate::station::Station;
use crate::url::{HostPort, MavlinkUrl};
use crate::wire::{Decoder, Packet};

/// Maximum blocking time of [`Link::receive`].
pub const POLL_INTERVAL: Duration = Duration::from_millis(10);
/// Maximum blocking time of a transmission: what a full buffer does not take is lost.
const SEND_TIME: Duration = Duration::from_millis(20);
/// Interval between attempts to connect again, and the time for one.
const RECONNECT: Duration = Duration::from_secs(1);
/// A peer that has been silent for this long may be replaced by another one: a vehicle that restarted.
const PEER_SILENT: Duration = Duration::from_secs(3);
/// Longest datagram, bytes.
pub const LONGEST: usize = 4096;
/// Senders of heartbeats that are remembered. Somebody who floods the link must not fill the memory.
const STATIONS: usize = 64;

/// Why a link could not be opened.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LinkError {
    /// A local port cannot be bound.
    #[error("cannot listen on {url}")]
    Bind {
        /// The address.
        url: MavlinkUrl,
        /// The cause.
        #[source]
        source: std::io::Error,
    },
    /// The address cannot be reached.
    #[error("cannot reach {url}")]
    Unreachable {
        /// The address.
        url: MavlinkUrl,
        /// The cause.
        #[source]
        source: std::io::Error,
    },
    /// The serial port cannot be opened.
    #[error("cannot open {url}")]
    Serial {
        /// The address.
        url: MavlinkUrl,
        /// The cause.
        #[source]
        source: std::io::Error,
    },
}

/// The vehicle at the other end of a UDP socket.
#[derive(Debug, Default)]
struct Peer {
    address: Option<SocketAddr>,
    heard: Option<Instant>,
}

/// A TCP connection that is made again when it breaks.
struct Stream {
    stream: Option<TcpStream>,
    tried: Option<Instant>,
}

enum Port {
    /// The peer is the multicopter that is heard first; a fixed one has been named by the user.
    Udp {
        socket: UdpSocket,
        peer: Mutex<Peer>,
        fixed: bool,
    },
    TcpOut {
        at: SocketAddr,
        stream: Mutex<Stream>,
    },
    TcpIn {
        listener: TcpListener,
        stream: Mutex<Stream>,
    },
    #[cfg(unix)]
    Serial(std::fs::File),
}

/// An open link. One thread may receive while others send.
pub struct Link {
    port: Port,
    /// The system that the link is to; `None` for whichever is heard first.
    wanted: Option<u8>,
    heard: Mutex<Heard>,
}

/// What has arrived, also of those that may not speak for the vehicle.
#[derive(Debug, Default)]
struct Heard {
    /// Who sends heartbeats, by system and component.
    stations: BTreeMap<[u8; 2], Station>,
    /// Bytes so far.
    bytes: usize,
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // Every change is a single assignment.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Link {
    /// Opens a link to a vehicle: of this system, or to whichever is heard first.
    ///
    /// # Errors
    /// [`LinkError`] if a port cannot be bound or opened, or a host has no address or refuses.
    pub fn open(url: &MavlinkUrl, wanted: Option<u8>) -> Result<Self, LinkError> {
        let bind = |source| LinkError::Bind { url: url.clone(), source };
        let reach = |source| LinkError::Unreachable { url: url.clone(), source };
        let port = match url {
            MavlinkUrl::UdpIn(at) => {
                let socket = UdpSocket::bind(address(at).map_err(bind)?).map_err(bind)?;
                Port::Udp { socket: prepared(socket).map_err(bind)?, peer: Mutex::default(), fixed: false }
            }
            MavlinkUrl::UdpOut(at) => {
                let peer = address(at).map_err(reach)?;
                let local: SocketAddr = if peer.is_ipv4() { ([0; 4], 0).into() } else { ([0_u16; 8], 0).into() };
                let socket = UdpSocket::bind(local).map_err(reach)?;
                let peer = Peer { address: Some(peer), heard: None };
                Port::Udp { socket: prepared(socket).map_err(reach)?, peer: Mutex::new(peer), fixed: true }
            }
            MavlinkUrl::TcpOut(at) => {
                let at = address(at).map_err(reach)?;
                let stream = connect(at).map_err(reach)?;
                Port::TcpOut { at, stream: Mutex::new(Stream { stream: Some(stream), tried: None }) }
            }
            MavlinkUrl::TcpIn(at) => {
                let listener = TcpListener::bind(address(at).map_err(bind)?).map_err(bind)?;
                listener.set_nonblocking(true).map_err(bind)?;
                Port::TcpIn { listener, stream: Mutex::new(Stream { stream: None, tried: None }) }
            }
            MavlinkUrl::Serial { path, rate } => {
                let open = |source| LinkError::Serial { url: url.clone(), source };
                serial_port(path, *rate).map_err(open)?
            }
        };
        Ok(Self { port, wanted, heard: Mutex::default() })
    }

    /// Whether packets can be lost, reordered or come twice (UDP).
    #[must_use]
    pub fn is_datagram(&self) -> bool {
        matches!(self.port, Port::Udp { .. })
    }

    /// The sender of a packet that is a heartbeat is remembered.
    pub fn note(&self, packet: &Packet) {
        if let Some(station) = Station::of(packet) {
            let mut heard = lock(&self.heard);
            let id = [station.system, station.component];
            if heard.stations.len() < STATIONS || heard.stations.contains_key(&id) {
                heard.stations.insert(id, station);
            }
        }
    }

    /// Who has sent heartbeats so far, in the order of system and component.
    #[must_use]
    pub fn stations(&self) -> Vec<Station> {
        lock(&self.heard).stations.values().copied().collect()
    }

    /// Bytes that have arrived so far, from anyone.
    #[must_use]
    pub fn bytes(&self) -> usize {
        lock(&self.heard).bytes
    }

    /// The system of another multicopter than this one that was heard.
    #[must_use]
    pub fn other_than(&self, system: u8) -> Option<u8> {
        self.stations().into_iter().find(|station| station.system != system && station.is_vehicle()).map(|other| other.system)
    }

    /// Whether a datagram has the heartbeat of the multicopter that the link is to, with its checksum.
    fn is_of_vehicle(&self, datagram: &[u8]) -> bool {
        let mut decoder = Decoder::default();
        decoder.push(datagram);
        let packets: Vec<Packet> = core::iter::from_fn(|| decoder.next_packet()).collect();
        packets.iter().for_each(|packet| self.note(packet));
        let mut stations = packets.iter().filter_map(Station::of);
        stations.any(|station| station.is_vehicle() && self.wanted.is_none_or(|wanted| station.system == wanted))
    }

    /// Waits up to [`POLL_INTERVAL`] for bytes of the vehicle. Zero means that there are none yet. The flag is set where the bytes
    /// do not continue those before: a datagram, a new connection.
    pub fn receive(&self, buffer: &mut [u8]) -> (usize, bool) {
        let received = self.receive_from_port(buffer);
        lock(&self.heard).bytes += received.0;
        received
    }

    fn receive_from_port(&self, buffer: &mut [u8]) -> (usize, bool) {
        match &self.port {
            Port::Udp { socket, peer, fixed } => {
                let Ok((length, from)) = socket.recv_from(buffer) else { return (0, false) };
                let mut peer = lock(peer);
                let now = Instant::now();
                let known = peer.address == Some(from);
                let silent = peer.heard.is_none_or(|heard| now.duration_since(heard) >= PEER_SILENT);
                // Nobody else may speak for the vehicle while it is there, and no other than a multicopter at any time.
                if !known && (!self.is_of_vehicle(&buffer[..length]) || *fixed || !silent) {
                    lock(&self.heard).bytes += length;
                    return (0, false);
                }
                *peer = Peer { address: Some(from), heard: Some(now) };
                (length, true)
            }
            Port::TcpOut { at, stream } => {
                let again = || connect(*at).ok();
                receive_stream(stream, buffer, again)
            }
            Port::TcpIn { listener, stream } => {
                let accept = || {
                    let (stream, _) = listener.accept().ok()?;
                    timed(stream).ok()
                };
                receive_stream(stream, buffer, accept)
            }
            #[cfg(unix)]
            Port::Serial(file) => {
                let mut file: &std::fs::File = file;
                match file.read(buffer) {
                    Ok(0) | Err(_) => {
                        // Without bytes it returns at once or after its own time; a port that was unplugged, with an error.
                        std::thread::sleep(POLL_INTERVAL / 5);
                        (0, false)
                    }
                    Ok(length) => (length, false),
                }
            }
        }
    }

    /// Sends one frame. What cannot be sent is lost, as on the radio.
    pub fn send(&self, frame: &[u8]) {
        let sent = match &self.port {
            Port::Udp { socket, peer, .. } => {
                let to = lock(peer).address;
                to.map_or(Ok(()), |to| socket.send_to(frame, to).map(|_| ()))
            }
            Port::TcpOut { stream, .. } | Port::TcpIn { stream, .. } => {
                let writer = lock(stream).stream.as_ref().and_then(|stream| stream.try_clone().ok());
                writer.map_or(Ok(()), |mut writer| writer.write_all(frame))
            }
            #[cfg(unix)]
            Port::Serial(file) => write_within(file, frame, SEND_TIME),
        };
        if let Err(error) = sent {
            tracing::debug!(%error, "not sent");
        }
    }
}

/// Writes to a port that does not block: one that takes nothing for this long, for its flow is stopped or its device is gone,
/// must not keep a landing waiting.
#[cfg(unix)]
fn write_within(mut file: &std::fs::File, mut bytes: &[u8], time: Duration) -> std::io::Result<()> {
    let begun = Instant::now();
    while !bytes.is_empty() {
        match file.write(bytes) {
            Ok(0) => return Err(ErrorKind::WriteZero.into()),
            Ok(written) => bytes = &bytes[written..],
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) if error.kind() == ErrorKind::WouldBlock && begun.elapsed() < time => {
                std::thread::sleep(Duration::from_millis(1));
            }
            Err(error) => return Err(error),
        }
    }
    Ok(())
}

#[cfg(unix)]
fn serial_port(path: &str, rate: u32) -> std::io::Result<Port> {
    serial::open(path, rate).map(Port::Serial)
}

#[cfg(not(unix))]
fn serial_port(path: &str, rate: u32) -> std::io::Result<Port> {
    Err(std::io::Error::new(ErrorKind::Unsupported, format!("{path} at {rate}")))
}

fn address(at: &HostPort) -> std::io::Result<SocketAddr> {
    let HostPort { host, port } = at;
    (host.as_str(), *port).to_socket_addrs()?.next().ok_or_else(|| std::io::Error::new(ErrorKind::NotFound, "no address"))
}

fn prepared(socket: UdpSocket) -> std::io::Result<UdpSocket> {
    socket.set_read_timeout(Some(POLL_INTERVAL))?;
    socket.set_write_timeout(Some(SEND_TIME))?;
    Ok(socket)
}

fn connect(at: SocketAddr) -> std::io::Result<TcpStream> {
    timed(TcpStream::connect_timeout(&at, RECONNECT)?)
}

fn timed(stream: TcpStream) -> std::io::Result<TcpStream> {
    stream.set_nonblocking(false)?;
    stream.set_read_timeout(Some(POLL_INTERVAL))?;
    stream.set_write_timeout(Some(SEND_TIME))?;
    stream.set_nodelay(true)?;
    Ok(stream)
}

/// Receives from a connection; one that ended is made again, at most once a second.
fn receive_stream(stream: &Mutex<Stream>, buffer: &mut [u8], again: impl Fn() -> Option<TcpStream>) -> (usize, bool) {
    let current = lock(stream).stream.as_ref().and_then(|stream| stream.try_clone().ok());
    let Some(mut reader) = current else {
        let due = lock(stream).tried.is_none_or(|tried| tried.elapsed() >= RECONNECT);
        if due {
            let made = again();
            let mut stream = lock(stream);
            let (waits, found) = (made.is_none(), made.is_some());
            *stream = Stream { stream: made, tried: waits.then(Instant::now).filter(|_| !found) };
        } else {
            std::thread::sleep(POLL_INTERVAL);
        }
        return (0, true);
    };
    match reader.read(buffer) {
        Ok(0) => {
            lock(stream).stream = None;
            (0, true)
        }
        Ok(length) => (length, false),
        Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted) => (0, false),
        Err(_) => {
            lock(stream).stream = None;
            (0, true)
        }
    }
}

/// Serial ports of Unix, without a library that needs udev.
#[cfg(unix)]
mod serial {
    use std::fs::File;
    use std::io::{Error, Result};
    use std::os::unix::fs::OpenOptionsExt as _;

    use rustix::fs::OFlags;
    use rustix::termios::{ControlModes, OptionalActions, SpecialCodeIndex, tcgetattr, tcsetattr};

    /// Opens a port for raw bytes: 8 data bits, no parity, no flow control. Neither reading nor writing waits.
    pub(super) fn open(path: &str, rate: u32) -> Result<File> {
        // Without NOCTTY a signal of the port would end the program; without NONBLOCK opening waits for a modem's carrier.
        let flags = (OFlags::NOCTTY | OFlags::NONBLOCK).bits() as i32;
        let file = File::options().read(true).write(true).custom_flags(flags).open(path)?;
        let mut port = tcgetattr(&file).map_err(Error::from)?;
        port.make_raw();
        port.control_modes |= ControlModes::CLOCAL | ControlModes::CREAD;
        port.control_modes -= ControlModes::CRTSCTS;
        port.set_speed(rate).map_err(Error::from)?;
        port.special_codes[SpecialCodeIndex::VMIN] = 0;
        port.special_codes[SpecialCodeIndex::VTIME] = 0;
        tcsetattr(&file, OptionalActions::Now, &port).map_err(Error::from)?;
        Ok(file)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::{Body, Encoder};

    /// A heartbeat of system, component, type and autopilot.
    fn beat([system, component, kind, autopilot]: [u8; 4]) -> Vec<u8> {
        // Mode, type, autopilot, base mode, state, version.
        Encoder::new([system, component]).frame(&Body { id: 0, payload: vec![0, 0, 0, 0, kind, autopilot, 1, 4, 3] })
    }

    fn heartbeat(component: u8, autopilot: u8) -> Vec<u8> {
        beat([1, component, 2, autopilot])
    }

    /// Whether any of what was sent from a socket is taken for the vehicle's.
    fn arrives(link: &Link, from: &UdpSocket, bytes: &[u8]) -> usize {
        let Port::Udp { socket, .. } = &link.port else { panic!("no UDP") };
        from.send_to(bytes, ("127.0.0.1", socket.local_addr().unwrap().port())).unwrap();
        let mut buffer = [0; LONGEST];
        // What was dropped has been received by the second call.
        [(); 2].map(|()| link.receive(&mut buffer).0).into_iter().sum()
    }

    /// Each sends from an address of its own, before the vehicle does: an ADS-B receiver, a camera that says that it has an autopilot
    /// and is component 1, a rover, an antenna tracker, a ground station with the vehicle's number.
    #[test]
    fn whoever_else_is_heard_first_does_not_keep_the_vehicle_out() {
        let others = [[9, 156, 27, 0], [1, 1, 30, 0], [3, 1, 10, 3], [4, 1, 5, 3], [1, 190, 6, 8]];
        for other in others {
            let link = Link::open(&"udpin:127.0.0.1:0".parse().unwrap(), None).unwrap();
            let [first, vehicle] = [(); 2].map(|()| UdpSocket::bind("127.0.0.1:0").unwrap());
            let bytes = beat(other);
            assert_eq!(arrives(&link, &first, &bytes), 0, "{other:?}");
            // Something has arrived, and from whom is known.
            let [system, component, kind, autopilot] = other;
            assert_eq!(link.stations(), [Station { system, component, kind, autopilot }]);
            assert_eq!(link.bytes(), bytes.len());
            assert!(arrives(&link, &vehicle, &heartbeat(1, 12)) > 0, "{other:?}");
            assert_eq!(link.other_than(1), None, "{other:?} is no second vehicle");
        }
    }

    #[test]
    fn a_flood_of_senders_is_not_remembered() {
        let link = Link::open(&"udpin:127.0.0.1:0".parse().unwrap(), None).unwrap();
        for system in 1..=255 {
            assert!(!link.is_of_vehicle(&beat([system, 190, 6, 8])));
        }
        assert_eq!(link.stations().len(), STATIONS);
    }

    #[test]
    fn only_the_heartbeat_of_a_multicopter_makes_a_peer() {
        let link = Link::open(&"udpin:127.0.0.1:0".parse().unwrap(), None).unwrap();
        let mut broken = heartbeat(1, 12);
        broken[12] ^= 1;
        let attitude = Encoder::new([1, 1]).frame(&Body { id: 30, payload: vec![1; 28] });
        for other in [&b"hello"[..], &heartbeat(100, 12), &heartbeat(1, 8), &broken, &attitude, &[]] {
            assert!(!link.is_of_vehicle(other), "{other:?}");
        }
        assert!(link.is_of_vehicle(&heartbeat(1, 12)) && link.is_of_vehicle(&[attitude, heartbeat(1, 3)].concat()));
        let [stranger, vehicle] = [(); 2].map(|()| UdpSocket::bind("127.0.0.1:0").unwrap());
        assert_eq!(arrives(&link, &stranger, b"hello"), 0);
        let beat = heartbeat(1, 12);
        assert_eq!((arrives(&link, &vehicle, &beat), arrives(&link, &stranger, &beat)), (beat.len(), 0));
        vehicle.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
        link.send(b"to the vehicle");
        assert_eq!(vehicle.recv(&mut [0; 64]).unwrap(), 14);
    }

    /// Both are heard, wherever they send from; the one that is wanted may speak.
    #[test]
    fn two_vehicles_on_one_port_are_both_known() {
        for (wanted, speaks) in [(None, 1), (Some(2), 2)] {
            let link = Link::open(&"udpin:127.0.0.1:0".parse().unwrap(), wanted).unwrap();
            let vehicles = [1, 2].map(|system| (system, UdpSocket::bind("127.0.0.1:0").unwrap()));
            for (system, vehicle) in &vehicles {
                let arrived = arrives(&link, vehicle, &beat([*system, 1, 2, 12]));
                assert_eq!(arrived > 0, *system == speaks, "{wanted:?} {system}");
            }
            assert_eq!((link.other_than(1), link.other_than(2)), (Some(2), Some(1)));
        }
    }

    /// A port that takes nothing any more, as with a cable that is stuck.
    #[cfg(unix)]
    #[test]
    fn a_port_that_takes_nothing_does_not_block() {
        let (ours, theirs) = std::os::unix::net::UnixStream::pair().unwrap();
        ours.set_nonblocking(true).unwrap();
        let file = std::fs::File::from(std::os::fd::OwnedFd::from(ours));
        let frame = [7; 4096];
        while write_within(&file, &frame, Duration::ZERO).is_ok() {}
        let link = Link { port: Port::Serial(file), wanted: None, heard: Mutex::default() };
        let begun = Instant::now();
        link.send(&frame);
        assert!((SEND_TIME..Duration::from_secs(60)).contains(&begun.elapsed()), "{:?}", begun.elapsed());
        drop(theirs);
    }
}

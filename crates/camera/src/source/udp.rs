//! RTP and MPEG-TS by UDP.

use std::io::ErrorKind;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, UdpSocket};

use spf_core::time::Duration;

use crate::arrivals::{Arrivals, Kind};
use crate::clock::Unwrapper;
use crate::diagnosis::other_packets;
use crate::failure::SourceError;
use crate::feed::{Feed, Packets};
use crate::rtp::Receiver;
use crate::ts::TsReceiver;

/// Maximum wait for a packet before other things are looked after.
const POLL_INTERVAL: Duration = Duration::from_millis(20);
/// Size of the socket's buffer, bytes: a key frame of 4K video arrives at once.
const BUFFER: usize = 4 << 20;
/// Largest UDP packet.
const LONGEST: usize = 65_536;
/// Clock rate of video in RTP and of time stamps in MPEG-TS, Hz.
const CLOCK: u32 = 90_000;

/// Receives H.264 in RTP.
pub(super) fn rtp(address: SocketAddr, feed: &mut Feed) -> Result<(), SourceError> {
    let socket = open(address)?;
    let (mut receiver, mut units) = (Receiver::default(), Vec::new());
    let mut times = Unwrapper::new(32, CLOCK);
    let (mut buffer, mut arrivals) = (vec![0; LONGEST], Arrivals::default());
    while !feed.stopped() {
        let datagram = receive(&socket, &mut buffer).map_err(|error| SourceError::Socket { address, error })?;
        let now = feed.now();
        match datagram {
            Some(datagram) => {
                arrivals.push(datagram);
                receiver.push(now, datagram, &mut units);
            }
            None => receiver.expire(now, &mut units),
        }
        let (received, lost) = receiver.packets();
        feed.tally(receiver.tally(), Packets { received: Some(received), lost });
        feed.arrived(&arrivals, !receiver.has_parameters(), &[]);
        for unit in units.drain(..) {
            let stamp = times.nanoseconds(unit.timestamp.into());
            feed.unit(unit.at, Some(stamp), None, unit.unit)?;
        }
        if receiver.is_h265() {
            return Err(SourceError::Codec("H.265".to_owned()));
        }
        // Senders may give H.264 a payload type of audio. Packets of a transport stream seem to be parameter sets.
        let is_other = |kind: &Kind| *kind == Kind::RtpTs || !receiver.makes_sense();
        judge(address, &arrivals, Kind::Rtp, is_other, feed)?;
    }
    Ok(())
}

/// Receives H.264 in an MPEG transport stream.
pub(super) fn ts(address: SocketAddr, feed: &mut Feed) -> Result<(), SourceError> {
    let socket = open(address)?;
    let (mut receiver, mut units) = (TsReceiver::default(), Vec::new());
    let mut times = Unwrapper::new(33, CLOCK);
    let (mut buffer, mut arrivals) = (vec![0; LONGEST], Arrivals::default());
    while !feed.stopped() {
        let datagram = receive(&socket, &mut buffer).map_err(|error| SourceError::Socket { address, error })?;
        let Some(datagram) = datagram else { continue };
        arrivals.push(datagram);
        receiver.push(feed.now(), datagram, &mut units);
        feed.tally(receiver.tally(), Packets::default());
        feed.arrived(&arrivals, receiver.has_video() && !receiver.has_parameters(), receiver.other_streams());
        for unit in units.drain(..) {
            let stamp = unit.timestamp.map(|stamp| times.nanoseconds(stamp));
            feed.unit(unit.at, stamp, None, unit.unit)?;
        }
        if receiver.is_h265() {
            return Err(SourceError::Codec("H.265".to_owned()));
        }
        judge(address, &arrivals, Kind::Ts, |_| !receiver.makes_sense(), feed)?;
    }
    Ok(())
}

/// Fails if no image came, but packets of another kind, of which the receiver makes nothing.
fn judge(
    address: SocketAddr,
    arrivals: &Arrivals,
    expected: Kind,
    is_other: impl Fn(&Kind) -> bool,
    feed: &Feed,
) -> Result<(), SourceError> {
    if feed.has_images() {
        return Ok(());
    }
    if let Some(kind) = arrivals.other_than(expected).filter(is_other) {
        return Err(other_packets(address, arrivals, kind));
    }
    if arrivals.are(expected) {
        feed.goes_on();
    }
    Ok(())
}

/// A socket at an address of this machine, or in a multicast group.
fn open(address: SocketAddr) -> Result<UdpSocket, SourceError> {
    let opened = || {
        let group = address.ip();
        let at = match group {
            IpAddr::V4(group) if group.is_multicast() => IpAddr::V4(Ipv4Addr::UNSPECIFIED),
            IpAddr::V6(group) if group.is_multicast() => IpAddr::V6(Ipv6Addr::UNSPECIFIED),
            other => other,
        };
        let socket = UdpSocket::bind((at, address.port()))?;
        match group {
            IpAddr::V4(group) if group.is_multicast() => socket.join_multicast_v4(&group, &Ipv4Addr::UNSPECIFIED)?,
            IpAddr::V6(group) if group.is_multicast() => socket.join_multicast_v6(&group, 0)?,
            _ => {}
        }
        // A system may limit the size; the usual one then has to do.
        socket2::SockRef::from(&socket).set_recv_buffer_size(BUFFER).ok();
        socket.set_read_timeout(Some(POLL_INTERVAL))?;
        Ok(socket)
    };
    opened().map_err(|error| SourceError::Socket { address, error })
}

/// The next packet; `None` if none came for a while.
fn receive<'a>(socket: &UdpSocket, buffer: &'a mut [u8]) -> std::io::Result<Option<&'a [u8]>> {
    match socket.recv(buffer) {
        Ok(length) => Ok(Some(&buffer[..length])),
        // The last two say that an earlier packet of ours, which we never sent, was not delivered (Windows).
        Err(error)
            if matches!(
                error.kind(),
                ErrorKind::WouldBlock
                    | ErrorKind::TimedOut
                    | ErrorKind::Interrupted
                    | ErrorKind::ConnectionReset
                    | ErrorKind::ConnectionRefused
            ) =>
        {
            Ok(None)
        }
        Err(error) => Err(error),
    }
}

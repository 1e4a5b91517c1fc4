//! What is accepted from the network: datagrams of the drone, of the sizes that it sends.

use std::net::{IpAddr, UdpSocket};

/// Space for a datagram; longer ones are cut off by the system, and refused for their length.
pub(super) const BUFFER: usize = 2048;
/// Longest state line or answer, bytes; a Tello's have less than 300.
pub const TEXT: usize = 1024;
/// Longest datagram of the video, bytes: a Tello's have 1460, and none has more than fits into a frame of the network.
pub const VIDEO: usize = 1472;

/// Whether a datagram of `length` bytes that came `from` an address is taken for one of `drone`, which sends at most `most`
/// bytes at a time.
#[must_use]
pub fn accepts(from: IpAddr, drone: IpAddr, length: usize, most: usize) -> bool {
    from == drone && (1..=most).contains(&length)
}

/// The next datagram of `drone` with 1 to `most` bytes; `None` for any other, and if none came in the socket's time.
pub(super) fn receive<'a>(socket: &UdpSocket, drone: IpAddr, most: usize, buffer: &'a mut [u8; BUFFER]) -> Option<&'a [u8]> {
    // Errors are from earlier sends, or the timeout.
    let (length, from) = socket.recv_from(buffer).ok()?;
    accepts(from.ip(), drone, length, most).then(|| &buffer[..length])
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn only_the_drone_is_heard_and_only_in_its_sizes() {
        let bind = |address: &str| UdpSocket::bind((address, 0)).unwrap();
        let (own, drone, other) = (bind("127.0.0.1"), bind("127.0.0.2"), bind("127.0.0.3"));
        own.set_read_timeout(Some(Duration::from_secs(10))).unwrap();
        let to = own.local_addr().unwrap();
        let heard = |from: &UdpSocket, length: usize| {
            from.send_to(&vec![b'x'; length], to).unwrap();
            receive(&own, drone.local_addr().unwrap().ip(), TEXT, &mut [0; BUFFER]).map(<[u8]>::len)
        };
        assert_eq!((heard(&drone, 1), heard(&drone, TEXT)), (Some(1), Some(TEXT)));
        assert_eq!((heard(&drone, TEXT + 1), heard(&drone, 0), heard(&drone, 9000)), (None, None, None));
        assert_eq!(heard(&other, 10), None);
    }
}

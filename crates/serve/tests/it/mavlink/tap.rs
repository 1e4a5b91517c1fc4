//! A relay between driver and vehicle that looks at what the driver sends, and may change it.

use std::net::{SocketAddr, UdpSocket};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use spf_mavlink::wire::{Decoder, Packet};

/// Relays datagrams to and from a vehicle until `ends`. `look` gets each packet of the driver with its time of arrival, and returns the
/// datagram that is sent in its place, if another. Returns the address for the driver.
pub(super) fn tap(
    vehicle: SocketAddr,
    ends: Arc<AtomicBool>,
    mut look: impl FnMut(Instant, &Packet) -> Option<Vec<u8>> + Send + 'static,
) -> SocketAddr {
    let front = UdpSocket::bind("127.0.0.1:0").unwrap();
    let back = UdpSocket::bind("127.0.0.1:0").unwrap();
    back.connect(vehicle).unwrap();
    let address = front.local_addr().unwrap();
    for socket in [&front, &back] {
        socket.set_read_timeout(Some(Duration::from_millis(50))).unwrap();
    }
    let (front_back, back_front) = ((front.try_clone().unwrap(), back.try_clone().unwrap()), (front, back));
    let client: Arc<Mutex<Option<SocketAddr>>> = Arc::default();
    let (to_client, ended) = (client.clone(), ends.clone());
    std::thread::spawn(move || {
        let (mut buffer, mut decoder) = ([0; 4096], Decoder::default());
        while !ended.load(Ordering::Relaxed) {
            let Ok((length, from)) = front_back.0.recv_from(&mut buffer) else { continue };
            let arrived = Instant::now();
            *client.lock().unwrap() = Some(from);
            decoder.push(&buffer[..length]);
            let mut changed = None;
            while let Some(packet) = decoder.next_packet() {
                changed = look(arrived, &packet).or(changed);
            }
            drop(front_back.1.send(changed.as_deref().unwrap_or(&buffer[..length])));
        }
    });
    std::thread::spawn(move || {
        let mut buffer = [0; 4096];
        while !ends.load(Ordering::Relaxed) {
            if let Ok(length) = back_front.1.recv(&mut buffer)
                && let Some(to) = *to_client.lock().unwrap()
            {
                drop(back_front.0.send_to(&buffer[..length], to));
            }
        }
    });
    address
}

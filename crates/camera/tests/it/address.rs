//! Addresses for programs that are given one, and cannot say which port they took: nobody else may take it in between.

use std::net::{Ipv4Addr, SocketAddrV4};
use std::sync::atomic::{AtomicU16, Ordering};

/// An address of this machine that is this process's alone, with a port whose successor is free as well (for RTCP). Sockets without
/// a number of their own are given ports above 32767 on Linux, and above 49151 elsewhere.
pub(crate) fn own_address() -> SocketAddrV4 {
    static NEXT: AtomicU16 = AtomicU16::new(0);
    let process = std::process::id();
    let [_, high, middle, low] = process.to_be_bytes();
    let number = NEXT.fetch_add(2, Ordering::Relaxed);
    if cfg!(target_os = "linux") {
        // The whole of 127.0.0.0/8 is this machine; numbers of processes have 22 bits.
        SocketAddrV4::new(Ipv4Addr::new(127, 64 | high & 63, middle, low), 20_000 + number)
    } else {
        SocketAddrV4::new(Ipv4Addr::LOCALHOST, 20_000 + 200 * (process % 100) as u16 + number)
    }
}

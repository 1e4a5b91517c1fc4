//! The radio link between craft and client, with faults: datagrams are delayed, duplicated, corrupted or lost.

use std::net::SocketAddr;

use spf_core::time::Time;

use crate::fault::{Content, CraftFault, FaultMachine, Stream};

/// Maximum number of datagrams in transit; more are lost, as on a radio link.
const MOST: usize = 1024;

/// A datagram in transit.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Packet {
    pub(crate) at: Time,
    pub(crate) stream: Stream,
    pub(crate) peer: SocketAddr,
    pub(crate) bytes: Vec<u8>,
}

/// Datagrams in transit, in both directions.
#[derive(Debug)]
pub(crate) struct Link {
    faults: FaultMachine,
    /// Number of datagrams so far, from which the faults of each are derived.
    count: u64,
    under_way: Vec<Packet>,
    /// The last state before the telemetry froze.
    frozen: Vec<u8>,
}

impl Link {
    pub(crate) fn new(faults: FaultMachine) -> Self {
        Self { faults, count: 0, under_way: Vec::new(), frozen: Vec::new() }
    }

    pub(crate) fn faults(&self) -> &FaultMachine {
        &self.faults
    }

    /// Sets new faults; datagrams in transit are not affected.
    pub(crate) fn set_faults(&mut self, faults: FaultMachine) {
        self.faults = faults;
    }

    /// Sends a datagram at `at`.
    pub(crate) fn send(&mut self, at: Time, stream: Stream, peer: SocketAddr, bytes: &[u8]) {
        self.count += 1;
        if self.faults.has_fault(at, CraftFault::LinkCut) {
            return;
        }
        if self.under_way.len() >= MOST {
            return;
        }
        for delivery in self.faults.pass(at, stream, self.count) {
            let bytes = match delivery.content {
                Content::FrozenSince(_) if stream == Stream::Telemetry && !self.frozen.is_empty() => self.frozen.clone(),
                Content::Intact | Content::FrozenSince(_) => bytes.to_vec(),
                Content::Corrupt(number) => corrupted(bytes, number),
                Content::Blank => Vec::new(),
            };
            if stream == Stream::Telemetry && delivery.content == Content::Intact {
                self.frozen.clone_from(&bytes);
            }
            self.under_way.push(Packet { at: delivery.at, stream, peer, bytes });
        }
    }

    /// The next datagram that arrives by `now` and satisfies `wanted`; earliest first, equal times in order of sending.
    pub(crate) fn take(&mut self, now: Time, wanted: impl Fn(Stream) -> bool) -> Option<Packet> {
        let due = |packet: &&Packet| packet.at <= now && wanted(packet.stream);
        let at = self.under_way.iter().filter(due).map(|packet| packet.at).min()?;
        let index = self.under_way.iter().position(|packet| packet.at == at && wanted(packet.stream))?;
        let packet = self.under_way.remove(index);
        // The link was cut while it was in transit.
        if self.faults.has_fault(packet.at, CraftFault::LinkCut) { self.take(now, wanted) } else { Some(packet) }
    }

    /// When the next datagram arrives.
    pub(crate) fn next_at(&self) -> Option<Time> {
        self.under_way.iter().map(|packet| packet.at).min()
    }
}

/// Flips one bit in every 64 bytes, at least one.
pub(crate) fn corrupted(bytes: &[u8], number: u64) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    let length = bytes.len();
    for round in 0..=length / 64 {
        let draw = number.wrapping_add(round as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        if let Some(byte) = bytes.get_mut((draw >> 16) as usize % length.max(1)) {
            *byte ^= 1 << (draw % 8);
        }
    }
    bytes
}

//! The clients: what each of them gets, and what is on its way to them.

use std::collections::{BTreeMap, VecDeque};

use spf_core::time::Time;
use spf_mavlink::dialect::{MavMessage, MavSeverity, STATUSTEXT_DATA};
use spf_mavlink::modes::Autopilot;
use spf_mavlink::wire::{Body, Packet};

use super::Peer;
use super::rates::{DEFAULTS, Streams};

/// Maximum number of clients, and of messages that wait to be sent.
const PEERS: usize = 16;
const WAITING: usize = 4096;

/// The clients of one vehicle.
#[derive(Debug)]
pub(super) struct Clients {
    autopilot: Autopilot,
    peers: BTreeMap<Peer, Streams>,
    out: VecDeque<(Peer, Body)>,
    /// Heartbeats of clients on their way to the others, with system and component.
    forwarded: VecDeque<(Peer, [u8; 2], Body)>,
    /// Firmware without `SET_MESSAGE_INTERVAL`.
    old: bool,
}

impl Clients {
    pub(super) fn new(autopilot: Autopilot) -> Self {
        Self { autopilot, peers: BTreeMap::new(), out: VecDeque::new(), forwarded: VecDeque::new(), old: false }
    }

    /// Adds a client, to which it sends from now on. More than 16 are ignored.
    pub(super) fn join(&mut self, now: Time, peer: Peer) {
        if self.peers.len() < PEERS {
            let old = self.old;
            self.peers.entry(peer).or_insert_with(|| {
                let mut streams = Streams::new(self.autopilot, now);
                if old {
                    streams.quiet();
                }
                streams
            });
        }
    }

    pub(super) fn leave(&mut self, peer: Peer) {
        self.peers.remove(&peer);
    }

    pub(super) fn has(&self, peer: Peer) -> bool {
        self.peers.contains_key(&peer)
    }

    /// From now on they get nothing but heartbeats by themselves, and rates of single messages are unknown.
    pub(super) fn grow_old(&mut self) {
        self.old = true;
        self.peers.values_mut().for_each(Streams::quiet);
    }

    /// Sets the interval of a message to a client, microseconds: 0 for the usual one, negative for none. False if it cannot be set.
    pub(super) fn set_interval(&mut self, now: Time, from: Peer, id: f32, interval: f32) -> bool {
        let known = id.is_finite() && DEFAULTS.iter().any(|(known, _)| *known == id as u32);
        match self.peers.get_mut(&from) {
            Some(streams) if known && interval.is_finite() && !self.old => {
                streams.set(id as u32, interval, self.autopilot, now);
                true
            }
            _ => false,
        }
    }

    /// Sets one rate, Hz, for a group of messages to a client (`MAV_DATA_STREAM`). PX4 does not know it.
    pub(super) fn set_group(&mut self, now: Time, from: Peer, group: u8, rate: u16) {
        let autopilot = self.autopilot;
        if let Some(streams) = self.peers.get_mut(&from).filter(|_| autopilot == Autopilot::ArduPilot) {
            streams.set_group(group, rate, autopilot, now);
        }
    }

    /// The messages that are due, for each client.
    pub(super) fn due(&mut self, now: Time) -> Vec<(Peer, Vec<u32>)> {
        self.peers.iter_mut().map(|(peer, streams)| (*peer, streams.due(now))).collect()
    }

    pub(super) fn send(&mut self, peer: Peer, body: Body) {
        if self.out.len() < WAITING {
            self.out.push_back((peer, body));
        }
    }

    /// Number of messages that wait to be sent.
    pub(super) fn waiting(&self) -> usize {
        self.out.len()
    }

    /// Sends a message before those that have been sent since so many waited.
    pub(super) fn send_before(&mut self, waiting: usize, peer: Peer, body: Body) {
        self.out.insert(waiting, (peer, body));
    }

    pub(super) fn broadcast(&mut self, body: &Body) {
        let peers: Vec<Peer> = self.peers.keys().copied().collect();
        for peer in peers {
            self.send(peer, body.clone());
        }
    }

    /// A text for all of them.
    pub(super) fn say(&mut self, severity: MavSeverity, text: &str) {
        let data = STATUSTEXT_DATA { severity, text: text.into(), ..STATUSTEXT_DATA::default() };
        self.broadcast(&Body::from(&MavMessage::STATUSTEXT(data)));
    }

    /// ArduPilot passes what is for everybody on to its other links; of that, heartbeats.
    pub(super) fn forward(&mut self, from: Peer, packet: &Packet) {
        if self.autopilot != Autopilot::ArduPilot {
            return;
        }
        let others: Vec<Peer> = self.peers.keys().filter(|peer| **peer != from).copied().collect();
        for peer in others.into_iter().take(PEERS - self.forwarded.len().min(PEERS)) {
            let body = Body { id: packet.id, payload: packet.payload.clone() };
            self.forwarded.push_back((peer, [packet.system, packet.component], body));
        }
    }

    /// The next message of a client to pass on, with the client that it is for, and the system and component that it is of.
    pub(super) fn poll_forwarded(&mut self) -> Option<(Peer, [u8; 2], Body)> {
        self.forwarded.pop_front()
    }

    /// The next message to send, with its client.
    pub(super) fn poll(&mut self) -> Option<(Peer, Body)> {
        self.out.pop_front()
    }
}

//! Restores the order of RTP packets, and finds the missing ones.

use std::collections::VecDeque;

use spf_core::time::{Duration, Time};

use super::Packet;

/// Packets that may wait for a missing one.
const WINDOW: usize = 10;
/// How long they wait.
const PATIENCE: Duration = Duration::from_millis(50);
/// A sequence number further away than this is a stray one, or that of a sender that was restarted.
const JUMP: u16 = 1000;

/// What comes next.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Ordered {
    /// A packet and its time of arrival.
    Packet(Time, Packet),
    /// At least one packet is missing here.
    Lost,
}

/// Puts packets in the order of their sequence numbers. At most ten packets wait for a missing one, for at most 50 ms.
#[derive(Clone, Debug, Default)]
pub struct Reorder {
    /// Sequence number expected next.
    expected: Option<u16>,
    /// Packets after a gap, by sequence number.
    waiting: Vec<(Time, Packet)>,
    /// The last packet, if its number was far away.
    stray: Option<(Time, Packet)>,
    ready: VecDeque<Ordered>,
    received: u64,
    lost: u64,
}

impl Reorder {
    /// Takes a packet that arrived at `now`.
    pub fn push(&mut self, now: Time, packet: Packet) {
        self.received += 1;
        let expected = *self.expected.get_or_insert(packet.sequence);
        let ahead = packet.sequence.wrapping_sub(expected);
        let stray = self.stray.take();
        if ahead == 0 {
            self.deliver(now, packet);
        } else if ahead < JUMP {
            // Repeated packets are dropped.
            if let Err(at) = self.waiting.binary_search_by_key(&ahead, |(_, other)| other.sequence.wrapping_sub(expected)) {
                self.waiting.insert(at, (now, packet));
            }
        } else if expected.wrapping_sub(packet.sequence) > JUMP {
            // Two packets in a row make a restart, as in RFC 3550, A.1.
            match stray.filter(|(_, stray)| stray.sequence.wrapping_add(1) == packet.sequence) {
                None => self.stray = Some((now, packet)),
                Some((at, stray)) => {
                    self.waiting.clear();
                    self.ready.push_back(Ordered::Lost);
                    self.deliver(at, stray);
                    self.deliver(now, packet);
                }
            }
        }
        // Otherwise it comes after its turn, or for the second time.
        self.follow();
        if self.waiting.len() > WINDOW {
            self.give_up();
        }
        self.expire(now);
    }

    /// Gives up on packets for which others have waited too long.
    pub fn expire(&mut self, now: Time) {
        while self.waiting.iter().any(|(at, _)| now.since(*at) >= PATIENCE) {
            self.give_up();
        }
    }

    /// Packets received and packets missing so far. One that comes after its turn counts as missing.
    #[must_use]
    pub fn packets(&self) -> (u64, u64) {
        (self.received, self.lost)
    }

    /// Skips to the first packet that waits.
    fn give_up(&mut self) {
        if let Some((_, first)) = self.waiting.first() {
            self.lost += u64::from(self.expected.map_or(0, |expected| first.sequence.wrapping_sub(expected)));
            self.expected = Some(first.sequence);
            self.ready.push_back(Ordered::Lost);
            self.follow();
        }
    }

    fn follow(&mut self) {
        while self.waiting.first().is_some_and(|(_, first)| Some(first.sequence) == self.expected) {
            let (at, packet) = self.waiting.remove(0);
            self.deliver(at, packet);
        }
    }

    fn deliver(&mut self, at: Time, packet: Packet) {
        self.expected = Some(packet.sequence.wrapping_add(1));
        self.ready.push_back(Ordered::Packet(at, packet));
    }
}

impl Iterator for Reorder {
    type Item = Ordered;

    fn next(&mut self) -> Option<Ordered> {
        self.ready.pop_front()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn packet(sequence: u16) -> Packet {
        Packet { marker: false, payload_type: 96, sequence, timestamp: 0, source: 0, payload: Vec::new() }
    }

    /// Sequence numbers in the order of delivery, -1 for a loss, of packets that arrive at these times, ms.
    fn order(arrivals: &[(u64, u16)]) -> Vec<i32> {
        let mut reorder = Reorder::default();
        arrivals.iter().for_each(|(at, sequence)| reorder.push(Time::from_millis(*at), packet(*sequence)));
        reorder
            .map(|ordered| match ordered {
                Ordered::Packet(_, packet) => i32::from(packet.sequence),
                Ordered::Lost => -1,
            })
            .collect()
    }

    #[test]
    fn order_is_restored_across_the_end_of_the_numbers() {
        assert_eq!(order(&[(0, 65_534), (0, 0), (0, 65_535), (0, 2), (0, 1), (0, 1)]), [65_534, 65_535, 0, 1, 2]);
    }

    #[test]
    fn a_missing_packet_is_given_up_after_ten_others() {
        let later: Vec<(u64, u16)> = std::iter::once(1).chain(3..13).map(|sequence| (0, sequence)).collect();
        assert_eq!(order(&later), [1]);
        let more: Vec<(u64, u16)> = later.into_iter().chain([(0, 13), (0, 2)]).collect();
        assert_eq!(order(&more), [1, -1, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13]);
    }

    #[test]
    fn a_missing_packet_is_given_up_after_50_ms() {
        assert_eq!(order(&[(0, 1), (10, 3), (59, 4)]), [1]);
        assert_eq!(order(&[(0, 1), (10, 3), (60, 4)]), [1, -1, 3, 4]);
        let mut reorder = Reorder::default();
        [1, 3].iter().for_each(|sequence| reorder.push(Time::ZERO, packet(*sequence)));
        reorder.expire(Time::from_millis(50));
        assert_eq!((reorder.by_ref().count(), reorder.packets()), (3, (2, 1)));
    }

    #[test]
    fn a_restarted_sender_begins_anew() {
        let restarts = [(0, 1), (0, 2), (0, 30_000), (0, 30_001), (0, 65_535), (0, 0), (0, 1)];
        assert_eq!(order(&restarts), [1, 2, -1, 30_000, 30_001, -1, 65_535, 0, 1]);
    }

    #[test]
    fn stray_packets_interrupt_nothing() {
        assert_eq!(order(&[(0, 1), (0, 30_000), (0, 2), (0, 30_001), (0, 3)]), [1, 2, 3]);
        assert_eq!(order(&[(0, 1), (0, 30_000), (0, 40_000), (0, 30_000), (0, 2)]), [1, 2]);
        // A packet that waits for another one goes on waiting.
        assert_eq!(order(&[(0, 1), (0, 3), (0, 30_000), (0, 2)]), [1, 2, 3]);
    }
}

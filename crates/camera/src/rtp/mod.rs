//! H.264 in RTP packets (RFC 3550, RFC 6184). No I/O.
//!
//! [`Packet`] parses a datagram, [`Reorder`] restores the order, and [`Depacketizer`] joins the payloads to access units.
//! [`Receiver`] combines them.
//!
//! The crates that depacketise H.264 (webrtc-rs, `str0m`, `retina`) do so inside a WebRTC or RTSP session only, so the
//! three payload formats that cameras send are read here.

pub mod h264;
pub mod reorder;

use spf_core::time::Time;
use spf_drone::frames::VideoStats;
use spf_media::h264::AccessUnit;

use self::h264::Depacketizer;
use self::reorder::{Ordered, Reorder};

/// Length of the fixed header, bytes.
const HEADER: usize = 12;
/// A stream from another source replaces the present one after this many of its packets, with none of the present in between.
const PACKETS_TO_SWITCH: u32 = 16;

/// An RTP packet (RFC 3550, section 5.1).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Packet {
    /// Whether this is the last packet of an access unit.
    pub marker: bool,
    /// Payload type.
    pub payload_type: u8,
    /// Sequence number.
    pub sequence: u16,
    /// Time of the access unit, 1/90000 s from an arbitrary start.
    pub timestamp: u32,
    /// The source (SSRC).
    pub source: u32,
    /// Payload without padding.
    pub payload: Vec<u8>,
}

impl Packet {
    /// Parses a datagram; `None` if it is not an RTP packet (RTCP is none either).
    #[must_use]
    pub fn parse(bytes: &[u8]) -> Option<Self> {
        let (head, mut rest) = bytes.split_at_checked(HEADER)?;
        let [first, second, ..] = *head else { return None };
        // RTCP on the same port has packet types 200 to 204 in the place of marker and payload type (RFC 5761).
        if first >> 6 != 2 || (200..=207).contains(&second) {
            return None;
        }
        rest = rest.get(4 * usize::from(first & 0x0f)..)?;
        if first & 0x10 != 0 {
            let words = u16::from_be_bytes(rest.get(2..4)?.try_into().ok()?);
            rest = rest.get(4 + 4 * usize::from(words)..)?;
        }
        if first & 0x20 != 0 {
            let padding = usize::from(*rest.last()?);
            rest = rest.get(..rest.len().checked_sub(padding.max(1))?)?;
        }
        let word = |at: usize| Some(u32::from_be_bytes(head.get(at..at + 4)?.try_into().ok()?));
        Some(Self {
            marker: second & 0x80 != 0,
            payload_type: second & 0x7f,
            sequence: u16::from_be_bytes([head[2], head[3]]),
            timestamp: word(4)?,
            source: word(8)?,
            payload: rest.to_vec(),
        })
    }
}

/// A received access unit.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TimedUnit {
    /// Arrival of its last packet.
    pub at: Time,
    /// Its RTP time, 1/90000 s.
    pub timestamp: u32,
    /// The unit.
    pub unit: AccessUnit,
}

/// Receives one stream of H.264 in RTP.
#[derive(Clone, Debug, Default)]
pub struct Receiver {
    source: Option<u32>,
    /// Another source, and the number of its packets since the last of the present one.
    other_source: Option<(u32, u32)>,
    reorder: Reorder,
    depacketizer: Depacketizer,
    damaged: u64,
}

impl Receiver {
    /// Takes a datagram that arrived at `now`; appends the access units that it completes.
    pub fn push(&mut self, now: Time, datagram: &[u8], units: &mut Vec<TimedUnit>) {
        let Some(packet) = Packet::parse(datagram) else {
            self.damaged += 1;
            return;
        };
        if self.source.is_none_or(|source| source == packet.source) {
            self.other_source = None;
            self.source = Some(packet.source);
        } else {
            // A sender that restarts has a new source number; one that sends beside it must not interrupt the first.
            let before = self.other_source.filter(|(source, _)| *source == packet.source).map_or(0, |(_, count)| count);
            self.other_source = Some((packet.source, before + 1));
            if before + 1 < PACKETS_TO_SWITCH {
                return;
            }
            self.other_source = None;
            self.source = Some(packet.source);
            self.reorder = Reorder::default();
            self.depacketizer.restart();
        }
        self.reorder.push(now, packet);
        self.drain(units);
    }

    /// Gives up waiting for packets that are missing for too long; to be called when nothing arrives.
    pub fn expire(&mut self, now: Time, units: &mut Vec<TimedUnit>) {
        self.reorder.expire(now);
        self.drain(units);
    }

    fn drain(&mut self, units: &mut Vec<TimedUnit>) {
        for ordered in self.reorder.by_ref() {
            match ordered {
                Ordered::Packet(at, packet) => self.depacketizer.push(at, &packet, units),
                Ordered::Lost => self.depacketizer.lost(),
            }
        }
    }

    /// Losses so far.
    #[must_use]
    pub fn tally(&self) -> VideoStats {
        let tally = self.depacketizer.tally();
        VideoStats { damaged: tally.damaged + self.damaged, ..tally }
    }

    /// Packets received and packets lost so far.
    #[must_use]
    pub fn packets(&self) -> (u64, u64) {
        self.reorder.packets()
    }

    /// Whether a decoder could be set up: parameter sets have come.
    #[must_use]
    pub fn has_parameters(&self) -> bool {
        self.depacketizer.has_parameters()
    }

    /// Whether most of its payloads are those of H.264.
    #[must_use]
    pub fn makes_sense(&self) -> bool {
        self.depacketizer.makes_sense()
    }

    /// Whether the stream looks like H.265, which cannot be decoded.
    #[must_use]
    pub fn is_h265(&self) -> bool {
        self.depacketizer.is_h265()
    }
}

#[cfg(test)]
pub(crate) mod testing {
    //! Packets as senders make them.

    use super::*;
    use spf_media::h264::nal_units;

    impl Packet {
        /// The bytes of a packet.
        pub(crate) fn bytes(&self) -> Vec<u8> {
            let mut bytes = vec![0x80, u8::from(self.marker) << 7 | self.payload_type];
            bytes.extend(self.sequence.to_be_bytes());
            bytes.extend(self.timestamp.to_be_bytes());
            bytes.extend(self.source.to_be_bytes());
            bytes.extend(&self.payload);
            bytes
        }
    }

    /// Packets of access units, from this sequence number on: parameter sets in STAP-A, long units in FU-A.
    pub(crate) fn packets(units: &[AccessUnit], first: u16, size: usize) -> Vec<Vec<Packet>> {
        let mut sequence = first;
        let mut packed = Vec::new();
        for (number, unit) in units.iter().enumerate() {
            let mut payloads: Vec<Vec<u8>> = Vec::new();
            let mut together = vec![0x78];
            for nal in nal_units(&unit.annex_b) {
                if nal.len() < 40 && matches!(nal[0] & 0x1f, 7 | 8) {
                    together.extend((nal.len() as u16).to_be_bytes());
                    together.extend(nal);
                } else if nal.len() <= size {
                    payloads.push(nal.to_vec());
                } else {
                    let pieces: Vec<&[u8]> = nal[1..].chunks(size - 2).collect();
                    for (piece, bytes) in pieces.iter().enumerate() {
                        let ends = u8::from(piece == 0) << 7 | u8::from(piece + 1 == pieces.len()) << 6;
                        payloads.push([&[nal[0] & 0xe0 | 28, ends | nal[0] & 0x1f], *bytes].concat());
                    }
                }
            }
            if together.len() > 1 {
                payloads.insert(0, together);
            }
            let last = payloads.len() - 1;
            let packet = |(index, payload)| {
                let packet = Packet {
                    marker: index == last,
                    payload_type: 96,
                    sequence,
                    timestamp: (number as u32).wrapping_mul(9000).wrapping_sub(20_000),
                    source: 7,
                    payload,
                };
                sequence = sequence.wrapping_add(1);
                packet
            };
            packed.push(payloads.into_iter().enumerate().map(packet).collect());
        }
        packed
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::testing::packets;
    use super::*;
    use crate::testing::units;

    fn receive(receiver: &mut Receiver, packets: &[Packet]) -> Vec<TimedUnit> {
        let mut units = Vec::new();
        for packet in packets {
            receiver.push(Time::ZERO, &packet.bytes(), &mut units);
        }
        units
    }

    #[test]
    fn headers_are_parsed() {
        let mut bytes = vec![0xb1, 0xe0, 0, 7, 0, 0, 0, 9, 0, 0, 0, 1, 1, 2, 3, 4, 0, 0, 0, 1, 9, 9, 9, 9, 0x65, 1, 0, 0, 3];
        let packet = Packet::parse(&bytes).unwrap();
        assert_eq!((packet.marker, packet.payload_type, packet.sequence, packet.timestamp, packet.source), (true, 96, 7, 9, 1));
        assert_eq!(packet.payload, [0x65, 1]);
        // Padding longer than the packet, RTCP, another version, too short.
        *bytes.last_mut().unwrap() = 200;
        assert_eq!(Packet::parse(&bytes), None);
        assert_eq!(Packet::parse(&[0x80, 200, 0, 6, 0, 0, 0, 0, 0, 0, 0, 0, 0]), None);
        assert_eq!(Packet::parse(&[0; 40]), None);
        assert_eq!(Packet::parse(&[0x80; 11]), None);
    }

    #[test]
    fn a_stream_comes_back_whatever_its_packet_size() {
        let sent = units(128, 96, 12, 0.5);
        for size in [100, 333, 1200, 100_000] {
            let mut receiver = Receiver::default();
            let packets = packets(&sent, 65_530, size);
            let came: Vec<_> = packets.iter().flat_map(|packets| receive(&mut receiver, packets)).collect();
            assert_eq!(came.iter().map(|came| &came.unit).collect::<Vec<_>>(), sent.iter().collect::<Vec<_>>());
            assert_eq!(came[1].timestamp.wrapping_sub(came[0].timestamp), 9000);
            assert_eq!(receiver.packets().1, 0);
        }
    }

    #[test]
    fn each_lost_packet_costs_the_rest_of_its_group_and_no_more() {
        let sent = units(128, 96, 25, 1.0);
        let packets = packets(&sent, 0, 300);
        for frame in [2, 9, 10] {
            for lost in 0..packets[frame].len() {
                let mut receiver = Receiver::default();
                let mut damaged = packets.clone();
                damaged[frame].remove(lost);
                let came = receive(&mut receiver, &damaged.concat());
                let numbers: Vec<usize> =
                    came.iter().filter_map(|came| sent.iter().position(|unit| *unit == came.unit)).collect();
                assert_eq!(numbers.len(), came.len(), "what comes out is what went in");
                let next = match (frame, lost) {
                    // Parameter sets that have not changed are known.
                    (10, 0) => 10,
                    (10, _) => 20,
                    _ => 10,
                };
                let expected: Vec<usize> = (0..frame).chain(next..25).collect();
                assert_eq!(numbers, expected, "packet {lost} of frame {frame}");
                assert_eq!((receiver.packets().1, receiver.tally().gaps), (1, 1));
            }
        }
    }

    #[test]
    fn a_restarted_sender_is_followed_and_a_second_one_is_not() {
        let sent = units(64, 48, 40, 0.5);
        let old = packets(&sent, 100, 1200).concat();
        let new: Vec<Packet> =
            packets(&sent, 9000, 1200).concat().into_iter().map(|packet| Packet { source: 8, ..packet }).collect();
        let mut receiver = Receiver::default();
        let both: Vec<Packet> = old.iter().zip(&new).flat_map(|(old, new)| [old.clone(), new.clone()]).collect();
        assert_eq!(receive(&mut receiver, &both).len(), 40);
        assert!(receive(&mut receiver, &new).len() >= 20);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]
        #[test]
        fn packets_out_of_order_and_repeated_change_nothing(
            swaps in proptest::collection::vec((0_usize..200, 1_usize..8), 0..20), again in 0_usize..50,
        ) {
            let sent = units(64, 48, 12, 0.5);
            let mut packets = packets(&sent, 65_500, 100).concat();
            // The first packet tells where the stream begins.
            let count = packets.len();
            for (at, by) in swaps {
                let at = 1 + at % (count - 9);
                // A packet that is moved by more than the window counts as lost.
                let ordered = packets[at..=at + by].windows(2).all(|pair| pair[1].sequence == pair[0].sequence.wrapping_add(1));
                if ordered {
                    packets.swap(at, at + by);
                }
            }
            packets.insert(count.min(again + 2), packets[again.min(count - 1)].clone());
            let mut receiver = Receiver::default();
            let came = receive(&mut receiver, &packets);
            prop_assert_eq!(came.into_iter().map(|came| came.unit).collect::<Vec<_>>(), sent);
        }

        #[test]
        fn with_losses_nothing_comes_out_that_did_not_go_in(seed in proptest::collection::vec(0_u8..100, 300), share in 0_u8..40) {
            let sent = units(64, 48, 30, 0.5);
            let packets = packets(&sent, 7, 100).concat();
            let kept: Vec<Packet> =
                packets.into_iter().zip(seed.iter().cycle()).filter(|(_, chance)| **chance >= share).map(|(packet, _)| packet).collect();
            let mut receiver = Receiver::default();
            let mut last = None;
            for came in receive(&mut receiver, &kept) {
                let number = sent.iter().position(|unit| *unit == came.unit);
                prop_assert!(number.is_some() && number > last);
                last = number;
            }
        }

        #[test]
        fn no_datagrams_panic_or_pile_up(datagrams in proptest::collection::vec(
            (any::<u16>(), any::<u32>(), any::<bool>(), proptest::collection::vec(any::<u8>(), 0..30), 0_usize..3000), 0..80)) {
            let mut receiver = Receiver::default();
            let mut units = Vec::new();
            for (number, (sequence, timestamp, marker, bytes, length)) in datagrams.into_iter().enumerate() {
                let payload: Vec<u8> = bytes.iter().copied().cycle().take(if bytes.is_empty() { 0 } else { length }).collect();
                let packet = Packet { marker, payload_type: 96, sequence: sequence % 64, timestamp, source: 1, payload };
                receiver.push(Time::from_millis(number as u64), &packet.bytes(), &mut units);
                receiver.push(Time::from_millis(number as u64), &packet.payload, &mut units);
                receiver.expire(Time::from_millis(number as u64), &mut units);
            }
        }
    }
}

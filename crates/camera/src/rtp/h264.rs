//! H.264 access units from RTP payloads in order (RFC 6184, non-interleaved mode): single NAL units, STAP-A and FU-A.

use spf_core::time::Time;
use spf_drone::frames::VideoStats;

use super::{Packet, TimedUnit};
use crate::unit::{LONGEST_UNIT, UnitBuilder};

/// Payload that aggregates NAL units of one time.
const STAP_A: u8 = 24;
/// Payload with a fragment of a NAL unit.
const FU_A: u8 = 28;
/// Payloads that look like H.265 before the stream counts as such.
const SIGNS: u32 = 3;

/// Joins payloads to access units.
#[derive(Clone, Debug, Default)]
pub struct Depacketizer {
    builder: UnitBuilder,
    /// Fragments of the current NAL unit; empty if none is open.
    fragments: Vec<u8>,
    /// Time of the open unit, and arrival of its last packet.
    open: Option<(u32, Time)>,
    /// Payloads that were read, and those that were invalid.
    sound: u64,
    damaged: u64,
    h265_signs: u32,
}

impl Depacketizer {
    /// Losses so far.
    #[must_use]
    pub fn tally(&self) -> VideoStats {
        let tally = self.builder.tally();
        VideoStats { damaged: tally.damaged + self.damaged, ..tally }
    }

    /// Whether a decoder could be set up: parameter sets have come.
    #[must_use]
    pub fn has_parameters(&self) -> bool {
        self.builder.has_parameters()
    }

    /// Whether most payloads are those of H.264. Of random bytes, such as audio, about a third seem to be.
    #[must_use]
    pub fn makes_sense(&self) -> bool {
        self.sound > self.damaged
    }

    /// Whether the stream looks like H.265.
    #[must_use]
    pub fn is_h265(&self) -> bool {
        self.h265_signs >= SIGNS && self.builder.tally().units == 0
    }

    /// Reports that packets are missing before the next one.
    pub fn lost(&mut self) {
        self.fragments.clear();
        self.builder.lost();
    }

    /// Reports that another stream begins.
    pub fn restart(&mut self) {
        self.lost();
        self.open = None;
    }

    /// Takes the next packet; appends the access units that it completes.
    pub fn push(&mut self, at: Time, packet: &Packet, units: &mut Vec<TimedUnit>) {
        // The last packet of the unit before had no marker: it was lost, or the sender sets none.
        if self.open.is_some_and(|(timestamp, _)| timestamp != packet.timestamp) {
            self.end(units);
        }
        self.open = Some((packet.timestamp, at));
        if self.payload(&packet.payload) {
            self.sound += u64::from(!packet.payload.is_empty());
        } else {
            self.damaged += 1;
            self.lost();
        }
        if packet.marker {
            self.end(units);
        }
    }

    fn end(&mut self, units: &mut Vec<TimedUnit>) {
        if !self.fragments.is_empty() {
            self.lost();
        }
        let unit = self.builder.end();
        if let (Some((timestamp, at)), Some(unit)) = (self.open.take(), unit) {
            units.push(TimedUnit { at, timestamp, unit });
        }
    }

    /// Reads a payload; false if it is invalid.
    fn payload(&mut self, payload: &[u8]) -> bool {
        // An empty payload keeps a path through a firewall open.
        let Some((&head, rest)) = payload.split_first() else { return true };
        if head & 0x80 != 0 {
            return false;
        }
        // VPS, SPS, PPS and aggregates of H.265, of layer 0 (RFC 7798, section 1.1.4). As H.264 they would be partitions and
        // types without a meaning.
        if matches!(head, 0x40 | 0x42 | 0x44 | 0x60 | 0x62) && rest.first() == Some(&1) {
            self.h265_signs = self.h265_signs.saturating_add(1);
        }
        let kind = head & 0x1f;
        if kind != FU_A && !self.fragments.is_empty() {
            self.lost();
        }
        match kind {
            1..=23 => self.builder.nal(payload),
            STAP_A => return self.aggregate(rest),
            FU_A => return self.fragment(head, rest),
            _ => return false,
        }
        true
    }

    /// NAL units after their 16-bit lengths.
    fn aggregate(&mut self, mut rest: &[u8]) -> bool {
        while let Some((length, after)) = rest.split_first_chunk::<2>() {
            let Some((nal, after)) = after.split_at_checked(usize::from(u16::from_be_bytes(*length))) else { return false };
            if !nal.is_empty() {
                self.builder.nal(nal);
            }
            rest = after;
        }
        rest.is_empty()
    }

    fn fragment(&mut self, head: u8, rest: &[u8]) -> bool {
        let Some((&second, piece)) = rest.split_first() else { return false };
        let (starts, ends) = (second & 0x80 != 0, second & 0x40 != 0);
        if starts {
            if !self.fragments.is_empty() {
                return false;
            }
            self.fragments.push(head & 0xe0 | second & 0x1f);
        } else if self.fragments.is_empty() {
            return false;
        }
        if self.fragments.len() + piece.len() > LONGEST_UNIT {
            return false;
        }
        self.fragments.extend_from_slice(piece);
        if ends {
            let nal = std::mem::take(&mut self.fragments);
            self.builder.nal(&nal);
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rtp::testing::packets;
    use crate::testing::units;

    fn push(depacketizer: &mut Depacketizer, packets: &[Packet]) -> Vec<TimedUnit> {
        let mut units = Vec::new();
        packets.iter().for_each(|packet| depacketizer.push(Time::ZERO, packet, &mut units));
        units
    }

    #[test]
    fn units_without_markers_end_where_the_time_changes() {
        let sent = units(64, 48, 6, 1.0);
        let mut packets = packets(&sent, 0, 200).concat();
        packets.iter_mut().for_each(|packet| packet.marker = false);
        let came = push(&mut Depacketizer::default(), &packets);
        assert_eq!(came.into_iter().map(|came| came.unit).collect::<Vec<_>>(), sent[..5]);
    }

    #[test]
    fn h265_is_recognised_and_h264_is_not() {
        let packet = |number: u16, payload: &[u8]| Packet {
            marker: true,
            payload_type: 96,
            sequence: number,
            timestamp: u32::from(number),
            source: 1,
            payload: payload.to_vec(),
        };
        let mut depacketizer = Depacketizer::default();
        let h265: [&[u8]; 4] = [&[0x40, 1, 12], &[0x42, 1, 1], &[0x44, 1, 0xc0], &[0x62, 1, 0x93, 0xaf]];
        let packets: Vec<Packet> = (0..).zip(h265).map(|(number, payload)| packet(number, payload)).collect();
        assert!(push(&mut depacketizer, &packets).is_empty() && depacketizer.is_h265());
        let mut depacketizer = Depacketizer::default();
        push(&mut depacketizer, &super::super::testing::packets(&units(64, 48, 12, 0.5), 0, 200).concat());
        assert!(!depacketizer.is_h265() && depacketizer.makes_sense());
        // Audio: silence by the µ-law, and noise.
        let noise: Vec<u8> = (0..160_u32 * 160).map(|n| (n.wrapping_mul(2_654_435_761) >> 13) as u8).collect();
        for audio in [vec![0xff; 160 * 160], noise] {
            let mut depacketizer = Depacketizer::default();
            let packets: Vec<Packet> = (0..).zip(audio.chunks(160)).map(|(number, payload)| packet(number, payload)).collect();
            push(&mut depacketizer, &packets);
            assert!(!depacketizer.makes_sense(), "{depacketizer:?}");
        }
    }

    #[test]
    fn a_fragment_without_its_beginning_is_a_loss() {
        let sent = units(64, 48, 6, 0.5);
        let packets = packets(&sent, 0, 100);
        let mut depacketizer = Depacketizer::default();
        assert!(push(&mut depacketizer, &packets[0][2..]).is_empty());
        assert_eq!(depacketizer.tally().damaged as usize, packets[0].len() - 2);
        assert_eq!(push(&mut depacketizer, &packets[5]).len(), 1);
    }
}

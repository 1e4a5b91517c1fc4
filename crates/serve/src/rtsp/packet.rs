//! H.264 in RTP packets (RFC 3550, RFC 6184) and the sender reports that tell when an image was captured. No I/O.

use std::time::Duration;

use spf_media::h264::nal_units;

/// Payload type, one of those that a description assigns (RFC 3551, section 3).
pub const PAYLOAD_TYPE: u8 = 96;
/// Clock rate of video, Hz (RFC 6184, section 5.1).
pub const CLOCK: u32 = 90_000;
/// Longest RTP packet, bytes: with the headers of UDP and IP it fits into an Ethernet frame.
const LONGEST: usize = 1400;
/// Length of the RTP header, bytes.
const HEADER: usize = 12;
/// NAL unit type of a fragment (RFC 6184, section 5.8).
const FU_A: u8 = 28;
/// Seconds from 1900, when the time of NTP begins, to 1970 (RFC 5905, figure 4).
const NTP_EPOCH: u64 = 2_208_988_800;

/// Makes the RTP packets of one stream for one receiver.
#[derive(Clone, Debug)]
pub struct Packetizer {
    source: u32,
    sequence: u16,
    /// Added to timestamps, so that they tell nothing about the clock (RFC 3550, section 5.1).
    offset: u32,
    /// What the clock of the timestamps is off by, ticks.
    off: i32,
    packets: u32,
    octets: u32,
}

impl Packetizer {
    /// A stream whose source number, first sequence number and timestamps follow from random bits.
    #[must_use]
    pub const fn new(random: u64) -> Self {
        let source = (random >> 32) as u32;
        Self { source, sequence: random as u16, offset: source.rotate_left(16) ^ random as u32, off: 0, packets: 0, octets: 0 }
    }

    /// Its source number (SSRC).
    #[must_use]
    pub const fn source(&self) -> u32 {
        self.source
    }

    /// Sequence number of the next packet.
    #[must_use]
    pub const fn next_sequence(&self) -> u16 {
        self.sequence
    }

    /// From now on the clock of the timestamps is off by this many ticks.
    pub const fn set_clock(&mut self, off: i32) {
        self.off = off;
    }

    /// The RTP time at a wall-clock time, given as the time since 1970.
    fn timestamp(&self, wall: Duration) -> u32 {
        let ticks = wall.as_nanos() * u128::from(CLOCK) / 1_000_000_000;
        // 32 bits, which wrap every 13 hours.
        (ticks as u32).wrapping_add(self.offset).wrapping_add_signed(self.off)
    }

    /// The packets of an access unit (NAL units with start codes) captured at `wall`, a time since 1970.
    #[must_use]
    pub fn packets(&mut self, wall: Duration, annex_b: &[u8]) -> Vec<Vec<u8>> {
        let timestamp = self.timestamp(wall);
        let mut packets = Vec::new();
        for unit in nal_units(annex_b) {
            match unit {
                [] => {}
                _ if HEADER + unit.len() <= LONGEST => packets.push(self.packet(timestamp, &[unit])),
                [header, rest @ ..] => {
                    let parts = rest.chunks(LONGEST - HEADER - 2);
                    let last = parts.len() - 1;
                    for (number, part) in parts.enumerate() {
                        let place = match number {
                            0 => 0x80,
                            _ if number == last => 0x40,
                            _ => 0,
                        };
                        packets.push(self.packet(timestamp, &[&[header & 0xe0 | FU_A, place | header & 0x1f], part]));
                    }
                }
            }
        }
        // The marker: the last packet of the image.
        if let Some(byte) = packets.last_mut().and_then(|packet| packet.get_mut(1)) {
            *byte |= 0x80;
        }
        packets
    }

    fn packet(&mut self, timestamp: u32, payload: &[&[u8]]) -> Vec<u8> {
        let mut packet = vec![0x80, PAYLOAD_TYPE];
        packet.extend(self.sequence.to_be_bytes());
        packet.extend(timestamp.to_be_bytes());
        packet.extend(self.source.to_be_bytes());
        payload.iter().for_each(|part| packet.extend(*part));
        self.sequence = self.sequence.wrapping_add(1);
        self.packets = self.packets.wrapping_add(1);
        self.octets = self.octets.wrapping_add((packet.len() - HEADER) as u32);
        packet
    }

    /// A sender report (RFC 3550, section 6.4.1) at `wall`, a time since 1970, with the description of the source that must
    /// follow it.
    #[must_use]
    pub fn sender_report(&self, wall: Duration) -> Vec<u8> {
        let seconds = (wall.as_secs() + NTP_EPOCH) as u32;
        let fraction = ((u64::from(wall.subsec_nanos()) << 32) / 1_000_000_000) as u32;
        let mut report = vec![0x80, 200, 0, 6];
        for word in [self.source, seconds, fraction, self.timestamp(wall), self.packets, self.octets] {
            report.extend(word.to_be_bytes());
        }
        // The canonical name (section 6.5.1), filled up with zeros, at least one.
        let name = b"spf";
        report.extend([0x81, 202, 0, 3]);
        report.extend(self.source.to_be_bytes());
        report.extend([1, name.len() as u8]);
        report.extend(name);
        report.extend([0; 3]);
        report
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn a_report_by_hand() {
        let mut packetizer = Packetizer::new(0x0102_0304_0000_fffe);
        // 2.5 s after 1970: 225000 ticks of the clock.
        let wall = Duration::from_millis(2500);
        drop(packetizer.packets(wall, &[0, 0, 0, 1, 0x65, 9, 9]));
        let report = packetizer.sender_report(wall);
        let word = |at: usize| u32::from_be_bytes(report[at..at + 4].try_into().unwrap());
        assert_eq!((&report[..4], word(4), report.len()), (&[0x80, 200, 0, 6][..], 0x0102_0304, 44));
        assert_eq!((word(8), word(12)), (2_208_988_802, 0x8000_0000));
        assert_eq!(word(16), 225_000_u32.wrapping_add(packetizer.offset));
        assert_eq!((word(20), word(24)), (1, 3));
    }

    #[test]
    fn sequence_numbers_wrap_and_the_last_packet_is_marked() {
        let mut packetizer = Packetizer::new(0xffff);
        let unit = [&[0, 0, 0, 1, 0x67, 1][..], &[0, 0, 0, 1, 0x65], &[7; 3000]].concat();
        let packets = packetizer.packets(Duration::from_secs(1), &unit);
        let heads: Vec<_> = packets.iter().map(|packet| (packet[1], u16::from_be_bytes([packet[2], packet[3]]))).collect();
        assert_eq!(heads, [(96, 0xffff), (96, 0), (96, 1), (96 | 0x80, 2)]);
        assert_eq!(packets[1][12..14], [0x7c, 0x85]);
        assert_eq!(packets[3][12..14], [0x7c, 0x45]);
    }

    proptest! {
        /// A receiver written apart from this joins the packets to the same NAL units.
        #[test]
        fn what_is_sent_is_received(sizes in proptest::collection::vec(1_usize..6000, 1..5), random in any::<u64>(), millis in 0_u64..100_000) {
            let mut unit = vec![0, 0, 0, 1, 0x67, 1, 2, 3, 0, 0, 0, 1, 0x68, 1];
            for (number, size) in sizes.iter().enumerate() {
                unit.extend([0, 0, 0, 1, 0x65]);
                unit.extend(std::iter::repeat_n(number as u8 + 3, *size));
            }
            let mut packetizer = Packetizer::new(random);
            let mut receiver = spf_camera::rtp::Receiver::default();
            let mut units = Vec::new();
            let packets = packetizer.packets(Duration::from_millis(millis), &unit);
            for packet in &packets {
                prop_assert!(packet.len() <= LONGEST);
                receiver.push(spf_core::time::Time::ZERO, packet, &mut units);
            }
            prop_assert_eq!(units.len(), 1);
            let sent: Vec<&[u8]> = nal_units(&unit).collect();
            let received: Vec<&[u8]> = nal_units(&units[0].unit.annex_b).collect();
            prop_assert_eq!(received, sent);
            prop_assert!(units[0].unit.key);
        }
    }
}

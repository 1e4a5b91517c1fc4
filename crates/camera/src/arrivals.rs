//! What the packets that arrive at a port seem to be. No I/O.
//!
//! A camera that sends something else than the address says gives no image, and looks like one that sends nothing.

use crate::rtp::Packet;

/// Packets after which what is received is judged.
const ENOUGH: u64 = 30;
/// Payload types that are remembered.
const MOST_TYPES: usize = 4;
/// Length of the packets of a transport stream, and their first byte (ISO/IEC 13818-1, 2.4.3.2).
const TS_LENGTH: usize = 188;
const TS_SYNC: u8 = 0x47;
/// First bytes of packets, as far apart as these are long, that show a transport stream cut anywhere.
const FEWEST_SYNCS: usize = 3;

/// What a packet seems to be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// RTP, of a payload type that may be H.264.
    Rtp,
    /// RTP with MPEG-TS.
    RtpTs,
    /// RTP with JPEG images (RFC 2435).
    RtpJpeg,
    /// RTP with audio.
    RtpAudio,
    /// RTCP, the reports that go with RTP.
    Rtcp,
    /// MPEG-TS.
    Ts,
    /// H.264 or H.265 with start codes, in no container.
    Bare,
    /// A JPEG image.
    Jpeg,
    /// Text, such as a Tello's state.
    Text,
    /// Anything else.
    Unknown,
}

/// Whether it is a piece of a transport stream that begins anywhere in a packet, as with datagrams whose length is no multiple of theirs.
fn is_cut_ts(bytes: &[u8]) -> bool {
    let shows = |from: usize| {
        let mut firsts = bytes.iter().skip(from).step_by(TS_LENGTH);
        firsts.len() >= FEWEST_SYNCS && firsts.all(|byte| *byte == TS_SYNC)
    };
    (1..TS_LENGTH).any(shows)
}

const KINDS: [Kind; 10] = [
    Kind::Rtp,
    Kind::RtpTs,
    Kind::RtpJpeg,
    Kind::RtpAudio,
    Kind::Rtcp,
    Kind::Ts,
    Kind::Bare,
    Kind::Jpeg,
    Kind::Text,
    Kind::Unknown,
];

impl Kind {
    /// That of a packet.
    #[must_use]
    pub fn of(bytes: &[u8]) -> Self {
        let is_ts = |bytes: &[u8]| bytes.len() >= TS_LENGTH && bytes.chunks_exact(TS_LENGTH).all(|packet| packet[0] == TS_SYNC);
        if is_ts(bytes) {
            return Self::Ts;
        }
        let rtp = Packet::parse(bytes);
        if rtp.as_ref().is_some_and(|packet| is_ts(&packet.payload)) {
            return Self::RtpTs;
        }
        if is_cut_ts(bytes) {
            return Self::Ts;
        }
        if bytes.starts_with(&[0, 0, 0, 1]) || bytes.starts_with(&[0, 0, 1]) {
            return Self::Bare;
        }
        if bytes.starts_with(&[0xff, 0xd8, 0xff]) {
            return Self::Jpeg;
        }
        if let Some(packet) = rtp {
            // RFC 3551, tables 4 and 5.
            return match packet.payload_type {
                26 => Self::RtpJpeg,
                0..=23 => Self::RtpAudio,
                _ => Self::Rtp,
            };
        }
        match bytes {
            [first, 200..=207, ..] if first >> 6 == 2 => Self::Rtcp,
            _ if !bytes.is_empty() && bytes.iter().all(|byte| byte.is_ascii_graphic() || byte.is_ascii_whitespace()) => {
                Self::Text
            }
            _ => Self::Unknown,
        }
    }

    /// In words, with what shows it.
    #[must_use]
    pub const fn words(self) -> &'static str {
        match self {
            Self::Rtp => "RTP",
            Self::RtpTs => "MPEG-TS in RTP",
            Self::RtpJpeg => "RTP with JPEG images (payload type 26)",
            Self::RtpAudio => "RTP with audio",
            Self::Rtcp => "RTCP, the reports that go with RTP",
            Self::Ts => "MPEG-TS (each packet begins with 0x47)",
            Self::Bare => "a bare stream of H.264 or H.265 (they begin with a start code)",
            Self::Jpeg => "JPEG images",
            Self::Text => "text",
            Self::Unknown => "neither RTP nor MPEG-TS",
        }
    }
}

/// Counts packets by what they seem to be.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Arrivals {
    counts: [u64; KINDS.len()],
    /// Payload types of RTP, in the order in which they came.
    types: Vec<u8>,
}

impl Arrivals {
    /// Counts a packet.
    pub fn push(&mut self, packet: &[u8]) {
        let kind = Kind::of(packet);
        if let Some(count) = KINDS.iter().position(|known| *known == kind).and_then(|at| self.counts.get_mut(at)) {
            *count += 1;
        }
        if matches!(kind, Kind::Rtp | Kind::RtpTs | Kind::RtpJpeg | Kind::RtpAudio)
            && let Some(second) = packet.get(1)
            && self.types.len() < MOST_TYPES
            && !self.types.contains(&(second & 0x7f))
        {
            self.types.push(second & 0x7f);
        }
    }

    /// Number of packets.
    #[must_use]
    pub fn packets(&self) -> u64 {
        self.counts.iter().sum()
    }

    /// What most of the packets seem to be; `None` without packets.
    #[must_use]
    pub fn seem(&self) -> Option<Kind> {
        let most = *self.counts.iter().max()?;
        let at = self.counts.iter().position(|count| *count == most && most > 0)?;
        KINDS.get(at).copied()
    }

    /// Whether there are enough of them to judge, and most are what was expected.
    #[must_use]
    pub fn are(&self, expected: Kind) -> bool {
        self.packets() >= ENOUGH && self.seem() == Some(expected)
    }

    /// What they seem to be, if most of enough packets are not what was expected.
    #[must_use]
    pub fn other_than(&self, expected: Kind) -> Option<Kind> {
        self.seem().filter(|kind| *kind != expected && self.packets() >= ENOUGH)
    }

    /// Payload types of RTP, such as `96, 97`.
    #[must_use]
    pub fn payload_types(&self) -> String {
        let mut types = self.types.clone();
        types.sort_unstable();
        types.iter().map(u8::to_string).collect::<Vec<_>>().join(", ")
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::rtp::testing::packets;
    use crate::testing::units;

    fn rtp(payload_type: u8, payload: &[u8]) -> Vec<u8> {
        [&[0x80, payload_type, 0, 1, 0, 0, 0, 2, 0, 0, 0, 3], payload].concat()
    }

    #[test]
    fn packets_are_told_apart() {
        let mut ts = vec![0; 7 * TS_LENGTH];
        (0..7).for_each(|n| ts[n * TS_LENGTH] = TS_SYNC);
        for (packet, kind) in [
            (packets(&units(64, 48, 1, 1.0), 0, 400)[0][0].bytes(), Kind::Rtp),
            (rtp(33, &ts), Kind::RtpTs),
            (rtp(26, &[0; 40]), Kind::RtpJpeg),
            (rtp(0, &[0; 160]), Kind::RtpAudio),
            (vec![0x80, 200, 0, 6, 0, 0, 0, 1], Kind::Rtcp),
            (units(64, 48, 1, 1.0)[0].annex_b.clone(), Kind::Bare),
            (vec![0xff, 0xd8, 0xff, 0xe0, 0], Kind::Jpeg),
            (b"pitch:0;roll:0;yaw:0;\r\n".to_vec(), Kind::Text),
            (vec![0xfd, 9, 0, 0, 1, 1, 1, 0, 0, 0], Kind::Unknown),
            (ts[..TS_LENGTH + 10].to_vec(), Kind::Ts),
            (ts[100..].to_vec(), Kind::Ts),
            (rtp(33, &ts[100..])[12..].to_vec(), Kind::Ts),
            (ts, Kind::Ts),
            (vec![7; 1472], Kind::Unknown),
            (Vec::new(), Kind::Unknown),
        ] {
            assert_eq!(Kind::of(&packet), kind, "{:x?}", &packet[..packet.len().min(20)]);
        }
    }

    #[test]
    fn the_majority_of_enough_packets_counts() {
        let mut arrivals = Arrivals::default();
        assert_eq!((arrivals.packets(), arrivals.seem()), (0, None));
        (0..20).for_each(|_| arrivals.push(&rtp(97, &[0x41; 20])));
        assert_eq!((arrivals.seem(), arrivals.other_than(Kind::Ts)), (Some(Kind::Rtp), None));
        (0..20).for_each(|_| arrivals.push(&rtp(96, &[0x41; 20])));
        (0..9).for_each(|_| arrivals.push(b"text"));
        assert_eq!(
            (arrivals.packets(), arrivals.other_than(Kind::Ts), arrivals.other_than(Kind::Rtp)),
            (49, Some(Kind::Rtp), None)
        );
        assert_eq!(arrivals.payload_types(), "96, 97");
    }

    proptest! {
        #[test]
        fn no_bytes_panic(bytes in proptest::collection::vec(any::<u8>(), 0..400)) {
            let mut arrivals = Arrivals::default();
            arrivals.push(&bytes);
            prop_assert_eq!(arrivals.packets(), 1);
            prop_assert!(arrivals.seem().is_some());
        }
    }
}

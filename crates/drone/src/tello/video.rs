//! Reassembles the video: its datagrams have no header or number, so only lengths and start codes mark the end of a NAL
//! unit.

use spf_media::h264::{AccessUnit, NalKind};

use crate::frames::VideoStats;

/// A datagram of this length is followed by more of its NAL unit, unless the unit ends with it.
const FULL: usize = 1460;
const START: [u8; 4] = [0, 0, 0, 1];
/// Maximum length of a NAL unit; real ones have about 35 kB, so a longer one is damaged.
const LONGEST: usize = 1 << 20;

/// Reassembles access units from datagrams.
#[derive(Clone, Debug, Default)]
pub struct Joiner {
    nal: Vec<u8>,
    /// Parameter sets and similar units that precede the next image.
    head: Vec<u8>,
    /// Bits of `frame_num`, from the sequence parameter set.
    number_bits: Option<u32>,
    last_number: Option<u32>,
    /// Whether decoding can continue: nothing was lost since the last key frame.
    whole: bool,
    tally: VideoStats,
}

impl Joiner {
    /// Losses so far.
    #[must_use]
    pub fn tally(&self) -> VideoStats {
        self.tally
    }

    /// Adds a datagram; access units that it completes are appended to `units`. A unit that follows a loss is dropped,
    /// and so are all after it up to the next key frame, since they cannot be decoded correctly.
    pub fn push(&mut self, datagram: &[u8], units: &mut Vec<AccessUnit>) {
        // The current unit did not end in a shorter datagram, so its end is lost. A complete unit whose length is a
        // multiple of a datagram's looks the same (one in 1460); it is dropped too, since a truncated image must not
        // pass for complete.
        if datagram.starts_with(&START) && !self.nal.is_empty() {
            self.nal.clear();
            self.tally.damaged += 1;
            self.lost();
        }
        if self.nal.len() + datagram.len() > LONGEST {
            self.nal.clear();
            self.tally.damaged += 1;
            return;
        }
        self.nal.extend_from_slice(datagram);
        if datagram.len() < FULL {
            self.end_nal(units);
        }
    }

    /// Whether nothing can be decoded until the next key frame, because of a loss.
    #[must_use]
    pub fn awaits_key(&self) -> bool {
        !self.whole
    }

    /// Reports that a unit could not be decoded: its successors up to the next key frame cannot be either.
    pub fn refuse(&mut self) {
        self.lost();
    }

    fn end_nal(&mut self, units: &mut Vec<AccessUnit>) {
        if self.nal.is_empty() {
            return;
        }
        let nal = std::mem::take(&mut self.nal);
        // The remainder of a unit whose start was lost has no start code.
        let Some(payload) = nal.strip_prefix(&START) else {
            self.tally.damaged += 1;
            self.lost();
            return;
        };
        match NalKind::of(payload) {
            Some(NalKind::Sps) => {
                self.number_bits = number_bits(payload);
                // A new sequence: earlier parameter sets do not apply to it.
                self.head = nal;
            }
            Some(NalKind::Pps | NalKind::Other(6..=9)) => {
                if self.head.len() + nal.len() <= LONGEST {
                    self.head.extend_from_slice(&nal);
                }
            }
            Some(NalKind::IdrSlice) => {
                self.whole = !self.head.is_empty();
                self.last_number = Some(0);
                self.end_unit(&nal, true, units);
            }
            Some(NalKind::Slice) => {
                self.count(payload);
                self.end_unit(&nal, false, units);
            }
            _ => self.tally.damaged += 1,
        }
    }

    /// Checks the frame number: an image refers to its predecessor, so a missing number is a lost image.
    fn count(&mut self, slice: &[u8]) {
        let Some(bits) = self.number_bits else { return self.lost() };
        let number = frame_number(slice, bits);
        let expected = self.last_number.map(|last| (last + 1) & ((1 << bits) - 1));
        if number.is_none() || number != expected {
            self.lost();
        }
        self.last_number = number;
    }

    fn lost(&mut self) {
        self.tally.gaps += u64::from(self.whole);
        self.whole = false;
    }

    fn end_unit(&mut self, slice: &[u8], key: bool, units: &mut Vec<AccessUnit>) {
        let mut annex_b = std::mem::take(&mut self.head);
        if !self.whole {
            self.tally.skipped += 1;
            return;
        }
        annex_b.extend_from_slice(slice);
        self.tally.units += 1;
        units.push(AccessUnit { key, annex_b });
    }
}

/// Bits of a NAL unit's payload, without emulation prevention bytes.
struct Bits<'a> {
    bytes: &'a [u8],
    at: usize,
    zeros: u32,
    byte: u8,
    left: u32,
}

impl<'a> Bits<'a> {
    /// Reads a NAL unit without start code; its first byte is skipped.
    fn of(nal: &'a [u8]) -> Self {
        Self { bytes: nal, at: 1, zeros: 0, byte: 0, left: 0 }
    }

    fn bit(&mut self) -> Option<u32> {
        if self.left == 0 {
            let mut byte = *self.bytes.get(self.at)?;
            self.at += 1;
            if self.zeros >= 2 && byte == 3 {
                byte = *self.bytes.get(self.at)?;
                self.at += 1;
                self.zeros = 0;
            }
            self.zeros = if byte == 0 { self.zeros + 1 } else { 0 };
            (self.byte, self.left) = (byte, 8);
        }
        self.left -= 1;
        Some(u32::from(self.byte >> self.left) & 1)
    }

    fn bits(&mut self, count: u32) -> Option<u32> {
        let mut value = 0;
        for _ in 0..count {
            value = value << 1 | self.bit()?;
        }
        Some(value)
    }

    /// An Exp-Golomb number (ITU-T H.264, 9.1).
    fn number(&mut self) -> Option<u32> {
        let mut zeros = 0;
        while self.bit()? == 0 {
            zeros += 1;
            if zeros > 20 {
                return None;
            }
        }
        Some((1 << zeros) - 1 + self.bits(zeros)?)
    }
}

/// `log2_max_frame_num` of a sequence parameter set (ITU-T H.264, 7.3.2.1.1).
fn number_bits(sps: &[u8]) -> Option<u32> {
    let mut bits = Bits::of(sps);
    let profile = bits.bits(8)?;
    bits.bits(16)?;
    bits.number()?;
    if matches!(profile, 100 | 110 | 122 | 244 | 44 | 83 | 86 | 118 | 128) {
        if bits.number()? == 3 {
            bits.bit()?;
        }
        bits.number()?;
        bits.number()?;
        bits.bit()?;
        // Scaling matrices: not used by any drone, and long to parse.
        if bits.bit()? == 1 {
            return None;
        }
    }
    bits.number().map(|log| log + 4).filter(|bits| *bits <= 16)
}

/// `frame_num` of a slice (ITU-T H.264, 7.3.3).
fn frame_number(slice: &[u8], number_bits: u32) -> Option<u32> {
    let mut bits = Bits::of(slice);
    bits.number()?;
    bits.number()?;
    bits.number()?;
    bits.bits(number_bits)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use spf_core::time::Time;
    use spf_media::Rgb;
    use spf_media::h264::{Decoder, Encoder, EncoderSettings, nal_units};

    use super::*;

    /// Datagrams of several noise images, split as a Tello splits them.
    fn stream(frames: u32) -> Vec<Vec<Vec<u8>>> {
        let settings = EncoderSettings { key_interval: 1.0, quantiser: 20, ..EncoderSettings::for_size(192, 144, 10.0) };
        let mut encoder = Encoder::new(settings).unwrap();
        let image = |frame: u32| {
            let mut image = Rgb::new(192, 144);
            for (index, byte) in image.data_mut().iter_mut().enumerate() {
                *byte = (index as u32 / 5 * (7 + frame)) as u8;
            }
            image
        };
        let cut = |unit: &[u8]| -> Vec<Vec<u8>> {
            nal_units(unit)
                .flat_map(|nal| {
                    let mut bytes = START.to_vec();
                    bytes.extend_from_slice(nal);
                    if bytes.len().is_multiple_of(FULL) {
                        bytes.push(0);
                    }
                    bytes.chunks(FULL).map(<[u8]>::to_vec).collect::<Vec<_>>()
                })
                .collect()
        };
        (0..frames)
            .map(|frame| cut(&encoder.encode(Time::from_millis(100 * u64::from(frame)), &image(frame)).unwrap().annex_b))
            .collect()
    }

    fn join(joiner: &mut Joiner, datagrams: &[Vec<u8>]) -> Vec<AccessUnit> {
        let mut units = Vec::new();
        datagrams.iter().for_each(|datagram| joiner.push(datagram, &mut units));
        units
    }

    #[test]
    fn whole_images_come_out_at_once_and_decode() {
        let stream = stream(25);
        assert!(stream.iter().any(|datagrams| datagrams.len() > 4));
        let (mut joiner, mut decoder) = (Joiner::default(), Decoder::new().unwrap());
        for datagrams in &stream {
            let units = join(&mut joiner, datagrams);
            assert_eq!(units.len(), 1);
            assert_eq!(units[0].key, datagrams.len() > 2 && datagrams[0].get(4) == Some(&0x67));
            assert!(decoder.decode(&units[0].annex_b).unwrap().is_some());
        }
        assert_eq!(joiner.tally(), VideoStats { units: 25, ..VideoStats::default() });
    }

    #[test]
    fn one_lost_datagram_costs_the_rest_of_the_group() {
        let stream = stream(25);
        for lost in 0..stream[4].len() {
            let mut damaged = stream.clone();
            damaged[4].remove(lost);
            let (mut joiner, mut decoder) = (Joiner::default(), Decoder::new().unwrap());
            let mut came = Vec::new();
            for (frame, datagrams) in damaged.iter().enumerate() {
                for unit in join(&mut joiner, datagrams) {
                    came.push(frame);
                    if decoder.decode(&unit.annex_b).is_err() {
                        assert!((4..6).contains(&frame), "{frame}");
                        joiner.refuse();
                    }
                }
            }
            // A loss inside a unit shows when it, or the unit after it, is decoded.
            let expected: Vec<usize> = (0..4).chain(10..25).collect();
            came.retain(|frame| !(4..6).contains(frame));
            assert_eq!(came, expected, "datagram {lost} of {}", stream[4].len());
            assert_eq!(joiner.tally().gaps, 1);
        }
    }

    /// The sequence parameter set of a real Tello, as found in several projects.
    #[test]
    fn a_real_tello_s_numbers_have_eight_bits() {
        assert_eq!(number_bits(&[0x67, 0x4d, 0x40, 0x28, 0x95, 0xa0, 0x3c, 0x05, 0xb9]), Some(8));
    }

    #[test]
    fn a_stream_that_is_joined_in_the_middle_begins_with_its_next_key_frame() {
        let stream = stream(25);
        let mut joiner = Joiner::default();
        let came: Vec<usize> = (3..25).filter(|frame| !join(&mut joiner, &stream[*frame]).is_empty()).collect();
        assert_eq!(came, (10..25).collect::<Vec<_>>());
    }

    proptest! {
        #[test]
        fn no_datagrams_panic_or_pile_up(datagrams in proptest::collection::vec(
            (proptest::collection::vec(any::<u8>(), 0..40), 0_usize..1500, any::<bool>()), 0..60)) {
            let mut joiner = Joiner::default();
            let mut units = Vec::new();
            for (bytes, length, start) in datagrams {
                let mut datagram = if start { START.to_vec() } else { Vec::new() };
                datagram.extend(bytes.iter().cycle().take(if bytes.is_empty() { 0 } else { length }));
                joiner.push(&datagram, &mut units);
                prop_assert!(joiner.nal.len() <= LONGEST && joiner.head.len() <= LONGEST);
            }
        }
    }
}

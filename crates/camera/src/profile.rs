//! Whether an H.264 stream can be decoded, by its sequence parameter set (ITU-T H.264, 7.3.2.1.1). No I/O.
//!
//! The decoder only says that it failed, as it does for damaged data; a camera or an encoder that is set to another profile never
//! becomes decodable by itself, so that this is told apart.

use spf_media::h264::{NalKind, nal_units};

/// Profiles that the decoder (OpenH264) knows: Baseline, Main, Scalable Baseline, Scalable High, Extended, High.
const KNOWN: [u32; 6] = [66, 77, 83, 86, 88, 100];
/// Profiles whose sets tell about colours and depth.
const DETAILED: [u32; 13] = [44, 83, 86, 100, 110, 118, 122, 128, 134, 135, 138, 139, 244];
/// Bits per sample beyond 8 (7.4.2.1.1).
const MOST_MORE_BITS: u32 = 6;
/// Where the kind of a slice ends at the latest, bytes from its start: two codes of at most 63 bits.
const HEAD: usize = 24;
/// What a set contains at most before what is read here, bytes.
const LONGEST: usize = 512;

/// Why a stream with these NAL units (annex B) cannot be decoded, such as `profile High 4:2:2 (122)`. `None` if it can, as far as its
/// sequence parameter sets tell, or if it has none.
#[must_use]
pub fn why_undecodable(annex_b: &[u8]) -> Option<String> {
    nal_units(annex_b).filter(|nal| NalKind::of(nal) == Some(NalKind::Sps)).find_map(of_set)
}

/// The same for one set. One that ends too early is not judged.
fn of_set(nal: &[u8]) -> Option<String> {
    let profile = u32::from(*nal.get(1)?);
    if !KNOWN.contains(&profile) {
        return Some(format!("profile {} ({profile})", name(profile)));
    }
    let mut bits = Bits::of(nal.get(4..)?);
    bits.number()?;
    if DETAILED.contains(&profile) {
        let chroma = bits.number()?;
        if chroma > 1 {
            return Some(format!("with the colours {}", if chroma == 2 { "4:2:2" } else { "4:4:4" }));
        }
        match bits.number()?.max(bits.number()?) {
            0 => {}
            more @ 1..=MOST_MORE_BITS => return Some(format!("with {} bits per sample", 8 + more)),
            // No encoder writes this: the set is damaged.
            _ => return None,
        }
        bits.bit()?;
        if bits.bit()? == 1 {
            for list in 0..8 {
                if bits.bit()? == 1 {
                    skip_scaling_list(&mut bits, if list < 6 { 16 } else { 64 })?;
                }
            }
        }
    }
    bits.number()?;
    match bits.number()? {
        0 => _ = bits.number()?,
        1 => {
            bits.bit()?;
            bits.number()?;
            bits.number()?;
            for _ in 0..bits.number()?.min(255) {
                bits.number()?;
            }
        }
        _ => {}
    }
    bits.number()?;
    bits.bit()?;
    bits.number()?;
    bits.number()?;
    let whole_frames = bits.bit()? == 1;
    (!whole_frames).then(|| "interlaced".to_owned())
}

/// Whether a picture with these NAL units (annex B) has a slice of bidirectional prediction (7.3.3, table 7-6): a B-frame, which is
/// sent after a picture that was captured later.
#[must_use]
pub fn has_b_slice(annex_b: &[u8]) -> bool {
    nal_units(annex_b).filter(|nal| NalKind::of(nal) == Some(NalKind::Slice)).any(|nal| {
        let kind = nal.get(1..HEAD.min(nal.len())).and_then(|head| {
            let mut bits = Bits::of(head);
            bits.number()?;
            bits.number()
        });
        matches!(kind, Some(1 | 6))
    })
}

fn name(profile: u32) -> &'static str {
    match profile {
        44 => "CAVLC 4:4:4 Intra",
        110 => "High 10",
        118 => "Multiview High",
        122 => "High 4:2:2",
        128 => "Stereo High",
        244 => "High 4:4:4 Predictive",
        _ => "unknown",
    }
}

/// 7.3.2.1.1.1. A difference is coded like a number, with its sign as the last bit.
fn skip_scaling_list(bits: &mut Bits, length: u32) -> Option<()> {
    let (mut last, mut next) = (8_i64, 8_i64);
    for _ in 0..length {
        if next != 0 {
            let coded = i64::from(bits.number()?);
            let difference = if coded % 2 == 1 { coded / 2 + 1 } else { -(coded / 2) };
            next = (last + difference).rem_euclid(256);
        }
        last = if next == 0 { last } else { next };
    }
    Some(())
}

/// Bits of a NAL unit without the bytes that prevent start codes.
struct Bits {
    bytes: Vec<u8>,
    at: usize,
}

impl Bits {
    fn of(nal: &[u8]) -> Self {
        let mut bytes = Vec::with_capacity(nal.len().min(LONGEST));
        let mut zeros = 0;
        for &byte in nal.iter().take(LONGEST) {
            if zeros >= 2 && byte == 3 {
                zeros = 0;
                continue;
            }
            zeros = if byte == 0 { zeros + 1 } else { 0 };
            bytes.push(byte);
        }
        Self { bytes, at: 0 }
    }

    fn bit(&mut self) -> Option<u32> {
        let byte = *self.bytes.get(self.at / 8)?;
        let bit = byte >> (7 - self.at % 8) & 1;
        self.at += 1;
        Some(u32::from(bit))
    }

    /// An unsigned Exp-Golomb code (9.1), of at most 31 bits behind its zeros.
    fn number(&mut self) -> Option<u32> {
        let mut zeros = 0;
        while self.bit()? == 0 {
            zeros += 1;
            if zeros > 31 {
                return None;
            }
        }
        let mut value = 1_u64;
        for _ in 0..zeros {
            value = value << 1 | u64::from(self.bit()?);
        }
        u32::try_from(value - 1).ok()
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::testing::units;

    fn of(nal: &[u8]) -> Option<String> {
        why_undecodable(&[&[0, 0, 0, 1], nal].concat())
    }

    #[test]
    fn what_is_decoded_here_is_decodable() {
        assert_eq!(why_undecodable(&units(64, 48, 1, 1.0)[0].annex_b), None);
        assert_eq!(why_undecodable(&[0, 0, 0, 1, 0x65, 1, 2]), None);
        // Cut off: it is left to the decoder.
        assert_eq!(of(&[0x67, 100, 0, 31]), None);
    }

    /// Sets of x264, as ffmpeg writes them for these formats.
    #[test]
    fn other_profiles_colours_depths_and_fields_are_named() {
        for (set, expected) in [
            (&[0x67, 244, 0, 13, 0x91, 0x9b, 0x28][..], "profile High 4:4:4 Predictive (244)"),
            (&[0x67, 122, 0, 13], "profile High 4:2:2 (122)"),
            (&[0x67, 110, 0, 13], "profile High 10 (110)"),
            (&[0x67, 1, 0, 13], "profile unknown (1)"),
            // High: set 0 (1), colours 2 (011).
            (&[0x67, 100, 0, 13, 0b1011_0000, 0], "with the colours 4:2:2"),
            // Set 0 (1), colours 1 (010), depths 8 (1) and 10 (011).
            (&[0x67, 100, 0, 13, 0b1010_1011, 0], "with 10 bits per sample"),
            // Main: set 0 (1), numbers of 4 bits (1), order 2 (011), 1 reference (010), no gaps (0), 20×15 units, fields (0).
            (&[0x67, 77, 0, 13, 0b1101_1010, 0b0000_0101, 0b0000_0111, 0b1000_0000], "interlaced"),
        ] {
            assert_eq!(of(set).as_deref(), Some(expected), "{set:x?}");
        }
    }

    #[test]
    fn a_depth_that_cannot_be_is_left_to_the_decoder() {
        // Set 0 (1), colours 1 (010), depths of 2³² - 2 (31 zeros and 32 ones) and 0 (1).
        assert_eq!(of(&[0x67, 100, 0, 13, 0b1010_0000, 0, 0, 3, 0, 0b0001_1111, 0xff, 0xff, 0xff, 0xf0, 0x80]), None);
        // Of 14 and of 15 bits: 6 more (00111) and 7 more (0001000), and 0 (1).
        assert_eq!(of(&[0x67, 100, 0, 13, 0b1010_0011, 0b1100_0000]).as_deref(), Some("with 14 bits per sample"));
        assert_eq!(of(&[0x67, 100, 0, 13, 0b1010_0001, 0b0001_0000]), None);
    }

    #[test]
    fn b_slices_are_told_from_others() {
        // First unit 0 (1), kinds 0 (P: 1), 1 (B: 010), 2 (I: 011), 5 (P: 00110), 6 (B: 00111).
        for (head, expected) in
            [(0b1100_0000, false), (0b1010_0000, true), (0b1011_0000, false), (0b1001_1000, false), (0b1001_1100, true)]
        {
            assert_eq!(has_b_slice(&[0, 0, 0, 1, 0x41, head, 0x80]), expected, "{head:b}");
        }
        // Nor is the same in a key frame, in a parameter set, or cut off.
        for nal in [&[0x65, 0b1010_0000][..], &[0x67, 0b1010_0000], &[0x41], &[0x41, 0]] {
            assert!(!has_b_slice(&[&[0, 0, 0, 1], nal].concat()), "{nal:x?}");
        }
        assert!(!units(64, 48, 6, 1.0).iter().any(|unit| has_b_slice(&unit.annex_b)));
    }

    proptest! {
        #[test]
        fn no_bytes_panic(profile in prop::sample::select(vec![66_u8, 77, 83, 100, 244]), bytes in proptest::collection::vec(any::<u8>(), 0..80)) {
            of(&[&[0x67, profile, 0, 31], &bytes[..]].concat());
            _ = has_b_slice(&[&[0, 0, 0, 1, 0x41], &bytes[..]].concat());
        }
    }
}

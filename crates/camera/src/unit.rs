//! Access units of an H.264 stream from its NAL units, without those that a loss made undecodable.

use spf_drone::frames::VideoStats;
use spf_media::h264::{AccessUnit, NalKind};

const START: [u8; 4] = [0, 0, 0, 1];
/// Maximum length of an access unit, bytes. A key frame of 4K video at high quality has about 2 MB.
pub const LONGEST_UNIT: usize = 8 << 20;
/// Maximum length of a parameter set, bytes; real ones have less than 100.
const LONGEST_PARAMETERS: usize = 4096;
/// Maximum number of picture parameter sets that are kept.
const MOST_PICTURE_SETS: usize = 16;

/// Collects NAL units to access units.
///
/// Parameter sets are kept, and precede each key frame, so that a decoder can start at any of them. After a loss, units
/// are dropped until the next key frame, since a decoder would show them with errors.
#[derive(Clone, Debug, Default)]
pub struct UnitBuilder {
    sequence_set: Vec<u8>,
    picture_sets: Vec<Vec<u8>>,
    /// Whether the parameter sets changed since the last unit.
    changed: bool,
    /// The unit so far, with start codes and without parameter sets.
    open: Vec<u8>,
    key: bool,
    has_slice: bool,
    /// Whether a part of the open unit is missing.
    broken: bool,
    /// Whether decoding can continue: nothing was lost since the last key frame.
    whole: bool,
    tally: VideoStats,
}

impl UnitBuilder {
    /// Losses so far.
    #[must_use]
    pub fn tally(&self) -> VideoStats {
        self.tally
    }

    /// Whether nothing can be decoded until the next key frame.
    #[must_use]
    pub fn awaits_key(&self) -> bool {
        !self.whole
    }

    /// Whether a decoder could be set up: parameter sets have come.
    #[must_use]
    pub fn has_parameters(&self) -> bool {
        !self.sequence_set.is_empty() && !self.picture_sets.is_empty()
    }

    /// Adds a NAL unit without start code.
    pub fn nal(&mut self, nal: &[u8]) {
        match NalKind::of(nal) {
            Some(NalKind::Sps) if nal.len() <= LONGEST_PARAMETERS => {
                if self.sequence_set != nal {
                    self.sequence_set = nal.to_vec();
                    self.picture_sets.clear();
                    self.changed = true;
                }
            }
            Some(NalKind::Pps) if nal.len() <= LONGEST_PARAMETERS => self.picture_set(nal),
            Some(NalKind::Slice | NalKind::IdrSlice | NalKind::Other(2..=4 | 6 | 19 | 20)) => {
                if self.open.len() + nal.len() > LONGEST_UNIT {
                    self.tally.damaged += 1;
                    return self.lost();
                }
                let kind = NalKind::of(nal);
                // The first bit of `first_mb_in_slice` is 1 when that is 0: a picture begins here, so what was lost belongs
                // to an earlier one.
                if kind != Some(NalKind::Other(6)) && nal.get(1).is_some_and(|byte| byte & 0x80 != 0) {
                    self.broken = false;
                }
                self.key |= kind == Some(NalKind::IdrSlice);
                self.has_slice |= kind != Some(NalKind::Other(6));
                self.open.extend_from_slice(&START);
                self.open.extend_from_slice(nal);
            }
            // Delimiters, ends of sequences and filler data do not matter to the decoder.
            Some(NalKind::Other(9..=12)) => {}
            _ => self.tally.damaged += 1,
        }
    }

    fn picture_set(&mut self, nal: &[u8]) {
        // The newest of several with the same number is the last that the decoder reads.
        if self.picture_sets.last().is_some_and(|last| last == nal) {
            return;
        }
        let before = self.picture_sets.len();
        self.picture_sets.retain(|set| set != nal);
        self.changed |= self.picture_sets.len() == before;
        if self.picture_sets.len() >= MOST_PICTURE_SETS {
            self.picture_sets.remove(0);
        }
        self.picture_sets.push(nal.to_vec());
    }

    /// Reports that something is missing here: the open unit is incomplete.
    pub fn lost(&mut self) {
        self.broken = true;
        self.open.clear();
        (self.key, self.has_slice) = (false, false);
        self.tally.gaps += u64::from(self.whole);
        self.whole = false;
    }

    /// Ends the open unit, and returns it if it can be decoded.
    pub fn end(&mut self) -> Option<AccessUnit> {
        let open = std::mem::take(&mut self.open);
        let (key, broken) = (std::mem::take(&mut self.key), std::mem::take(&mut self.broken));
        // Without a slice it is no picture; after a loss it counts as one.
        if !std::mem::take(&mut self.has_slice) && !broken {
            return None;
        }
        if key && !broken && self.has_parameters() {
            self.whole = true;
        }
        if !self.whole || broken {
            self.tally.skipped += 1;
            return None;
        }
        let mut annex_b = Vec::with_capacity(open.len() + 256);
        if key || self.changed {
            for set in std::iter::once(&self.sequence_set).chain(&self.picture_sets) {
                annex_b.extend_from_slice(&START);
                annex_b.extend_from_slice(set);
            }
            self.changed = false;
        }
        annex_b.extend_from_slice(&open);
        self.tally.units += 1;
        Some(AccessUnit { key, annex_b })
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use spf_media::h264::nal_units;

    use super::*;
    use crate::testing::units;

    #[test]
    fn units_come_back_and_start_with_a_key_frame() {
        let stream = units(64, 48, 12, 0.5);
        let mut builder = UnitBuilder::default();
        let mut came = Vec::new();
        for (number, unit) in stream.iter().enumerate().skip(2) {
            nal_units(&unit.annex_b).for_each(|nal| builder.nal(nal));
            if let Some(unit) = builder.end() {
                came.push((number, unit));
            }
        }
        assert_eq!(came.iter().map(|(number, _)| *number).collect::<Vec<_>>(), (5..12).collect::<Vec<_>>());
        for (number, unit) in came {
            assert_eq!(unit.key, number % 5 == 0);
            let same: Vec<_> = nal_units(&unit.annex_b).collect();
            assert_eq!(same, nal_units(&stream[number].annex_b).collect::<Vec<_>>());
        }
        assert_eq!(builder.tally(), VideoStats { units: 7, gaps: 0, skipped: 3, damaged: 0 });
    }

    #[test]
    fn parameter_sets_sent_once_precede_every_key_frame() {
        let stream = units(64, 48, 12, 0.5);
        let mut builder = UnitBuilder::default();
        let mut keys = 0;
        for (number, unit) in stream.iter().enumerate() {
            for nal in nal_units(&unit.annex_b) {
                if number == 0 || !matches!(NalKind::of(nal), Some(NalKind::Sps | NalKind::Pps)) {
                    builder.nal(nal);
                }
            }
            let unit = builder.end().unwrap();
            if unit.key {
                keys += 1;
                let kinds: Vec<_> = nal_units(&unit.annex_b).filter_map(NalKind::of).collect();
                assert_eq!(kinds, [NalKind::Sps, NalKind::Pps, NalKind::IdrSlice]);
            }
        }
        assert_eq!(keys, 3);
    }

    #[test]
    fn a_loss_drops_everything_up_to_the_next_key_frame() {
        let stream = units(64, 48, 12, 0.5);
        let mut builder = UnitBuilder::default();
        let came: Vec<usize> = (0..12)
            .filter(|number| {
                if *number == 2 {
                    builder.lost();
                }
                nal_units(&stream[*number].annex_b).for_each(|nal| builder.nal(nal));
                builder.end().is_some()
            })
            .collect();
        assert_eq!(came, [0, 1, 5, 6, 7, 8, 9, 10, 11]);
        assert_eq!(builder.tally(), VideoStats { units: 9, gaps: 1, skipped: 3, damaged: 0 });
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(12))]
        #[test]
        fn nothing_panics_or_piles_up(nals in proptest::collection::vec(
            (proptest::collection::vec(any::<u8>(), 0..20), 0_usize..3_000_000, 0..4), 0..40)) {
            let mut builder = UnitBuilder::default();
            for (bytes, length, what) in nals {
                match what {
                    0 => drop(builder.end()),
                    1 => builder.lost(),
                    _ => {
                        let nal: Vec<u8> = bytes.iter().copied().cycle().take(if bytes.is_empty() { 0 } else { length }).collect();
                        builder.nal(&nal);
                    }
                }
                let sets: usize = builder.picture_sets.iter().map(Vec::len).sum();
                prop_assert!(builder.open.len() <= LONGEST_UNIT + 4 * 40 && sets <= MOST_PICTURE_SETS * LONGEST_PARAMETERS);
            }
        }
    }
}

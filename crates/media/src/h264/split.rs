//! Splits an Annex B byte stream into NAL units (ITU-T H.264, annex B).

/// Relevant types of NAL units (ITU-T H.264, table 7-1).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NalKind {
    /// A slice that refers to other pictures.
    Slice,
    /// A slice of an IDR picture, at which decoding can start.
    IdrSlice,
    /// A sequence parameter set.
    Sps,
    /// A picture parameter set.
    Pps,
    /// Anything else, by its `nal_unit_type`.
    Other(u8),
}

impl NalKind {
    /// The kind of a NAL unit given without its start code; `None` if it is empty.
    #[must_use]
    pub fn of(unit: &[u8]) -> Option<Self> {
        Some(match unit.first()? & 0x1f {
            1 => Self::Slice,
            5 => Self::IdrSlice,
            7 => Self::Sps,
            8 => Self::Pps,
            other => Self::Other(other),
        })
    }
}

/// The NAL units of a complete Annex B buffer, in order, without start codes and trailing zero bytes.
///
/// Bytes before the first start code and empty units are skipped.
pub fn nal_units(annex_b: &[u8]) -> impl Iterator<Item = &[u8]> {
    let mut rest = after_start_code(annex_b);
    core::iter::from_fn(move || {
        let here = rest?;
        let end = start_code(here).unwrap_or(here.len());
        rest = after_start_code(&here[end..]);
        // A NAL unit ends in a one bit, so zeros before the next start code are padding (`trailing_zero_8bits`).
        let used = here[..end].iter().rposition(|&byte| byte != 0).map_or(0, |last| last + 1);
        Some(&here[..used])
    })
    .filter(|unit| !unit.is_empty())
}

/// Position of the next bytes 0, 0, 1.
fn start_code(bytes: &[u8]) -> Option<usize> {
    bytes.windows(3).position(|window| window == [0, 0, 1])
}

fn after_start_code(bytes: &[u8]) -> Option<&[u8]> {
    start_code(bytes).map(|at| &bytes[at + 3..])
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn units_are_cut_at_short_and_long_start_codes() {
        let stream = [9, 9, 0, 0, 0, 1, 0x67, 1, 2, 0, 0, 1, 0x68, 3, 0, 0, 0, 0, 1, 0x65, 4, 0, 5, 0, 0];
        let units: Vec<_> = nal_units(&stream).collect();
        assert_eq!(units, [&[0x67, 1, 2][..], &[0x68, 3], &[0x65, 4, 0, 5]]);
        let kinds: Vec<_> = units.iter().filter_map(|unit| NalKind::of(unit)).collect();
        assert_eq!(kinds, [NalKind::Sps, NalKind::Pps, NalKind::IdrSlice]);
        assert_eq!(NalKind::of(&[]), None);
    }

    proptest! {
        #[test]
        fn joining_and_cutting_gives_the_units_back(
            units in proptest::collection::vec(proptest::collection::vec(1_u8.., 1..40), 0..8),
            long in any::<bool>(),
        ) {
            let mut stream = Vec::new();
            for unit in &units {
                stream.extend_from_slice(if long { &[0, 0, 0, 1] } else { &[0, 0, 1] });
                stream.extend_from_slice(unit);
            }
            prop_assert_eq!(nal_units(&stream).map(<[u8]>::to_vec).collect::<Vec<_>>(), units);
        }

        #[test]
        fn no_bytes_panic_and_no_unit_holds_a_start_code(bytes in proptest::collection::vec(0_u8..4, 0..200)) {
            for unit in nal_units(&bytes) {
                prop_assert!(start_code(unit).is_none());
                prop_assert!(unit.last() != Some(&0));
            }
        }
    }
}

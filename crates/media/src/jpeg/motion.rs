//! Images of Motion JPEG, as webcams and AVI files have them: JPEG files without Huffman tables.

use std::borrow::Cow;

use super::baseline::huffman_tables;

/// Markers (ITU-T T.81, table B.1).
const TABLES: u8 = 0xc4;
const SCAN: u8 = 0xda;
const END: u8 = 0xd9;

/// A JPEG file with Huffman tables: if none precedes the first scan, those of ITU-T T.81 Annex K are inserted, which Motion JPEG
/// implies. A file that has its tables, or whose segments are damaged before the scan, is returned as it is.
#[must_use]
pub fn with_huffman_tables(file: &[u8]) -> Cow<'_, [u8]> {
    let Some(scan) = scan_without_tables(file) else { return Cow::Borrowed(file) };
    let mut whole = Vec::with_capacity(file.len() + 432);
    whole.extend_from_slice(&file[..scan]);
    huffman_tables(&mut whole);
    whole.extend_from_slice(&file[scan..]);
    Cow::Owned(whole)
}

/// Where the first scan begins; `None` if tables precede it, or if there is none.
fn scan_without_tables(file: &[u8]) -> Option<usize> {
    let mut at = 2;
    loop {
        let (first, kind) = (*file.get(at)?, *file.get(at + 1)?);
        match (first, kind) {
            (0xff, SCAN) => return Some(at),
            (0xff, TABLES | END) => return None,
            // Fill bytes, and markers without a segment.
            (0xff, 0xff) => at += 1,
            (0xff, 0x01 | 0xd0..=0xd8) => at += 2,
            (0xff, _) => {
                let length = u16::from_be_bytes([*file.get(at + 2)?, *file.get(at + 3)?]);
                at += 2 + usize::from(length.max(2));
            }
            _ => return None,
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::jpeg::decode;
    use crate::{Jpeg, Rgb};

    /// An encoded image, and the same without its tables.
    fn with_and_without() -> (Vec<u8>, Vec<u8>) {
        let mut image = Rgb::new(48, 32);
        for (index, byte) in image.data_mut().iter_mut().enumerate() {
            *byte = (index * 7 % 251) as u8;
        }
        let whole = Jpeg::encode(&image, 80).unwrap().bytes().to_vec();
        let mut without = whole[..2].to_vec();
        let mut at = 2;
        while whole[at + 1] != SCAN {
            let end = at + 2 + usize::from(u16::from_be_bytes([whole[at + 2], whole[at + 3]]));
            if whole[at + 1] != TABLES {
                without.extend_from_slice(&whole[at..end]);
            }
            at = end;
        }
        without.extend_from_slice(&whole[at..]);
        (whole, without)
    }

    #[test]
    fn missing_tables_are_those_of_the_standard() {
        let (whole, without) = with_and_without();
        assert!(decode(&without).is_err(), "the test removes what is needed");
        assert_eq!(with_huffman_tables(&without), whole);
        assert!(matches!(with_huffman_tables(&whole), Cow::Borrowed(_)));
    }

    #[test]
    fn a_file_that_ends_early_stays_as_it_is() {
        let (_, without) = with_and_without();
        let scan = without.windows(2).position(|bytes| bytes == [0xff, SCAN]).unwrap();
        for length in 0..=scan {
            assert_eq!(with_huffman_tables(&without[..length]), &without[..length]);
        }
    }

    proptest! {
        #[test]
        fn any_bytes_grow_by_the_tables_at_most(mut bytes in proptest::collection::vec(any::<u8>(), 0..200), marked in any::<bool>()) {
            if marked {
                bytes.splice(0..0, [0xff, 0xd8, 0xff]);
            }
            prop_assert!(with_huffman_tables(&bytes).len() <= bytes.len() + 432);
        }
    }
}

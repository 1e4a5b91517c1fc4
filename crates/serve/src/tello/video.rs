//! Splits the video into datagrams as a Tello does: without headers or numbers, marked only by lengths.

/// A datagram of this length is followed by more of its NAL unit; a shorter one ends it.
pub const DATAGRAM: usize = 1460;

/// The datagrams of an access unit (NAL units without start codes): each unit is preceded by a four-byte start code and
/// split every [`DATAGRAM`] bytes. A unit that would end in a full datagram gets an extra zero byte, which H.264
/// allows, so that its end can be recognised.
#[must_use]
pub fn datagrams<'a>(units: impl Iterator<Item = &'a [u8]>) -> Vec<Vec<u8>> {
    let mut datagrams = Vec::new();
    for unit in units {
        let mut bytes = vec![0, 0, 0, 1];
        bytes.extend_from_slice(unit);
        if bytes.len().is_multiple_of(DATAGRAM) {
            bytes.push(0);
        }
        datagrams.extend(bytes.chunks(DATAGRAM).map(<[u8]>::to_vec));
    }
    datagrams
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn lengths_show_where_units_end(sizes in proptest::collection::vec(1_usize..5000, 1..6), full in 0_usize..3) {
            let mut units: Vec<Vec<u8>> = sizes.iter().map(|size| vec![7; *size]).collect();
            units.push(vec![9; DATAGRAM * (full + 1) - 4]);
            let cut = datagrams(units.iter().map(Vec::as_slice));
            let mut joined = vec![Vec::new()];
            for datagram in &cut {
                prop_assert!(datagram.len() <= DATAGRAM && !datagram.is_empty());
                joined.last_mut().unwrap().extend_from_slice(datagram);
                if datagram.len() < DATAGRAM {
                    joined.push(Vec::new());
                }
            }
            prop_assert_eq!(joined.pop(), Some(Vec::new()));
            for (unit, joined) in units.iter().zip(joined) {
                prop_assert_eq!(&joined[..4], &[0, 0, 0, 1]);
                prop_assert_eq!(&joined[4..4 + unit.len()], unit.as_slice());
            }
        }
    }
}

//! Whether the texts of a record fit into it. The parser reserves memory for the length that a text claims, up to 4 GiB, before
//! it reads it, so that a file of a few hundred bytes could exhaust the memory.

use mcap::records::op;

/// A field of a record.
#[derive(Clone, Copy)]
enum Field {
    /// Numbers of so many bytes in all.
    Numbers(usize),
    /// A length of 32 bits, and a text.
    Text,
    /// A length of 32 bits in bytes, and pairs of texts.
    Texts,
    /// A length of 32 bits in bytes, and pairs of numbers.
    Pairs,
}

/// The fields of a record up to its last text; empty for one without any, or one of a later version of the format.
fn fields(opcode: u8) -> &'static [Field] {
    use Field::{Numbers, Pairs, Text, Texts};
    match opcode {
        op::HEADER => &[Text, Text],
        op::SCHEMA => &[Numbers(2), Text, Text],
        op::CHANNEL => &[Numbers(4), Text, Text, Texts],
        op::CHUNK => &[Numbers(28), Text],
        op::CHUNK_INDEX => &[Numbers(32), Pairs, Numbers(8), Text],
        op::ATTACHMENT => &[Numbers(16), Text, Text],
        op::ATTACHMENT_INDEX => &[Numbers(40), Text, Text],
        op::METADATA => &[Text, Texts],
        op::METADATA_INDEX => &[Numbers(16), Text],
        _ => &[],
    }
}

/// Whether every text of a record ends within it.
pub(super) fn fit(opcode: u8, record: &[u8]) -> bool {
    let mut rest = record;
    fields(opcode).iter().all(|field| match field {
        Field::Numbers(length) => take(&mut rest, *length).is_some(),
        Field::Text | Field::Pairs => text(&mut rest).is_some(),
        Field::Texts => text(&mut rest).is_some_and(|mut pairs| {
            while !pairs.is_empty() {
                if text(&mut pairs).is_none() {
                    return false;
                }
            }
            true
        }),
    })
}

/// Takes a length and that many bytes.
fn text<'a>(rest: &mut &'a [u8]) -> Option<&'a [u8]> {
    let length = u32::from_le_bytes(take(rest, 4)?.try_into().ok()?);
    take(rest, usize::try_from(length).ok()?)
}

fn take<'a>(rest: &mut &'a [u8], length: usize) -> Option<&'a [u8]> {
    let (taken, left) = rest.split_at_checked(length)?;
    *rest = left;
    Some(taken)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A record whose texts are of this length each, with one pair in a map; and the places of all lengths.
    fn record(opcode: u8, length: u32) -> (Vec<u8>, Vec<usize>) {
        let (mut bytes, mut places) = (Vec::new(), Vec::new());
        let mut text = |bytes: &mut Vec<u8>| {
            places.push(bytes.len());
            bytes.extend(length.to_le_bytes());
            bytes.extend(std::iter::repeat_n(b'x', length as usize));
        };
        for field in fields(opcode) {
            match field {
                Field::Numbers(length) => bytes.extend(std::iter::repeat_n(1, *length)),
                Field::Text => text(&mut bytes),
                Field::Pairs => bytes.extend(0_u32.to_le_bytes()),
                Field::Texts => {
                    bytes.extend((2 * (4 + length)).to_le_bytes());
                    text(&mut bytes);
                    text(&mut bytes);
                }
            }
        }
        (bytes, places)
    }

    const WITH_TEXTS: [u8; 9] = [
        op::HEADER,
        op::SCHEMA,
        op::CHANNEL,
        op::CHUNK,
        op::CHUNK_INDEX,
        op::ATTACHMENT,
        op::ATTACHMENT_INDEX,
        op::METADATA,
        op::METADATA_INDEX,
    ];

    #[test]
    fn a_text_that_claims_more_than_its_record_has_is_found() {
        for opcode in WITH_TEXTS {
            for length in [0, 3] {
                let (whole, places) = record(opcode, length);
                assert!(fit(opcode, &whole), "{opcode}");
                assert!((0..whole.len()).all(|cut| !fit(opcode, &whole[..cut])), "{opcode}");
                for place in places {
                    let mut wrong = whole.clone();
                    wrong[place..place + 4].copy_from_slice(&u32::MAX.to_le_bytes());
                    assert!(!fit(opcode, &wrong), "{opcode}, {place}");
                }
            }
        }
        assert!(fit(op::MESSAGE, &[]) && fit(0x80, b"unknown"));
    }

    /// The parser reads the same fields: it accepts what fits, with whatever follows the texts.
    #[test]
    fn the_parser_has_the_same_fields() {
        for opcode in WITH_TEXTS {
            let (mut bytes, places) = record(opcode, 1);
            // Equal keys are refused by the parser.
            if let [.., _, value] = places[..]
                && matches!(opcode, op::CHANNEL | op::METADATA)
            {
                bytes[value + 4] = b'y';
            }
            bytes.extend([0; 64]);
            assert!(mcap::read::parse_record(opcode, &bytes).is_ok(), "{opcode}: {:?}", mcap::read::parse_record(opcode, &bytes));
        }
    }
}

use proptest::prelude::*;

use super::*;

fn square() -> Vec<FenceShape> {
    let corners = vec![[474_000_000, 85_000_000], [474_001_000, 85_000_000], [474_001_000, 85_001_000]];
    let hole = vec![[474_000_200, 85_000_200], [474_000_300, 85_000_200], [474_000_300, 85_000_300]];
    vec![
        FenceShape::Polygon { inside: true, corners },
        FenceShape::Polygon { inside: false, corners: hole },
        FenceShape::Circle { inside: true, centre: [474_000_000, 85_000_000], radius: 80.0 },
    ]
}

fn at(ms: u64) -> Time {
    Time::from_millis(ms)
}

/// Command, first parameter and place stand where `MISSION_ITEM_INT` has them.
#[test]
fn an_item_is_laid_out_as_in_the_protocol_and_read_back() {
    let items = items(&square());
    let body = FenceMessage::Item(2, items[2]).body([1, 1]);
    assert_eq!((body.id, &body.payload[28..32]), (73, &[2, 0, 0x89, 0x13][..]), "sequence 2, command 5001");
    assert_eq!(f32::from_le_bytes(body.payload[..4].try_into().unwrap()), 3.0);
    assert_eq!(i32::from_le_bytes(body.payload[16..20].try_into().unwrap()), 474_001_000);
    let mut decoder = crate::wire::Decoder::default();
    decoder.push(&crate::wire::Encoder::new([255, 190]).frame(&body));
    let read = FenceMessage::read(&decoder.next_packet().unwrap().message().unwrap());
    assert_eq!(read, Some((FenceMessage::Item(2, items[2]), [1, 1])));
    assert_eq!(shapes(&items), Some(square()));
    assert_eq!(shapes(&items[1..]), None, "a corner is missing");
}

/// A vehicle that keeps what it is sent, on a link that loses what `loses` says.
fn exchange(transfer: &mut Transfer, kept: &mut Vec<FenceItem>, mut loses: impl FnMut() -> bool) {
    let mut count = 0;
    for ms in (0..120_000).step_by(50) {
        while let Some(sent) = transfer.poll(at(ms)) {
            if loses() {
                continue;
            }
            let answer = match sent {
                FenceMessage::Count(n) => {
                    kept.clear();
                    count = n;
                    FenceMessage::Request(0)
                }
                FenceMessage::Item(seq, item) if usize::from(seq) == kept.len() => {
                    kept.push(item);
                    if kept.len() == usize::from(count) { FenceMessage::End(0) } else { FenceMessage::Request(seq + 1) }
                }
                FenceMessage::Item(..) if kept.len() == usize::from(count) => FenceMessage::End(0),
                FenceMessage::Item(..) => FenceMessage::Request(kept.len() as u16),
                FenceMessage::List => FenceMessage::Count(kept.len() as u16),
                FenceMessage::Request(seq) => FenceMessage::Item(seq, kept[usize::from(seq)]),
                FenceMessage::End(_) => continue,
            };
            if !loses() {
                transfer.handle(at(ms), answer);
            }
        }
    }
}

#[test]
fn a_silent_autopilot_and_one_that_refuses_end_a_transfer() {
    let mut transfer = Transfer::default();
    transfer.upload(at(0), items(&square()));
    let sent = (0..100).filter(|n| transfer.poll(at(n * 100)).is_some()).count();
    assert_eq!((sent, transfer.take_result()), (5, Some(Err(FenceError::Silent))));
    transfer.download(at(0));
    transfer.poll(at(0));
    transfer.handle(at(1), FenceMessage::End(3));
    assert_eq!((transfer.take_result(), transfer.is_busy()), (Some(Err(FenceError::Refused(3))), false));
    transfer.download(at(0));
    transfer.handle(at(1), FenceMessage::Count(60_000));
    assert_eq!(transfer.take_result(), Some(Err(FenceError::TooLarge)));
}

proptest! {
    /// Over a link that loses a quarter, what was sent is what is read, or the transfer ends with an error.
    #[test]
    fn what_was_uploaded_is_read_back(seed in proptest::collection::vec(0_u8..4, 400)) {
        let (mut transfer, mut kept, wanted) = (Transfer::default(), Vec::new(), items(&square()));
        let mut losses = seed.iter().cycle();
        transfer.upload(at(0), wanted.clone());
        exchange(&mut transfer, &mut kept, || losses.next() == Some(&0));
        if transfer.take_result() == Some(Ok(None)) {
            prop_assert!(are_same(&kept, &wanted));
            transfer.download(at(0));
            exchange(&mut transfer, &mut kept, || losses.next() == Some(&0));
            if let Some(Ok(read)) = transfer.take_result() {
                prop_assert!(are_same(&read.unwrap(), &wanted));
            }
        }
        prop_assert!(!transfer.is_busy());
    }

    #[test]
    fn no_items_panic(kinds in proptest::collection::vec((0_u16..6, any::<bool>(), any::<f32>()), 0..20)) {
        let items: Vec<FenceItem> = kinds.iter().map(|(count, inside, radius)| {
            let kind = match count % 3 {
                0 => FenceKind::Corner { inside: *inside, count: *count },
                1 => FenceKind::Circle { inside: *inside, radius: *radius },
                _ => FenceKind::Return,
            };
            FenceItem { kind, place: [0, 0] }
        }).collect();
        if let Some(shapes) = shapes(&items) {
            prop_assert!(shapes.len() <= items.len());
        }
    }
}

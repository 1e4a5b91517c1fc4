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

/// An ArduPilot on a link that loses what `loses` says: it asks for each item, again after a second, answers one that it did not ask
/// for with an error and goes on, and gives up after 8 s. Returns how many items it was sent that it had not asked for.
fn exchange(transfer: &mut Transfer, kept: &mut Vec<FenceItem>, mut loses: impl FnMut() -> bool) -> u32 {
    // What it receives, how many there are to be, when it asked last, and when it was last sent something.
    let mut receiving: Option<(Vec<FenceItem>, u16, u64, u64)> = None;
    let mut unasked = 0;
    for ms in (0..120_000).step_by(50) {
        let mut answers = Vec::new();
        if let Some((items, _, asked, heard)) = &mut receiving {
            if ms - *heard >= 8000 {
                receiving = None;
            } else if ms - *asked >= 1000 {
                *asked = ms;
                answers.push(FenceMessage::Request(items.len() as u16));
            }
        }
        while let Some(sent) = transfer.poll(at(ms)) {
            let lost = loses();
            match sent {
                _ if lost => {}
                FenceMessage::Count(n) => {
                    receiving = Some((Vec::new(), n, ms, ms));
                    answers.push(FenceMessage::Request(0));
                }
                FenceMessage::Item(seq, item) => match &mut receiving {
                    Some((items, count, asked, heard)) if usize::from(seq) == items.len() => {
                        items.push(item);
                        (*asked, *heard) = (ms, ms);
                        if items.len() == usize::from(*count) {
                            *kept = core::mem::take(items);
                            receiving = None;
                            answers.push(FenceMessage::End(0));
                        } else {
                            answers.push(FenceMessage::Request(seq + 1));
                        }
                    }
                    _ => {
                        unasked += 1;
                        answers.push(FenceMessage::End(13));
                    }
                },
                FenceMessage::List => answers.push(FenceMessage::Count(kept.len() as u16)),
                FenceMessage::Request(seq) => answers.push(FenceMessage::Item(seq, kept[usize::from(seq)])),
                FenceMessage::End(_) => {}
            }
        }
        for answer in answers {
            if !loses() {
                transfer.handle(at(ms), answer);
            }
        }
    }
    unasked
}

#[test]
fn an_item_is_sent_only_when_it_is_asked_for_and_a_lost_last_word_ends_in_reading_back() {
    let (mut transfer, wanted) = (Transfer::default(), items(&square()));
    transfer.upload(at(0), wanted.clone());
    assert_eq!(transfer.poll(at(0)), Some(FenceMessage::Count(7)));
    transfer.handle(at(100), FenceMessage::Request(0));
    assert_eq!(transfer.poll(at(100)), Some(FenceMessage::Item(0, wanted[0])));
    assert_eq!((100..8000).step_by(50).find_map(|ms| transfer.poll(at(ms))), None, "nothing by itself");
    transfer.handle(at(8000), FenceMessage::End(13));
    assert!(transfer.is_busy(), "it goes on");
    for seq in 0..7 {
        transfer.handle(at(8000), FenceMessage::Request(seq));
        assert_eq!(transfer.poll(at(8000)), Some(FenceMessage::Item(seq, wanted[usize::from(seq)])));
    }
    assert_eq!((transfer.poll(at(15_950)), transfer.take_result()), (None, None));
    assert_eq!((transfer.poll(at(16_000)), transfer.take_result()), (None, Some(Ok(None))));
    // In the middle, silence is a failure.
    transfer.upload(at(0), wanted);
    transfer.poll(at(0));
    transfer.handle(at(0), FenceMessage::Request(0));
    transfer.poll(at(0));
    assert_eq!((transfer.poll(at(8000)), transfer.take_result()), (None, Some(Err(FenceError::Silent))));
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
            transfer.download(at(0));
            exchange(&mut transfer, &mut kept, || losses.next() == Some(&0));
            if let Some(Ok(read)) = transfer.take_result() {
                // What was not taken, reading back shows.
                prop_assert!(are_same(&read.unwrap(), &wanted) == are_same(&kept, &wanted));
            }
        }
        prop_assert!(!transfer.is_busy());
    }

    /// Nothing is sent that was not asked for, unless a request came twice.
    #[test]
    fn over_a_link_that_loses_nothing_no_item_comes_unasked(count in 3_u16..40) {
        let corner = |n: u16| FenceItem { kind: FenceKind::Corner { inside: true, count }, place: [n.into(), 0] };
        let wanted: Vec<FenceItem> = (0..count).map(corner).collect();
        let (mut transfer, mut kept) = (Transfer::default(), Vec::new());
        transfer.upload(at(0), wanted.clone());
        prop_assert_eq!(exchange(&mut transfer, &mut kept, || false), 0);
        prop_assert!(transfer.take_result() == Some(Ok(None)) && are_same(&kept, &wanted));
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

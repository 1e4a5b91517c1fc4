//! A log from the reader's side: messages are complete and in order, also if its writer was slow, stopped or killed.

use std::path::Path;
use std::time::{Duration, Instant};

use proptest::prelude::*;
use schemars::JsonSchema;
use spf_core::time::Time;
use spf_record::log::{Entry, Log, LogError, LogReader, Message, ReadError, RepairError, Topic, foxglove, repair, rewrite};

#[derive(JsonSchema)]
#[allow(dead_code, reason = "only its schema is used")]
struct Row {
    /// A number.
    number: u32,
}

fn topics() -> Vec<Topic> {
    vec![Topic::of_json::<Row>("/row", "test.Row"), Topic::of_foxglove::<foxglove::CompressedImage>("/image")]
}

fn row(number: u32) -> Message {
    Message { topic: 0, time: Time::from_millis(u64::from(number)), data: format!("{{\"number\":{number}}}").into() }
}

/// A message like an image: large, and of bytes that do not compress.
fn image(number: u32) -> Message {
    let mut state = number.wrapping_mul(2_654_435_761) | 1;
    let noise = (0..60_000).map(|_| {
        state ^= state << 13;
        state ^= state >> 17;
        state ^= state << 5;
        state as u8
    });
    Message { topic: 1, time: Time::from_millis(u64::from(number)), data: noise.collect::<Vec<u8>>().into() }
}

fn read(path: &Path) -> (Vec<Entry>, Option<ReadError>) {
    let (mut entries, mut trouble) = (Vec::new(), None);
    for entry in LogReader::open(path).unwrap() {
        match entry {
            Ok(entry) => entries.push(entry),
            Err(error) => trouble = Some(error),
        }
    }
    (entries, trouble)
}

#[test]
fn what_goes_in_comes_out_in_order() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("flight.mcap");
    let log = Log::create(&path, &topics(), true).unwrap();
    let sent: Vec<Message> = (0..300).map(|number| if number % 10 == 0 { image(number) } else { row(number) }).collect();
    let sender = log.sender();
    for message in &sent {
        sender.send(message.clone());
    }
    drop(sender);
    let facts = log.finish().unwrap();
    assert_eq!((facts.lost, facts.bytes), (0, std::fs::metadata(&path).unwrap().len()));
    let (entries, trouble) = read(&path);
    assert!(trouble.is_none(), "{trouble:?}");
    assert_eq!(entries.len(), sent.len());
    for (number, (entry, message)) in entries.iter().zip(&sent).enumerate() {
        let (topic, schema, encoding) =
            [("/row", "test.Row", "json"), ("/image", "foxglove.CompressedImage", "protobuf")][message.topic];
        assert_eq!((&*entry.topic, &*entry.schema, &*entry.encoding), (topic, schema, encoding));
        assert_eq!((entry.time, entry.sequence as usize, &entry.data), (message.time, number, &message.data));
    }
}

/// Messages are on the disk soon, without the log being finished: this is what a kill leaves.
#[test]
fn a_message_is_on_the_disk_soon_after() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("flight.mcap");
    let log = Log::create(&path, &topics(), false).unwrap();
    let sender = log.sender();
    sender.send(row(7));
    let begun = Instant::now();
    loop {
        let (entries, trouble) = read(&path);
        assert!(matches!(trouble, Some(ReadError::Torn)), "{trouble:?}");
        if !entries.is_empty() {
            assert_eq!(entries[0].data, row(7).data);
            break;
        }
        assert!(begun.elapsed() < Duration::from_secs(60), "it never came");
        std::thread::sleep(Duration::from_millis(20));
    }
    drop(sender);
    log.finish().unwrap();
}

#[test]
#[cfg(target_os = "linux")]
fn a_full_disk_is_an_error_that_names_the_file() {
    let error = Log::create(Path::new("/dev/full"), &topics(), true).unwrap_err();
    assert!(matches!(error, LogError::Write { .. }) && error.to_string().contains("/dev/full"), "{error}");
}

#[test]
fn other_files_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("letter.txt");
    for letter in ["Dear reader, this is a long letter and no log.", "Dear"] {
        std::fs::write(&path, letter).unwrap();
        let refused = LogReader::open(&path).map(drop);
        assert!(matches!(refused, Err(ReadError::Broken(_))), "{refused:?}");
    }
    for begun in [&b""[..], b"\x89MCA"] {
        std::fs::write(&path, begun).unwrap();
        let (entries, trouble) = read(&path);
        assert!(entries.is_empty() && matches!(trouble, Some(ReadError::Torn)), "{trouble:?}");
    }
}

/// A log of some chunks, as bytes.
fn sample() -> Vec<u8> {
    static SAMPLE: std::sync::OnceLock<Vec<u8>> = std::sync::OnceLock::new();
    let make = || {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("flight.mcap");
        let log = Log::create(&path, &topics(), true).unwrap();
        for number in 0..2000 {
            log.sender().send(if number % 50 == 0 { image(number) } else { row(number) });
        }
        log.finish().unwrap();
        std::fs::read(&path).unwrap()
    };
    SAMPLE.get_or_init(make).clone()
}

fn entries_of(bytes: &[u8]) -> Vec<Entry> {
    LogReader::new(bytes).map(Result::unwrap).collect()
}

/// A repair replaces the log's file; later messages of the flight would be lost.
#[cfg(unix)]
#[test]
fn a_log_that_is_being_written_is_not_repaired() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("flight.mcap");
    let log = Log::create(&path, &topics(), true).unwrap();
    assert!(matches!(repair(&path), Err(RepairError::Busy { .. })));
    assert!(log.sender().send(row(1)));
    log.finish().unwrap();
    assert!(repair(&path).unwrap().trouble.is_none());
}

#[test]
fn a_torn_log_is_repaired_in_its_place_and_a_whole_one_stays() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("flight.mcap");
    let whole = sample();
    std::fs::write(&path, &whole[..whole.len() * 2 / 3]).unwrap();
    let repaired = repair(&path).unwrap();
    assert!(matches!(repaired.trouble, Some(ReadError::Torn)) && repaired.messages > 500, "{repaired:?}");
    let kept = std::fs::read(&path).unwrap();
    assert_eq!(entries_of(&kept).len() as u64, repaired.messages);
    assert_eq!(entries_of(&kept), entries_of(&whole)[..entries_of(&kept).len()]);
    assert!(LogReader::new(&kept[..]).head().is_none(), "not before the first message");
    let again = repair(&path).unwrap();
    assert!(again.trouble.is_none() && std::fs::read(&path).unwrap() == kept, "{again:?}");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "no part is left");

    std::fs::write(&path, &whole[..100]).unwrap();
    assert!(repair(&path).is_err(), "there is nothing to keep");
    assert_eq!(std::fs::read(&path).unwrap(), whole[..100]);
}

#[test]
fn a_later_format_is_refused() {
    let bytes = sample();
    // The version number is the only `1` after its key; the record has no checksum of its own.
    let at = bytes.windows(7).position(|window| window == b"format\x01").unwrap() + 6 + 4;
    let mut later = bytes;
    later[at] = b'9';
    let first = LogReader::new(&later[..]).next().unwrap();
    assert!(matches!(first, Err(ReadError::Format(9))), "{first:?}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Wherever a log is truncated, and whatever garbage follows, everything complete before that point is kept, and
    /// nothing else.
    #[test]
    fn a_cut_log_keeps_its_whole_chunks(cut in 0.0..1.0f64, tail in proptest::collection::vec(any::<u8>(), 0..400)) {
        let whole = sample();
        let all = entries_of(&whole);
        let mut torn = whole[..(cut * whole.len() as f64) as usize].to_vec();
        torn.extend(tail);
        match rewrite(&torn[..], Vec::new()) {
            Ok((found, copy)) => {
                let kept = entries_of(&copy);
                prop_assert_eq!(kept.len() as u64, found.messages);
                prop_assert!(kept == all[..kept.len()]);
                // A chunk holds about nine images: little more than one is lost.
                let images = |entries: &[Entry]| entries.iter().filter(|entry| entry.topic == "/image").count() as f64;
                prop_assert!(images(&kept) >= cut * images(&all) - 12.0, "{} of {}", images(&kept), images(&all));
            }
            Err(error) => prop_assert!(false, "{error:?}"),
        }
    }

    /// Arbitrary bytes end in entries or an error.
    #[test]
    fn no_bytes_panic(bytes in proptest::collection::vec(any::<u8>(), 0..600), magic: bool, flips in proptest::collection::vec((any::<u16>(), any::<u8>()), 0..6)) {
        let mut whole = sample();
        for (at, value) in flips {
            whole[usize::from(at)] ^= value;
        }
        let crafted = if magic { [b"\x89MCAP0\r\n".to_vec(), bytes].concat() } else { bytes };
        for bytes in [crafted, whole] {
            assert!(LogReader::new(&bytes[..]).count() < 5000);
            drop(rewrite(&bytes[..], Vec::new()));
        }
    }
}

//! A log as others meet it: what goes in comes out, in order, also when its writer was slow, stopped or torn away.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

use std::path::Path;
use std::time::{Duration, Instant};

use schemars::JsonSchema;
use spf_core::time::Time;
use spf_record::log::{Entry, Log, LogError, LogReader, Message, ReadError, Topic, foxglove};

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

/// A message like a picture: large, and of bytes that do not compress.
fn picture(number: u32) -> Message {
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
    let sent: Vec<Message> = (0..300).map(|number| if number % 10 == 0 { picture(number) } else { row(number) }).collect();
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

/// What was sent is on the disk soon, without the log being ended: this is what a kill leaves.
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
    std::fs::write(&path, "Dear reader, this is a long letter and no log.").unwrap();
    let (entries, trouble) = read(&path);
    assert!(entries.is_empty() && matches!(trouble, Some(ReadError::Broken(_))), "{trouble:?}");
}

//! Any bytes as a flight log: read to an error or the end, and the messages read can be written to a complete log.
#![no_main]

use libfuzzer_sys::fuzz_target;
use spf_flight::replay::{Changes, replay};
use spf_record::log::{LogReader, rewrite};

fuzz_target!(|bytes: &[u8]| {
    let read = LogReader::new(bytes).take_while(Result::is_ok).count();
    if let Ok((found, copy)) = rewrite(bytes, Vec::new()) {
        assert_eq!(LogReader::new(&copy[..]).map(|entry| entry.expect("a rewritten log is whole")).count() as u64, found.messages);
        assert!(read as u64 <= found.messages);
    }
    drop(replay(LogReader::new(bytes), &Changes::default()));
});

//! Any bytes as a flight log: read to an error or the end, and the messages read can be written to a complete log.
//! The same bytes as a flight to share, and as a log that was shared.
#![no_main]

use libfuzzer_sys::fuzz_target;
use spf_flight::replay::{Changes, replay};
use spf_flight::share::{Pictures, check, share};
use spf_record::log::{LogReader, ReadError, rewrite};

fuzz_target!(|bytes: &[u8]| {
    let read = LogReader::new(bytes).take_while(Result::is_ok).count();
    if let Ok((found, copy)) = rewrite(bytes, Vec::new()) {
        // A log of a later format is copied as it is, and is one that this version does not read.
        let again = LogReader::new(&copy[..]).collect::<Result<Vec<_>, _>>();
        match again {
            Ok(entries) => assert_eq!(entries.len() as u64, found.messages),
            Err(error) => assert!(matches!(error, ReadError::Format(_)), "a rewritten log is whole: {error}"),
        }
        assert!(read as u64 <= found.messages);
    }
    drop(replay(LogReader::new(bytes), &Changes::default()));
    drop(check(LogReader::new(bytes)));
    if let Ok((_, shared)) = share(|| Ok::<_, ReadError>(LogReader::new(bytes)), Vec::new(), Pictures::Kept, &[]) {
        let again = LogReader::new(&shared[..]).collect::<Result<Vec<_>, _>>();
        assert!(again.is_ok_and(|entries| !entries.is_empty()), "a log made to be shared is whole");
    }
});

//! Any text as rows of a bench's results: rejected, or parsed, and then written and parsed again unchanged.
#![no_main]

use libfuzzer_sys::fuzz_target;
use spf_bench::trial::{FlownPath, Record};

fuzz_target!(|text: &str| {
    if let Ok(record) = serde_json::from_str::<Record>(text) {
        let again = serde_json::to_string(&record).expect("a row that was read can be written");
        assert_eq!(serde_json::from_str::<Record>(&again).expect("and read again"), record);
    }
    if let Ok(path) = serde_json::from_str::<FlownPath>(text) {
        assert!(!path.is_sound() || path.places.iter().flatten().all(|metres| metres.is_finite()));
    }
});

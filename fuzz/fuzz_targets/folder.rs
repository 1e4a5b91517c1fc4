//! Any bytes as the log of answered questions, or as an answer's file: refused with the line, or rows in order; a text without an
//! editor's mark, whole only if it is an object.
#![no_main]

use libfuzzer_sys::fuzz_target;
use spf_vlm::folder::{answer_of, rows};

fuzz_target!(|data: &[u8]| {
    match rows(&String::from_utf8_lossy(data)) {
        Ok(rows) => assert!(rows.iter().zip(1..).all(|(row, number)| row.question == number)),
        Err(line) => assert!(line as usize <= data.split(|byte| *byte == b'\n').count()),
    }
    let (text, is_whole) = answer_of(data);
    assert!(!text.starts_with('\u{feff}') && text.trim() == text);
    assert!(!is_whole || text.starts_with('{') && text.ends_with('}'));
});

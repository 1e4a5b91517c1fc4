//! Any text as the oracle's error file: read or refused, never a panic.
#![no_main]

use libfuzzer_sys::fuzz_target;
use spf_oracle::ErrorFile;

fuzz_target!(|text: &str| {
    let _ = ErrorFile::from_toml(text);
});

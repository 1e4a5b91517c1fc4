//! Any text as the oracle's error file: parsed or rejected, never a panic.
#![no_main]

use libfuzzer_sys::fuzz_target;
use spf_oracle::ErrorFile;

fuzz_target!(|text: &str| {
    let _ = ErrorFile::from_toml(text);
});

//! Any text as operator events: read or refused, in bounded memory, and never a velocity that is no number.
#![no_main]

use libfuzzer_sys::fuzz_target;
use spf_flight::world::Script;

fuzz_target!(|text: &str| {
    let script = Script::from_toml(text);
    // TOML writes it `nan`; an instruction may say what it likes.
    assert!(text.contains("NaN") || !format!("{script:?}").contains("NaN"));
});

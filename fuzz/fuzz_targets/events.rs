//! Any text as operator events: parsed or rejected, in bounded memory, and never a velocity that is not a number.
#![no_main]

use libfuzzer_sys::fuzz_target;
use spf_flight::world::Script;

fuzz_target!(|text: &str| {
    let script = Script::from_toml(text);
    // TOML writes it as `nan`; an instruction may contain it.
    assert!(text.contains("NaN") || !format!("{script:?}").contains("NaN"));
});

//! Any text as a recording of answers: rejected with its line, or a stand-in that answers without end.
#![no_main]

use libfuzzer_sys::fuzz_target;
use spf_vlm::cassette::Replay;

fuzz_target!(|data: &[u8]| {
    drop(Replay::read(data));
});

//! Any line of a program that answers queries: a reply to the request, to another one, or an error; never a panic.
#![no_main]

use libfuzzer_sys::fuzz_target;
use spf_core::grounding::GroundingProfile;
use spf_core::reply::parse_reply;
use spf_vlm::exec::read_reply;

fuzz_target!(|data: &[u8]| {
    let line = String::from_utf8_lossy(data);
    if let Some(Ok(text)) = read_reply("program", 0, &line) {
        let _ = parse_reply(&text, &GroundingProfile::default(), false);
    }
});

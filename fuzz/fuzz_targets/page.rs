//! Any text as a message of a page to the view or the cockpit, and of a viewer to the live view: read or refused, never a panic.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|text: &str| {
    let _ = spf_web::view::read_page_message(text);
    let _ = spf_cockpit::read_page_message(text);
    let _ = spf_record::live::read_request(text);
});

//! Any bytes as a vendor's answer, in any wire format, streamed or whole: text or a named error, and never more than
//! the limit.
#![no_main]

use libfuzzer_sys::fuzz_target;
use serde_json::Value;
use spf_core::reply::MAX_TEXT;
use spf_vlm::wire::sse::Events;
use spf_vlm::wire::{Gathered, WireKind, error_of};

fuzz_target!(|data: &[u8]| {
    let Some((&choice, rest)) = data.split_first() else { return };
    let wires = [WireKind::Gemini, WireKind::OpenaiChat, WireKind::OpenaiResponses, WireKind::Anthropic];
    let wire = wires[usize::from(choice & 3)];
    let mut gathered = Gathered::default();
    let mut take = |bytes: &[u8]| {
        let Ok(object) = serde_json::from_slice::<Value>(bytes) else { return true };
        drop(error_of("host", 503, &object));
        wire.read("host", &object, &mut gathered).is_ok()
    };
    if choice & 4 == 0 {
        take(rest);
    } else {
        // The events of a stream do not depend on how it is split.
        let size = usize::from(choice >> 3) + 1;
        let mut events = Events::default();
        let mut pieces: Vec<String> = rest.chunks(size).flat_map(|piece| events.push(piece)).collect();
        pieces.extend(events.finish());
        let mut whole = Events::default();
        assert_eq!(pieces, [whole.push(rest), whole.finish()].concat());
        let _ = pieces.iter().all(|piece| take(piece.as_bytes()));
    }
    if let Ok(text) = gathered.finish("host") {
        assert!(!text.trim().is_empty() && text.len() <= 2 * MAX_TEXT);
    }
});

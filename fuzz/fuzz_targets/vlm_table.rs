//! Any text as rows of models, and any text as the name of one: an error with a reason, or a model that can be queried.
#![no_main]

use libfuzzer_sys::fuzz_target;
use spf_vlm::table::Table;

fuzz_target!(|data: &[u8]| {
    let text = String::from_utf8_lossy(data);
    let (name, rows) = text.split_once('\n').unwrap_or((&text, ""));
    let Ok(table) = Table::shipped().extended(rows) else { return };
    let Ok(choice) = table.select(name, "2026-11-21") else { return };
    for camera in [(960, 720), (64, 48), (8192, 1)] {
        let (width, height) = choice.model.image.sent(camera, None);
        assert!(width > 0 && height > 0);
        let _ = choice.model.grounding((width, height));
    }
});

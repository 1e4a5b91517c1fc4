//! Any bytes as a model whose windows are written out: rewritten, refused or left as they are, and never twice.
#![no_main]

use libfuzzer_sys::fuzz_target;
use spf_detect::windows::complete;

fuzz_target!(|bytes: &[u8]| {
    let Ok(once) = complete(bytes.to_vec()) else { return };
    // Each operator grows by its window at most.
    assert!(once.len() <= 40 * bytes.len());
    if let Ok(twice) = complete(once.clone()) {
        assert_eq!(twice, once);
    }
});

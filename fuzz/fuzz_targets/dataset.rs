//! Any text as the file of an image dataset, in every format that is recognised by its name: items or an error that
//! names the file.
#![no_main]

use std::fs;
use std::path::PathBuf;
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use spf_bench::ground::source::open;
use spf_media::{Jpeg, Rgb};

/// A folder of this process that contains one image of 8×6 pixels, `a.jpg`.
static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| {
    let folder = std::env::temp_dir().join(format!("spf-fuzz-dataset-{}", std::process::id()));
    fs::create_dir_all(&folder).expect("a temporary folder can be made");
    let image = Jpeg::encode(&Rgb::new(8, 6), 70).expect("it has a size");
    fs::write(folder.join("a.jpg"), image.bytes()).expect("a small file can be written");
    folder
});

fuzz_target!(|data: &[u8]| {
    let Some((&choice, text)) = data.split_first() else { return };
    let file = FOLDER.join(if choice & 1 == 0 { "photos.jsonl" } else { "annotations.json" });
    fs::write(&file, text).expect("a small file can be written");
    match open(&file) {
        Ok(source) => assert!(!source.items.is_empty()),
        Err(error) => assert!(error.to_string().contains("spf-fuzz-dataset"), "{error}"),
    }
});

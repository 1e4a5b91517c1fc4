//! What is compared with must not change: the data that answer flights, and the tasks. A change of these digests changes published
//! results, so it needs a measurement of all methods before and after. Flights are pinned in `pins.rs`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// FNV-1a, 64 bits.
fn digest(bytes: &[u8]) -> String {
    let value =
        bytes.iter().fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3));
    format!("{value:016x}")
}

/// The files of a folder below the repository, and of those below it, by path.
fn files(root: &Path, folder: &str, found: &mut BTreeMap<String, PathBuf>) {
    for entry in std::fs::read_dir(root.join(folder)).unwrap() {
        let entry = entry.unwrap();
        let name = format!("{folder}/{}", entry.file_name().into_string().unwrap());
        if entry.file_type().unwrap().is_dir() {
            files(root, &name, found);
        } else {
            found.insert(name, entry.path());
        }
    }
}

#[test]
fn language_error_files_and_tasks_are_frozen() {
    let pinned = [
        "crates/oracle/data: 7 files, d1a94294026504ab",
        "crates/oracle/src/errors: 6 files, 386eea5d7ee6a054",
        "tasks/hard: 30 files, ee3544ae0aaf7a93",
        "tasks/paper: 34 files, e8f1e8dae4512953",
        "tasks/trials: 50 files, cd06f9f7b72a716b",
    ];
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    for pinned in pinned {
        let (folder, _) = pinned.split_once(':').unwrap();
        let mut all = BTreeMap::new();
        files(&root, folder, &mut all);
        let line = |(name, path): (&String, &PathBuf)| format!("{name} {}\n", digest(&std::fs::read(path).unwrap()));
        let listed: String = all.iter().map(line).collect();
        assert_eq!(format!("{folder}: {} files, {}", all.len(), digest(listed.as_bytes())), pinned);
    }
}

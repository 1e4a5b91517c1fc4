//! What is compared with must not change: flights of `spf` and `spf-paper` without guidance between two answers, the data that
//! answer them, and the tasks. A change of these digests changes published results, so it needs a measurement of all methods
//! before and after.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use spf_bench::task::shipped;
use spf_bench::trial::{Method, Trial, VlmUnderTest, draw};
use spf_flight::sim::oracle_factory;
use spf_oracle::ErrorFile;

/// FNV-1a, 64 bits.
fn digest(bytes: &[u8]) -> String {
    let value =
        bytes.iter().fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3));
    format!("{value:016x}")
}

/// Digest of a trial's row and path. Left out are the program's version and revision, and the digest of its parameters, which
/// includes the prompt; the oracle reads no prompt.
fn flown(task: &str, method: &str, vlm: &str, seed: u64) -> String {
    let task = Arc::new(shipped(task).unwrap().unwrap());
    let name = format!("oracle:{vlm}");
    let vlm_factory = oracle_factory(name.clone(), ErrorFile::named(vlm).unwrap());
    let pointer = Some(VlmUnderTest { vlm_factory, name, latency: None });
    let drawn = draw(&task, seed).unwrap();
    let trial = Trial { task, method: Method::of_name(method).unwrap(), pointer, seed, max_cost_usd: None };
    let mut flown = trial.fly(&drawn, None);
    assert_eq!(flown.record.error, None);
    (flown.record.program, flown.record.git_rev, flown.record.params_hash) = Default::default();
    let row = serde_json::to_string(&flown.record).unwrap() + &serde_json::to_string(&flown.path).unwrap();
    digest(row.as_bytes())
}

#[test]
fn flights_of_the_paper_and_without_guidance_are_the_same_as_before() {
    let pinned = [
        ("sim-nav-red-crane", "spf-paper", "default", 0, "1c1f0017a8975965"),
        ("real-nav-chair", "spf-paper", "perfect", 1, "e2857d451c69a6a8"),
        ("sim-obstacle-white-needle", "spf", "default", 1, "f9f2aa58ce8ec291"),
        ("real-obstacle-cone", "spf", "perfect", 0, "516102d71a224be4"),
        ("sim-search-train", "spf", "poor", 0, "1f410d77a295a59b"),
    ];
    let found = pinned.map(|(task, method, vlm, seed, _)| flown(task, method, vlm, seed));
    assert_eq!(found, pinned.map(|(.., digest)| digest));
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
        "crates/oracle/src/errors: 6 files, 75d4fea20c9c7264",
        "tasks/hard: 30 files, ee3544ae0aaf7a93",
        "tasks/paper: 34 files, d3917ed408b03511",
        "tasks/trials: 50 files, f58f128bdacf402a",
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

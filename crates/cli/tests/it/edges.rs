//! Crates depend downwards only (docs/architecture.md); any other edge is refused, development dependencies included.

use std::collections::BTreeMap;
use std::process::Command;

/// Crate → the crates of ours that it may use.
const ALLOWED: &[(&str, &[&str])] = &[
    ("spf-core", &[]),
    ("spf-media", &["spf-core"]),
    ("spf-record", &["spf-media", "spf-core"]),
    ("spf-vlm", &["spf-media", "spf-core"]),
    ("spf-detect", &["spf-media", "spf-core"]),
    ("spf-drone", &["spf-media", "spf-core"]),
    ("spf-oracle", &["spf-core"]),
    ("spf-scene", &["spf-media", "spf-core"]),
    ("spf-render", &["spf-scene", "spf-media", "spf-core"]),
    ("spf-sim", &["spf-render", "spf-scene", "spf-media", "spf-core"]),
    ("spf-flight", BELOW_FLIGHT),
    ("spf-serve", FLIGHT_AND_BELOW),
    ("spf-web", FLIGHT_AND_BELOW),
    ("spf-bench", SERVE_AND_BELOW),
    ("spf", ALL_BELOW),
];

const BELOW_FLIGHT: &[&str] = &[
    "spf-sim",
    "spf-render",
    "spf-scene",
    "spf-oracle",
    "spf-detect",
    "spf-drone",
    "spf-vlm",
    "spf-record",
    "spf-media",
    "spf-core",
];

const FLIGHT_AND_BELOW: &[&str] = &[
    "spf-flight",
    "spf-sim",
    "spf-render",
    "spf-scene",
    "spf-oracle",
    "spf-detect",
    "spf-drone",
    "spf-vlm",
    "spf-record",
    "spf-media",
    "spf-core",
];

const SERVE_AND_BELOW: &[&str] = &[
    "spf-serve",
    "spf-flight",
    "spf-sim",
    "spf-render",
    "spf-scene",
    "spf-oracle",
    "spf-detect",
    "spf-drone",
    "spf-vlm",
    "spf-record",
    "spf-media",
    "spf-core",
];

const ALL_BELOW: &[&str] = &[
    "spf-bench",
    "spf-web",
    "spf-serve",
    "spf-flight",
    "spf-sim",
    "spf-render",
    "spf-scene",
    "spf-oracle",
    "spf-detect",
    "spf-drone",
    "spf-vlm",
    "spf-record",
    "spf-media",
    "spf-core",
];

#[test]
fn crates_depend_downwards_only() {
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--format-version", "1", "--no-deps", "--offline"])
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let metadata: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let allowed: BTreeMap<_, _> = ALLOWED.iter().copied().collect();
    let packages = metadata["packages"].as_array().unwrap();
    assert_eq!(packages.len(), ALLOWED.len(), "a crate is missing from the table");
    for package in packages {
        let name = package["name"].as_str().unwrap();
        let may_use = allowed.get(name).unwrap_or_else(|| panic!("`{name}` is not in the table"));
        for dependency in package["dependencies"].as_array().unwrap() {
            let on = dependency["name"].as_str().unwrap();
            // A crate's own tests may turn its features on.
            if on != name && allowed.contains_key(on) {
                assert!(may_use.contains(&on), "`{name}` must not use `{on}`");
            }
        }
    }
}

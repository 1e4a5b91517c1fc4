//! Crates depend downwards only: as in the table of docs/explanation/architecture.md, development dependencies
//! included.

use std::collections::{BTreeMap, BTreeSet};
use std::process::Command;

/// Crate → the crates of ours that it may use, from the rows ``| `spf-x` (`crates/x`) | what it is | may use |`` of a document.
///
/// The last cell lists crates without `spf-`; `below` stands for every row under the last one named, `all below` for
/// every row under its own, `–` for none.
fn allowed(document: &str) -> BTreeMap<String, BTreeSet<String>> {
    let rows: Vec<(String, &str)> = document
        .lines()
        .filter_map(|line| {
            let mut cells = line.strip_prefix("| `spf")?.split('|');
            let name = format!("spf{}", cells.next()?.split('`').next()?);
            cells.nth(1).map(|may_use| (name, may_use.trim()))
        })
        .collect();
    let place = |name: &str| rows.iter().position(|(row, _)| row == name).unwrap_or_else(|| panic!("no row for `{name}`"));
    let below = |row: usize| rows[row + 1..].iter().map(|(name, _)| name.clone());
    let mut table = BTreeMap::new();
    for (index, (name, may_use)) in rows.iter().enumerate() {
        let (mut uses, mut last) = (BTreeSet::new(), index);
        for word in may_use.split([',', ' ']).filter(|word| !matches!(*word, "" | "and" | "all" | "–")) {
            if word == "below" {
                uses.extend(below(last));
            } else {
                last = place(&format!("spf-{word}"));
                uses.insert(rows[last].0.clone());
            }
        }
        assert!(table.insert(name.clone(), uses).is_none(), "`{name}` has two rows");
    }
    table
}

#[test]
fn a_table_is_read() {
    let document = "| crate | what | may use |\n|---|---|---|\n| `spf` (`crates/cli`) | a | all below |\n\
                    | `spf-top` (`crates/top`) | b | mid and below |\n| `spf-other` (`crates/o`) | c | core |\n\
                    | `spf-mid` (`crates/mid`) | d | low, core |\n| `spf-low` (`crates/low`) | e | – |\n| `spf-core` (`c`) | f | – |\n";
    let told: Vec<String> = allowed(document)
        .into_iter()
        .map(|(name, uses)| format!("{name}: {}", uses.into_iter().collect::<Vec<_>>().join(" ")))
        .collect();
    assert_eq!(
        told,
        [
            "spf: spf-core spf-low spf-mid spf-other spf-top",
            "spf-core: ",
            "spf-low: ",
            "spf-mid: spf-core spf-low",
            "spf-other: spf-core",
            "spf-top: spf-core spf-low spf-mid",
        ]
    );
}

#[test]
fn crates_depend_downwards_only() {
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--format-version", "1", "--no-deps", "--offline"])
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let metadata: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let allowed = allowed(include_str!("../../../../docs/explanation/architecture.md"));
    let packages = metadata["packages"].as_array().unwrap();
    let names: BTreeSet<&str> = packages.iter().map(|package| package["name"].as_str().unwrap()).collect();
    assert_eq!(
        names,
        allowed.keys().map(String::as_str).collect(),
        "the table in docs/explanation/architecture.md has other crates"
    );
    for package in packages {
        let name = package["name"].as_str().unwrap();
        for dependency in package["dependencies"].as_array().unwrap() {
            let on = dependency["name"].as_str().unwrap();
            // A crate's own tests may enable its features.
            if on != name && allowed.contains_key(on) {
                assert!(allowed[name].contains(on), "`{name}` must not use `{on}` (docs/explanation/architecture.md)");
            }
        }
    }
}

//! The matrix of faults and phases, and the page that contains it.

use std::path::Path;
use std::sync::Arc;

use spf_flight::sim::LoadedScene;

use crate::matrix::{Cell, fly_all, tables, tsv};

/// The tables of the page are between these lines.
const BEGIN: &str = "<!-- tables -->\n";
const END: &str = "<!-- end of tables -->\n";

#[test]
fn whatever_fails_in_whatever_phase_nothing_moves_without_a_reason() {
    let cells = Cell::all();
    let flown = fly_all(&cells, &Arc::new(LoadedScene::load("city").unwrap()));
    let mut problems = Vec::new();
    for (cell, flown) in cells.iter().zip(&flown) {
        let found = flown.iter().flat_map(|flown| cell.problems(flown));
        problems.extend(found.map(|problem| format!("{}: {problem}", cell.name())));
    }
    assert!(problems.is_empty(), "{problems:#?}");

    let studies = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/studies");
    let (rows, page) = (studies.join("2026-11-24-fault-matrix.tsv"), studies.join("2026-11-24-fault-matrix.md"));
    let text = std::fs::read_to_string(&page).unwrap();
    let (before, rest) = text.split_once(BEGIN).unwrap();
    let (_, after) = rest.split_once(END).unwrap();
    let written = format!("{before}{BEGIN}\n{}{END}{after}", tables(&cells, &flown));
    if std::env::var_os("INSTA_UPDATE").is_some_and(|update| update == "always") {
        std::fs::write(&rows, tsv(&cells, &flown)).unwrap();
        std::fs::write(&page, &written).unwrap();
    }
    let same =
        std::fs::read_to_string(&rows).unwrap() == tsv(&cells, &flown) && std::fs::read_to_string(&page).unwrap() == written;
    assert!(same, "docs/studies/2026-11-24-fault-matrix.md is old: INSTA_UPDATE=always cargo test -p spf-serve fault_matrix");
}

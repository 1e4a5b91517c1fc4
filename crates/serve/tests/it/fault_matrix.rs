//! The matrix of faults and phases, and the page that contains it.

use std::path::Path;
use std::sync::Arc;

use spf_flight::sim::LoadedScene;

use crate::matrix::{Cell, Column, fly_all, tables, tsv};

/// Flies the matrix of two columns and compares it with a file, and with the tables of the page between two lines.
fn compare(columns: [Column; 2], file: &str, [begin, end]: [&str; 2], command: &str) {
    let cells = Cell::all(columns);
    let flown = fly_all(&cells, &Arc::new(LoadedScene::load("city").unwrap()));
    let mut problems = Vec::new();
    for (cell, flown) in cells.iter().zip(&flown) {
        let found = flown.iter().flat_map(|flown| cell.problems(flown));
        problems.extend(found.map(|problem| format!("{}: {problem}", cell.name())));
    }
    assert!(problems.is_empty(), "{problems:#?}");

    let studies = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/studies");
    let (rows, page) = (studies.join(file), studies.join("2026-11-24-fault-matrix.md"));
    let text = std::fs::read_to_string(&page).unwrap();
    let (before, rest) = text.split_once(begin).unwrap();
    let (_, after) = rest.split_once(end).unwrap();
    let written = format!("{before}{begin}\n{}{end}{after}", tables(columns, &cells, &flown));
    if std::env::var_os("INSTA_UPDATE").is_some_and(|update| update == "always") {
        std::fs::write(&rows, tsv(&cells, &flown)).unwrap();
        std::fs::write(&page, &written).unwrap();
    }
    let same =
        std::fs::read_to_string(&rows).unwrap() == tsv(&cells, &flown) && std::fs::read_to_string(&page).unwrap() == written;
    assert!(same, "docs/studies/2026-11-24-fault-matrix.md is old: INSTA_UPDATE=always cargo test -p spf-serve {command}");
}

#[test]
fn whatever_fails_in_whatever_phase_nothing_moves_without_a_reason() {
    let lines = ["<!-- tables -->\n", "<!-- end of tables -->\n"];
    compare(Column::OTHERS, "2026-11-24-fault-matrix.tsv", lines, "fault_matrix");
}

/// The same for PX4 and ArduPilot behind the MAVLink driver, with what the autopilot was told last.
#[test]
#[ignore = "long: .ci/interop runs it"]
fn whatever_fails_an_autopilot_is_not_moved_without_a_reason_either() {
    let lines = ["<!-- tables of MAVLink -->\n", "<!-- end of tables of MAVLink -->\n"];
    compare(Column::MAVLINK, "2026-11-24-fault-matrix-mavlink.tsv", lines, "--test it -- --ignored fault_matrix");
}

//! The matrix of faults and phases, and the page that contains it.

use std::path::Path;
use std::sync::Arc;

use spf_flight::sim::LoadedScene;

use crate::matrix::{Cell, Column, fly_all, tables, tsv};

/// The rows of the Tello and of the simulated quadcopter.
const OTHERS: &str = "2026-11-24-fault-matrix.tsv";

/// Flies the matrix of two columns and compares it with a file, and with the tables of the page between two lines.
fn compare(columns: [Column; 2], file: &str, [begin, end]: [&str; 2]) {
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
    assert!(
        same,
        "docs/studies/2026-11-24-fault-matrix.md is old: INSTA_UPDATE=always cargo test -p spf-serve --test it -- \
         --ignored fault_matrix"
    );
}

#[test]
#[ignore = "long: .ci/interop runs it"]
fn whatever_fails_in_whatever_phase_nothing_moves_without_a_reason() {
    let lines = ["<!-- tables -->\n", "<!-- end of tables -->\n"];
    compare(Column::OTHERS, OTHERS, lines);
}

#[test]
fn in_every_tenth_cell_nothing_moves_without_a_reason() {
    let cells: Vec<Cell> = Cell::all(Column::OTHERS).into_iter().filter(|cell| cell.left_out().is_none()).step_by(10).collect();
    assert!(cells.len() > 10, "{}", cells.len());
    let flown = fly_all(&cells, &Arc::new(LoadedScene::load("city").unwrap()));
    let problems = cells.iter().zip(&flown).flat_map(|(cell, flown)| flown.iter().flat_map(|flown| cell.problems(flown)));
    assert_eq!(problems.collect::<Vec<_>>(), Vec::<String>::new());
    let rows = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/studies").join(OTHERS)).unwrap();
    for line in tsv(&cells, &flown).lines() {
        assert!(rows.lines().any(|row| row == line), "{OTHERS} is old: {line}");
    }
}

/// The same for PX4 and ArduPilot behind the MAVLink driver, with what the autopilot was told last.
#[test]
#[ignore = "long: .ci/interop runs it"]
fn whatever_fails_an_autopilot_is_not_moved_without_a_reason_either() {
    let lines = ["<!-- tables of MAVLink -->\n", "<!-- end of tables of MAVLink -->\n"];
    compare(Column::MAVLINK, "2026-11-24-fault-matrix-mavlink.tsv", lines);
}

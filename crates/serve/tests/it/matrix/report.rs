//! The matrix as tables.

use std::fmt::Write as _;

use super::column::Column;
use super::faults::{FlightPart, rows};
use super::{Cell, Flown};

/// One line per cell, tab-separated.
pub(crate) fn tsv(cells: &[Cell], flown: &[Option<Flown>]) -> String {
    let mut text =
        "craft\tfault\tphase\tfault begins, s\tlast motion after it, s\toutcome\tcause\tlast command\tcraft at the end"
            .to_owned();
    let autopilot = cells.iter().any(|cell| cell.column.autopilot().is_some());
    text.push_str(if autopilot { "\tautopilot told last\tits flight mode\n" } else { "\n" });
    for (cell, flown) in cells.iter().zip(flown) {
        let name = format!("{}\t{}\t{}", cell.column.name(), cell.row.name, cell.part.name()).to_lowercase();
        let rest = match flown {
            None => format!("\t\tnot flown\t{}\t\t{}", cell.left_out().unwrap_or_default(), if autopilot { "\t\t" } else { "" }),
            Some(flown) => format!(
                "{:.2}\t{}\t{}\t{}\t{}\t{:?}, {:.2} m/s{}{}",
                flown.onset,
                flown.last_motion.map_or("none".to_owned(), |after| format!("{after:.2}")),
                flown.outcome,
                flown.cause,
                flown.last_command,
                flown.phase,
                flown.speed,
                flown.nearest.map_or(String::new(), |nearest| format!("; never nearer than {nearest:.2} m")),
                flown.told.as_ref().map_or(String::new(), |(last, mode)| format!("\t{last}\t{mode}")),
            ),
        };
        writeln!(text, "{name}\t{rest}").unwrap();
    }
    text
}

/// A table per craft: faults down, phases across.
pub(crate) fn tables(columns: [Column; 2], cells: &[Cell], flown: &[Option<Flown>]) -> String {
    let mut text = String::new();
    for column in columns {
        let parts: Vec<&str> = FlightPart::ALL.iter().map(|part| part.name()).collect();
        writeln!(text, "### {}\n\n| fault | {} |\n|---|{}", column.name(), parts.join(" | "), "---|".repeat(parts.len()))
            .unwrap();
        for row in rows() {
            let of = |part: FlightPart| {
                let index = cells.iter().position(|cell| cell.column == column && cell.row.name == row.name && cell.part == part);
                match index.and_then(|index| flown[index].as_ref()) {
                    None => "–".to_owned(),
                    Some(flown) => {
                        let motion = flown.last_motion.map_or("0".to_owned(), |after| format!("{after:.1}"));
                        let told = flown.told.as_ref().map_or(String::new(), |(last, _)| format!("; {last}"));
                        format!("{motion}, {}{told}", flown.outcome)
                    }
                }
            };
            writeln!(text, "| {} | {} |", row.name, FlightPart::ALL.map(of).join(" | ")).unwrap();
        }
        text.push_str("\nNot flown (–):\n\n");
        for row in rows() {
            let cells = cells.iter().filter(|cell| cell.column == column && cell.row.name == row.name);
            if let Some(why) = cells.filter_map(Cell::left_out).next() {
                writeln!(text, "- {}: {why}", row.name).unwrap();
            }
        }
        text.push('\n');
    }
    text
}

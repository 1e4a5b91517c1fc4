//! Output: data to standard output, messages to standard error. The only module that prints.

use std::io::{IsTerminal, Write};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// Prints, and keeps one live line at the bottom when a person watches.
pub(crate) struct Printer {
    live: Option<ProgressBar>,
    json: bool,
}

impl Printer {
    /// `json`: standard output is for one JSON object alone.
    pub(crate) fn new(json: bool) -> Self {
        Self { live: None, json }
    }

    /// Starts the live line; nothing when standard error is no terminal.
    pub(crate) fn start_live(&mut self) {
        if std::io::stderr().is_terminal() {
            let bar = ProgressBar::new_spinner();
            bar.set_draw_target(ProgressDrawTarget::stderr_with_hz(10));
            if let Ok(style) = ProgressStyle::with_template("{spinner} {wide_msg}") {
                bar.set_style(style);
            }
            self.live = Some(bar);
        }
    }

    /// Starts a live line that counts to `total` and says how long it will take; `done` are done already.
    pub(crate) fn start_count(&mut self, total: u64, done: u64) {
        if std::io::stderr().is_terminal() {
            let bar = ProgressBar::new(total).with_position(done);
            bar.set_draw_target(ProgressDrawTarget::stderr_with_hz(10));
            if let Ok(style) = ProgressStyle::with_template("{wide_bar} {pos}/{len}, {eta} left") {
                bar.set_style(style);
            }
            // What was done before says nothing about the speed now.
            bar.reset_eta();
            self.live = Some(bar);
        }
    }

    /// Counts to `done`.
    pub(crate) fn count(&self, done: u64) {
        if let Some(bar) = &self.live {
            bar.set_position(done);
        }
    }

    /// Replaces the live line's text.
    pub(crate) fn live(&self, text: &str) {
        if let Some(bar) = &self.live {
            bar.set_message(harmless(text));
            bar.tick();
        }
    }

    /// Ends the live line.
    pub(crate) fn end_live(&mut self) {
        if let Some(bar) = self.live.take() {
            bar.finish_and_clear();
        }
    }

    /// Talk: progress, warnings. Standard error.
    pub(crate) fn say(&self, text: &str) {
        let text = harmless(text);
        match &self.live {
            Some(bar) => bar.println(text),
            // A closed standard error must not end a flight.
            None => drop(writeln!(std::io::stderr().lock(), "{text}")),
        }
    }

    /// A result for people: standard output, unless that is for JSON.
    pub(crate) fn result(&self, text: &str) {
        if self.json {
            return;
        }
        self.data(&harmless(text));
    }

    /// Whether standard output is for one JSON object alone.
    pub(crate) fn is_json(&self) -> bool {
        self.json
    }

    /// Data: standard output, always. A closed pipe is no error.
    pub(crate) fn data(&self, text: &str) {
        drop(writeln!(std::io::stdout().lock(), "{text}"));
    }
}

/// Control codes made visible: instructions, files and a model's words are text from elsewhere, and a terminal obeys them.
fn harmless(text: &str) -> String {
    text.chars().map(|letter| if letter.is_control() && letter != '\n' { char::REPLACEMENT_CHARACTER } else { letter }).collect()
}

/// Text from elsewhere on one line, so that it cannot pass for another line of ours.
pub(crate) fn one_line(text: &str) -> String {
    text.replace(['\n', '\r'], " ")
}

/// Rows of cells in columns, two spaces between them; the last column is as wide as it is.
pub(crate) fn table(rows: &[Vec<String>]) -> String {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let width = |column: usize| rows.iter().filter_map(|row| row.get(column)).map(|cell| cell.chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..columns).map(width).collect();
    let line = |row: &Vec<String>| {
        let cells: Vec<String> = row.iter().zip(&widths).map(|(cell, width)| format!("{cell:width$}")).collect();
        cells.join("  ").trim_end().to_owned()
    };
    rows.iter().map(line).collect::<Vec<_>>().join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_as_wide_as_their_widest_cell() {
        let rows = [vec!["a".to_owned(), "größer".to_owned()], vec!["bcd".to_owned(), "e".to_owned(), "f".to_owned()]];
        assert_eq!(table(&rows), "a    größer\nbcd  e       f");
        assert_eq!(table(&[]), "");
    }
}

//! Output: data to standard output, messages to standard error. The only module that prints.

use std::io::{IsTerminal, Write};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// Prints output, with a live line at the bottom on a terminal.
pub(crate) struct Printer {
    live: Option<ProgressBar>,
    json: bool,
}

impl Printer {
    /// `json`: standard output is reserved for one JSON object.
    pub(crate) fn new(json: bool) -> Self {
        Self { live: None, json }
    }

    /// Starts the live line, if standard error is a terminal.
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

    /// Starts a live line with a count to `total` and the remaining time; `done` are already complete.
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

    /// Sets the count to `done`.
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

    /// Prints a message (progress, warnings) to standard error.
    pub(crate) fn log(&self, text: &str) {
        let text = harmless(text);
        match &self.live {
            Some(bar) => bar.println(text),
            // A closed standard error must not end a flight.
            None => drop(writeln!(std::io::stderr().lock(), "{text}")),
        }
    }

    /// Prints a result to standard output, unless that is reserved for JSON.
    pub(crate) fn result(&self, text: &str) {
        if self.json {
            return;
        }
        self.data(&harmless(text));
    }

    /// Whether standard output is reserved for one JSON object.
    pub(crate) fn is_json(&self) -> bool {
        self.json
    }

    /// Prints data to standard output in any case. A closed pipe is not an error.
    pub(crate) fn data(&self, text: &str) {
        drop(writeln!(std::io::stdout().lock(), "{text}"));
    }
}

/// Makes control codes visible: instructions, files and replies are external text, which a terminal would interpret.
fn harmless(text: &str) -> String {
    let harmful = |letter: char| letter.is_control() && letter != '\n' || turns_direction(letter);
    text.chars().map(|letter| if harmful(letter) { char::REPLACEMENT_CHARACTER } else { letter }).collect()
}

/// Characters that make a terminal show text in another order than it has (Unicode Bidirectional Algorithm, explicit formatting).
fn turns_direction(letter: char) -> bool {
    matches!(letter, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}' | '\u{200e}' | '\u{200f}' | '\u{061c}')
}

/// Reduces external text to one line, so that it cannot pass for other output.
pub(crate) fn one_line(text: &str) -> String {
    text.replace(['\n', '\r'], " ")
}

/// Formats rows of cells in columns separated by two spaces; the last column is not padded.
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

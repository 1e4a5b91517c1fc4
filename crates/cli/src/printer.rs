//! Output: data to standard output, messages to standard error. The only module that prints.

pub(crate) use spf_api::error::{one_line, quoted};

use std::io::{IsTerminal, Write};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{HumanDuration, ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::stalled;

/// Interval of progress lines when standard error is not a terminal.
const LINE_EVERY: Duration = Duration::from_secs(10);

/// Prints output, with a live line at the bottom on a terminal.
pub(crate) struct Printer {
    live: Live,
    count: Option<Count>,
    json: bool,
}

/// The live line, if there is one.
#[derive(Clone, Default)]
struct Live(Arc<Mutex<Option<ProgressBar>>>);

impl Live {
    fn get(&self) -> Option<ProgressBar> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn set(&self, bar: Option<ProgressBar>) -> Option<ProgressBar> {
        core::mem::replace(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner), bar)
    }

    fn log(&self, text: &str) {
        let text = harmless(text);
        match self.get() {
            Some(bar) => bar.println(text),
            // A closed standard error must not end a flight.
            None => stalled::print(move || drop(writeln!(std::io::stderr().lock(), "{text}"))),
        }
    }
}

/// Prints messages of other threads.
pub(crate) struct Voice(Live);

impl Voice {
    /// Prints a message to standard error.
    pub(crate) fn log(&self, text: &str) {
        self.0.log(text);
    }
}

impl Printer {
    /// `json`: standard output is reserved for one JSON object.
    pub(crate) fn new(json: bool) -> Self {
        Self { live: Live::default(), count: None, json }
    }

    /// Starts the live line, if standard error is a terminal.
    pub(crate) fn start_live(&mut self) {
        if std::io::stderr().is_terminal() {
            let bar = ProgressBar::new_spinner();
            bar.set_draw_target(ProgressDrawTarget::stderr_with_hz(10));
            if let Ok(style) = ProgressStyle::with_template("{spinner} {wide_msg}") {
                bar.set_style(style);
            }
            self.live.set(Some(bar));
        }
    }

    /// Starts a count of `what` to `total` with the remaining time; `done` are already complete. It is a live line on a
    /// terminal, and otherwise a line every ten seconds.
    pub(crate) fn start_count(&mut self, what: &'static str, total: u64, done: u64) {
        let now = Instant::now();
        self.count = Some(Count { what, total, begun: done, since: now, shown: now });
        if std::io::stderr().is_terminal() {
            let bar = ProgressBar::new(total).with_position(done);
            bar.set_draw_target(ProgressDrawTarget::stderr_with_hz(10));
            if let Ok(style) = ProgressStyle::with_template("{wide_bar} {pos}/{len}{msg}") {
                bar.set_style(style);
            }
            self.live.set(Some(bar));
        }
    }

    /// Sets the count to `done`.
    pub(crate) fn count(&mut self, done: u64) {
        self.count_with(done, "");
    }

    /// Sets the count to `done`, and shows `more` behind it.
    pub(crate) fn count_with(&mut self, done: u64, more: &str) {
        let Some(count) = &mut self.count else { return };
        let left = count.left(done, count.since.elapsed());
        let left = left.map_or(String::new(), |left| format!(", {} left", HumanDuration(left))) + more;
        if let Some(bar) = self.live.get() {
            bar.set_message(left);
            bar.set_position(done);
        } else if count.shown.elapsed() >= LINE_EVERY {
            count.shown = Instant::now();
            let line = format!("{done} of {} {}{left}", count.total, count.what);
            self.log(&line);
        }
    }

    /// Whether standard error is a terminal.
    pub(crate) fn has_terminal(&self) -> bool {
        std::io::stderr().is_terminal()
    }

    /// Columns and lines of that terminal, if it tells them.
    pub(crate) fn terminal_size(&self) -> Option<(usize, usize)> {
        #[cfg(unix)]
        {
            let size = rustix::termios::tcgetwinsize(std::io::stderr()).ok()?;
            let (columns, lines) = (usize::from(size.ws_col), usize::from(size.ws_row));
            // Serial lines and some emulators do not know.
            (columns > 0 && lines > 0).then_some((columns, lines))
        }
        #[cfg(not(unix))]
        None
    }

    /// Shows lines in black on white on standard error, a terminal; `over`: in the place of those shown last.
    pub(crate) fn show_code(&self, lines: &[String], over: bool) {
        let mut text = if over { format!("\x1b[{}A", lines.len()) } else { String::new() };
        for line in lines {
            // By number: a theme may show "black" and "white" otherwise.
            text.push_str(&format!("\x1b[38;5;16;48;5;231m{line}\x1b[0m\n"));
        }
        // There is nobody to tell if this fails.
        let mut terminal = std::io::stderr().lock();
        drop(terminal.write_all(text.as_bytes()).and_then(|()| terminal.flush()));
    }

    /// Replaces the live line's text.
    pub(crate) fn live(&self, text: &str) {
        if let Some(bar) = self.live.get() {
            bar.set_message(harmless(text));
            bar.tick();
        }
    }

    /// Ends the live line.
    pub(crate) fn end_live(&mut self) {
        self.count = None;
        if let Some(bar) = self.live.set(None) {
            bar.finish_and_clear();
        }
    }

    /// Prints a message (progress, warnings) to standard error.
    pub(crate) fn log(&self, text: &str) {
        self.live.log(text);
    }

    /// Prints messages of other threads, without disturbing the live line.
    pub(crate) fn voice(&self) -> Voice {
        Voice(self.live.clone())
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
        let text = text.to_owned();
        stalled::print(move || drop(writeln!(std::io::stdout().lock(), "{text}")));
    }
}

/// A count whose progress is shown.
struct Count {
    what: &'static str,
    total: u64,
    /// Number that were complete before the count started, which must not affect the estimated speed.
    begun: u64,
    since: Instant,
    /// When the last line was printed.
    shown: Instant,
}

impl Count {
    /// The remaining time at the mean speed so far; `None` before the first is complete.
    fn left(&self, done: u64, elapsed: Duration) -> Option<Duration> {
        let since = done.checked_sub(self.begun).filter(|since| *since > 0)?;
        Duration::try_from_secs_f64(elapsed.as_secs_f64() / since as f64 * self.total.saturating_sub(done) as f64).ok()
    }
}

/// Makes control codes visible: instructions, files and replies are external text, which a terminal would interpret.
fn harmless(text: &str) -> String {
    let harmful = |letter: char| letter.is_control() && letter != '\n' || turns_direction(letter);
    text.chars().map(|letter| if harmful(letter) { char::REPLACEMENT_CHARACTER } else { letter }).collect()
}

/// Characters that make a terminal show text in another order than it has (Unicode Bidirectional Algorithm, explicit formatting).
pub(crate) fn turns_direction(letter: char) -> bool {
    matches!(letter, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}' | '\u{200e}' | '\u{200f}' | '\u{061c}')
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
    fn the_remaining_time_of_a_resumed_count_does_not_use_what_was_done_before() {
        let now = Instant::now();
        let count = Count { what: "trials", total: 100, begun: 80, since: now, shown: now };
        assert_eq!(count.left(80, Duration::from_secs(5)), None);
        assert_eq!(count.left(90, Duration::from_secs(30)), Some(Duration::from_secs(30)));
        assert_eq!(count.left(100, Duration::from_secs(60)), Some(Duration::ZERO));
    }

    #[test]
    fn columns_are_as_wide_as_their_widest_cell() {
        let rows = [vec!["a".to_owned(), "größer".to_owned()], vec!["bcd".to_owned(), "e".to_owned(), "f".to_owned()]];
        assert_eq!(table(&rows), "a    größer\nbcd  e       f");
        assert_eq!(table(&[]), "");
    }
}

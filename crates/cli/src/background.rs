//! Writing to the terminal from a thread of its own, so that a terminal that does not read (a full pipe, a stopped
//! pager) never delays the caller: on the wall clock that is the loop that flies the drone.

use std::backtrace::{Backtrace, BacktraceStatus};
use std::borrow::Cow;
use std::io::{self, Write};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};
use std::thread::Builder;

use tracing_subscriber::fmt::MakeWriter;

use crate::printer::{Printer, turns_direction};
use crate::stalled::{self, PATIENCE};

/// Maximum number of waiting lines; further ones are lost, and counted.
const WAITING: usize = 1024;
/// Work for the logging thread.
enum Log {
    Lines(Vec<u8>),
    /// Answered once everything before it is written.
    Flush(Sender<()>),
}

static LOG: OnceLock<SyncSender<Log>> = OnceLock::new();
/// Number of log lines lost.
static LOST: AtomicU64 = AtomicU64::new(0);

/// Starts the thread that writes log lines to standard error. Without it they are written directly.
pub(crate) fn start() {
    let (lines, waiting) = sync_channel(WAITING);
    if Builder::new().name("log lines".to_owned()).spawn(move || write_all(&waiting)).is_ok() {
        drop(LOG.set(lines));
        // The message of a panic must not delay the unwinding that lands the drone.
        std::panic::set_hook(Box::new(|panic| {
            let trace = Backtrace::capture();
            let trace = if trace.status() == BacktraceStatus::Captured { format!("\n{trace}") } else { String::new() };
            say(&format!("internal error: {panic}{trace}"));
        }));
    }
}

fn write_all(waiting: &Receiver<Log>) {
    for log in waiting {
        match log {
            Log::Lines(bytes) => {
                // A closed standard error is not an error.
                drop(io::stderr().write_all(&bytes));
                let lost = LOST.swap(0, Ordering::Relaxed);
                if lost > 0 {
                    drop(writeln!(io::stderr(), "{lost} log lines were lost: standard error was blocked"));
                }
            }
            Log::Flush(done) => drop(done.send(())),
        }
    }
}

/// Prints a line to standard error without ever waiting for it.
pub(crate) fn say(text: &str) {
    drop(LogWriter.write_all(format!("{text}\n").as_bytes()));
}

/// Waits until the lines so far are written, at most for a second.
pub(crate) fn flush() {
    let (done, written) = channel();
    if LOG.get().is_some_and(|log| log.try_send(Log::Flush(done)).is_ok()) {
        let _ = written.recv_timeout(PATIENCE);
    }
}

/// A log line without characters that change the direction of writing: it may quote a drone, a model or a file. The log's own
/// colour codes stay; control codes within messages are escaped by `tracing_subscriber`.
fn in_order(line: &[u8]) -> Cow<'_, [u8]> {
    match core::str::from_utf8(line) {
        Ok(text) if text.contains(turns_direction) => text.replace(turns_direction, "\u{fffd}").into_bytes().into(),
        _ => line.into(),
    }
}

/// Writes log lines through the thread.
#[derive(Clone, Copy)]
pub(crate) struct LogWriter;

impl Write for LogWriter {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let line = in_order(bytes);
        match LOG.get() {
            Some(log) => {
                if log.try_send(Log::Lines(line.into_owned())).is_err() {
                    LOST.fetch_add(1, Ordering::Relaxed);
                }
            }
            None => io::stderr().write_all(&line)?,
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl MakeWriter<'_> for LogWriter {
    type Writer = Self;

    fn make_writer(&self) -> Self {
        *self
    }
}

/// A message of a flight's progress.
pub(crate) enum Line {
    /// A line that stays.
    Say(String),
    /// The text of the live line.
    Live(String),
}

/// Passes messages to the printing thread.
pub(crate) struct Lines {
    queue: SyncSender<Line>,
    /// Whether the caller must not wait; messages can then be lost.
    paced: bool,
    lost: u64,
}

impl Lines {
    /// Prints a message, or drops it if the terminal has not read the last ones.
    pub(crate) fn send(&mut self, line: Line) {
        if !self.paced {
            drop(self.queue.send(line));
            return;
        }
        if self.lost > 0
            && self.queue.try_send(Line::Say(format!("{} lines of output lost: the terminal was blocked", self.lost))).is_ok()
        {
            self.lost = 0;
        }
        if self.queue.try_send(line).is_err() {
            self.lost += 1;
        }
    }
}

/// The printing thread of a flight.
pub(crate) struct PrintThread {
    back: Receiver<Printer>,
    json: bool,
    paced: bool,
}

impl PrintThread {
    /// Moves the printer to a thread until [`PrintThread::finish`]. `paced`: the flight is on the wall clock and must not
    /// wait.
    pub(crate) fn start(printer: Printer, paced: bool) -> (Self, Lines) {
        let json = printer.is_json();
        let (queue, waiting) = sync_channel(WAITING);
        let (returned, back) = channel();
        let print = move || {
            for line in waiting {
                match line {
                    Line::Say(text) => printer.log(&text),
                    Line::Live(text) => printer.live(&text),
                }
            }
            drop(returned.send(printer));
        };
        // Without a thread nothing is printed; the flight and its files do not depend on it.
        if let Err(error) = Builder::new().name("progress".to_owned()).spawn(print) {
            tracing::warn!(%error, "progress is not shown");
        }
        (Self { back, json, paced }, Lines { queue, paced, lost: 0 })
    }

    /// The printer, once everything is printed; a new one if the terminal does not read. The [`Lines`] must have been
    /// dropped.
    pub(crate) fn finish(self) -> Printer {
        let printer = if self.paced { self.back.recv_timeout(PATIENCE).ok() } else { self.back.recv().ok() };
        stalled::set(printer.is_none());
        printer.unwrap_or_else(|| Printer::new(self.json))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_log_line_changes_the_direction_of_writing() {
        let line = "WARN the drone answered `\u{202e}ok\u{2066}\u{200f}`\n".as_bytes();
        assert_eq!(in_order(line), "WARN the drone answered `\u{fffd}ok\u{fffd}\u{fffd}`\n".as_bytes());
        for line in [b"\x1b[33mWARN\x1b[0m ok\n".as_slice(), "naïve – שלום\n".as_bytes(), b"\xff\n"] {
            assert_eq!(in_order(line), line);
        }
    }
}

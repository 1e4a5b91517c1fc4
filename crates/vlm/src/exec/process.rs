//! The process of a program: its pipes, each with a thread, and its end.

use std::io::{BufRead, BufReader, Read, Write};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::Builder;
use std::time::Instant;

use spf_core::time::Duration;

use crate::error::{brief, quote};

/// Maximum length of a line, bytes.
const LONGEST_LINE: u64 = 1 << 20;
/// Most lines that wait to be read: a program that prints more waits itself, and does not fill the memory.
const WAITING: usize = 16;
/// Time that a program has to end by itself once its input is closed.
const EXIT_GRACE: Duration = Duration::from_millis(500);

/// What a program printed.
pub(super) enum Said {
    /// A line.
    Line(String),
    /// Its output has ended.
    End,
}

/// A running program. Dropping it closes its input, then kills it.
pub(super) struct Running {
    child: Child,
    /// `None` once its input is closed.
    requests: Option<Sender<String>>,
    lines: Receiver<Said>,
    last_error: Arc<Mutex<String>>,
    /// Disconnected once standard error has been read to its end.
    errors_read: Receiver<()>,
    /// When it was started.
    pub(super) started: Instant,
    /// Whether it has answered a request.
    pub(super) answered: bool,
}

impl Running {
    /// Starts a program with arguments, in a process group of its own: Ctrl-C is not meant for it, and whatever it
    /// started can be killed with it.
    pub(super) fn start(words: &[String]) -> std::io::Result<Self> {
        let (program, args) = words.split_first().ok_or(std::io::ErrorKind::InvalidInput)?;
        let mut command = Command::new(program);
        command.args(args).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let mut child = command.spawn()?;
        let (requests, to_write) = channel::<String>();
        let (said, lines) = sync_channel(WAITING);
        let last_error = Arc::new(Mutex::new(String::new()));
        let (reading, errors_read) = channel::<()>();
        let pipes = (child.stdin.take(), child.stdout.take(), child.stderr.take());
        let running = Self {
            child,
            requests: Some(requests),
            lines,
            last_error: last_error.clone(),
            errors_read,
            started: Instant::now(),
            answered: false,
        };
        let (Some(mut stdin), Some(stdout), Some(stderr)) = pipes else { return Err(std::io::ErrorKind::BrokenPipe.into()) };
        Builder::new().name("exec in".to_owned()).spawn(move || {
            for line in to_write {
                if writeln!(stdin, "{line}").and_then(|()| stdin.flush()).is_err() {
                    return;
                }
            }
        })?;
        Builder::new().name("exec out".to_owned()).spawn(move || {
            let mut stdout = BufReader::new(stdout);
            while let Some(line) = next_line(&mut stdout) {
                if said.send(Said::Line(line)).is_err() {
                    return;
                }
            }
            // An error means that the receiver is gone.
            drop(said.send(Said::End));
        })?;
        Builder::new().name("exec err".to_owned()).spawn(move || {
            let _reading = reading;
            let mut stderr = BufReader::new(stderr);
            while let Some(line) = next_line(&mut stderr) {
                let line = quote(&line);
                tracing::debug!("exec: {line}");
                if !line.is_empty() {
                    *last_error.lock().unwrap_or_else(PoisonError::into_inner) = brief(line);
                }
            }
        })?;
        Ok(running)
    }

    /// Sends a line. A program that has ended is noticed when its answer is awaited.
    pub(super) fn send(&self, line: String) {
        drop(self.requests.as_ref().map(|requests| requests.send(line)));
    }

    /// The next line, or the end of the output; `None` after `wait`.
    pub(super) fn next(&self, wait: Duration) -> Option<Said> {
        match self.lines.recv_timeout(wait) {
            Ok(said) => Some(said),
            Err(RecvTimeoutError::Timeout) => None,
            Err(RecvTimeoutError::Disconnected) => Some(Said::End),
        }
    }

    /// Drops the lines printed so far.
    pub(super) fn discard(&self) {
        while let Ok(Said::Line(line)) = self.lines.try_recv() {
            tracing::debug!("exec: unsolicited output: {}", brief(quote(&line)));
        }
    }

    /// Why the program has ended; `None` if it has not.
    pub(super) fn ended(&mut self) -> Option<String> {
        self.child.try_wait().ok().flatten().map(|_| self.why_ended())
    }

    /// How the program ended, with its last message. Its output must have ended.
    pub(super) fn why_ended(&mut self) -> String {
        let status =
            self.wait(EXIT_GRACE).map_or_else(|| "it closed its output".to_owned(), |status| format!("it ended with {status}"));
        // Its last message may still be on the way; a child that it left behind may keep the pipe open.
        let _ = self.errors_read.recv_timeout(EXIT_GRACE);
        match self.last_error.lock().unwrap_or_else(PoisonError::into_inner).as_str() {
            "" => status,
            words => format!("{status}; its last message: {words}"),
        }
    }

    fn wait(&mut self, time: Duration) -> Option<std::process::ExitStatus> {
        let began = Instant::now();
        loop {
            match self.child.try_wait() {
                Ok(Some(status)) => return Some(status),
                Ok(None) if began.elapsed() < time => std::thread::sleep(Duration::from_millis(5)),
                _ => return None,
            }
        }
    }

    /// Kills the program and what it started.
    pub(super) fn kill(&mut self) {
        #[cfg(unix)]
        {
            // The whole group: a script may have started the program that hangs.
            let group = rustix::process::Pid::from_child(&self.child);
            let _ = rustix::process::kill_process_group(group, rustix::process::Signal::KILL);
        }
        // An error means that it has ended.
        drop(self.child.kill());
        drop(self.child.wait());
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        // A program that has never answered may be loading for minutes more.
        self.requests = None;
        if self.wait(if self.answered { EXIT_GRACE } else { Duration::ZERO }).is_none() {
            self.kill();
        }
    }
}

/// The next line, of limited length; `None` at the end.
fn next_line(from: &mut impl BufRead) -> Option<String> {
    let mut line = Vec::new();
    let read = from.take(LONGEST_LINE).read_until(b'\n', &mut line).ok()?;
    (read > 0).then(|| String::from_utf8_lossy(&line).trim_end().to_owned())
}

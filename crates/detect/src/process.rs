//! A network in a process of its own, whose memory and time are bounded.

use std::ffi::OsString;
use std::io::{BufReader, BufWriter};
use std::path::PathBuf;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use crate::bounds::Bounds;
use crate::error::NetworkError;
use crate::exchange::{Description, Input, Output};
use crate::wire::{self, Reply};
use crate::worker::ARGUMENT;

/// Number of runs of the trial before a flight.
const TRIAL: u64 = 2;

/// Where a network is run.
#[derive(Clone, Debug)]
pub enum Place {
    /// In this process, without bounds: for models that you trust, and tests.
    Here,
    /// In a process of its own, which runs [`crate::worker::serve`].
    Process {
        /// The program.
        program: PathBuf,
        /// Its arguments.
        args: Vec<OsString>,
        /// What the network may use.
        bounds: Bounds,
    },
}

impl Place {
    /// In a process of the same program, which must call [`crate::worker::serve`] if its first argument is [`ARGUMENT`].
    ///
    /// # Errors
    /// If the path of this program cannot be determined.
    pub fn this_program(bounds: Bounds) -> std::io::Result<Self> {
        let args = vec![ARGUMENT.into(), bounds.memory.to_string().into()];
        Ok(Self::Process { program: std::env::current_exe()?, args, bounds })
    }
}

/// A network in another process.
pub(crate) struct Remote {
    bounds: Bounds,
    line: Mutex<Line>,
}

/// The process and its pipes.
struct Line {
    child: Child,
    to: Option<BufWriter<ChildStdin>>,
    replies: Receiver<Reply>,
    /// How often it has run.
    runs: u64,
    /// Why it was ended; whoever asks again gets the same reason.
    ended: Option<String>,
}

impl Remote {
    /// Starts the process and loads a model.
    pub(crate) fn load(
        model: &[u8],
        program: &std::path::Path,
        args: &[OsString],
        bounds: Bounds,
    ) -> Result<(Self, Description), NetworkError> {
        let started = |error: std::io::Error| NetworkError::Load(format!("cannot start its process: {error}"));
        let mut command = Command::new(program);
        command.args(args).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::null());
        // Ctrl-C on a terminal is for the flight, which lands before it ends this process.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let mut child = command.spawn().map_err(started)?;
        let to = child.stdin.take().map(BufWriter::new);
        let (sender, replies) = mpsc::sync_channel(1);
        if let Some(from) = child.stdout.take() {
            let mut from = BufReader::new(from);
            std::thread::spawn(move || {
                while let Ok(Some((kind, bytes))) = wire::receive(&mut from, wire::MAX_FROM) {
                    let Some(reply) = Reply::decode(kind, &bytes) else { return };
                    if sender.send(reply).is_err() {
                        return;
                    }
                }
            });
        }
        let mut line = Line { child, to, replies, runs: 0, ended: None };
        match line.ask(model, bounds, bounds.load).map_err(NetworkError::Load)? {
            Reply::Loaded(description) => Ok((Self { bounds, line: Mutex::new(line) }, description)),
            Reply::Failed(error) => Err(error),
            Reply::Ran(_) => Err(NetworkError::Load("its process answers out of turn".to_owned())),
        }
    }

    /// Runs it.
    pub(crate) fn run(&self, input: Input<'_>) -> Result<Output, NetworkError> {
        let mut line = self.line.lock().unwrap_or_else(PoisonError::into_inner);
        let time = if line.runs >= TRIAL { self.bounds.run } else { self.bounds.load };
        match line.ask(&wire::input(input), self.bounds, time).map_err(NetworkError::Run)? {
            Reply::Ran(output) => {
                line.runs += 1;
                Ok(output)
            }
            Reply::Failed(error) => Err(error),
            Reply::Loaded(_) => Err(NetworkError::Run("its process answers out of turn".to_owned())),
        }
    }
}

impl Line {
    /// Sends a message and waits for the reply. A process that does not reply in time is ended.
    fn ask(&mut self, payload: &[u8], bounds: Bounds, time: Duration) -> Result<Reply, String> {
        if let Some(why) = &self.ended {
            return Err(why.clone());
        }
        let reply = self.exchange(payload, bounds, time);
        self.ended = reply.as_ref().err().cloned();
        reply
    }

    fn exchange(&mut self, payload: &[u8], bounds: Bounds, time: Duration) -> Result<Reply, String> {
        let Some(to) = &mut self.to else { return Err("its process has ended".to_owned()) };
        // A process that has ended takes nothing; why it has, its status says.
        if wire::send(to, b'>', payload).is_ok() {
            match self.replies.recv_timeout(time) {
                Ok(reply) => return Ok(reply),
                Err(RecvTimeoutError::Timeout) => {
                    self.end();
                    return Err(format!("it takes longer than {} s", time.as_secs_f64()));
                }
                Err(RecvTimeoutError::Disconnected) => {}
            }
        }
        // One that sends what is no reply, or too much of it, is still there.
        let status = self.end();
        let gib = bounds.memory as f64 / f64::from(1 << 30);
        let mib = wire::MAX_FROM >> 20;
        let size = if gib < 1.0 { format!("{:.0} MiB", 1024.0 * gib) } else { format!("{gib:.0} GiB") };
        Err(format!(
            "its process ended ({status}): it needs more than {size} of memory, its output exceeds {mib} MiB, or it crashed"
        ))
    }

    /// Ends the process, if it has not ended by itself, and says how it ended.
    fn end(&mut self) -> String {
        self.to = None;
        // It ends by itself when its input does; one that has aborted needs a moment until its status is known.
        for _ in 0..50 {
            if let Ok(Some(status)) = self.child.try_wait() {
                return status.to_string();
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        drop(self.child.kill());
        self.child.wait().map_or_else(|error| error.to_string(), |status| status.to_string())
    }
}

impl Drop for Line {
    fn drop(&mut self) {
        self.to = None;
        drop(self.child.kill());
        drop(self.child.wait());
    }
}

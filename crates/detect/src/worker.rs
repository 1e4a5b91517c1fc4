//! The process of a network: it receives a model and inputs, and sends outputs, within a limit of memory.
//!
//! A model is a program of its author's: it may ask for any amount of memory and time, on loading too. In a process of its own it
//! can be ended whatever it does.

use std::io::{self, Write};
use std::process::ExitCode;
use std::sync::mpsc;

use crate::bounds::Bounds;
use crate::error::NetworkError;
use crate::network::Network;
use crate::wire::{self, Reply};

/// The argument with which a program runs [`serve`] in place of anything else.
pub const ARGUMENT: &str = "detector-process";

/// Serves the network whose model arrives on standard input, until that ends. The second argument of the process is its limit of
/// memory, as [`crate::Place::this_program`] gives it.
#[must_use]
pub fn serve() -> ExitCode {
    let memory = std::env::args().nth(2).and_then(|text| text.parse().ok()).unwrap_or(Bounds::default().memory);
    limit(memory);
    yield_to_others();
    match answer(&mut io::stdout().lock()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(_) => ExitCode::FAILURE,
    }
}

/// Limits what this process may allocate. An allocation beyond it ends the process.
fn limit(memory: u64) {
    #[cfg(unix)]
    {
        use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
        let maximum = getrlimit(Resource::Data).maximum.map_or(memory, |maximum| maximum.min(memory));
        // Without it the time is still bounded.
        let _is_limited = setrlimit(Resource::Data, Rlimit { current: Some(maximum), maximum: Some(maximum) });
    }
    #[cfg(not(unix))]
    let _ = memory;
}

/// Lets other processes go first: the flight must not wait for a network.
fn yield_to_others() {
    // Without it the network is no faster, and the flight a little later.
    #[cfg(unix)]
    let _is_lower = rustix::process::nice(5);
}

fn answer(to: &mut impl Write) -> io::Result<()> {
    let inbox = read_ahead();
    let Ok(model) = inbox.recv() else { return Ok(()) };
    let network = match Network::load(model) {
        Ok(network) => network,
        Err(error) => return reply(to, &Reply::Failed(error)),
    };
    reply(to, &Reply::Loaded(network.description().clone()))?;
    for bytes in inbox {
        let mut values = Vec::new();
        let ran = match wire::to_input(&bytes, &mut values) {
            Some(input) => network.run(input),
            None => Err(NetworkError::Run("its process got no input".to_owned())),
        };
        reply(to, &ran.map_or_else(Reply::Failed, Reply::Ran))?;
    }
    Ok(())
}

fn reply(to: &mut impl Write, reply: &Reply) -> io::Result<()> {
    let (kind, bytes) = reply.encode();
    wire::send(to, kind, &bytes)
}

/// Reads in a thread of its own, which ends the process when nobody listens any more, whatever the network is doing.
fn read_ahead() -> mpsc::Receiver<Vec<u8>> {
    let (sender, receiver) = mpsc::sync_channel(1);
    std::thread::spawn(move || {
        let mut from = io::stdin().lock();
        while let Ok(Some((_, bytes))) = wire::receive(&mut from, wire::MAX_TO) {
            if sender.send(bytes).is_err() {
                return;
            }
        }
        #[allow(clippy::exit, reason = "a network that is running cannot be told to stop")]
        std::process::exit(0);
    });
    receiver
}

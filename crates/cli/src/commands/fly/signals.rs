//! Signals during a flight: those that land it, and those that must not end it.

use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, OnceLock};

use spf_drone::abandon;

use super::manual;
use crate::background;
use crate::error::CliError;
use crate::exit::Exit;

/// The count of this process, once something listens; its handlers stay for good.
static COUNT: OnceLock<Arc<AtomicU32>> = OnceLock::new();
/// Whether other signals are listened to.
static OTHERS: OnceLock<()> = OnceLock::new();

/// Counts Ctrl-C presses, SIGTERM and SIGHUP. The first one ends the work in an orderly fashion; the second one exits
/// without waiting for the files, after landing a real drone; the third one exits at once.
pub(crate) fn interrupts() -> Result<Arc<AtomicU32>, CliError> {
    if let Some(count) = COUNT.get() {
        return Ok(count.clone());
    }
    let count = Arc::new(AtomicU32::new(0));
    let counted = count.clone();
    ctrlc::set_handler(move || interrupt(&counted)).map_err(|error| cannot_listen(&error))?;
    Ok(COUNT.get_or_init(|| count).clone())
}

/// The same for a flight, which SIGQUIT lands too. Other signals that would end the process, and with a `real` drone those
/// that would suspend it, are ignored.
pub(crate) fn flight_interrupts(real: bool) -> Result<Arc<AtomicU32>, CliError> {
    let count = interrupts()?;
    // A program flies with one drone, real or not, also if it flies several times.
    if OTHERS.get().is_none() {
        others(real, count.clone()).map_err(|error| cannot_listen(&error))?;
        OTHERS.get_or_init(|| ());
    }
    Ok(count)
}

fn cannot_listen(error: &dyn std::error::Error) -> CliError {
    CliError::internal("cannot listen for Ctrl-C").because(error)
}

fn interrupt(count: &AtomicU32) {
    let before = count.fetch_add(1, Ordering::Relaxed);
    if before == 1 && abandon::is_any_connected() {
        // On its own thread, so that a third Ctrl-C is handled.
        drop(std::thread::Builder::new().name("landing".to_owned()).spawn(land_and_exit));
    } else if before > 0 {
        background::say("ended by the second Ctrl-C; files being written are incomplete");
        background::flush();
        manual::restore();
        #[allow(clippy::exit, reason = "a second Ctrl-C exits at once")]
        std::process::exit(Exit::Aborted as i32);
    }
}

/// Signals of Linux that `signal_hook` has no name for, and those without a meaning, from the first that the C libraries leave free.
#[cfg(target_os = "linux")]
const SIGSTKFLT: i32 = 16;
#[cfg(target_os = "linux")]
const SIGPWR: i32 = 30;
#[cfg(target_os = "linux")]
const REAL_TIME: core::ops::RangeInclusive<i32> = 35..=64;

/// Lands without the flight loop, which may be stuck, and exits.
fn land_and_exit() {
    background::say("landing the drone; pressing Ctrl-C again ends the program at once and leaves the drone uncontrolled");
    abandon::land_all();
    background::flush();
    manual::restore();
    #[allow(clippy::exit, reason = "a second Ctrl-C asks for exactly this")]
    std::process::exit(Exit::Aborted as i32);
}

#[cfg(unix)]
fn others(real: bool, count: Arc<AtomicU32>) -> std::io::Result<()> {
    use signal_hook::consts::{
        SIGABRT, SIGALRM, SIGIO, SIGPROF, SIGQUIT, SIGSYS, SIGTRAP, SIGTSTP, SIGTTIN, SIGTTOU, SIGUSR1, SIGUSR2, SIGVTALRM,
        SIGXCPU, SIGXFSZ,
    };
    use signal_hook::iterator::Signals;

    // An abort of this program itself ends it all the same: it takes the handler away.
    let mut kinds =
        vec![SIGABRT, SIGALRM, SIGIO, SIGPROF, SIGQUIT, SIGSYS, SIGTRAP, SIGUSR1, SIGUSR2, SIGVTALRM, SIGXCPU, SIGXFSZ];
    #[cfg(target_os = "linux")]
    kinds.extend([SIGSTKFLT, SIGPWR].into_iter().chain(REAL_TIME));
    if real {
        // A suspended program cannot control anything.
        kinds.extend([SIGTSTP, SIGTTIN, SIGTTOU]);
    }
    let mut signals = Signals::new(kinds)?;
    let listen = move || {
        for signal in signals.forever() {
            match signal {
                SIGQUIT => interrupt(&count),
                SIGTSTP => background::say("Ctrl-Z does not suspend a flight; Ctrl-C lands"),
                _ => {
                    #[cfg(debug_assertions)]
                    super::drill::hear(signal);
                    tracing::debug!(signal, "ignored in flight");
                }
            }
        }
    };
    std::thread::Builder::new().name("signals".to_owned()).spawn(listen).map(drop)
}

#[cfg(not(unix))]
fn others(_real: bool, _count: Arc<AtomicU32>) -> std::io::Result<()> {
    Ok(())
}

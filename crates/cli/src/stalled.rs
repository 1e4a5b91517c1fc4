//! A terminal that does not read what is printed, as a stopped pager or a full pipe: the end of a flight does not wait for it.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::channel;
use std::thread::Builder;
use std::time::Duration;

/// Maximum wait for the terminal at the end of the program or of a flight.
pub(crate) const PATIENCE: Duration = Duration::from_secs(1);

static STALLED: AtomicBool = AtomicBool::new(false);

/// Notes whether the terminal did not read what a flight had printed.
pub(crate) fn set(stalled: bool) {
    STALLED.store(stalled, Ordering::Relaxed);
}

/// Prints something; beside a terminal that does not read, from a thread of its own, for which it waits a second at most.
pub(crate) fn print(print: impl FnOnce() + Send + 'static) {
    if !STALLED.load(Ordering::Relaxed) {
        return print();
    }
    let (done, printed) = channel();
    let print = move || {
        print();
        let _ = done.send(());
    };
    if Builder::new().name("output".to_owned()).spawn(print).is_ok() {
        let _ = printed.recv_timeout(PATIENCE);
    }
}

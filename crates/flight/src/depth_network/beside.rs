//! Work in a thread of its own, for flights on the wall clock.

use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::Builder;
use std::time::Instant;

use spf_core::time::Duration;

/// The newest item, if it was not taken yet.
struct Newest<T> {
    item: Option<T>,
    closed: bool,
}

struct Slot<T> {
    newest: Mutex<Newest<T>>,
    news: Condvar,
}

impl<T> Slot<T> {
    fn newest(&self) -> MutexGuard<'_, Newest<T>> {
        // The value is consistent between calls.
        self.newest.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits for an item, which is the newest at `due` or later; `None` when closed.
    fn take(&self, due: Instant) -> Option<T> {
        let mut newest = self.newest();
        while !newest.closed {
            let early = due.saturating_duration_since(Instant::now());
            if early.is_zero()
                && let Some(item) = newest.item.take()
            {
                return Some(item);
            }
            // Items that arrive meanwhile wake it too.
            let wait = if early.is_zero() { Duration::from_secs(1) } else { early };
            newest = self.news.wait_timeout(newest, wait).unwrap_or_else(PoisonError::into_inner).0;
        }
        None
    }
}

/// Work beside the flight loop, which it never delays: the loop only leaves the newest item. The thread ends when this is dropped,
/// after the item that it is working on, for which nobody waits.
pub(super) struct Beside<T, R> {
    slot: Arc<Slot<T>>,
    done: Receiver<R>,
}

impl<T: Send + 'static, R: Send + 'static> Beside<T, R> {
    /// Starts the thread, which begins with an item `period` after the one before at the earliest.
    ///
    /// # Errors
    /// The operating system's error if the thread cannot be started.
    pub(super) fn start(
        name: &str,
        period: Duration,
        mut work: impl FnMut(T) -> Option<R> + Send + 'static,
    ) -> std::io::Result<Self> {
        let slot = Arc::new(Slot { newest: Mutex::new(Newest { item: None, closed: false }), news: Condvar::new() });
        let (of_thread, (results, done)) = (slot.clone(), channel());
        Builder::new().name(name.to_owned()).spawn(move || {
            let mut due = Instant::now();
            while let Some(item) = of_thread.take(due) {
                due = Instant::now() + period;
                if let Some(result) = work(item)
                    && results.send(result).is_err()
                {
                    return;
                }
            }
        })?;
        Ok(Self { slot, done })
    }

    /// Leaves an item.
    pub(super) fn put(&self, item: T) {
        self.slot.newest().item = Some(item);
        self.slot.news.notify_one();
    }

    /// A result that is there.
    pub(super) fn take(&self) -> Option<R> {
        self.done.try_recv().ok()
    }
}

impl<T, R> Drop for Beside<T, R> {
    fn drop(&mut self) {
        let mut newest = self.slot.newest();
        (newest.closed, newest.item) = (true, None);
        drop(newest);
        self.slot.news.notify_one();
    }
}

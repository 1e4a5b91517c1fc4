//! A question as it is put to a [`Vlm`](crate::Vlm), and how it is taken back.

use std::sync::Arc;

use spf_core::query::Query;
use spf_core::time::Duration;
use tokio::sync::watch;

/// A query with the time that is left for it.
#[derive(Clone, Debug)]
pub struct Asked<'a> {
    /// The query.
    pub query: &'a Query,
    /// How long its answer is waited for, from now.
    pub time_left: Duration,
    /// Takes it back.
    pub cancel: Cancel,
}

impl<'a> Asked<'a> {
    /// A query that nobody will take back.
    #[must_use]
    pub fn new(query: &'a Query, time_left: Duration) -> Self {
        Self { query, time_left, cancel: Cancel::default() }
    }
}

/// Takes a question back, from any thread; clones are the same switch.
#[derive(Clone, Debug)]
pub struct Cancel(Arc<watch::Sender<bool>>);

impl Default for Cancel {
    fn default() -> Self {
        Self(Arc::new(watch::Sender::new(false)))
    }
}

impl Cancel {
    /// The answer is no longer wanted.
    pub fn cancel(&self) {
        self.0.send_replace(true);
    }

    /// Whether it is no longer wanted.
    #[must_use]
    pub fn is_cancelled(&self) -> bool {
        *self.0.borrow()
    }

    /// Returns when it is no longer wanted, and never otherwise.
    pub(crate) async fn cancelled(&self) {
        let mut seen = self.0.subscribe();
        // The sender lives in `self`, so that waiting cannot fail.
        let _ = seen.wait_for(|cancelled| *cancelled).await;
    }
}

//! A query as passed to a [`Vlm`](crate::Vlm), with its time limit and cancellation.

use std::sync::Arc;

use spf_core::query::Query;
use spf_core::time::Duration;
use tokio::sync::watch;

/// A query with its remaining time.
#[derive(Clone, Debug)]
pub struct QueryRequest<'a> {
    /// The query.
    pub query: &'a Query,
    /// Remaining time for the reply.
    pub time_left: Duration,
    /// Cancels the query.
    pub cancel: Cancel,
}

impl<'a> QueryRequest<'a> {
    /// A query that is never cancelled.
    #[must_use]
    pub fn new(query: &'a Query, time_left: Duration) -> Self {
        Self { query, time_left, cancel: Cancel::default() }
    }
}

/// Cancels a query, from any thread; clones share the same state.
#[derive(Clone, Debug)]
pub struct Cancel(Arc<watch::Sender<bool>>);

impl Default for Cancel {
    fn default() -> Self {
        Self(Arc::new(watch::Sender::new(false)))
    }
}

impl Cancel {
    /// Cancels the query.
    pub fn cancel(&self) {
        self.0.send_replace(true);
    }

    /// Whether the query was cancelled.
    #[must_use]
    pub fn is_cancelled(&self) -> bool {
        *self.0.borrow()
    }

    /// Returns when the query is cancelled, and never otherwise.
    pub(crate) async fn cancelled(&self) {
        let mut seen = self.0.subscribe();
        // `self` holds the sender, so waiting cannot fail.
        let _ = seen.wait_for(|cancelled| *cancelled).await;
    }
}

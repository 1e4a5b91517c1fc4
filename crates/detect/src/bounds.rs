//! What the process of a network may use.

use std::time::Duration;

/// What a network may use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bounds {
    /// Memory, bytes. The limit is one of Linux; on other systems the time alone is bounded.
    pub memory: u64,
    /// Time to load it and to run it for the first time, each.
    pub load: Duration,
    /// Time of every later run.
    pub run: Duration,
}

impl Default for Bounds {
    fn default() -> Self {
        // YOLOv8x, the largest of its family (68 million weights), needs 0.9 GiB.
        Self { memory: 4 << 30, load: Duration::from_secs(60), run: Duration::from_secs(10) }
    }
}

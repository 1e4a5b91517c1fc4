//! What the process of a network may use.

use std::time::Duration;

/// Maximum size of a model file, bytes.
pub const MAX_MODEL: u64 = 512 << 20;
/// Maximum side length of a network's input, pixels.
pub const MAX_SIDE: usize = 4096;

/// What a network may use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bounds {
    /// Memory, bytes. The limit is one of Linux; on other systems the time alone is bounded.
    pub memory: u64,
    /// Time to load it, and for each of the two runs of its trial.
    pub load: Duration,
    /// Time of every later run.
    pub run: Duration,
}

impl Bounds {
    /// Of a network that estimates depth beside a flight: a depth of a frame that is older than this is of no use.
    pub const DEPTH: Self = Self { memory: 4 << 30, load: Duration::from_secs(60), run: Duration::from_secs(5) };
}

impl Default for Bounds {
    fn default() -> Self {
        // YOLOv8x, the largest of its family (68 million weights), needs 0.9 GiB.
        Self { memory: 4 << 30, load: Duration::from_secs(60), run: Duration::from_secs(10) }
    }
}

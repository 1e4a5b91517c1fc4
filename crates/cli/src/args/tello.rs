//! What can be typed after `spf tello`.

use std::path::PathBuf;

use clap::{Args, Subcommand};

/// A DJI Tello.
#[derive(Debug, Subcommand)]
pub(crate) enum Tello {
    /// Measure what full stick does, in flight, for spf.toml
    Calibrate(Calibrate),
}

/// Flies a Tello for some 45 s and measures what full stick does.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  spf tello calibrate >> spf.toml
  spf tello calibrate --drone tello@127.0.0.1

It takes off, turns by some two thirds of a round, climbs and sinks by some 1 m, and flies ahead and back by some 1.3 m, each at half stick: keep 3 m \
ahead and 2 m above free. What it tells of itself is compared before and after, so its heights (steps of 10 cm) and speeds (steps of \
10 cm/s) limit what is measured; docs/guide/tello.md says how well. Ctrl-C lands.")]
pub(crate) struct Calibrate {
    /// The drone: tello, or tello@ADDRESS [default: tello]
    #[arg(long, value_name = "DRONE")]
    pub(crate) drone: Option<String>,
    /// Configuration file [default: spf.toml here]
    #[arg(long, value_name = "FILE")]
    pub(crate) config: Option<PathBuf>,
}

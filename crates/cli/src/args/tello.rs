//! Arguments of `spf tello`.

use clap::{Args, Subcommand};

use super::taken::OfTello;
use crate::settings::Flags;

/// A DJI Tello.
#[derive(Debug, Subcommand)]
pub(crate) enum Tello {
    /// Calibrate the stick response in flight, and print it for spf.toml
    Calibrate(Calibrate),
    /// Show the state of a Tello, and whether it is in the air
    Status(TelloAddress),
    /// Land a Tello that another program left in the air
    Land(TelloAddress),
    /// Command zero velocity: the Tello hovers, and lands by itself after 15 s
    Stop(TelloAddress),
}

/// Connects to a Tello without flying it.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  spf tello status
  spf tello land
  spf tello land --drone tello@127.0.0.1
  spf tello stop

`status` exits with code 6 if the telemetry does not show whether the Tello is on the ground or in the air. `land` repeats the command until the telemetry shows the motors off, for at most 25 s, and exits with code 6 if they are \
still running. All three commands (status, land and stop) work even while the program that flew the drone is running or \
hangs; its commands compete with them.")]
pub(crate) struct TelloAddress {
    #[command(flatten)]
    pub(crate) settings: Flags<OfTello>,
}

/// Flies a Tello for about 45 s and calibrates its stick response.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  spf tello calibrate >> spf.toml
  spf tello calibrate --drone tello@127.0.0.1

The drone takes off, yaws by about 240 degrees, climbs and descends by about 1 m, and flies forward and back by about 1.3 m, \
each at half stick: leave 3 m of free space ahead and 2 m above. The speeds printed are those at full stick, calculated from the \
motion that the drone reports. Their accuracy is limited by the telemetry's resolution (10 cm in height, 10 cm/s in speed); \
docs/guide/tello.md gives figures. Ctrl-C lands.")]
pub(crate) struct Calibrate {
    #[command(flatten)]
    pub(crate) settings: Flags<OfTello>,
}

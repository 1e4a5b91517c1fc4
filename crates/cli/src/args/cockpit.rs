//! Arguments of `spf cockpit`.

use std::path::PathBuf;

use clap::Args;

use super::{FlightArgs, Fly};

/// Opens the cockpit and flies what is typed there, one flight after the other, until Ctrl-C.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  spf cockpit
  spf cockpit --scene park --vlm human
  spf cockpit --view flights

The flags are those of `spf fly`. The address to open is printed; what follows its `#` gives the right to fly.")]
pub(crate) struct Cockpit {
    /// Only show the recorded flights of this folder
    #[arg(long, value_name = "DIR")]
    pub(crate) view: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) flight: FlightArgs,
}

impl Cockpit {
    /// The flight of an instruction with these flags.
    pub(crate) fn flight(&self, instruction: String) -> Fly {
        Fly { instruction, anyway: false, flight: self.flight.clone() }
    }
}

//! Arguments of `spf cockpit`.

use std::path::PathBuf;

use clap::Args;

use super::{CameraArgs, Fly, LimitArgs, MethodArgs, OutputArgs, WorldArgs};

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
    pub(crate) world: WorldArgs,
    #[command(flatten)]
    pub(crate) method: MethodArgs,
    #[command(flatten)]
    pub(crate) camera: CameraArgs,
    #[command(flatten)]
    pub(crate) limits: LimitArgs,
    #[command(flatten)]
    pub(crate) output: OutputArgs,
}

impl Cockpit {
    /// The flight of an instruction with these flags.
    pub(crate) fn flight(&self, instruction: String) -> Fly {
        Fly {
            instruction,
            world: self.world.clone(),
            method: self.method.clone(),
            camera: self.camera.clone(),
            limits: self.limits.clone(),
            output: self.output.clone(),
        }
    }
}

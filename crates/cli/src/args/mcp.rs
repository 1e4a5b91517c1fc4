//! Arguments of `spf mcp`.

use std::net::SocketAddr;

use clap::{Args, Subcommand};

use super::CameraArgs;
use super::taken::OfFlight;
#[cfg(feature = "mcp")]
use super::{FlightArgs, Fly};
use crate::settings::Flags;

/// Lets an assistant look, fly and stop, by the Model Context Protocol: on standard input and output, until its client ends, or
/// by HTTP, until Ctrl-C.
#[derive(Debug, Args)]
#[command(
    args_conflicts_with_subcommands = true,
    after_help = "\
Examples:
  spf mcp                                     # the simulator; started by a client, such as a desktop assistant
  spf mcp --scene park --vlm gemini
  spf mcp --drone tello --cockpit             # a real drone moves only once the operator has armed the assistant
  spf mcp arm                                 # in another terminal
  spf mcp --http 127.0.0.1:8720               # for clients that connect; prints a token

The other flags are those of `spf fly`. The guide docs/guide/mcp.md has the settings of the usual clients."
)]
pub(crate) struct Mcp {
    #[command(subcommand)]
    pub(crate) command: Option<McpCommand>,
    /// Serve by HTTP at this address of this machine instead; the token is printed, or is that of SPF_MCP_TOKEN
    #[arg(long, value_name = "ADDR:PORT")]
    pub(crate) http: Option<SocketAddr>,
    /// Ask for the operator's consent in the client too, where that asks its user; know that yours shows the question to a person
    #[arg(long)]
    pub(crate) ask_in_client: bool,
    #[command(flatten)]
    pub(crate) settings: Flags<OfFlight>,
    #[command(flatten)]
    pub(crate) camera: CameraArgs,
}

#[derive(Debug, Subcommand)]
pub(crate) enum McpCommand {
    /// Let the assistant of a running `spf mcp` move its real drone, for some minutes and one flight
    Arm {
        /// For how long, minutes, 1 to 30
        #[arg(long, value_name = "MINUTES", default_value_t = 10, value_parser = clap::value_parser!(u8).range(1..=30))]
        minutes: u8,
    },
}

#[cfg(feature = "mcp")]
impl Mcp {
    /// The flight of an instruction with these flags.
    pub(crate) fn flight(&self, instruction: &str) -> Fly {
        let flight = FlightArgs { settings: self.settings.clone(), camera: self.camera.clone(), events: None, json: true };
        Fly { instruction: instruction.to_owned(), anyway: false, flight }
    }
}

//! Arguments of `spf log`, and `spf replay`.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::taken::OfReplay;
use crate::settings::Flags;

#[derive(Debug, Subcommand)]
pub(crate) enum Log {
    /// Summarize a flight log
    Info(Info),
    /// Print messages of a flight log as JSON lines
    Cat(Cat),
    /// Export the messages of a topic as a table: CSV, JSON lines or Parquet
    Export(Export),
    /// Make a video from the camera images of a flight log
    Video(Video),
    /// Repair a log truncated by a killed process, a crash or a full disk
    Repair(Repair),
    /// Make one file of a flight to send to somebody else: without keys, addresses, names, places and pictures
    Share(Share),
    /// Open a file made by `spf log share`, and make the pilot's decisions again
    Open(Open),
}

/// Summarizes a flight log: the flight, its topics, and whether the log is complete.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  spf log info flights/001-fly-to-the-red-crane/flight.mcap
  spf log info flight.mcap --json | jq '.topics[\"/camera/image\"].messages'")]
pub(crate) struct Info {
    /// The flight log
    pub(crate) file: PathBuf,
    /// Print only one JSON object on standard output
    #[arg(long)]
    pub(crate) json: bool,
}

/// Prints messages as JSON, one per line: `time_s`, `topic`, `message`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  spf log cat flight.mcap /command | jq -c '[.time_s, .message.wanted.forward, .message.cleared.forward]'
  spf log cat flight.mcap /query /reply

`spf log info` lists the topics; docs/reference/flight-log.md describes them. Bytes (images) are printed as base64.")]
pub(crate) struct Cat {
    /// The flight log
    pub(crate) file: PathBuf,
    /// Topics to print [default: all]
    #[arg(value_name = "TOPIC")]
    pub(crate) topics: Vec<String>,
}

/// Reads a truncated log as far as possible and replaces it by a complete one, with an index.
#[derive(Debug, Args)]
#[command(after_help = "\
Example:
  spf log repair flight.mcap

Data that cannot be read, at most the last second of a killed flight, is lost. A complete log is left unchanged.")]
pub(crate) struct Repair {
    /// The flight log
    pub(crate) file: PathBuf,
}

/// Replays a recorded flight: feeds the recorded inputs to the pilot and compares its outputs.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  spf replay flight.mcap
  spf replay flight.mcap --json | jq '.differences[0]'
  spf replay flight.mcap --vlm oracle:poor --out replies
  spf replay flight.mcap --vlm gemini --out replies      # each query is a request to the vendor

Parsing, projection, policy, executor and envelope run on the recorded frames, telemetry and replies. No VLM is queried and \
nothing is rendered. Exit code 1 if anything differs.

With --vlm, another VLM is queried about the same frames, rendered again from the log's scene and the true pose, and both \
replies are shown; the decisions that follow from them are not compared.")]
pub(crate) struct Replay {
    /// The flight log
    pub(crate) file: PathBuf,
    #[command(flatten)]
    pub(crate) settings: Flags<OfReplay>,
    /// Output folder for images of both replies, side by side (with --vlm)
    #[arg(long, value_name = "DIR", requires = "fly.vlm")]
    pub(crate) out: Option<PathBuf>,
    /// Print only one JSON object on standard output
    #[arg(long)]
    pub(crate) json: bool,
}

/// Exports the messages of a topic as one table, from one or more logs.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  spf log export flights -o decisions.csv
  spf log export flights/001-* --topic /command -o commands.csv
  spf log export trials --topic /summary -o trials.jsonl

Each row is a message and each column one of its values, named by its path in the message (reading.waypoint.u); lists are \
JSON. Every row includes its log, its flight time and the flight's instruction.")]
pub(crate) struct Export {
    /// Flight logs, or folders with *.mcap files
    #[arg(value_name = "LOG", required = true)]
    pub(crate) logs: Vec<PathBuf>,
    /// Topic to export
    #[arg(long, value_name = "TOPIC", default_value = "/decision")]
    pub(crate) topic: String,
    /// All columns of the topic, and not only those that people look at
    #[arg(long)]
    pub(crate) all_columns: bool,
    /// Output table: .csv, .jsonl or .parquet (requires the feature `parquet`)
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: PathBuf,
    /// Replace the output file if it exists
    #[arg(long)]
    pub(crate) overwrite: bool,
}

/// Makes a video from the camera images of a log, with waypoints and boxes overlaid.
#[derive(Debug, Args)]
#[command(after_help = "\
Example:
  spf log video flight.mcap -o flight.mp4")]
pub(crate) struct Video {
    /// The flight log
    pub(crate) file: PathBuf,
    /// Output video (.mp4)
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: PathBuf,
    /// Replace the output file if it exists
    #[arg(long)]
    pub(crate) overwrite: bool,
}

/// Makes one file of a recorded flight to send to somebody else, and tells what is in it and what was left out.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  spf log share flights/001-fly-to-the-red-crane
  spf log share flights/001-fly-to-the-red-crane -o first-flight.mcap --pictures

Kept: the instruction, what the model answered, telemetry, setpoints, decisions, limits and settings, with positions in metres from \
the start. Left out: keys, addresses, paths, names of users and servers, serial numbers, the wall clock, your own prompt, what \
servers said, and everything that this version does not know. Camera images are left out unless --pictures is given. The instruction \
and the answers are kept as they are, but for parts that look like one of these: read them before you send the file. Nothing is sent.

The receiver opens it with `spf log open`, and every other command for flight logs reads it too.")]
pub(crate) struct Share {
    /// The flight: its folder, or its flight.mcap
    pub(crate) flight: PathBuf,
    /// Output file [default: the flight's number with -shared.mcap, in the working directory]
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: Option<PathBuf>,
    /// Keep the camera images; faces, number plates and rooms can be seen on them
    #[arg(long)]
    pub(crate) pictures: bool,
    /// Replace the output file if it exists
    #[arg(long)]
    pub(crate) overwrite: bool,
}

/// Opens a file made by `spf log share`: tells of the flight, and makes the pilot's decisions again from what was recorded.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  spf log open first-flight.mcap
  spf log open first-flight.mcap --out first-flight      # a flight's folder: log, decisions, summary
  spf log open first-flight.mcap --json | jq .shared.left_out

As by `spf replay`: the pilot gets the recorded frames, telemetry and replies again, and every difference from the recorded decisions \
and commands is printed. Exit code 1 if anything differs.")]
pub(crate) struct Open {
    /// The file
    pub(crate) file: PathBuf,
    /// Unpack it to this folder, which must be new or empty
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Print only one JSON object on standard output
    #[arg(long)]
    pub(crate) json: bool,
}

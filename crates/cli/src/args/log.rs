//! What can be typed after `spf log`, and `spf replay`.

use std::path::PathBuf;

use clap::{Args, Subcommand};

#[derive(Debug, Subcommand)]
pub(crate) enum Log {
    /// Tell what is in a flight log
    Info(Info),
    /// Print messages of a flight log as JSON lines
    Cat(Cat),
    /// Write the messages of a topic as a table: CSV, JSON lines or Parquet
    Export(Export),
    /// Make a video from the pictures of a flight log
    Video(Video),
    /// Make a whole log of one that was torn by a kill, a crash or a full disk
    Repair(Repair),
}

/// Tells what is in a flight log: the flight, its topics, and whether the log is whole.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  spf log info flights/001-fly-to-the-red-crane/flight.mcap
  spf log info flight.mcap --json | jq '.topics[\"/camera/image\"].messages'")]
pub(crate) struct Info {
    /// The flight log
    pub(crate) file: PathBuf,
    /// Print one JSON object on standard output, and nothing else there
    #[arg(long)]
    pub(crate) json: bool,
}

/// Prints messages as JSON, one a line: `time_s`, `topic`, `message`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  spf log cat flight.mcap /command | jq -c '[.time_s, .message.wanted.forward, .message.cleared.forward]'
  spf log cat flight.mcap /query /reply

Topics stand in docs/reference/flight-log.md and in what `spf log info` prints. Bytes (pictures) are printed as base64.")]
pub(crate) struct Cat {
    /// The flight log
    pub(crate) file: PathBuf,
    /// Only these topics [default: all]
    #[arg(value_name = "TOPIC")]
    pub(crate) topics: Vec<String>,
}

/// Reads a torn log as far as it goes and puts a whole one, with its index, in its place.
#[derive(Debug, Args)]
#[command(after_help = "\
Example:
  spf log repair flight.mcap

What cannot be read, at most the last second of a flight that was killed, is gone. A log that is whole stays as it is.")]
pub(crate) struct Repair {
    /// The flight log
    pub(crate) file: PathBuf,
}

/// Flies a recorded flight again, on paper: the pilot is told what it was told, and what it wants is compared.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  spf replay flight.mcap
  spf replay flight.mcap --json | jq '.differences[0]'
  spf replay flight.mcap --vlm oracle:poor --out pictures
  spf replay flight.mcap --vlm gemini --out pictures      # every question is a request to the vendor

Parsing, projection, policy, executor and envelope run on the recorded frames, telemetry and replies. Nobody is asked and \
nothing is drawn. Exit code 1 when anything differs.

With --vlm somebody else is asked about the same frames, drawn again from the log's scene and the true pose, and both answers \
are shown; nothing is compared.")]
pub(crate) struct Replay {
    /// The flight log
    pub(crate) file: PathBuf,
    /// Ask this one about the same frames, as in `spf fly --vlm`: oracle:NAME, gemini, ollama#qwen2.5vl:7b, an address…
    #[arg(long, value_name = "VLM")]
    pub(crate) vlm: Option<String>,
    /// Models beyond those of `spf vlm list` (with --vlm)
    #[arg(long, value_name = "FILE", requires = "vlm")]
    pub(crate) vlm_models: Option<String>,
    /// Read this configuration file instead of ./spf.toml (with --vlm)
    #[arg(long, value_name = "FILE", requires = "vlm")]
    pub(crate) config: Option<PathBuf>,
    /// Folder for pictures of both answers, side by side (with --vlm)
    #[arg(long, value_name = "DIR", requires = "vlm")]
    pub(crate) out: Option<PathBuf>,
    /// Print one JSON object on standard output, and nothing else there
    #[arg(long)]
    pub(crate) json: bool,
}

/// Writes the messages of a topic as one table; a folder of logs becomes one table too.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  spf log export flights -o decisions.csv
  spf log export flights/001-* --topic /command -o commands.csv
  spf log export trials --topic /summary -o trials.jsonl

A row is a message, a column one of its values, named by its way through the message (reading.waypoint.u); lists are JSON. Each \
row tells its log, its flight time and what was flown.")]
pub(crate) struct Export {
    /// Flight logs, or folders in which every *.mcap is one
    #[arg(value_name = "LOG", required = true)]
    pub(crate) logs: Vec<PathBuf>,
    /// The topic
    #[arg(long, value_name = "TOPIC", default_value = "/decision")]
    pub(crate) topic: String,
    /// The table: .csv, .jsonl or .parquet (built with the feature `parquet`)
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: PathBuf,
}

/// Makes a video from the pictures of a log, with waypoints and boxes drawn on them.
#[derive(Debug, Args)]
#[command(after_help = "\
Example:
  spf log video flight.mcap -o flight.mp4")]
pub(crate) struct Video {
    /// The flight log
    pub(crate) file: PathBuf,
    /// The video (.mp4)
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: PathBuf,
}

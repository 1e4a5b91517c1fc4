//! Command-line arguments, unparsed (see `settings` for their meaning).
//!
//! Doc comments here are help texts for a terminal.
#![allow(rustdoc::broken_intra_doc_links, reason = "`heading_deg[,pitch_deg]` is no link")]

mod bench;
mod camera;
mod cockpit;
mod ground;
mod log;
mod mcp;
mod methods;
mod model;
pub(crate) mod refused;
mod screen;
mod serve;
mod sim;
mod taken;
mod tello;
mod track;

use std::path::PathBuf;
use std::sync::LazyLock;

use clap::{Args, Parser, Subcommand};
use clap_complete::Shell;
use spf_bench::trial::GIT_REV;

pub(crate) use bench::{Bench, BenchAsk, BenchCheck, BenchImport, BenchList, BenchMerge, BenchReport, BenchRun, BenchShow};
pub(crate) use camera::{Camera, CameraArgs, CameraCalibrate, CameraTest, Times};
pub(crate) use cockpit::Cockpit;
pub(crate) use ground::Ground;
pub(crate) use log::{Cat, Export, Info, Log, Open, Repair, Replay, Share, Video};
pub(crate) use mcp::Mcp;
#[cfg(feature = "mcp")]
pub(crate) use mcp::McpCommand;
pub(crate) use model::{Model, ModelGet, ModelList};
pub(crate) use screen::{Screen, ScreenCalibrate, ScreenPreview};
pub(crate) use serve::Serve;
pub(crate) use sim::{Dataset, Render, Scenes, Sim, SimWindow, View};
#[cfg(test)]
pub(crate) use taken::taken;
pub(crate) use tello::{Calibrate, Tello, TelloAddress};
pub(crate) use track::Track;

use self::taken::{OfDoctor, OfFlight, OfVlmCheck, OfVlmList, OfVlmTrial};
use crate::settings::Flags;

/// Version, revision and features, for reports of problems.
fn long_version() -> &'static str {
    static TEXT: LazyLock<String> = LazyLock::new(|| {
        let revision = if GIT_REV.is_empty() { "an unknown revision" } else { GIT_REV };
        let all = [
            ("onnx", cfg!(feature = "onnx")),
            ("mcp", cfg!(feature = "mcp")),
            ("parquet", cfg!(feature = "parquet")),
            ("gstreamer", cfg!(feature = "gstreamer")),
            ("screen-native", cfg!(feature = "screen-native")),
        ];
        let on: Vec<&str> = all.into_iter().filter_map(|(name, on)| on.then_some(name)).collect();
        let features = if on.is_empty() { "none".to_owned() } else { on.join(", ") };
        format!("{}\nrevision: {revision}\nfeatures: {features}", env!("CARGO_PKG_VERSION"))
    });
    &TEXT
}

/// See, Point, Fly: fly a drone by natural-language instructions.
/// A vision-language model picks a waypoint in the camera image, geometry lifts it to a 3D displacement, a controller flies
/// it, and the loop repeats until the instruction is fulfilled.
#[derive(Debug, Parser)]
#[command(
    name = "spf",
    version,
    long_version = long_version(),
    max_term_width = 110,
    after_help = "\
Start here, no key and no GPU needed:
  spf fly \"Take off and fly to the red crane\"

Exit codes: 0 reached (and verified, where ground truth exists), 1 internal error (replay: a difference; fly: files \
incomplete), 2 usage or configuration, 3 not reached, 4 collision, 5 aborted (operator, envelope, geofence, battery, cost limit), 6 failed (VLM, video or link \
lost)."
)]
pub(crate) struct Cli {
    /// The command to run.
    #[command(subcommand)]
    pub(crate) command: Command,
    /// Increase log verbosity: -v logs queries and connections, -vv every command to the craft (see also RUST_LOG)
    #[arg(short, long, global = true, action = clap::ArgAction::Count, display_order = 990)]
    pub(crate) verbose: u8,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Fly a natural-language instruction
    Fly(Box<Fly>),
    /// Fly, watch and point in a browser: wait for instructions, or look at recorded flights
    Cockpit(Box<Cockpit>),
    /// Let an assistant look, fly and stop, by the Model Context Protocol
    Mcp(Box<Mcp>),
    /// Run pre-flight checks: drone, battery, video, light, VLM, disk
    Doctor(Doctor),
    /// DJI Tello tools: show the state, land, stop, calibrate the stick response
    #[command(subcommand)]
    Tello(Tello),
    /// Cameras that are not part of a drone: test one, measure its delay
    #[command(subcommand)]
    Camera(Camera),
    /// Games and simulators that are flown through their window: list windows, capture one
    #[command(subcommand)]
    Screen(Screen),
    /// The embedded simulator: render, list, view and serve scenes
    #[command(subcommand)]
    Sim(Sim),
    /// Flight logs (flight.mcap): inspect, export, make videos, repair, share
    #[command(subcommand)]
    Log(Log),
    /// Replay a flight log and report where spf's decisions now differ
    Replay(Replay),
    /// Query VLMs about images and measure pointing accuracy
    Ground(Box<Ground>),
    /// Follow a box through a video, from pixels alone
    Track(Track),
    /// Vision-language models: list them, and check that one responds and points accurately
    #[command(subcommand)]
    Vlm(Vlm),
    /// Neural networks that others have published: list them, fetch one
    #[command(subcommand)]
    Model(Model),
    /// Benchmark: fly tasks and measure success rates, judged by the simulator
    #[command(subcommand)]
    Bench(Bench),
    /// Show the effective configuration and the source of each value
    #[command(subcommand)]
    Config(Config),
    /// Print a script that lets a shell complete commands and flags
    Completions(Completions),
    /// Write the manual: a page for each command
    Man(Man),
}

impl Command {
    /// Whether standard output carries JSON only.
    pub(crate) fn is_json(&self) -> bool {
        match self {
            Self::Fly(fly) => fly.flight.json,
            Self::Cockpit(cockpit) => cockpit.flight.json,
            Self::Doctor(doctor) => doctor.json,
            Self::Sim(Sim::Scenes(scenes)) => scenes.json,
            Self::Log(Log::Info(info)) => info.json,
            Self::Log(Log::Open(open)) => open.json,
            Self::Replay(replay) => replay.json,
            Self::Ground(ground) => ground.json,
            Self::Vlm(Vlm::List(list)) => list.json,
            Self::Model(Model::List(list)) => list.json,
            Self::Bench(Bench::Run(run)) => run.json,
            Self::Bench(Bench::Ask(ask)) => ask.json,
            Self::Bench(_)
            | Self::Sim(_)
            | Self::Tello(_)
            | Self::Camera(_)
            | Self::Screen(_)
            | Self::Log(_)
            | Self::Mcp(_)
            | Self::Vlm(_)
            | Self::Model(_)
            | Self::Track(_)
            | Self::Config(_)
            | Self::Completions(_)
            | Self::Man(_) => false,
        }
    }
}

/// Flies an instruction and writes the flight's files to a folder.
#[derive(Debug, Args)]
#[command(
    after_help = "\
Examples:
  spf fly \"Take off and fly to the red crane\"
  spf fly \"Fly to the black car\" --vlm gemini
  spf fly \"Fly to the person with the green shirt\" --drone tello --vlm gemini

These are the flags that most flights need; --help explains all of them.",
    after_long_help = "\
Examples:
  spf fly \"Take off and fly to the red crane\"
  spf fly \"Go to the black car\" --seed 7 --preset paper
  spf fly \"Fly to the white needle tower\" --depth-sensor on --out needle
  spf fly \"Find the bridge\" --json | jq .outcome
  spf fly \"Fly to the tall white building\" --vlm oracle:poor --geofence fence.geojson
  spf fly \"Fly to the black car\" --vlm gemini
  spf fly \"Fly to the red crane\" --cockpit
  spf fly \"Fly to the person with the green shirt\" --drone tello --vlm gemini
  spf fly \"Go to the bridge\" --wind 3,from=270,gust=1 --camera-effects blur,noise,lens=tello_ros

The oracle stands in for a VLM: it reads the simulator's own ID and depth images and adds errors (perfect, default, poor, or \
a file). Oracle results are not VLM results.

Every flag except --events, --camera and its kind, --json and --config can also be set in spf.toml or the environment, and some \
settings only there: see `spf config show` and docs/reference/configuration.md."
)]
pub(crate) struct Fly {
    /// Instruction for the drone, in natural language
    pub(crate) instruction: String,
    #[command(flatten)]
    pub(crate) flight: FlightArgs,
    /// Fly although words of the instruction are used for nothing, or demand what nothing on board measures
    #[arg(long, help_heading = "Method", hide_short_help = true)]
    pub(crate) anyway: bool,
}

// No doc comment: clap would show it in place of the command's own.
#[derive(Clone, Debug, Args)]
pub(crate) struct FlightArgs {
    #[command(flatten)]
    pub(crate) settings: Flags<OfFlight>,
    #[command(flatten)]
    pub(crate) camera: CameraArgs,
    /// Operator events at given times (TOML; see docs/reference/flight-files.md)
    #[arg(long, value_name = "FILE", help_heading = "Simulation", hide_short_help = true)]
    pub(crate) events: Option<PathBuf>,
    /// Print only the summary, as one JSON object, on standard output
    #[arg(long, help_heading = "Output")]
    pub(crate) json: bool,
}

#[derive(Clone, Debug, Args)]
pub(crate) struct ConditionArgs {
    /// Light: day, overcast, dusk or night [default: the scene's]
    #[arg(long, value_name = "LIGHT")]
    pub(crate) light: Option<String>,
    /// Weather: clear, haze or rain; it has no effect on the oracle [default: the scene's]
    #[arg(long, value_name = "WEATHER")]
    pub(crate) weather: Option<String>,
}

#[derive(Debug, Args)]
#[command(after_help = "\
The drone does not take off. The VLM is queried with three small images, which costs less than a cent. Exit code 0: ready to \
fly; 6: not ready, and the report says what to fix.")]
pub(crate) struct Doctor {
    #[command(flatten)]
    pub(crate) settings: Flags<OfDoctor>,
    /// Print the checks as one JSON array on standard output
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) camera: CameraArgs,
}

/// Vision-language models.
#[derive(Debug, Subcommand)]
pub(crate) enum Vlm {
    /// List the known models: status, price, and whether an API key is set
    List(VlmList),
    /// Query one model with three images of a dot, and check that it responds and points accurately
    Check(VlmCheck),
    /// Try models: calibration dots, 60 pointing questions and 10 flights each, with a one-page HTML report
    Trial(VlmTrial),
}

#[derive(Debug, Args)]
pub(crate) struct VlmList {
    /// Print the list as one JSON array on standard output
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) settings: Flags<OfVlmList>,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Sends three small images, which costs less than a cent with every listed model. Exit code 0: the model responds and points \
accurately; 2: it cannot be queried (no API key, unknown name); 6: it does not respond, or points inaccurately.")]
pub(crate) struct VlmCheck {
    /// VLM: NAME[#MODEL][@URL] or exec:COMMAND as for `spf fly --vlm`, or auto
    pub(crate) name: String,
    /// Width and height of the frames of the camera that will be flown with, pixels [default: 960x720, as in the simulator and of
    /// a Tello]
    #[arg(long, value_name = "WxH")]
    pub(crate) size: Option<String>,
    #[command(flatten)]
    pub(crate) settings: Flags<OfVlmCheck>,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  spf vlm trial gemini,anthropic --max-cost 2 -o trial
  spf vlm trial 'exec:python3 my_model.py' -o trial

The cost is estimated first and, in a terminal, must be confirmed. The same command resumes an interrupted trial; then only \
unanswered questions and missing flights are paid for. The page is DIR/index.html, its figures DIR/trial.json. Exit codes: 0 \
complete; 2 usage; 5 interrupted, declined, or --max-cost reached; 6 no model replied, or a model's service failed.")]
pub(crate) struct VlmTrial {
    /// VLMs, comma-separated: NAME[#MODEL][@URL] or exec:COMMAND as for `spf fly --vlm`
    pub(crate) names: String,
    /// Output folder
    #[arg(short, long, value_name = "DIR", default_value = "vlm-trial")]
    pub(crate) output: PathBuf,
    /// Number of pointing questions to each model
    #[arg(long, value_name = "N", default_value_t = 60, value_parser = clap::value_parser!(u64).range(1..=10_000))]
    pub(crate) questions: u64,
    /// Number of flights with each model, spread over the tasks of the suite `paper`
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u64).range(0..=34))]
    pub(crate) flights: u64,
    /// Random seed of questions and flights
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) seed: u64,
    /// Number of parallel queries and flights
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u16).range(1..=64))]
    pub(crate) parallel: u16,
    #[command(flatten)]
    pub(crate) settings: Flags<OfVlmTrial>,
    /// Start without asking for confirmation; without a terminal a trial that may cost money needs this or --max-cost
    #[arg(long)]
    pub(crate) yes: bool,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Config {
    /// Print every key with its effective value and source
    Show {
        /// Read this configuration file instead of ./spf.toml
        #[arg(long, value_name = "FILE")]
        config: Option<PathBuf>,
    },
}

/// Prints a script that lets a shell complete commands and flags.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  spf completions bash > ~/.local/share/bash-completion/completions/spf
  spf completions zsh > ~/.zfunc/_spf              # a folder of $fpath
  spf completions fish > ~/.config/fish/completions/spf.fish
  spf completions powershell >> $PROFILE

A new shell reads it.")]
pub(crate) struct Completions {
    /// The shell
    pub(crate) shell: Shell,
}

/// Writes the manual: a page for each command.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  spf man ~/.local/share/man/man1
  man spf-fly")]
pub(crate) struct Man {
    /// Folder of the pages, which is made if there is none; pages of the same names are replaced
    #[arg(value_name = "DIR")]
    pub(crate) folder: PathBuf,
}

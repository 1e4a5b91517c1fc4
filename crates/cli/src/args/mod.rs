//! What can be typed: arguments only, no meaning (see `settings`).
//!
//! Doc comments here are help texts for a terminal.
#![allow(rustdoc::broken_intra_doc_links, reason = "`heading_deg[,pitch_deg]` is no link")]

mod bench;
mod drones;
mod ground;
mod log;
mod methods;
mod serve;
mod sim;
mod tello;

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand};

pub(crate) use bench::{Bench, BenchCheck, BenchMerge, BenchReport, BenchRun, BenchShow};
pub(crate) use ground::Ground;
pub(crate) use log::{Cat, Export, Info, Log, Repair, Replay, Video};
pub(crate) use serve::Serve;
pub(crate) use sim::{Dataset, Render, Scenes, Sim, View};
pub(crate) use tello::{Calibrate, Tello};

/// See, Point, Fly: tell a drone in plain words where to go.
///
/// A vision-language model points at the place in the camera image, geometry lifts the point to a 3D displacement, a small
/// controller flies it, and the loop repeats until the instruction is fulfilled.
#[derive(Debug, Parser)]
#[command(
    name = "spf",
    version,
    max_term_width = 110,
    after_help = "\
Start here, no key and no GPU needed:
  spf fly \"Take off and fly to the red crane\"

Exit codes: 0 reached (and verified, where there is truth), 1 internal error (of replay: a difference), 2 usage or configuration, 3 not reached, \
4 collision, 5 aborted (operator, envelope, geofence, battery), 6 failed (VLM, video or link gave out)."
)]
pub(crate) struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub(crate) command: Command,
    /// More talk on standard error: -v decisions, -vv setpoints (also: RUST_LOG)
    #[arg(short, long, global = true, action = clap::ArgAction::Count)]
    pub(crate) verbose: u8,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Fly an instruction in plain words
    Fly(Box<Fly>),
    /// Check everything before a flight: drone, battery, video, light, VLM, disk
    Doctor(Doctor),
    /// A DJI Tello: measure what its sticks do
    #[command(subcommand)]
    Tello(Tello),
    /// The embedded simulator: its scenes and pictures of them
    #[command(subcommand)]
    Sim(Sim),
    /// Flight logs (flight.mcap): what is in them, tables, videos, repair
    #[command(subcommand)]
    Log(Log),
    /// Replay a flight from its log, and tell what the pilot would do otherwise now
    Replay(Replay),
    /// Ask who points about pictures, and measure how well they point
    Ground(Box<Ground>),
    /// Vision-language models: which there are, and whether one answers and points well
    #[command(subcommand)]
    Vlm(Vlm),
    /// Tasks and trials: how often a method does what it is told, judged by the simulator
    #[command(subcommand)]
    Bench(Bench),
    /// The configuration in force, and where each value came from
    #[command(subcommand)]
    Config(Config),
}

impl Command {
    /// Whether standard output is for one JSON object alone.
    pub(crate) fn is_json(&self) -> bool {
        match self {
            Self::Fly(fly) => fly.output.json,
            Self::Doctor(doctor) => doctor.json,
            Self::Sim(Sim::Scenes(scenes)) => scenes.json,
            Self::Log(Log::Info(info)) => info.json,
            Self::Replay(replay) => replay.json,
            Self::Ground(ground) => ground.json,
            Self::Vlm(Vlm::List(list)) => list.json,
            Self::Bench(Bench::Run(run)) => run.json,
            Self::Bench(_) | Self::Sim(_) | Self::Tello(_) | Self::Log(_) | Self::Vlm(_) | Self::Config(_) => false,
        }
    }
}

/// Flies a simulated drone by language and leaves the evidence in a folder.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  spf fly \"Take off and fly to the red crane\"
  spf fly \"Go to the black car\" --seed 7 --preset paper
  spf fly \"Fly to the white needle tower, keep clear of everything\" --avoid --out needle
  spf fly \"Find the bridge\" --json | jq .outcome
  spf fly \"Fly to the tall white building\" --vlm oracle:poor --geofence fence.geojson
  spf fly \"Fly to the black car\" --vlm gemini
  spf fly \"Fly to the person with the green shirt\" --drone tello --vlm gemini
  spf fly \"Go to the bridge\" --wind 3,from=270,gust=1 --camera-effects blur,noise,lens=tello_ros

The oracle answers in place of a VLM: it sees the simulator's own id and depth pictures through errors (perfect, default, \
poor, or a file). No number made with it is a VLM's.

Every flag but --events, --json and --config can stand in spf.toml or the environment: see `spf config show`.")]
pub(crate) struct Fly {
    /// What the drone is to do, in any words
    pub(crate) instruction: String,
    #[command(flatten)]
    pub(crate) world: WorldArgs,
    #[command(flatten)]
    pub(crate) method: MethodArgs,
    #[command(flatten)]
    pub(crate) limits: LimitArgs,
    #[command(flatten)]
    pub(crate) output: OutputArgs,
}

#[derive(Debug, Args)]
#[command(next_help_heading = "World")]
pub(crate) struct WorldArgs {
    /// Scene to fly in: a built-in name, scene file or .glb; city@17 is a variant [default: city]
    #[arg(long, value_name = "SCENE")]
    pub(crate) scene: Option<String>,
    #[command(flatten)]
    pub(crate) conditions: ConditionArgs,
    /// Where to start: east,north,up,heading_deg; the craft stands on what is below [default: the scene's]
    #[arg(long, value_name = "POSE", allow_hyphen_values = true)]
    pub(crate) start: Option<String>,
    #[arg(long, value_name = "DRONE", help = drones::drones())]
    pub(crate) drone: Option<String>,
    /// How a Tello flies: rc (velocities, which it holds when the link is cut) or go (each step as moves that it ends by itself;
    /// stop-and-think, sequential) [default: rc]
    #[arg(long, value_name = "HOW")]
    pub(crate) tello_motion: Option<String>,
    /// Craft to simulate: quad or tello [default: the scene's]
    #[arg(long, value_name = "MODEL")]
    pub(crate) drone_model: Option<String>,
    /// Seed of all chance: the same seed gives the same flight, byte for byte [default: 0]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub(crate) seed: Option<String>,
    /// Wind: metres a second[,from=DEG][,gust=M_S][,gust_time=S], from the north unless said [default: still air]
    #[arg(long, value_name = "WIND", allow_hyphen_values = true)]
    pub(crate) wind: Option<String>,
    /// Battery charge at the start, 0 to 1 [default: 1]
    #[arg(long, value_name = "CHARGE", allow_negative_numbers = true)]
    pub(crate) battery: Option<String>,
    /// What the camera does to its pictures: blur, noise, exposure, lens, compression, each with =STRENGTH, or all [default:
    /// none]
    #[arg(long, value_name = "EFFECTS")]
    pub(crate) camera_effects: Option<String>,
    /// Operator events at given times (TOML; see docs/reference/flight-files.md)
    #[arg(long, value_name = "FILE")]
    pub(crate) events: Option<PathBuf>,
    /// Fly on the wall clock instead of as fast as the machine can
    #[arg(long)]
    pub(crate) realtime: bool,
}

#[derive(Debug, Args)]
pub(crate) struct ConditionArgs {
    /// Light: day, overcast, dusk or night [default: the scene's]
    #[arg(long, value_name = "LIGHT")]
    pub(crate) light: Option<String>,
    /// Weather: clear, haze or rain [default: the scene's]
    #[arg(long, value_name = "WEATHER")]
    pub(crate) weather: Option<String>,
}

#[derive(Debug, Args)]
#[command(next_help_heading = "Method")]
pub(crate) struct MethodArgs {
    /// Who points: NAME[#MODEL][@URL] of a vision-language model (see `spf vlm list`), auto (the first whose key is set),
    /// replay:FILE, oracle, oracle:NAME (perfect, default, poor, size, linear, intended) or oracle:FILE [default: oracle; auto
    /// with a real drone]
    #[arg(long, value_name = "VLM")]
    pub(crate) vlm: Option<String>,
    /// What the VLM is told: a prompt file (see docs/guide/vlm.md) [default: the shipped one]
    #[arg(long, value_name = "FILE")]
    pub(crate) prompt: Option<String>,
    /// Record the VLM's answers in this new file; `--vlm replay:FILE` flies the same flight again
    #[arg(long, value_name = "FILE")]
    pub(crate) vlm_record: Option<String>,
    /// VLM that is asked when the first one fails
    #[arg(long, value_name = "VLM")]
    pub(crate) vlm_fallback: Option<String>,
    /// After so many seconds without an answer a second request goes out, and the first good answer counts
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    pub(crate) vlm_hedge: Option<String>,
    /// TOML file with further rows for the table of models (see docs/guide/vlm.md)
    #[arg(long, value_name = "FILE")]
    pub(crate) vlm_models: Option<String>,
    /// With a real drone: take off without asking the VLM about pictures of a dot first
    #[arg(long)]
    pub(crate) no_vlm_check: bool,
    #[arg(long, value_name = "POLICY", help = methods::policies())]
    pub(crate) policy: Option<String>,
    /// Named set of choices: default (the best we know) or paper (the paper's constants and manner) [default: default]
    #[arg(long, value_name = "PRESET")]
    pub(crate) preset: Option<String>,
    /// Step length: adaptive (paper §3.2) or fixed:METRES [default: the preset's]
    #[arg(long, value_name = "STEP", allow_negative_numbers = true)]
    pub(crate) step: Option<String>,
    /// Primitives one after the other (sequential) or all at once (blended) [default: the preset's]
    #[arg(long, value_name = "MOTION")]
    pub(crate) motion: Option<String>,
    /// Hold while the VLM thinks (stop) or keep flying the last plan (continuous) [default: the preset's]
    #[arg(long, value_name = "THINK")]
    pub(crate) think: Option<String>,
    /// Setpoints a second, 5 to 100 [default: 10]
    #[arg(long, value_name = "HZ", allow_negative_numbers = true)]
    pub(crate) rate: Option<String>,
    /// Obstacle mode: ask for boxes of obstacles and keep clear of them
    #[arg(long)]
    pub(crate) avoid: bool,
    /// Obstacle mode with boxes from a detector in place of the VLM's: a YOLO model's FILE.onnx (see docs/guide/detector.md), or
    /// in the simulator oracle or oracle:NAME, which stands in for one that knows COCO's classes
    #[arg(long, value_name = "WHO")]
    pub(crate) detector: Option<String>,
}

#[derive(Debug, Args)]
#[command(next_help_heading = "Limits")]
pub(crate) struct LimitArgs {
    /// Flight time after which the flight is a timeout, seconds [default: 180]
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    pub(crate) max_time: Option<String>,
    /// Decisions after which the flight is a timeout [default: 60]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub(crate) max_decisions: Option<String>,
    /// US dollars for the VLM after which the flight ends [default: no limit]
    #[arg(long, value_name = "USD", allow_negative_numbers = true)]
    pub(crate) max_cost: Option<String>,
    /// Polygons to stay in: GeoJSON in local east/north metres
    #[arg(long, value_name = "FILE")]
    pub(crate) geofence: Option<String>,
}

#[derive(Debug, Args)]
#[command(next_help_heading = "Output")]
pub(crate) struct OutputArgs {
    /// Folder for the flight's files; must be new or empty [default: flights/NNN-instruction]
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<String>,
    /// Make no video (much faster: nothing needs drawing)
    #[arg(long)]
    pub(crate) no_video: bool,
    /// Show the flight live to Foxglove, at ws://127.0.0.1:8765 or the address named; flies on the wall clock
    #[arg(long, value_name = "ADDR:PORT", num_args = 0..=1, require_equals = true, default_missing_value = "127.0.0.1:8765")]
    pub(crate) live: Option<String>,
    /// Print the summary as one JSON object on standard output, and nothing else there
    #[arg(long)]
    pub(crate) json: bool,
    /// Read this configuration file instead of ./spf.toml
    #[arg(long, value_name = "FILE")]
    pub(crate) config: Option<PathBuf>,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Nothing takes off. A VLM is asked about three small pictures, which costs less than a cent. Exit code 0: one can fly; 6: one \
should not, and what to do is said.")]
pub(crate) struct Doctor {
    #[arg(long, value_name = "DRONE", help = drones::forms_of_drones())]
    pub(crate) drone: Option<String>,
    /// Who points, as for `spf fly --vlm` [default: oracle; auto with a real drone]
    #[arg(long, value_name = "VLM")]
    pub(crate) vlm: Option<String>,
    /// Scene of the simulated drone [default: city]
    #[arg(long, value_name = "SCENE")]
    pub(crate) scene: Option<String>,
    /// A detector's FILE.onnx, as for `spf fly --detector`
    #[arg(long, value_name = "FILE")]
    pub(crate) detector: Option<String>,
    /// Print the checks as one JSON array on standard output
    #[arg(long)]
    pub(crate) json: bool,
    /// Read this configuration file instead of ./spf.toml
    #[arg(long, value_name = "FILE")]
    pub(crate) config: Option<PathBuf>,
}

/// Vision-language models.
#[derive(Debug, Subcommand)]
pub(crate) enum Vlm {
    /// List the models of the table: status, price, whether their key is set
    List(VlmList),
    /// Ask one model about three pictures of a dot: does it answer, and does it point where we think?
    Check(VlmCheck),
}

#[derive(Debug, Args)]
pub(crate) struct VlmList {
    /// Print the list as one JSON array on standard output
    #[arg(long)]
    pub(crate) json: bool,
    /// TOML file with further rows for the table of models (see docs/guide/vlm.md)
    #[arg(long, value_name = "FILE")]
    pub(crate) vlm_models: Option<String>,
    /// Read this configuration file instead of ./spf.toml
    #[arg(long, value_name = "FILE")]
    pub(crate) config: Option<PathBuf>,
}

#[derive(Debug, Args)]
#[command(after_help = "\
It sends three small pictures, which costs less than a cent with every model of the table. Exit code 0: it answers and points \
well; 2: it cannot be asked (no key, no such name); 6: it does not answer, or points astray.")]
pub(crate) struct VlmCheck {
    /// Which: NAME[#MODEL][@URL] as for `spf fly --vlm`, or auto
    pub(crate) name: String,
    /// TOML file with further rows for the table of models (see docs/guide/vlm.md)
    #[arg(long, value_name = "FILE")]
    pub(crate) vlm_models: Option<String>,
    /// Read this configuration file instead of ./spf.toml
    #[arg(long, value_name = "FILE")]
    pub(crate) config: Option<PathBuf>,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Config {
    /// Print every key with its value in force, and where that came from
    Show {
        /// Read this configuration file instead of ./spf.toml
        #[arg(long, value_name = "FILE")]
        config: Option<PathBuf>,
    },
}

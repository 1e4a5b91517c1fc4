//! Command-line arguments, unparsed (see `settings` for their meaning).
//!
//! Doc comments here are help texts for a terminal.
#![allow(rustdoc::broken_intra_doc_links, reason = "`heading_deg[,pitch_deg]` is no link")]

mod bench;
mod camera;
mod cockpit;
mod drones;
mod ground;
mod log;
mod methods;
pub(crate) mod refused;
mod screen;
mod serve;
mod sim;
mod tello;
mod track;

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand};

pub(crate) use bench::{Bench, BenchCheck, BenchMerge, BenchReport, BenchRun, BenchShow};
pub(crate) use camera::{Camera, CameraArgs, CameraCalibrate, CameraTest, Times};
pub(crate) use cockpit::Cockpit;
pub(crate) use ground::Ground;
pub(crate) use log::{Cat, Export, Info, Log, Open, Repair, Replay, Share, Video};
pub(crate) use screen::{Screen, ScreenCalibrate, ScreenPreview};
pub(crate) use serve::Serve;
pub(crate) use sim::{Dataset, Render, Scenes, Sim, SimWindow, View};
pub(crate) use tello::{Calibrate, Tello, TelloAddress};
pub(crate) use track::Track;

/// See, Point, Fly: fly a drone by natural-language instructions.
/// A vision-language model picks a waypoint in the camera image, geometry lifts it to a 3D displacement, a controller flies
/// it, and the loop repeats until the instruction is fulfilled.
#[derive(Debug, Parser)]
#[command(
    name = "spf",
    version,
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
    /// Benchmark: fly tasks and measure success rates, judged by the simulator
    #[command(subcommand)]
    Bench(Bench),
    /// Show the effective configuration and the source of each value
    #[command(subcommand)]
    Config(Config),
}

impl Command {
    /// Whether standard output carries JSON only.
    pub(crate) fn is_json(&self) -> bool {
        match self {
            Self::Fly(fly) => fly.flight.output.json,
            Self::Cockpit(cockpit) => cockpit.flight.output.json,
            Self::Doctor(doctor) => doctor.json,
            Self::Sim(Sim::Scenes(scenes)) => scenes.json,
            Self::Log(Log::Info(info)) => info.json,
            Self::Log(Log::Open(open)) => open.json,
            Self::Replay(replay) => replay.json,
            Self::Ground(ground) => ground.json,
            Self::Vlm(Vlm::List(list)) => list.json,
            Self::Bench(Bench::Run(run)) => run.json,
            Self::Bench(_)
            | Self::Sim(_)
            | Self::Tello(_)
            | Self::Camera(_)
            | Self::Screen(_)
            | Self::Log(_)
            | Self::Vlm(_)
            | Self::Track(_)
            | Self::Config(_) => false,
        }
    }
}

/// Flies an instruction and writes the flight's files to a folder.
#[derive(Debug, Args)]
#[command(after_help = "\
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

Every flag except --events, --camera and its kind, --json and --config can also be set in spf.toml or the environment: see `spf config show`.")]
pub(crate) struct Fly {
    /// Instruction for the drone, in natural language
    pub(crate) instruction: String,
    #[command(flatten)]
    pub(crate) flight: FlightArgs,
}

// No doc comment: clap would show it in place of the command's own.
#[derive(Clone, Debug, Args)]
pub(crate) struct FlightArgs {
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

#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "World")]
pub(crate) struct WorldArgs {
    /// Scene to fly in: a built-in name, scene file or .glb; city@17 is a variant [default: city]
    #[arg(long, value_name = "SCENE")]
    pub(crate) scene: Option<String>,
    #[command(flatten)]
    pub(crate) conditions: ConditionArgs,
    /// Start pose: east,north,up,heading_deg; the craft is placed on the surface below [default: the scene's]
    #[arg(long, value_name = "POSE", allow_hyphen_values = true)]
    pub(crate) start: Option<String>,
    #[arg(long, value_name = "DRONE", help = drones::drones())]
    pub(crate) drone: Option<String>,
    /// Tello control mode: rc (velocity commands; if the link is lost, the last one stays in force) or go (position
    /// moves that the Tello ends by itself; replaces --motion, and sets --think stop) [default: rc]
    #[arg(long, value_name = "MODE")]
    pub(crate) tello_motion: Option<String>,
    /// Replace the fence of a PX4 or ArduPilot by --geofence (one polygon), or by a circle of --max-distance around home
    #[arg(long)]
    pub(crate) upload_fence: bool,
    /// Pitch of the gimbal of a PX4 or ArduPilot at the start, degrees, negative downwards; off if --camera is not on it
    #[arg(long, value_name = "DEG", allow_hyphen_values = true)]
    pub(crate) gimbal: Option<String>,
    /// Craft to simulate: quad or tello [default: the scene's]
    #[arg(long, value_name = "MODEL")]
    pub(crate) drone_model: Option<String>,
    /// Random seed: the same seed gives the same flight, byte for byte [default: 0]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub(crate) seed: Option<String>,
    /// Wind: M_S[,from=DEG][,gust=M_S][,gust_time=S], from the north by default [default: still air]
    #[arg(long, value_name = "WIND", allow_hyphen_values = true)]
    pub(crate) wind: Option<String>,
    /// Depth sensor of the simulated craft: on, off, or failing after 10 s: frozen, half (left half black) or scale (10 %
    /// too far) [default: off]
    #[arg(long, value_name = "SENSOR")]
    pub(crate) depth_sensor: Option<String>,
    /// Battery charge at the start, 0 to 1 [default: 1]
    #[arg(long, value_name = "CHARGE", allow_negative_numbers = true)]
    pub(crate) battery: Option<String>,
    /// Camera effects: blur, noise, exposure, lens, compression, each with =STRENGTH, or all [default: none]
    #[arg(long, value_name = "EFFECTS")]
    pub(crate) camera_effects: Option<String>,
    /// Operator events at given times (TOML; see docs/reference/flight-files.md)
    #[arg(long, value_name = "FILE")]
    pub(crate) events: Option<PathBuf>,
    /// Fly in real time instead of as fast as possible
    #[arg(long)]
    pub(crate) realtime: bool,
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

#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Method")]
pub(crate) struct MethodArgs {
    /// VLM: NAME[#MODEL][@URL] (see `spf vlm list`), auto (the first with an API key set), exec:COMMAND (a program of your own),
    /// human (you, typing), replay:FILE, oracle, oracle:NAME (perfect, default, poor, size, linear, intended; see
    /// docs/explanation/oracle.md) or oracle:FILE
    /// [default: oracle; auto with a real drone]
    #[arg(long, value_name = "VLM")]
    pub(crate) vlm: Option<String>,
    /// Prompt for the VLM: a file (see docs/guide/vlm.md), or paper (the VLM's depth label states how far to fly) [default:
    /// built-in]
    #[arg(long, value_name = "FILE")]
    pub(crate) prompt: Option<String>,
    /// Record the VLM's replies to a new file; `--vlm replay:FILE` repeats the flight
    #[arg(long, value_name = "FILE")]
    pub(crate) vlm_record: Option<String>,
    /// Fallback VLM, used when the first one fails
    #[arg(long, value_name = "VLM")]
    pub(crate) vlm_fallback: Option<String>,
    /// Send a second request after this many seconds without a reply, and use the first valid reply; auto: beyond what replies usually take
    #[arg(long, value_name = "S|auto", allow_negative_numbers = true)]
    pub(crate) vlm_hedge: Option<String>,
    /// Simulated latency of every reply, seconds, regardless of the real latency [default: 1.5 for human and exec:]
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    pub(crate) vlm_latency: Option<String>,
    /// Price in US dollars per million tokens, input and output, for --max-cost [default: the price shown by `spf vlm list`]
    #[arg(long, value_name = "IN,OUT", allow_negative_numbers = true)]
    pub(crate) vlm_price: Option<String>,
    /// TOML file with additional model definitions (see docs/guide/vlm.md)
    #[arg(long, value_name = "FILE")]
    pub(crate) vlm_models: Option<String>,
    /// Servers that may receive an API key in addition to the key's own vendor: HOST or HOST:PORT, comma-separated
    #[arg(long, value_name = "HOST")]
    pub(crate) send_key_to: Option<String>,
    /// With a real drone: skip the VLM pointing check before take-off
    #[arg(long)]
    pub(crate) no_vlm_check: bool,
    #[arg(long, value_name = "POLICY", help = methods::policies())]
    pub(crate) policy: Option<String>,
    /// Preset: default (recommended settings) or paper (constants and behaviour of the SPF paper) [default: default]
    #[arg(long, value_name = "PRESET")]
    pub(crate) preset: Option<String>,
    /// Step length: adaptive (paper §3.2), adaptive:s=METRES,L=LABELS,p=EXPONENT,min=METRES with other constants, or fixed:METRES
    /// [default: the preset's]
    #[arg(long, value_name = "STEP", allow_negative_numbers = true)]
    pub(crate) step: Option<String>,
    /// How the VLM states distances: labels (1 to 10) or metres (for ablation studies) [default: labels]
    #[arg(long, value_name = "FORM")]
    pub(crate) depth_as: Option<String>,
    /// Send an enlarged crop of a small target (its last box was under 24 pixels) as a second image
    #[arg(long)]
    pub(crate) close_up: bool,
    /// Distance from the target that counts as reached, metres, as told to the VLM [default: the scene's; 0.8 with a Tello;
    /// else 3]
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    pub(crate) near: Option<String>,
    /// Execute motion primitives one at a time (sequential) or simultaneously (blended) [default: the preset's]
    #[arg(long, value_name = "MOTION")]
    pub(crate) motion: Option<String>,
    /// While waiting for the VLM, hold position (stop) or keep flying the last plan (continuous) [default: the preset's]
    #[arg(long, value_name = "THINK")]
    pub(crate) think: Option<String>,
    /// Setpoint rate, 5 to 100 Hz [default: 10]
    #[arg(long, value_name = "HZ", allow_negative_numbers = true)]
    pub(crate) rate: Option<String>,
    /// Obstacle mode: request obstacle boxes and keep clear of them: on (also --avoid alone), off, or auto (on with the
    /// policy spf and the preset default; off with a depth sensor, a prompt file, and the VLMs human and exec:) [default: auto]
    #[arg(long, value_name = "SWITCH", num_args = 0..=1, require_equals = true, default_missing_value = "on")]
    pub(crate) avoid: Option<String>,
    /// Keep an estimate of the target's position between replies, fused from all of them: on, off, or auto (on
    /// with a depth sensor, and in obstacle mode) [default: auto]
    #[arg(long, value_name = "SWITCH")]
    pub(crate) anchor: Option<String>,
    /// Keep a map of obstacles, from depth sensor, depth network and rangefinders, and plan around them: on, off, or auto
    /// (on with any of them) [default: auto]
    #[arg(long, value_name = "SWITCH")]
    pub(crate) map: Option<String>,
    /// Brake for obstacles that the depth sensor sees or the map contains, whatever the VLM says, and for the boxes
    /// of replies while somebody is followed: on, off, or auto (on with a depth sensor, a depth network or a tracker) [default: auto]
    #[arg(long, value_name = "SWITCH")]
    pub(crate) brake: Option<String>,
    /// Keep the target's box between replies: pixels (a tracker follows it in the camera's frames) or off [default: off]
    #[arg(long, value_name = "TRACKER")]
    pub(crate) track: Option<String>,
    /// With --track pixels, the distance to keep from somebody who is followed, 2 to 10 m [default: 2.5]
    #[arg(long, value_name = "METRES")]
    pub(crate) keep: Option<String>,
    /// With --track pixels, end the flight as reached after following for this long, with the target in view
    #[arg(long, value_name = "SECONDS")]
    pub(crate) follow_time: Option<String>,
    /// Obstacle mode with boxes from a detector instead of the VLM: a YOLO model FILE.onnx (see docs/guide/detector.md), or,
    /// in the simulator, oracle or oracle:NAME (simulates a detector of the COCO classes)
    #[arg(long, value_name = "DETECTOR")]
    pub(crate) detector: Option<String>,
    /// Network of your own that estimates the depth of frames, for the obstacle map: FILE.onnx:KIND, where KIND is what its
    /// output is: disparity, relative, metric, or canonical[=FOCAL] (see docs/guide/obstacles.md)
    #[arg(long, value_name = "MODEL")]
    pub(crate) depth_model: Option<String>,
    /// Size of the depth network's input, if the file leaves it open: WIDTHxHEIGHT [default: 252x196]
    #[arg(long, value_name = "SIZE")]
    pub(crate) depth_model_size: Option<String>,
    /// How often the depth network is asked at most, times per second [default: 2]
    #[arg(long, value_name = "HZ", allow_negative_numbers = true)]
    pub(crate) depth_model_hz: Option<String>,
}

#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Limits")]
pub(crate) struct LimitArgs {
    /// When the instruction has ended: land; hover for up to 60 s and accept a new instruction; or rtl, return home by the
    /// drone's own navigation and land there [default: land; hover with a real drone and a terminal]
    #[arg(long, value_name = "ACTION")]
    pub(crate) at_end: Option<String>,
    /// Fly a real drone without a terminal, and so without keyboard control: Ctrl-C and SIGTERM land it
    #[arg(long)]
    pub(crate) unattended: bool,
    /// Maximum flight time, seconds, not counting manual flight [default: 180]
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    pub(crate) max_time: Option<String>,
    /// Maximum number of decisions [default: 60]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub(crate) max_decisions: Option<String>,
    /// Maximum age of a frame when its VLM reply arrives, seconds; if the frame is older, the reply is ignored unless the craft
    /// has hovered in place
    /// since [default: 8]
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    pub(crate) max_reply_age: Option<String>,
    /// VLM cost limit of the flight, US dollars [default: no limit]
    #[arg(long, value_name = "USD", allow_negative_numbers = true)]
    pub(crate) max_cost: Option<String>,
    /// Geofence: GeoJSON polygons in local east/north metres
    #[arg(long, value_name = "FILE")]
    pub(crate) geofence: Option<String>,
    /// Maximum height above the take-off point, metres [default: the scene's; 5 with a Tello; else 120]
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    pub(crate) max_altitude: Option<String>,
    /// Maximum distance from the take-off point, metres [default: 300; 20 with a Tello]
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    pub(crate) max_distance: Option<String>,
    /// Horizontal speed limit, m/s [default: 1.5 times the craft's speed; 0.6 with a Tello]
    #[arg(long, value_name = "M_S", allow_negative_numbers = true)]
    pub(crate) max_speed: Option<String>,
}

#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Output")]
pub(crate) struct OutputArgs {
    /// Output folder for the flight's files; must be new or empty [default: flights/NNN-instruction]
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<String>,
    /// Do not record video (much faster: no rendering needed)
    #[arg(long)]
    pub(crate) no_video: bool,
    /// Stream the flight live to Foxglove, at ws://127.0.0.1:8765 or the given address; flies in real time
    #[arg(long, value_name = "ADDR:PORT", num_args = 0..=1, require_equals = true, default_missing_value = "127.0.0.1:8765")]
    pub(crate) live: Option<String>,
    /// Allow pages from this origin to connect to the live view, besides Foxglove's
    #[arg(long, value_name = "URL")]
    pub(crate) live_origin: Option<String>,
    /// Open the cockpit, a page to watch, point, stop and instruct, at http://127.0.0.1:8700 or the given address; flies in real
    /// time (see docs/guide/cockpit.md)
    #[arg(long, value_name = "ADDR:PORT", num_args = 0..=1, require_equals = true, default_missing_value = COCKPIT)]
    pub(crate) cockpit: Option<String>,
    /// Print only the summary, as one JSON object, on standard output
    #[arg(long)]
    pub(crate) json: bool,
    /// Read this configuration file instead of ./spf.toml
    #[arg(long, value_name = "FILE")]
    pub(crate) config: Option<PathBuf>,
}

/// Where the cockpit is served if nothing else is said.
pub(crate) const COCKPIT: &str = "127.0.0.1:8700";

#[derive(Debug, Args)]
#[command(after_help = "\
The drone does not take off. The VLM is queried with three small images, which costs less than a cent. Exit code 0: ready to \
fly; 6: not ready, and the report says what to fix.")]
pub(crate) struct Doctor {
    #[arg(long, value_name = "DRONE", help = drones::forms_of_drones())]
    pub(crate) drone: Option<String>,
    /// VLM, as for `spf fly --vlm` [default: oracle; auto with a real drone]
    #[arg(long, value_name = "VLM")]
    pub(crate) vlm: Option<String>,
    /// Servers that may receive an API key in addition to the key's own vendor: HOST or HOST:PORT, comma-separated
    #[arg(long, value_name = "HOST")]
    pub(crate) send_key_to: Option<String>,
    /// Scene of the simulated drone [default: city]
    #[arg(long, value_name = "SCENE")]
    pub(crate) scene: Option<String>,
    #[command(flatten)]
    pub(crate) camera: CameraArgs,
    /// Detector model FILE.onnx, as for `spf fly --detector`
    #[arg(long, value_name = "FILE")]
    pub(crate) detector: Option<String>,
    /// Depth network FILE.onnx:KIND, as for `spf fly --depth-model`; writes what it sees to a new file depth-model.png
    #[arg(long, value_name = "MODEL")]
    pub(crate) depth_model: Option<String>,
    /// Size of its input, as for `spf fly --depth-model-size`
    #[arg(long, value_name = "SIZE")]
    pub(crate) depth_model_size: Option<String>,
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
    /// TOML file with additional model definitions (see docs/guide/vlm.md)
    #[arg(long, value_name = "FILE")]
    pub(crate) vlm_models: Option<String>,
    /// Read this configuration file instead of ./spf.toml
    #[arg(long, value_name = "FILE")]
    pub(crate) config: Option<PathBuf>,
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
    /// TOML file with additional model definitions (see docs/guide/vlm.md)
    #[arg(long, value_name = "FILE")]
    pub(crate) vlm_models: Option<String>,
    /// Servers that may receive an API key in addition to the key's own vendor: HOST or HOST:PORT, comma-separated
    #[arg(long, value_name = "HOST")]
    pub(crate) send_key_to: Option<String>,
    /// Read this configuration file instead of ./spf.toml
    #[arg(long, value_name = "FILE")]
    pub(crate) config: Option<PathBuf>,
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
    /// Cost limit of the whole trial, US dollars [default: no limit]
    #[arg(long, value_name = "USD", allow_negative_numbers = true)]
    pub(crate) max_cost: Option<String>,
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
    /// Latency of every reply in the flights, seconds, however long it took [default: 1.5 for exec:]
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    pub(crate) vlm_latency: Option<String>,
    /// Price in US dollars per million tokens, input and output, for models whose price is unknown
    #[arg(long, value_name = "IN,OUT", allow_negative_numbers = true)]
    pub(crate) vlm_price: Option<String>,
    /// TOML file with additional model definitions (see docs/guide/vlm.md)
    #[arg(long, value_name = "FILE")]
    pub(crate) vlm_models: Option<String>,
    /// Servers that may receive an API key besides its vendor's: HOST or HOST:PORT, comma-separated
    #[arg(long, value_name = "HOST")]
    pub(crate) send_key_to: Option<String>,
    /// Start without asking for confirmation; without a terminal a trial that may cost money needs this or --max-cost
    #[arg(long)]
    pub(crate) yes: bool,
    /// Read this configuration file instead of ./spf.toml
    #[arg(long, value_name = "FILE")]
    pub(crate) config: Option<PathBuf>,
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

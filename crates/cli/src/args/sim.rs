//! Arguments of `spf sim`.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::ConditionArgs;
use super::serve::Serve;

#[derive(Debug, Subcommand)]
pub(crate) enum Sim {
    /// Render a scene from a pose to a PNG
    Render(Box<Render>),
    /// List scenes and their contents
    Scenes(Scenes),
    /// Explore a scene in a browser
    View(View),
    /// Fly the simulated craft by keys in a window of X11, as in a game
    Window(SimWindow),
    /// Generate a labelled pointing dataset: images, instructions, targets
    Dataset(Box<Dataset>),
    /// Serve a simulated Tello, PX4, ArduPilot or AirSim, its camera, or a VLM endpoint backed by the oracle to other programs, until Ctrl-C
    Serve(Box<Serve>),
}

/// Renders an image of the simulated camera.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  spf sim render city --pose 0,0,3,0 -o x.png --depth depth.png --ids ids.png
  spf sim render city --light dusk --weather rain -o rain.png
  spf sim render city -o x.png --camera-effects blur=20,noise=5,lens=wide --moving 2,0,0,60

Depth is a 16-bit PNG in centimetres along the optical axis (0: none or beyond 655 m). IDs are a 16-bit PNG with a JSON \
legend of the same name next to it. `spf sim scenes SCENE --objects` lists bounds, start and positions.")]
pub(crate) struct Render {
    /// Scene: a built-in name, scene file or .glb; NAME@N is a variant
    pub(crate) scene: String,
    #[command(flatten)]
    pub(crate) conditions: ConditionArgs,
    /// Camera pose: east,north,up,heading_deg[,pitch_deg] [default: the scene's start, at take-off height]
    #[arg(long, value_name = "POSE", allow_hyphen_values = true)]
    pub(crate) pose: Option<String>,
    /// Output image (.png)
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: PathBuf,
    /// Also write the depth image
    #[arg(long, value_name = "FILE")]
    pub(crate) depth: Option<PathBuf>,
    /// Also write the ID image and its legend
    #[arg(long, value_name = "FILE")]
    pub(crate) ids: Option<PathBuf>,
    /// Image size, WIDTHxHEIGHT [default: the camera's, 960x720]
    #[arg(long, value_name = "WxH")]
    pub(crate) size: Option<String>,
    /// Camera of this craft: quad or tello [default: the scene's]
    #[arg(long, value_name = "MODEL")]
    pub(crate) drone_model: Option<String>,
    /// Camera effects: blur, noise, exposure, lens, compression, each with =STRENGTH, or all [default: none]
    #[arg(long, value_name = "EFFECTS")]
    pub(crate) camera_effects: Option<String>,
    /// Velocity of the craft, for motion blur: forward,right,up,yaw in m/s and degrees/s [default: at rest]
    #[arg(long, value_name = "MOTION", allow_hyphen_values = true)]
    pub(crate) moving: Option<String>,
}

/// Lists scenes: description, size, contents.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  spf sim scenes
  spf sim scenes office --objects
  spf sim scenes --stats --pictures previews
  spf sim scenes --contact-sheet scenes.jpg
  spf sim scenes city@1 city@2 yard@1 yard@2 --contact-sheet variants.jpg
  spf sim scenes city my/yard.toml --json | jq '.scenes[].tags'")]
pub(crate) struct Scenes {
    /// Scenes to list: built-in names or scene files; NAME@N is a variant [default: all built-in scenes]
    #[arg(value_name = "SCENE")]
    pub(crate) scenes: Vec<String>,
    /// Also show meshes, triangles, materials, tags, loading time and memory
    #[arg(long)]
    pub(crate) stats: bool,
    /// Also list every object: ID, name, colour, position and size; and the scene's bounds and start
    #[arg(long)]
    pub(crate) objects: bool,
    /// Also list what can be said there to the oracle, by kind and difficulty
    #[arg(long)]
    pub(crate) say: bool,
    /// Render an image of each scene into this folder, and print the paths
    #[arg(long = "pictures", value_name = "DIR")]
    pub(crate) images: Option<PathBuf>,
    /// Render a contact sheet (.jpg or .png) of the scenes in every light and weather, and of variants in their own light and
    /// weather
    #[arg(long, value_name = "FILE")]
    pub(crate) contact_sheet: Option<PathBuf>,
    /// Print only one JSON object on standard output
    #[arg(long)]
    pub(crate) json: bool,
}

/// Serves a page to explore a scene with keyboard and mouse in a browser.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  spf sim view
  spf sim view --scene city --light dusk --listen 127.0.0.1:8000

The address is printed on standard output. The page is self-contained and lists its keys and buttons. It is only reachable \
from this machine unless --listen gives another address.")]
pub(crate) struct View {
    /// Initial scene: a built-in name or a scene file; NAME@N is a variant
    #[arg(long, value_name = "SCENE", default_value = "city")]
    pub(crate) scene: String,
    #[command(flatten)]
    pub(crate) conditions: ConditionArgs,
    /// Initial pose: east,north,up,heading_deg[,pitch_deg] [default: the scene's preview pose]
    #[arg(long, value_name = "POSE", allow_hyphen_values = true)]
    pub(crate) pose: Option<String>,
    /// Camera of this craft: quad or tello [default: the scene's]
    #[arg(long, value_name = "MODEL")]
    pub(crate) drone_model: Option<String>,
    /// Address and port to listen on; port 0 picks a free one
    #[arg(long, value_name = "ADDR:PORT", default_value = "127.0.0.1:0")]
    pub(crate) listen: String,
}

/// Generates a labelled pointing dataset: images, instructions, and their targets in the image.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  spf sim dataset --scene city -n 200 -o data
  spf sim dataset --scene city -n 1000 --seed 7 -o data --camera-effects noise,lens=tello_ros --pictures png
  spf sim dataset --scene city -n 2000 --seed 7 -o data --resume

By default a quarter of the examples do not show their target, and a quarter show a look-alike: an object of the same name \
that differs in colour or another attribute. docs/guide/dataset.md describes the files; the same command gives the same \
bytes. After Ctrl-C the examples written so far are complete, and --resume continues.")]
pub(crate) struct Dataset {
    /// Scenes, comma-separated, used in turn: built-in names or scene files; NAME@N is a variant
    #[arg(long, value_name = "SCENE", default_value = "city")]
    pub(crate) scene: String,
    #[command(flatten)]
    pub(crate) conditions: ConditionArgs,
    /// Number of examples
    #[arg(short = 'n', long = "count", value_name = "N", value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
    pub(crate) count: u64,
    /// Output folder; must be new or empty
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: PathBuf,
    /// Random seed of views and instructions
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) seed: u64,
    /// Fraction of examples whose target is not in the image
    #[arg(long, value_name = "FRACTION", default_value_t = 0.25, allow_negative_numbers = true)]
    pub(crate) absent: f64,
    /// Fraction of examples with a look-alike of the target
    #[arg(long, value_name = "FRACTION", default_value_t = 0.25, allow_negative_numbers = true)]
    pub(crate) look_alikes: f64,
    /// Minimum target area, pixels at 960x720
    #[arg(long, value_name = "N", default_value_t = 256)]
    pub(crate) min_pixels: u32,
    /// Image size, WIDTHxHEIGHT [default: the camera's, 960x720]
    #[arg(long, value_name = "WxH")]
    pub(crate) size: Option<String>,
    /// Camera of this craft: quad or tello [default: the first scene's]
    #[arg(long, value_name = "MODEL")]
    pub(crate) drone_model: Option<String>,
    /// Camera effects: noise, exposure, lens, compression, each with =STRENGTH, or all [default: none]
    #[arg(long, value_name = "EFFECTS")]
    pub(crate) camera_effects: Option<String>,
    /// Image format: png or jpeg:QUALITY
    #[arg(long = "pictures", value_name = "FORMAT", default_value = "jpeg:90")]
    pub(crate) images: String,
    /// Resume the dataset in the folder
    #[arg(long, conflicts_with = "overwrite")]
    pub(crate) resume: bool,
    /// Overwrite the dataset in the folder
    #[arg(long)]
    pub(crate) overwrite: bool,
}

/// Shows what the simulated craft sees in a window, and moves it by the keys that are held, as a game does.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  spf sim window city
  spf sim window park --size 640x480 --truth truth.tsv
  spf fly \"fly to the red crane\" --drone screen:spf-window --vlm \"exec:python3 examples/exec_blob.py\" --unattended

The last one flies it from another terminal, through the window. Keys: t takes off, l lands, w s fly forward and back, a d to the \
sides, r f up and down, q e turn, p freezes the picture and the craft.

Lines of the truth: seconds, metres east, north and up, heading in degrees, number of collisions.")]
pub(crate) struct SimWindow {
    /// Scene: a built-in name, scene file or .glb; NAME@N is a variant
    #[arg(default_value = "city")]
    pub(crate) scene: String,
    #[command(flatten)]
    pub(crate) conditions: ConditionArgs,
    /// Start pose: east,north,up,heading_deg; the craft is placed on the surface below [default: the scene's]
    #[arg(long, value_name = "POSE", allow_hyphen_values = true)]
    pub(crate) start: Option<String>,
    /// Craft to simulate: quad or tello [default: the scene's]
    #[arg(long, value_name = "MODEL")]
    pub(crate) drone_model: Option<String>,
    /// Size of the window, WIDTHxHEIGHT [default: the camera's, 960x720]
    #[arg(long, value_name = "WxH")]
    pub(crate) size: Option<String>,
    /// Pictures per second, at most
    #[arg(long, value_name = "N", default_value_t = 20.0, allow_negative_numbers = true)]
    pub(crate) fps: f64,
    /// Random seed
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) seed: u64,
    /// File for the true poses, twenty a second
    #[arg(long, value_name = "FILE")]
    pub(crate) truth: Option<PathBuf>,
}

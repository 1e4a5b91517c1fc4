//! What can be typed after `spf sim`.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::ConditionArgs;
use super::serve::Serve;

#[derive(Debug, Subcommand)]
pub(crate) enum Sim {
    /// Draw a scene from a pose into a PNG
    Render(Box<Render>),
    /// List scenes and what is in them
    Scenes(Scenes),
    /// Fly around in a scene from a browser
    View(View),
    /// Make labelled pointing data: pictures, instructions, what they mean
    Dataset(Box<Dataset>),
    /// Serve a Tello to other programs, or an endpoint that they ask as a VLM with the oracle for a mind
    Serve(Box<Serve>),
}

/// Draws what the simulated camera sees.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  spf sim render city --pose 0,0,3,0 -o x.png --depth depth.png --ids ids.png
  spf sim render city --light dusk --weather rain -o rain.png
  spf sim render city -o x.png --camera-effects blur=20,noise=5,lens=wide --moving 2,0,0,60

Depth is a 16-bit PNG in centimetres along the optical axis (0: none or beyond 655 m). Ids are a 16-bit PNG; a JSON legend of \
the same name is written beside it.")]
pub(crate) struct Render {
    /// Scene: a built-in name, scene file or .glb; with @ and a number a variant of it
    pub(crate) scene: String,
    #[command(flatten)]
    pub(crate) conditions: ConditionArgs,
    /// Camera pose: east,north,up,heading_deg[,pitch_deg] [default: the scene's start, at take-off height]
    #[arg(long, value_name = "POSE", allow_hyphen_values = true)]
    pub(crate) pose: Option<String>,
    /// The picture to write
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: PathBuf,
    /// Write the depth picture too
    #[arg(long, value_name = "FILE")]
    pub(crate) depth: Option<PathBuf>,
    /// Write the id picture and its legend too
    #[arg(long, value_name = "FILE")]
    pub(crate) ids: Option<PathBuf>,
    /// Picture size, WIDTHxHEIGHT [default: the camera's, 960x720]
    #[arg(long, value_name = "WxH")]
    pub(crate) size: Option<String>,
    /// Camera of this craft: quad or tello [default: the scene's]
    #[arg(long, value_name = "MODEL")]
    pub(crate) drone_model: Option<String>,
    /// What the camera does to the picture: blur, noise, exposure, lens, compression, each with =STRENGTH, or all [default:
    /// none]
    #[arg(long, value_name = "EFFECTS")]
    pub(crate) camera_effects: Option<String>,
    /// How the craft moves, for motion blur: forward,right,up,yaw in m/s and degrees/s [default: at rest]
    #[arg(long, value_name = "MOTION", allow_hyphen_values = true)]
    pub(crate) moving: Option<String>,
}

/// Lists scenes: what they show, how large they are, what is in them.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  spf sim scenes
  spf sim scenes --stats --pictures previews
  spf sim scenes --contact-sheet scenes.jpg
  spf sim scenes city@1 city@2 yard@1 yard@2 --contact-sheet variants.jpg
  spf sim scenes city my/yard.toml --json | jq '.scenes[].tags'")]
pub(crate) struct Scenes {
    /// Only these: built-in names or scene files, with @ and a number variants of them [default: all built-in scenes]
    #[arg(value_name = "SCENE")]
    pub(crate) scenes: Vec<String>,
    /// Meshes, triangles, materials, tags, loading time and memory too
    #[arg(long)]
    pub(crate) stats: bool,
    /// Draw a picture of each scene into this folder, and print the paths
    #[arg(long, value_name = "DIR")]
    pub(crate) pictures: Option<PathBuf>,
    /// Draw them under every light and weather, and variants as they are, small, on one picture (.jpg or .png)
    #[arg(long, value_name = "FILE")]
    pub(crate) contact_sheet: Option<PathBuf>,
    /// Print one JSON object on standard output, and nothing else there
    #[arg(long)]
    pub(crate) json: bool,
}

/// Flies around in a scene, by keyboard and mouse, in a page that a browser opens.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  spf sim view
  spf sim view --scene city --light dusk --listen 127.0.0.1:8000

The address is printed on standard output. The page needs nothing from elsewhere; keys and buttons are explained on it. It \
answers on this machine alone unless --listen names another address.")]
pub(crate) struct View {
    /// Scene to begin in: a built-in name or a scene file; with @ and a number a variant of it
    #[arg(long, value_name = "SCENE", default_value = "city")]
    pub(crate) scene: String,
    #[command(flatten)]
    pub(crate) conditions: ConditionArgs,
    /// Where to begin: east,north,up,heading_deg[,pitch_deg] [default: where the scene is best shown]
    #[arg(long, value_name = "POSE", allow_hyphen_values = true)]
    pub(crate) pose: Option<String>,
    /// Camera of this craft: quad or tello [default: the scene's]
    #[arg(long, value_name = "MODEL")]
    pub(crate) drone_model: Option<String>,
    /// Address and port to answer on; port 0 takes one that is free
    #[arg(long, value_name = "ADDR:PORT", default_value = "127.0.0.1:0")]
    pub(crate) listen: String,
}

/// Makes labelled pointing data: pictures, instructions, and what they mean in the picture.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  spf sim dataset --scene city -n 200 -o data
  spf sim dataset --scene city -n 1000 --seed 7 -o data --camera-effects noise,lens=tello_ros --pictures png
  spf sim dataset --scene city -n 2000 --seed 7 -o data --resume

A quarter of the targets are not in the picture, and a quarter of the pictures hold something of the target's name in another \
colour or quality. docs/guide/dataset.md describes the files; the same command gives the same bytes. Ctrl-C leaves whole examples, \
and --resume goes on with them.")]
pub(crate) struct Dataset {
    /// Scene, or several joined by commas, shown in turn: built-in names or scene files, with @ and a number variants of them
    #[arg(long, value_name = "SCENE", default_value = "city")]
    pub(crate) scene: String,
    #[command(flatten)]
    pub(crate) conditions: ConditionArgs,
    /// How many examples
    #[arg(short = 'n', long = "count", value_name = "N", value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
    pub(crate) count: u64,
    /// Folder for the files; must be new or empty
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: PathBuf,
    /// Seed of views and words
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) seed: u64,
    /// Share of examples whose target is not in the picture
    #[arg(long, value_name = "SHARE", default_value_t = 0.25, allow_negative_numbers = true)]
    pub(crate) absent: f64,
    /// Share of examples with something that resembles the target
    #[arg(long, value_name = "SHARE", default_value_t = 0.25, allow_negative_numbers = true)]
    pub(crate) look_alikes: f64,
    /// Least pixels of a target, counted at 960x720
    #[arg(long, value_name = "N", default_value_t = 256)]
    pub(crate) min_pixels: u32,
    /// Picture size, WIDTHxHEIGHT [default: the camera's, 960x720]
    #[arg(long, value_name = "WxH")]
    pub(crate) size: Option<String>,
    /// Camera of this craft: quad or tello [default: the first scene's]
    #[arg(long, value_name = "MODEL")]
    pub(crate) drone_model: Option<String>,
    /// What the camera does to its pictures: noise, exposure, lens, compression, each with =STRENGTH, or all [default: none]
    #[arg(long, value_name = "EFFECTS")]
    pub(crate) camera_effects: Option<String>,
    /// How pictures are kept: png or jpeg:QUALITY
    #[arg(long, value_name = "FORMAT", default_value = "jpeg:90")]
    pub(crate) pictures: String,
    /// Go on with the dataset that is in the folder
    #[arg(long, conflicts_with = "overwrite")]
    pub(crate) resume: bool,
    /// Make the dataset that is in the folder anew
    #[arg(long)]
    pub(crate) overwrite: bool,
}

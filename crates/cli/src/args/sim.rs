//! What can be typed after `spf sim`.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::ConditionArgs;

#[derive(Debug, Subcommand)]
pub(crate) enum Sim {
    /// Draw a scene from a pose into a PNG
    Render(Render),
    /// List scenes and what is in them
    Scenes(Scenes),
    /// Fly around in a scene from a browser
    View(View),
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
    /// Scene: a built-in name, scene file or .glb
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
  spf sim scenes city my/yard.toml --json | jq '.scenes[].tags'")]
pub(crate) struct Scenes {
    /// Only these: built-in names or scene files [default: all built-in scenes]
    #[arg(value_name = "SCENE")]
    pub(crate) scenes: Vec<String>,
    /// Meshes, triangles, materials, tags, loading time and memory too
    #[arg(long)]
    pub(crate) stats: bool,
    /// Draw a picture of each scene into this folder, and print the paths
    #[arg(long, value_name = "DIR")]
    pub(crate) pictures: Option<PathBuf>,
    /// Draw them under every light and weather, small, on one picture (.jpg or .png)
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
    /// Scene to begin in: a built-in name or a scene file
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

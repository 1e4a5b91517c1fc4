//! What can be typed after `spf sim serve`.

use std::path::PathBuf;

use clap::Args;

use super::ConditionArgs;

/// Serves parts of the simulator to other programs over the interfaces of real ones, until Ctrl-C.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  spf sim serve --vlm --scene city --vlm-listen 127.0.0.1:8080
  spf sim serve --vlm=oracle:poor --scene yard --instruction \"fly to the red bicycle\" --answer gemini-point
  curl -s http://127.0.0.1:8080/frame.jpg -o frame.jpg && GEMINI_API_KEY=none \\
    spf ground frame.jpg \"the red crane\" --vlm gemini@http://127.0.0.1:8080/v1
  spf sim serve --tello --scene office --listen 127.0.0.1
  spf sim serve --tello --vlm --vlm-listen 127.0.0.1:8080 --scene office --truth truth.jsonl

GET /frame.jpg takes a picture with the camera that stands in the scene, and PUT /pose moves it. A question about one of the \
pictures of the last 10 s, at any size, is answered by the oracle; any other picture gets 422. The oracle is no VLM. It answers on \
this machine alone unless --vlm-listen names another address (docs/guide/grounding.md). With --tello the camera is the drone's, and \
flies with it. A client that binds port 8889 itself (djitellopy does) needs another address than the drone's (docs/guide/tello.md).")]
pub(crate) struct Serve {
    /// An endpoint that speaks OpenAI's, Gemini's and Anthropic's wires; the oracle of other errors by =oracle:NAME or =oracle:FILE
    #[arg(long, value_name = "ORACLE", num_args = 0..=1, require_equals = true, default_missing_value = "oracle")]
    pub(crate) vlm: Option<String>,
    /// Address and port of the endpoint; port 0 takes one that is free
    #[arg(long, value_name = "ADDR:PORT", default_value = "127.0.0.1:0")]
    pub(crate) vlm_listen: String,
    /// What is answered, and what --truth judges by: an instruction in any words, or from-prompt (what stands between « and », else
    /// the whole prompt)
    #[arg(long, value_name = "TEXT", default_value = "from-prompt")]
    pub(crate) instruction: String,
    /// How it is answered: spf (docs/reference/reply.md, in the coordinates that the prompt describes) or gemini-point (a list
    /// of points)
    #[arg(long, value_name = "FORM", default_value = "spf")]
    pub(crate) answer: String,
    /// A Tello: commands on UDP 8889, state to the client's port 8890, H.264 video to its port 11111
    #[arg(long)]
    pub(crate) tello: bool,
    /// The Tello's address, with a port when it is not 8889
    #[arg(long, value_name = "ADDR[:PORT]", default_value = "127.0.0.1")]
    pub(crate) listen: String,
    /// SDK that the Tello speaks: 1.3, 2.0 or 3.0
    #[arg(long, value_name = "SDK", default_value = "2.0")]
    pub(crate) sdk: String,
    /// How finely the Tello's video is drawn: full (smooth edges), live (jagged ones), draft (at half the size), or auto: live while
    /// there is time for it, else draft
    #[arg(long, value_name = "QUALITY", default_value = "auto")]
    pub(crate) quality: String,
    /// Faults of the Tello (TOML, see docs/guide/tello.md); read again whenever the file changes
    #[arg(long, value_name = "FILE")]
    pub(crate) fault: Option<PathBuf>,
    /// Add a JSON line about each flight of the Tello to this file: verified, final_distance_m, collisions
    #[arg(long, value_name = "FILE")]
    pub(crate) truth: Option<PathBuf>,
    /// Wind for the Tello: metres a second[,from=DEG][,gust=M_S][,gust_time=S] [default: still air]
    #[arg(long, value_name = "WIND", allow_hyphen_values = true)]
    pub(crate) wind: Option<String>,
    /// The Tello's charge at the start, 0 to 1
    #[arg(long, value_name = "CHARGE", default_value_t = 1.0)]
    pub(crate) battery: f64,
    /// Scene: a built-in name, scene file or .glb; with @ and a number a variant of it [default: city; office with --tello]
    #[arg(long, value_name = "SCENE")]
    pub(crate) scene: Option<String>,
    #[command(flatten)]
    pub(crate) conditions: ConditionArgs,
    /// Where the camera is at first, and the Tello stands: east,north,up,heading_deg[,pitch_deg] [default: the scene's start, the
    /// camera at take-off height]
    #[arg(long, value_name = "POSE", allow_hyphen_values = true)]
    pub(crate) start: Option<String>,
    /// Camera of this craft: quad or tello [default: the scene's]
    #[arg(long, value_name = "MODEL")]
    pub(crate) drone_model: Option<String>,
    /// What the camera does to its pictures: noise, exposure, lens, compression, each with =STRENGTH, or all [default: none]
    #[arg(long, value_name = "EFFECTS")]
    pub(crate) camera_effects: Option<String>,
    /// Seed of all chance
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) seed: u64,
}

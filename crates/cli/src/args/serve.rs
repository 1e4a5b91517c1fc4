//! Arguments of `spf sim serve`.

use std::path::PathBuf;

use clap::Args;

use super::ConditionArgs;

/// Serves simulated devices. The help shows the words of the command in `Sim`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  spf sim serve --vlm --scene city --vlm-listen 127.0.0.1:8080
  spf sim serve --vlm=oracle:poor --scene yard --instruction \"fly to the red bicycle\" --answer gemini-point
  curl -s http://127.0.0.1:8080/frame.jpg -o frame.jpg && \\
    spf ground frame.jpg \"the red crane\" --vlm http://127.0.0.1:8080/v1#spf-oracle
  spf sim serve --tello --scene office --listen 127.0.0.1
  spf sim serve --tello --vlm --vlm-listen 127.0.0.1:8080 --scene office --truth truth.jsonl
  spf sim serve --tello --scene office --rtsp
  spf sim serve --mavlink px4 --scene city --rtsp
  spf sim serve --mavlink ardupilot --scene park --mavlink-link tcpin:127.0.0.1:5760
  spf sim serve --airsim --scene city --airsim-settings settings.json

With --airsim, programs written for AirSim fly our scenes unchanged, without Unreal (docs/guide/airsim.md):
  python3 -c \"import airsim; c = airsim.MultirotorClient(); c.enableApiControl(True); print(c.takeoffAsync().join())\"

With --rtsp the drone's view is also an IP camera. Any player shows it, `spf camera test` tests it, and `spf fly --camera` flies \
by it, in another terminal:
  spf sim serve --tello --vlm --vlm-listen 127.0.0.1:8080 --scene office --rtsp
  spf camera test rtsp://127.0.0.1:8554/camera
  spf fly \"go to the person in the green shirt\" --drone tello@127.0.0.1 \\
    --vlm http://127.0.0.1:8080/v1#spf-oracle --no-vlm-check \\
    --camera rtsp://127.0.0.1:8554/camera --camera-fov 55.3 --camera-tilt 5
Field of view and tilt are printed at the start.

GET /frame.jpg returns an image from the camera in the scene, and PUT /pose moves the camera. The oracle answers questions \
about images of the last 10 s, at any size; any other image returns HTTP status 422. The oracle is not a VLM. The endpoint is only \
reachable from this machine unless --vlm-listen gives another address (docs/guide/grounding.md). With --tello the camera is \
the drone's. A client that binds port 8889 itself (as djitellopy does) must use a different local address than the drone \
(docs/guide/tello.md).")]
pub(crate) struct Serve {
    /// Serve a VLM endpoint with the OpenAI, Gemini and Anthropic APIs, backed by the oracle; =oracle:NAME or =oracle:FILE
    /// selects its errors
    #[arg(long, value_name = "ORACLE", num_args = 0..=1, require_equals = true, default_missing_value = "oracle")]
    pub(crate) vlm: Option<String>,
    /// Address and port of the VLM endpoint; port 0 picks a free one
    #[arg(long, value_name = "ADDR:PORT", default_value = "127.0.0.1:0")]
    pub(crate) vlm_listen: String,
    /// Instruction that the oracle follows in its answers, also used by --truth: natural language, or from-prompt (the text
    /// between « and », else the whole
    /// prompt)
    #[arg(long, value_name = "TEXT", default_value = "from-prompt")]
    pub(crate) instruction: String,
    /// Reply format: spf (docs/reference/reply.md, in the coordinates that the prompt describes) or gemini-point (a list of
    /// points)
    #[arg(long, value_name = "FORM", default_value = "spf")]
    pub(crate) answer: String,
    /// Serve a Tello: commands on UDP 8889, state to the client's port 8890, H.264 video to its port 11111
    #[arg(long)]
    pub(crate) tello: bool,
    /// Address of the Tello, with a port if it is not 8889
    #[arg(long, value_name = "ADDR[:PORT]", default_value = "127.0.0.1")]
    pub(crate) listen: String,
    /// Tello SDK version: 1.3, 2.0 or 3.0
    #[arg(long, value_name = "SDK", default_value = "2.0")]
    pub(crate) sdk: String,
    /// Quality of the Tello's video: full (antialiased), live (not antialiased), draft (half resolution), or auto (live if the
    /// machine keeps up, else draft)
    #[arg(long, value_name = "QUALITY", default_value = "auto")]
    pub(crate) quality: String,
    /// Serve a PX4 (px4) or an ArduPilot (ardupilot) by MAVLink (docs/guide/px4.md, docs/guide/ardupilot.md)
    #[arg(long, value_name = "AUTOPILOT", conflicts_with = "tello")]
    pub(crate) mavlink: Option<String>,
    /// Links of the MAVLink vehicle, separated by commas: udpout:HOST:PORT (it sends first), udpin:, tcpin: or serial:DEVICE:RATE
    /// [default: udpout:127.0.0.1:14540,udpout:127.0.0.1:14550; with ardupilot tcpin:127.0.0.1:5760,udpout:127.0.0.1:14550]
    #[arg(long, value_name = "URLS", requires = "mavlink")]
    pub(crate) mavlink_link: Option<String>,
    /// Sets a parameter of the MAVLink vehicle; may be repeated
    #[arg(long, value_name = "NAME=NUMBER", requires = "mavlink")]
    pub(crate) mavlink_param: Vec<String>,
    /// What the MAVLink vehicle carries: ranges (rangefinders ahead, left and right, and a proximity
    /// sensor), gimbal (of its camera); may be repeated
    #[arg(long, value_name = "NAME", requires = "mavlink")]
    pub(crate) mavlink_equipment: Vec<String>,
    /// Serve an AirSim: msgpack-rpc on TCP 41451, for AirSim's own clients (docs/guide/airsim.md)
    #[arg(long, conflicts_with_all = ["tello", "mavlink", "vlm", "rtsp", "truth", "fault"])]
    pub(crate) airsim: bool,
    /// Address and port of the AirSim; port 0 picks a free one
    #[arg(long, value_name = "ADDR:PORT", default_value = "127.0.0.1:41451", requires = "airsim")]
    pub(crate) airsim_listen: String,
    /// AirSim's settings.json: vehicles, cameras, clock speed, wind, origin [default: one vehicle, AirSim's cameras]
    #[arg(long, value_name = "FILE", requires = "airsim")]
    pub(crate) airsim_settings: Option<PathBuf>,
    /// The AirSim's time stands still until simPause(False) or simContinueForTime, as after simPause(True)
    #[arg(long, requires = "airsim")]
    pub(crate) airsim_paused: bool,
    /// Fault injection for the drone (TOML, see docs/guide/tello.md); reloaded when the file changes
    #[arg(long, value_name = "FILE")]
    pub(crate) fault: Option<PathBuf>,
    /// Append a JSON line for each flight of the Tello to this file: verified, final_distance_m, collisions
    #[arg(long, value_name = "FILE")]
    pub(crate) truth: Option<PathBuf>,
    /// Also send the drone's view by RTSP, as an IP camera does, with times of capture: rtsp://ADDR:PORT/camera, by TCP or UDP, for
    /// up to 16 viewers, without a password; with --tello or --mavlink [default with the flag alone: 127.0.0.1:8554]
    #[arg(long, value_name = "ADDR:PORT", num_args = 0..=1, require_equals = true, default_missing_value = "127.0.0.1:8554")]
    pub(crate) rtsp: Option<String>,
    /// Wind for the Tello: M_S[,from=DEG][,gust=M_S][,gust_time=S] [default: still air]
    #[arg(long, value_name = "WIND", allow_hyphen_values = true)]
    pub(crate) wind: Option<String>,
    /// Battery charge of the Tello at the start, 0 to 1
    #[arg(long, value_name = "CHARGE", default_value_t = 1.0)]
    pub(crate) battery: f64,
    /// Scene: a built-in name, scene file or .glb; NAME@N is a variant [default: city; office with --tello]
    #[arg(long, value_name = "SCENE")]
    pub(crate) scene: Option<String>,
    #[command(flatten)]
    pub(crate) conditions: ConditionArgs,
    /// Initial pose of the camera or the Tello: east,north,up,heading_deg[,pitch_deg] [default: the scene's start; for the
    /// camera, at take-off height]
    #[arg(long, value_name = "POSE", allow_hyphen_values = true)]
    pub(crate) start: Option<String>,
    /// Camera of this craft: quad or tello [default: the scene's]
    #[arg(long, value_name = "MODEL")]
    pub(crate) drone_model: Option<String>,
    /// Camera effects: noise, exposure, lens, compression, each with =STRENGTH, or all [default: none]
    #[arg(long, value_name = "EFFECTS")]
    pub(crate) camera_effects: Option<String>,
    /// Random seed
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) seed: u64,
}

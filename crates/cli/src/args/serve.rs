//! What can be typed after `spf sim serve`.

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

GET /frame.jpg takes a picture with the camera that stands in the scene, and PUT /pose moves it. A question about one of the \
pictures of the last 10 s, at any size, is answered by the oracle; any other picture gets 422. The oracle is no VLM. It answers on \
this machine alone unless --vlm-listen names another address (docs/grounding.md).")]
pub(crate) struct Serve {
    /// An endpoint that speaks OpenAI's, Gemini's and Anthropic's wires; the oracle of other errors by =oracle:NAME or =oracle:FILE
    #[arg(long, value_name = "ORACLE", num_args = 0..=1, require_equals = true, default_missing_value = "oracle")]
    pub(crate) vlm: Option<String>,
    /// Address and port of the endpoint; port 0 takes one that is free
    #[arg(long, value_name = "ADDR:PORT", default_value = "127.0.0.1:0")]
    pub(crate) vlm_listen: String,
    /// What is answered: an instruction in any words, or from-prompt (what stands between « and », else the whole prompt)
    #[arg(long, value_name = "TEXT", default_value = "from-prompt")]
    pub(crate) instruction: String,
    /// How it is answered: spf (docs/reply.md, in the coordinates that the prompt describes) or gemini-point (a list of points)
    #[arg(long, value_name = "FORM", default_value = "spf")]
    pub(crate) answer: String,
    /// Scene: a built-in name, scene file or .glb; with @ and a number a variant of it
    #[arg(long, value_name = "SCENE", default_value = "city")]
    pub(crate) scene: String,
    #[command(flatten)]
    pub(crate) conditions: ConditionArgs,
    /// Where the camera is at first: east,north,up,heading_deg[,pitch_deg] [default: the scene's start, at take-off height]
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

//! What can be typed after `spf ground`.

use std::path::PathBuf;

use clap::Args;

/// Asks who points about pictures: where is it, how far, and how well do they point?
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  spf ground photo.jpg \"the comfiest chair that keeps you dry\" --vlm gemini,anthropic
  spf ground holiday.mp4 \"fly to the lighthouse\" --vlm ollama#qwen2.5vl:7b --every 2
  cat photo.jpg | spf ground - \"the blue door\" --vlm gemini --json
  spf sim dataset --scene city -n 500 -o data && spf ground --dataset data --vlm gemini,oracle:poor -o graded
  spf ground --dataset data --vlm gemini --prompt prompts/point-2.txt,mine.txt --rate 60 --max-cost 2 -o wordings

An IMAGE is a PNG or JPEG file, a folder of them, an H.264 video (.mp4, .mov, .h264), or - for standard input. Photographs need a \
model: the oracle reads the simulator's ids, which photographs have not. With --dataset, always pointing at the middle of the \
picture stands beside the models, and the oracle where there is what it reads. Without truth there is no hit rate \
(docs/guide/grounding.md).

Exit codes: 0 asked and answered, 2 usage, 5 stopped or --max-cost spent (go on with --resume), 6 nobody answered.")]
pub(crate) struct Ground {
    /// Pictures, and last the instruction in any words
    #[arg(value_name = "IMAGE… INSTRUCTION", required_unless_present = "dataset", conflicts_with = "dataset")]
    pub(crate) words: Vec<String>,
    /// Grade on this dataset: of `spf sim dataset`, a folder with a JSONL of points, boxes or masks, COCO, or a public layout
    #[arg(long, value_name = "DIR|FILE")]
    pub(crate) dataset: Option<PathBuf>,
    /// Who points, several joined by commas: NAME[#MODEL][@URL] (see `spf vlm list`), auto, oracle[:NAME|FILE]
    #[arg(long, value_name = "VLM,…")]
    pub(crate) vlm: Option<String>,
    /// What models are told: prompt files joined by commas, compared on the same pictures [default: the shipped one]
    #[arg(long, value_name = "FILE,…")]
    pub(crate) prompt: Option<String>,
    /// TOML file with further rows for the table of models (see docs/guide/vlm.md)
    #[arg(long, value_name = "FILE")]
    pub(crate) vlm_models: Option<String>,
    /// Ask for boxes of obstacles too
    #[arg(long)]
    pub(crate) avoid: bool,
    /// Folder for what is written [default: grounding, of a dataset grounding/NAME]
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: Option<PathBuf>,
    /// Print one JSON object on standard output, and nothing else there
    #[arg(long)]
    pub(crate) json: bool,
    /// Of a video, one frame every so many seconds
    #[arg(long, value_name = "S", default_value_t = 1.0, allow_negative_numbers = true)]
    pub(crate) every: f64,
    /// Most frames of a video
    #[arg(long, value_name = "N", default_value_t = 10)]
    pub(crate) frames: usize,
    /// Only the first so many questions of the dataset
    #[arg(short = 'n', long = "count", value_name = "N", requires = "dataset")]
    pub(crate) count: Option<usize>,
    /// Questions at once
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u16).range(1..=256))]
    pub(crate) parallel: u16,
    /// Questions a minute to each model [default: as fast as they are answered]
    #[arg(long, value_name = "N", allow_negative_numbers = true, requires = "dataset")]
    pub(crate) rate: Option<f64>,
    /// US dollars after which no model is asked any more [default: no limit]
    #[arg(long, value_name = "USD", allow_negative_numbers = true, requires = "dataset")]
    pub(crate) max_cost: Option<String>,
    /// Seed of the oracle's errors
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) seed: u64,
    /// Go on with what is in the folder: only what was not answered is asked
    #[arg(long, requires = "dataset", conflicts_with = "overwrite")]
    pub(crate) resume: bool,
    /// Make what is in the folder anew
    #[arg(long, requires = "dataset")]
    pub(crate) overwrite: bool,
    /// Read this configuration file instead of ./spf.toml
    #[arg(long, value_name = "FILE")]
    pub(crate) config: Option<PathBuf>,
}

//! Arguments of `spf ground`.

use std::path::PathBuf;

use clap::Args;

use super::taken::OfGround;
use crate::settings::Flags;

/// Queries VLMs about images and measures pointing accuracy.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  spf ground photo.jpg \"the comfiest chair that keeps you dry\" --vlm gemini,anthropic
  spf ground holiday.mp4 \"fly to the lighthouse\" --vlm ollama#qwen2.5vl:7b --every 2
  cat photo.jpg | spf ground - \"the blue door\" --vlm gemini --json
  spf sim dataset --scene city -n 500 -o data && spf ground --dataset data --vlm gemini,oracle:poor -o graded
  spf ground --dataset signs --vlm gemini -o obedience
  spf ground --dataset data --vlm gemini --prompt prompts/point-6.txt,mine.txt --rate 60 --max-cost 2 -o wordings

An IMAGE is a PNG or JPEG file, a folder of them, an H.264 video (.mp4, .mov, .h264), or - for standard input. Photographs \
need a VLM: the oracle needs the simulator's ID images. With --dataset, the results include a baseline that always points at \
the image centre, and the oracle where the dataset has ID images. Without ground truth there is no hit rate \
(docs/guide/grounding.md).

Exit codes: 0 success, 2 usage, 5 interrupted or --max-cost reached (continue with --resume), 6 no VLM replied.")]
pub(crate) struct Ground {
    /// Images, followed by the instruction in natural language
    #[arg(value_name = "IMAGE… INSTRUCTION", required_unless_present = "dataset", conflicts_with = "dataset")]
    pub(crate) words: Vec<String>,
    /// Evaluate on this dataset: one made by `spf sim dataset`, a folder with a JSONL of points, boxes or masks, COCO, a public
    /// benchmark layout, or `signs`: rendered images with a misleading sign, each paired with one in which the sign is harmless
    #[arg(long, value_name = "DIR|FILE")]
    pub(crate) dataset: Option<PathBuf>,
    /// Prompt files, comma-separated, compared on the same images [default: built-in]
    #[arg(long, value_name = "FILE,…")]
    pub(crate) prompt: Option<String>,
    #[command(flatten)]
    pub(crate) settings: Flags<OfGround>,
    /// Also request obstacle boxes
    #[arg(long)]
    pub(crate) avoid: bool,
    /// Ask again about a target whose box is under 24 pixels, with its region enlarged as a second image
    #[arg(long)]
    pub(crate) close_up: bool,
    /// Output folder [default: grounding; with --dataset, grounding/NAME]
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: Option<PathBuf>,
    /// Print only one JSON object on standard output
    #[arg(long)]
    pub(crate) json: bool,
    /// Video sampling interval, seconds
    #[arg(long, value_name = "S", default_value_t = 1.0, allow_negative_numbers = true)]
    pub(crate) every: f64,
    /// Maximum number of frames per video
    #[arg(long, value_name = "N", default_value_t = 10)]
    pub(crate) frames: usize,
    /// Only the first N questions (each an image with an instruction) of the dataset
    #[arg(short = 'n', long = "count", value_name = "N", requires = "dataset")]
    pub(crate) count: Option<usize>,
    /// Number of parallel queries
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u16).range(1..=256))]
    pub(crate) parallel: u16,
    /// Maximum number of queries per minute to each model [default: unlimited]
    #[arg(long, value_name = "N", allow_negative_numbers = true, requires = "dataset")]
    pub(crate) rate: Option<f64>,
    /// Random seed of the oracle's errors
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) seed: u64,
    /// Resume in the folder: only unanswered questions are sent
    #[arg(long, requires = "dataset", conflicts_with = "overwrite")]
    pub(crate) resume: bool,
    /// Overwrite the contents of the folder
    #[arg(long, requires = "dataset")]
    pub(crate) overwrite: bool,
}

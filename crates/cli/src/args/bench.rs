//! Arguments of `spf bench`.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::methods;
use super::taken::{OfBenchAsk, OfBenchRun, OfBenchShow};
use crate::settings::Flags;

/// Default folder of results.
const RESULTS: &str = "bench-results";

#[derive(Debug, Subcommand)]
pub(crate) enum Bench {
    /// Fly a suite of tasks with many trials each, and report success rates
    Run(Box<BenchRun>),
    /// Let somebody answer in place of a VLM: write the questions of chosen trials to a folder, and fly on with the answers
    Ask(Box<BenchAsk>),
    /// Check a task: whether its file is valid, whether its example trajectories are judged as expected, and where flights start
    Check(BenchCheck),
    /// Merge the shards of a run flown on several machines
    Merge(BenchMerge),
    /// Write an HTML report of runs (charts, tables, maps, videos, failures), with CSV and LaTeX tables
    Report(BenchReport),
    /// Repeat one trial of a run and record its video, or show a task of another benchmark
    Show(BenchShow),
    /// List the suites and their tasks, or those in files and folders
    List(BenchList),
    /// Read the instruction set of another benchmark into task files
    Import(BenchImport),
}

/// Flies tasks and reports success rates.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  spf bench run --suite paper -o out
  spf bench run --suite table1 --vlm oracle:perfect,oracle:default -o out
  spf bench run --suite paper --method spf,spf-paper,pivot -o out
  spf bench run --task sim-nav-red-crane --task my/task.toml --trials 20 -o out
  spf bench run --suite latency-sweep --trials 20 -o out
  spf bench run --suite paper --vlm 'exec:python3 my_model.py' -o out
  spf bench run --suite paper --shard 0/4 -o part0

The same command in the same folder resumes an interrupted run. In the table, STRICT counts the trials in which the method \
reported success at the goal, PAPER those that the paper's judge would have counted: the goal was reached at any time. \
results.jsonl has one row per trial and no wall-clock times; docs/guide/bench.md describes it. A VLM's service that fails is \
waited for, up to two hours; a wrong key or no credit ends the run. Exit code 0 when all trials were flown, whatever their \
outcome; 5 when interrupted, declined, or --max-cost is reached; 6 when the VLM's service failed.")]
pub(crate) struct BenchRun {
    /// Suite of tasks (see `spf bench list`)
    #[arg(long, value_name = "NAME")]
    pub(crate) suite: Option<String>,
    /// Task name or file; can be repeated
    #[arg(long, value_name = "ID|FILE")]
    pub(crate) task: Vec<String>,
    #[arg(long, value_name = "LIST", help = methods::methods())]
    pub(crate) method: Option<String>,
    /// VLMs, comma-separated, as for `spf fly --vlm`; `oracle:default@3s` has a fixed latency of 3 s [default: oracle:default,
    /// or the suite's]
    #[arg(long, value_name = "LIST")]
    pub(crate) vlm: Option<String>,
    #[command(flatten)]
    pub(crate) settings: Flags<OfBenchRun>,
    /// Trials per task
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u64).range(1..=100_000))]
    pub(crate) trials: u64,
    /// Seed of the first trial; later trials count up from it
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) seed: u64,
    /// Number of parallel trials [default: number of processors]
    #[arg(long, value_name = "N")]
    pub(crate) jobs: Option<usize>,
    /// Fly only shard I of N, counted from 0 [default: from Slurm or Kubernetes, else all]
    #[arg(long, value_name = "I/N")]
    pub(crate) shard: Option<String>,
    /// Record each trial to videos/RUN_ID.mp4; takes several times as long
    #[arg(long)]
    pub(crate) videos: bool,
    /// VLM cost limit of each trial, US dollars: a trial that reaches it ends as a failure [default: no limit]
    #[arg(long, value_name = "USD", allow_negative_numbers = true)]
    pub(crate) max_cost_per_trial: Option<f64>,
    /// Do not ask before queries that cost money; without a terminal a run that may cost money needs this or --max-cost
    #[arg(long)]
    pub(crate) yes: bool,
    /// Output folder for the results
    #[arg(short, long, value_name = "DIR", default_value = RESULTS)]
    pub(crate) output: PathBuf,
    /// Print only the table, as one JSON array, on standard output
    #[arg(long)]
    pub(crate) json: bool,
}

/// Flies trials whose questions a person or a model answers that sees prompt and picture only.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  spf bench ask asked --task sim-nav-red-crane --trials 1 --seed 41 --who 'Ada Lovelace' --terminal
  spf bench ask asked --suite paper --trials 1 --who 'a model that reads pictures'
  spf bench ask asked --suite paper --trials 1 --who 'a model that reads pictures' --no-wait

Each question of a trial is written to DIR/RUN_ID: q0001.txt is the prompt as a VLM gets it, q0001.png the picture. Whoever \
answers looks at these two alone, and writes the reply to a0001.txt beside them: the JSON object that the prompt asks for, as \
{\"status\": \"navigating\", \"point\": [412, 300], \"depth\": 6, ...}. The flight goes on as soon as the file holds a complete \
object; any other text is taken once it has not changed for 5 s, and handled as a VLM's reply. DIR/open.txt lists the open \
questions, one per line: prompt, picture, answer, separated by tabs. The flight's clock stands still meanwhile, and counts each \
answer as --vlm-latency seconds (1.5).

Ctrl-C stops; the same command goes on at the first question without an answer. It flies the trials again with the answers that \
are there, and ends with an error if a question differs from the one on the disk. To take back an answer, delete it, all later \
questions and answers of its trial, and its log.jsonl. With --no-wait the command does not wait for answers, but \
writes the next question of every trial and ends: answer, and repeat it.

results.jsonl has the rows of `spf bench run` and who answered (`answered_by`). table.md and table.csv are the table, \
index.html leads to a page of each flight with pictures, prompts, answers, and what followed. `spf bench report` shows such \
rows apart from those of VLMs. Exit code 0 when all trials were flown; 2 if the folder does not fit; 5 when questions are open.")]
pub(crate) struct BenchAsk {
    /// Folder for questions, answers and results
    #[arg(value_name = "DIR")]
    pub(crate) folder: PathBuf,
    /// Who answers; stated with every result
    #[arg(long, value_name = "NAME")]
    pub(crate) who: String,
    /// Suite of tasks (see `spf bench list`)
    #[arg(long, value_name = "NAME")]
    pub(crate) suite: Option<String>,
    /// Task name or file; can be repeated
    #[arg(long, value_name = "ID|FILE")]
    pub(crate) task: Vec<String>,
    #[arg(long, value_name = "LIST", help = methods::methods())]
    pub(crate) method: Option<String>,
    #[command(flatten)]
    pub(crate) settings: Flags<OfBenchAsk>,
    /// Trials per task
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..=100_000))]
    pub(crate) trials: u64,
    /// Seed of the first trial; later trials count up from it
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) seed: u64,
    /// Trials that are under way, each with one open question [default: 4; with --terminal: 1]
    #[arg(long, value_name = "N", conflicts_with = "terminal", value_parser = clap::value_parser!(u16).range(1..=256))]
    pub(crate) jobs: Option<u16>,
    /// How points are asked for: [x, y] in pixels of the picture or in thousandths of its sides, or [y, x] in thousandths
    #[arg(long, value_name = "UNIT", default_value = "pixels", value_parser = ["pixels", "thousandths", "yx-thousandths"])]
    pub(crate) points: String,
    /// Show each prompt here and read the answer here: one line, either the JSON object, or `u v DEPTH`, `left`, `right`, `up`, `down`,
    /// `behind` or `done` (no obstacles are listed then)
    #[arg(long, conflicts_with = "no_wait")]
    pub(crate) terminal: bool,
    /// Do not wait for answers: end once every trial has an open question
    #[arg(long)]
    pub(crate) no_wait: bool,
    /// Print only the table, as one JSON array, on standard output
    #[arg(long)]
    pub(crate) json: bool,
}

/// Checks a task.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  spf bench check my/task.toml
  spf bench check sim-nav-red-crane --trials 3 --pictures views

Exit code 2 if the file is not a valid task, a trajectory is not judged as the file expects, or no valid start is found.")]
pub(crate) struct BenchCheck {
    /// Task file, or the name of a built-in task
    pub(crate) task: String,
    /// Number of trials whose starts are shown
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u64).range(0..=1000))]
    pub(crate) trials: u64,
    /// Seed of the first trial
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) seed: u64,
    /// Render the first camera image of each trial into this folder
    #[arg(long = "pictures", value_name = "DIR")]
    pub(crate) images: Option<PathBuf>,
}

/// Joins the shards of one run; the rows are byte for byte those of an unsharded run.
#[derive(Debug, Args)]
#[command(after_help = "\
Example:
  spf bench merge part0 part1 part2 part3 -o whole")]
pub(crate) struct BenchMerge {
    /// Folders of all shards
    #[arg(value_name = "DIR", required = true)]
    pub(crate) shards: Vec<PathBuf>,
    /// Output folder for the merged results; must be new or empty
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: PathBuf,
}

/// Writes the report of one or more runs: `report.html`, self-contained except for videos, and folders `csv` and `latex`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  spf bench run --suite table1 && spf bench report
  spf bench report out
  spf bench report oracle-run gemini-run -o report
  spf bench report out --pairs spf-avoid:spf,spf-default:spf-avoid

The report has success rates by category with confidence intervals, paired tests, curves over error level and latency, times, \
top-down trajectories, videos (of runs with --videos), every failure with the command that repeats it, and the paper's \
published results in a separate section. The output is reproducible byte for byte. Exit code 2 if a folder holds no results \
or is damaged.")]
pub(crate) struct BenchReport {
    /// Result folders
    #[arg(value_name = "DIR", default_value = RESULTS)]
    pub(crate) folders: Vec<PathBuf>,
    /// Output folder for the report [default: DIR/report, for a single DIR]
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: Option<PathBuf>,
    /// Compare only these pairs of methods, METHOD:METHOD, comma-separated; the first minus the second, and Holm's correction
    /// counts these pairs alone [default: every pair]
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub(crate) pairs: Vec<String>,
}

/// Repeats one trial: the same trajectory, with its video and its log.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  spf bench show sim-nav-red-crane/spf/oracle-default/3 -o flight
  spf bench show my-task/spf/gemini/0 --task my/task.toml --vlm gemini -o flight
  spf bench show aerialvln/aerialvln-val-unseen-00001.toml

RUN_ID is the `run_id` of the trial's row in results.jsonl. Characters outside A-Z a-z 0-9 . _ - are replaced by `-` there, so \
any VLM other than a built-in oracle must be given again with --vlm. FILE is the task of another benchmark (see `spf bench \
import`): its wordings, start, goal and path, and what the straight line from start to goal would score.")]
pub(crate) struct BenchShow {
    /// Trial (task/method/vlm/seed), or the .toml file of another benchmark's task
    #[arg(value_name = "RUN_ID|FILE")]
    pub(crate) run_id: String,
    /// Task file, for a task that is not built in
    #[arg(long, value_name = "FILE")]
    pub(crate) task: Option<String>,
    /// VLM, if it is not a built-in oracle
    #[arg(long, value_name = "VLM")]
    pub(crate) vlm: Option<String>,
    #[command(flatten)]
    pub(crate) settings: Flags<OfBenchShow>,
    /// Output folder for the flight's files; must be new or empty
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: Option<PathBuf>,
    /// Do not record video
    #[arg(long)]
    pub(crate) no_video: bool,
}

/// Lists tasks.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  spf bench list
  spf bench list my/task.toml aerialvln")]
pub(crate) struct BenchList {
    /// Task files, or folders of them [default: the built-in suites]
    #[arg(value_name = "FILE|DIR")]
    pub(crate) tasks: Vec<PathBuf>,
}

/// Reads the instruction set of another benchmark, and writes one task file for each of its paths, with all wordings of its
/// instruction.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  spf bench import val_unseen.json -o aerialvln
  spf bench list aerialvln
  spf bench show aerialvln/aerialvln-val-unseen-00001.toml

Known are the files of AerialVLN and AerialVLN-S: train.json, val_seen.json, val_unseen.json, test.json \
(https://github.com/AirVLN/AirVLN). The scenes of such tasks are programs of that benchmark with AirSim: `spf bench run` refuses \
them, since its trials are flown in this simulator's own scenes. Exit code 2 if the file is no known instruction set; the error \
names file, episode and key, and nothing is written.")]
pub(crate) struct BenchImport {
    /// File of the instruction set
    pub(crate) file: PathBuf,
    /// Output folder for the task files; must be new or empty
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: PathBuf,
}

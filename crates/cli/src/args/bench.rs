//! What can be typed after `spf bench`.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::methods;

/// Folder that results go to, and a report is about, unless another is named.
const RESULTS: &str = "bench-results";

#[derive(Debug, Subcommand)]
pub(crate) enum Bench {
    /// Fly a suite of tasks, many trials each, and say how often they were done
    Run(Box<BenchRun>),
    /// Check a task: its file, its predicate on its own trajectories, and what its trials begin with
    Check(BenchCheck),
    /// Join the results of several machines
    Merge(BenchMerge),
    /// Write a page with figures, tables, maps, videos and failures of runs; and CSV and LaTeX
    Report(BenchReport),
    /// Fly one trial of a run again, and write its video
    Show(BenchShow),
    /// List the suites and their tasks
    List,
}

/// Flies tasks and says how often they were done.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  spf bench run --suite paper -o out
  spf bench run --suite table1 --vlm oracle:perfect,oracle:default -o out
  spf bench run --suite paper --method spf,spf-paper,pivot -o out
  spf bench run --task sim-nav-red-crane --task my/task.toml --trials 20 -o out
  spf bench run --suite latency-sweep --trials 20 -o out
  spf bench run --suite paper --shard 0/4 -o part0

The same command in the same folder goes on where it was stopped. results.jsonl has a row a trial and no wall clock in it; \
docs/guide/bench.md describes it. Exit code 0 when all trials were flown, however they went; 5 when it was stopped.")]
pub(crate) struct BenchRun {
    /// Suite of tasks (see `spf bench list`)
    #[arg(long, value_name = "NAME")]
    pub(crate) suite: Option<String>,
    /// A task by its name or its file; can be given several times
    #[arg(long, value_name = "ID|FILE")]
    pub(crate) task: Vec<String>,
    #[arg(long, value_name = "LIST", help = methods::methods())]
    pub(crate) method: Option<String>,
    /// Who points, joined by commas: as for `spf fly --vlm`; `oracle:default@3s` answers after 3 s each time
    /// [default: oracle:default, or those of the suite]
    #[arg(long, value_name = "LIST")]
    pub(crate) vlm: Option<String>,
    /// Trials of each task
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u64).range(1..=100_000))]
    pub(crate) trials: u64,
    /// Seed of the first trial; the others follow
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) seed: u64,
    /// Trials flown at once [default: as many as there are processors]
    #[arg(long, value_name = "N")]
    pub(crate) jobs: Option<usize>,
    /// Fly share i of n only, counted from 0 [default: what Slurm or Kubernetes tells, else all]
    #[arg(long, value_name = "I/N")]
    pub(crate) shard: Option<String>,
    /// Film each trial into videos/RUN_ID.mp4; takes several times as long
    #[arg(long)]
    pub(crate) videos: bool,
    /// US dollars for the VLM after which a trial ends [default: no limit]
    #[arg(long, value_name = "USD")]
    pub(crate) max_cost: Option<f64>,
    /// Folder for the results
    #[arg(short, long, value_name = "DIR", default_value = RESULTS)]
    pub(crate) output: PathBuf,
    /// Print the table as one JSON array on standard output, and nothing else there
    #[arg(long)]
    pub(crate) json: bool,
    /// Read this configuration file instead of ./spf.toml
    #[arg(long, value_name = "FILE")]
    pub(crate) config: Option<PathBuf>,
}

/// Checks a task.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  spf bench check my/task.toml
  spf bench check sim-nav-red-crane --trials 3 --pictures views

Exit code 2 when the file is no task, when a trajectory is judged otherwise than the file says, or when no start is found.")]
pub(crate) struct BenchCheck {
    /// The task: a file, or the name of one that comes with the program
    pub(crate) task: String,
    /// Trials whose beginnings are shown
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u64).range(0..=1000))]
    pub(crate) trials: u64,
    /// Seed of the first
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) seed: u64,
    /// Draw what each trial first sees into this folder
    #[arg(long, value_name = "DIR")]
    pub(crate) pictures: Option<PathBuf>,
}

/// Joins shares of one run: the rows, byte for byte those of a run in one piece.
#[derive(Debug, Args)]
#[command(after_help = "\
Example:
  spf bench merge part0 part1 part2 part3 -o whole")]
pub(crate) struct BenchMerge {
    /// Folders of the shares, all of them
    #[arg(value_name = "DIR", required = true)]
    pub(crate) shares: Vec<PathBuf>,
    /// Folder for the whole; must be new or empty
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: PathBuf,
}

/// Writes what runs come to: `report.html`, one file with everything but videos in it, and folders `csv` and `latex`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  spf bench run --suite table1 && spf bench report
  spf bench report out
  spf bench report oracle-run gemini-run -o report

Success by category with intervals, paired tests, curves over errors and latency, times, ways from above, videos (of runs with \
--videos), every failure with the command that flies it again, and the paper's published figures in a block of their own. The \
same folders give the same bytes. Exit code 2 when a folder is none of results, or is damaged.")]
pub(crate) struct BenchReport {
    /// Folders of results
    #[arg(value_name = "DIR", default_value = RESULTS)]
    pub(crate) folders: Vec<PathBuf>,
    /// Folder for the report [default: DIR/report, of a single DIR]
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: Option<PathBuf>,
}

/// Flies one trial again: the same trajectory, with its video and its log.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  spf bench show sim-nav-red-crane/spf/oracle-default/3 -o flight
  spf bench show my-task/spf/gemini/0 --task my/task.toml --vlm gemini -o flight

The trial's name is the `run_id` of its row. In it, what is outside of A-Z a-z 0-9 . _ - stands as `-`; who pointed is therefore \
named again with --vlm where it is not one of the shipped oracles.")]
pub(crate) struct BenchShow {
    /// The trial: task/method/vlm/seed
    pub(crate) run_id: String,
    /// The task's file, when it does not come with the program
    #[arg(long, value_name = "FILE")]
    pub(crate) task: Option<String>,
    /// Who points, when it is no shipped oracle
    #[arg(long, value_name = "VLM")]
    pub(crate) vlm: Option<String>,
    /// Folder for the flight's files; must be new or empty
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: Option<PathBuf>,
    /// Make no video
    #[arg(long)]
    pub(crate) no_video: bool,
    /// Read this configuration file instead of ./spf.toml
    #[arg(long, value_name = "FILE")]
    pub(crate) config: Option<PathBuf>,
}

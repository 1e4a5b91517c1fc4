//! The decisions of a flight, read from its log `flight.mcap` (topics: docs/reference/flight-log.md).
//!
//! `cargo run -p spf-api --example read_log [flight.mcap]`; without a log it makes a short flight first.

#![allow(clippy::print_stdout, reason = "an example's output")]

use std::error::Error;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use spf_core::time::Duration;
use spf_flight::flight::{self, FlightPlan, Site};
use spf_flight::recorder::RecordPlan;
use spf_flight::replay::row;
use spf_flight::sim::{LoadedScene, Simulated, oracle_factory};
use spf_flight::words;
use spf_oracle::ErrorFile;
use spf_pilot::{Decision, PilotSettings};
use spf_record::log::LogReader;
use spf_record::out_dir::OutDir;

/// The decisions of a log, each with its time in seconds and a description. A truncated log returns the decisions that
/// it contains, and the reason why it ends.
pub(crate) fn decisions(log: &Path) -> Result<Vec<(f64, String)>, Box<dyn Error>> {
    let mut decisions = Vec::new();
    for entry in LogReader::open(log)? {
        let entry = entry?;
        if entry.topic == "/decision" {
            let decision: Decision = row(&entry)?;
            decisions.push((entry.time.as_secs_f64(), words::decision(&decision)));
        }
    }
    Ok(decisions)
}

/// Flies twenty seconds in the office; leaves the files in a folder.
pub(crate) fn flown(folder: &Path) -> Result<PathBuf, Box<dyn Error>> {
    let site = Site::Simulated(Simulated::new(Arc::new(LoadedScene::load("office")?), "office"));
    let vlm_factory = oracle_factory("oracle".to_owned(), ErrorFile::default());
    let plan = FlightPlan::new(site, "go to the person in the green shirt", "oracle", vlm_factory);
    let plan = FlightPlan {
        settings: PilotSettings { max_time: Duration::from_secs(20), ..plan.settings },
        record: Some(RecordPlan { out: OutDir::at(folder)?, video: false, view: None }),
        ..plan
    };
    flight::fly(plan, &mut [])?;
    Ok(folder.join("flight.mcap"))
}

fn main() -> Result<(), Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let log = std::env::args().nth(1).map_or_else(|| flown(folder.path()), |log| Ok(log.into()))?;
    for (at, words) in decisions(&log)? {
        println!("{at:6.2} s  {words}");
    }
    Ok(())
}
